//! The effects that recordings could not show, with the reason: what was not tested is not ruled
//! out.

use crate::effects::EffectName;
use crate::effects::definition::Span;
use crate::estimation::nominal::Nominal;
use crate::numerics::digits::short;
use crate::selection::periodic::TooShort;
use crate::selection::{candidates, periodic};
use std::f64::consts::TAU;

/// Effects that are neither in the rig nor were looked for, with the reason as a clause.
pub(crate) fn untested(span: &Span, nominal: &Nominal) -> Vec<(EffectName, String)> {
    let reason = |name: EffectName| Some((name, why(name, span, nominal)?));
    EffectName::ALL.iter().filter_map(|name| reason(*name)).collect()
}

/// Why an effect was not looked for; none if it was, or if the rig has it.
fn why(name: EffectName, span: &Span, nominal: &Nominal) -> Option<String> {
    let definition = name.definition();
    if nominal.holds(name) || !definition.is_sought() {
        return None;
    }
    if !candidates::is_seen(name, nominal) {
        return Some("it shows only where the inertia matters, and in this motion it hardly does".into());
    }
    if definition.is_periodic() {
        return Some(shorter(periodic::too_short_for(name, span, nominal)?, span, nominal));
    }
    if definition.is_of_jumps() || !definition.grid(name, span).is_empty() {
        return None;
    }
    // What has to be different for it to be looked for.
    let would = |change: &dyn Fn(&mut Span)| {
        let mut other = span.clone();
        change(&mut other);
        !definition.grid(name, &other).is_empty()
    };
    type Change<'a> = &'a dyn Fn(&mut Span);
    let changes: [(Change, &str); 4] = [
        (&|s| s.tilt = true, "a column `tilt_rad` that changes would be needed"),
        (&|s| s.force = true, "a column `force` that changes would be needed"),
        (
            &|s| s.rig.has_stroke = true,
            "recordings that start at one place would be needed, with `start_spread` or `absolute` in the rig",
        ),
        (&|s| s.rig.has_gravity = false, "the rig's weight under this tilt is the same force"),
    ];
    let found = changes.into_iter().find(|(change, _)| would(change)).map(|(_, why)| why);
    Some(found.unwrap_or("these recordings have no motion that would show it").to_owned())
}

/// Says for which waves the travel is too short.
fn shorter(short_for: TooShort, span: &Span, nominal: &Nominal) -> String {
    let unit = nominal.rig.kind.length();
    match short_for {
        TooShort::ForAll(needed) => format!(
            "the travel is {} {unit}, and at least {} {unit} would be needed",
            short(span.travel()),
            short(needed)
        ),
        TooShort::ForOrders { up_to } => {
            let is = short(span.travel() / nominal.rig.turn().unwrap_or(TAU));
            if up_to > 1.0 {
                format!(
                    "a travel of {is} turns is too short for orders 1 to {up_to}; one turn would show all"
                )
            } else {
                format!("a travel of {is} turns is too short for order 1; one turn would show it")
            }
        }
    }
}
