//! Intervals that allow for an effect that is not named: what it would take of a named one.

use crate::data::schema::Parameter;
use crate::evidence::acceptance_criteria::Rival;
use crate::evidence::parameters::parameters;
use crate::fit::noise::Colour;
use crate::propose::context::{FitContext, FittedModel};
use std::collections::BTreeMap;

/// Rivals that are tried beside an effect: the nearest.
const TRIED: usize = 2;

/// The parameters of effect `place` of a fitted model, with intervals that hold the values which
/// they have beside each of its nearest rivals, where the recordings are likelier with both than
/// with the effect alone: the rival is not named, and may still be there.
pub(crate) fn widened(
    context: &FitContext,
    fitted: &FittedModel,
    place: usize,
    rivals: &[Rival],
) -> BTreeMap<String, Parameter> {
    let mut values = parameters(context, fitted, place);
    let is_there = |rival: &&Rival| fitted.model.effects.iter().any(|effect| effect.name == rival.name);
    let mut near: Vec<&Rival> = rivals.iter().filter(|rival| !is_there(rival)).collect();
    near.sort_by(|a, b| a.z.total_cmp(&b.z));
    if near.is_empty() {
        return values;
    }
    let alone = context.fit(fitted.model.clone(), &fitted.noise, Colour::White);
    for rival in near.into_iter().take(TRIED) {
        let mut model = alone.model.clone();
        let own = model.effects.remove(place);
        // The last effect is the one whose shape moves.
        model.effects.extend([rival.effect.clone(), own]);
        let both = context.polish_one(&context.fit(model, &alone.noise, Colour::White));
        if both.merit <= alone.merit {
            continue;
        }
        let last = both.model.effects.len() - 1;
        for (name, beside) in parameters(context, &both, last) {
            let Some(known) = values.get_mut(&name) else { continue };
            known.ci95 = [known.ci95[0].min(beside.value), known.ci95[1].max(beside.value)];
        }
    }
    values
}
