//! The effects that recordings could not show, with the reason: what was not tested is not ruled
//! out.

use crate::fit::nominal::Nominal;
use crate::laws::EffectName;
use crate::laws::definition::Span;
use crate::propose::periodic::TooShort;
use crate::propose::{candidates, periodic};
use std::f64::consts::TAU;

/// The reason why recordings could not show an effect.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum NotTested {
    /// It shows only where the inertia matters, and in this motion it hardly does.
    InertiaHardlyMatters,
    /// No wave of it fits into the travel; both rad or m.
    TravelTooShort { travel: f64, needed: f64 },
    /// Waves of the turn up to this order do not fit into so many turns of travel.
    OrdersTooLong { turns: f64, up_to: f64 },
    /// A column is missing or constant.
    NoColumn(&'static str),
    /// Nothing says that the recordings start at one place.
    NoCommonStart,
    /// The rig's weight under this tilt is the same force.
    SameAsWeight,
    /// No motion of these recordings would show it.
    NoMotion,
}

/// Effects that are neither in the rig nor were looked for, with the reason.
pub(crate) fn untested(span: &Span, nominal: &Nominal) -> Vec<(EffectName, NotTested)> {
    let reason = |name: EffectName| Some((name, why(name, span, nominal)?));
    EffectName::ALL.iter().filter_map(|name| reason(*name)).collect()
}

/// The reason why an effect was not looked for; none if it was, or if the rig has it.
fn why(name: EffectName, span: &Span, nominal: &Nominal) -> Option<NotTested> {
    let definition = name.definition();
    if nominal.holds(name) || !definition.is_sought() {
        return None;
    }
    if !candidates::is_seen(name, nominal) {
        return Some(NotTested::InertiaHardlyMatters);
    }
    if candidates::needs_another_command(name, span) {
        return Some(NotTested::NoColumn("command"));
    }
    if definition.is_periodic() {
        let travel = span.travel();
        return Some(match periodic::too_short_for(name, span, nominal)? {
            TooShort::ForAll(needed) => NotTested::TravelTooShort { travel, needed },
            TooShort::ForOrders { up_to } => {
                NotTested::OrdersTooLong { turns: travel / nominal.rig.turn().unwrap_or(TAU), up_to }
            }
        });
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
    let changes: [(Change, NotTested); 4] = [
        (&|s| s.tilt = true, NotTested::NoColumn("tilt_rad")),
        (&|s| s.force = true, NotTested::NoColumn("force")),
        (&|s| s.rig.has_stroke = true, NotTested::NoCommonStart),
        (&|s| s.rig.has_gravity = false, NotTested::SameAsWeight),
    ];
    let found = changes.into_iter().find(|(change, _)| would(change)).map(|(_, why)| why);
    Some(found.unwrap_or(NotTested::NoMotion))
}
