//! Intervals that allow for an effect that is not named: what it would take of a named one.

use crate::data::schema::Parameter;
use crate::evidence::effect_evidence::Rival;
use crate::evidence::parameters::parameters;
use crate::fit::noise::Colour;
use crate::propose::context::{FitContext, FittedModel};
use std::collections::BTreeMap;

/// Parameters by their names in the report.
type Parameters = BTreeMap<String, Parameter>;

/// Rivals that are tried beside an effect: the nearest.
const TRIED: usize = 2;

/// `values`, the parameters of effect `place` of a fitted model, with intervals that hold what each
/// of its nearest rivals would take, where the recordings are likelier with both than with the
/// effect alone: the rival is not named, and may still be there.
pub(crate) fn widened(
    context: &FitContext,
    fitted: &FittedModel,
    place: usize,
    rivals: &[Rival],
    mut values: Parameters,
) -> Parameters {
    let is_there = |rival: &&Rival| fitted.model.effects.iter().any(|effect| effect.name == rival.name);
    let mut near: Vec<&Rival> = rivals.iter().filter(|rival| !is_there(rival)).collect();
    near.sort_by(|a, b| a.z.total_cmp(&b.z));
    if near.is_empty() {
        return values;
    }
    // Both fits are by likelihood, whatever gave the values: only what the rival takes counts.
    let alone = context.fit(fitted.model.clone(), &fitted.noise, Colour::White);
    let before = parameters(context, &alone, place);
    for rival in near.into_iter().take(TRIED) {
        let mut model = alone.model.clone();
        let own = model.effects.remove(place);
        // The last effect is the one whose shape moves.
        model.effects.extend([rival.effect.clone(), own]);
        let both = context.polish_one(&context.fit(model, &alone.noise, Colour::White));
        if both.log_score > alone.log_score {
            widen(&mut values, &before, &parameters(context, &both, both.model.effects.len() - 1));
        }
    }
    values
}

/// Widens intervals by what values differ `beside` a rival from what they are `alone`.
fn widen(values: &mut Parameters, alone: &Parameters, beside: &Parameters) {
    for (name, known) in values {
        let (Some(alone), Some(beside)) = (alone.get(name), beside.get(name)) else { continue };
        let there = known.value + beside.value - alone.value;
        known.ci95 = [known.ci95[0].min(there), known.ci95[1].max(there)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay(value: f64, ci95: [f64; 2]) -> Parameters {
        [("delay".to_owned(), Parameter { value, ci95, unit: "s".into() })].into()
    }

    #[test]
    fn an_interval_holds_what_a_rival_would_take() {
        let (alone, beside) = (delay(8.1, [7.7, 8.5]), delay(10.1, [9.0, 11.0]));
        let mut values = delay(8.0, [7.6, 8.4]);
        widen(&mut values, &alone, &beside);
        let [low, high] = values["delay"].ci95;
        assert!(low == 7.6 && (high - 10.0).abs() < 1e-12, "{low} to {high}");
        widen(&mut values, &alone, &delay(8.2, [7.0, 9.0]));
        assert_eq!(values["delay"].ci95, [low, high], "a small change is inside");
    }
}
