//! Which force tables may run: knots in their order, no force above the motor's, no slope that the
//! hold could not follow.

use super::ForceTable;
use crate::anatomy::SMALLEST_ANGLE;
use crate::law::ForceLimits;
use crate::refusal::{Field, Refusal, count, milli, within};
use fixed::types::I16F16;

/// Refuses a table with the first reason there is.
pub(super) fn check(table: &ForceTable, limits: &ForceLimits) -> Result<(), Refusal> {
    let (stiff, largest) = (limits.stiffest, limits.largest);
    within(Field::FrictionStiffness, table.stiffness.0, milli(50), stiff)?;
    within(Field::Withdrawal, table.withdrawal, I16F16::ZERO, I16F16::ONE)?;
    let knots = |field, low: I16F16, high: I16F16, knots: &mut dyn Iterator<Item = I16F16>| {
        let mut from = low;
        let mut count = 0;
        for knot in knots {
            // At least a hundredth apart: the slopes between them are computed.
            let least = if count == 0 { low } else { from.saturating_add(milli(10)) };
            within(field, knot, least, high)?;
            (from, count) = (knot, count + 1);
        }
        if count == 0 { Err(Refusal::Count { field, found: 0, wanted: 1 }) } else { Ok(()) }
    };
    let angles = || table.angles.iter().map(|angle| I16F16::from_num(angle.0));
    knots(Field::TableSpeed, I16F16::ZERO, milli(1_000_000), &mut table.speeds.iter().map(|speed| speed.0))?;
    knots(Field::TableAngle, I16F16::from_num(SMALLEST_ANGLE.0), milli(1_571_000), &mut angles())?;
    let cells = table.cells();
    let depths = table.forces.len() / cells;
    count(Field::TableForce, table.forces.len(), cells * depths.max(2))?;
    if table.depths.len() != depths {
        count(Field::TableDepth, table.depths.len(), table.forces.len())?;
    }
    check_ruptures(table, depths)?;
    let per_knot = table.depths.len() / depths;
    let depth = |knot: usize, cell: usize| {
        let hundredths = table.depths.get(knot * per_knot + cell % per_knot).copied().unwrap_or_default();
        I16F16::saturating_from_num(hundredths) / 100
    };
    for (index, &force) in table.forces.iter().enumerate() {
        let (knot, cell) = (index / cells, index % cells);
        let least = match knot.checked_sub(1) {
            // Closer knots give inaccurate slopes: at least 0.05 mm, less a rounding.
            Some(above) => depth(above, cell).saturating_add(milli(49)),
            None => I16F16::ZERO,
        };
        within(Field::TableDepth, depth(knot, cell), least, milli(163_830))?;
        let force = I16F16::saturating_from_num(force) / 1000;
        within(Field::TableForce, force, I16F16::ZERO, milli(16_383))?;
        if force > largest {
            return Err(Refusal::TooStrong { layer: 0, force, limit: largest });
        }
        // The slope from the knot above; along a slanted needle it is less.
        let Some(above) = index.checked_sub(cells).and_then(|above| table.forces.get(above)) else {
            continue;
        };
        let rise = force.saturating_sub(I16F16::saturating_from_num(*above) / 1000);
        let slope = rise.saturating_div(depth(knot, cell).saturating_sub(depth(knot - 1, cell)));
        if slope > table.stiffness.0 {
            return Err(Refusal::TooStiff { layer: 0, slope, limit: table.stiffness.0 });
        }
    }
    Ok(())
}

/// A layer gives way at a knot that has one above and one below it, each at one of its own.
fn check_ruptures(table: &ForceTable, depths: usize) -> Result<(), Refusal> {
    let mut least = 1;
    for &knot in &table.gives_way {
        let last = I16F16::from_num(depths as i32 - 2);
        within(Field::TableRupture, I16F16::from_num(knot), I16F16::from_num(least), last)?;
        // The fall ends at the next knot at the earliest.
        least = i32::from(knot) + 2;
    }
    Ok(())
}
