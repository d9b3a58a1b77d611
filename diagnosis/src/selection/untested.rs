//! The effects that recordings could not show, with the reason: what was not tested is not ruled out.

use crate::effects::EffectName;
use crate::effects::definition::Span;
use crate::estimation::nominal::Nominal;
use crate::numerics::digits::short;
use crate::selection::{candidates, periodic};

/// Effects that are neither in the rig nor were looked for, with the reason as a clause.
pub(crate) fn untested(span: &Span, nominal: &Nominal) -> Vec<(EffectName, String)> {
    let reason = |name: EffectName| Some((name, why(name, span, nominal)?));
    EffectName::ALL.iter().filter_map(|name| reason(*name)).collect()
}

/// Why an effect was not looked for; none if it was, or if the rig has it.
fn why(name: EffectName, span: &Span, nominal: &Nominal) -> Option<String> {
    let definition = name.definition();
    if nominal.holds(name) {
        return None;
    }
    if !candidates::is_seen(name, nominal) {
        return Some("it shows only where the inertia matters, and in this motion it hardly does".into());
    }
    if definition.is_periodic() {
        let needed = periodic::travel_needed(span, nominal)?;
        let length = format!(" {}", nominal.rig.kind.length());
        let (per, unit) = nominal.rig.turn().map_or((1.0, length.as_str()), |turn| (turn, " turns"));
        let [is, needed] = [span.travel(), needed].map(|travel| short(travel / per));
        return Some(format!("the travel is {is}{unit}, and at least {needed}{unit} would be needed"));
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
