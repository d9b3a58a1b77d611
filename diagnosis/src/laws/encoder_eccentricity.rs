//! An encoder that errs once per turn: travel added to what it reads.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span};
use super::mass_imbalance::{LEAST_TURNS, once_a_turn};
use super::shape::ShapeKey;
use super::waves::{self, Waves};
use super::{Effect, EffectName};

pub(super) struct EncoderEccentricity;

impl EffectLaw for EncoderEccentricity {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(Waves::new(effect, false)))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[waves::KEYS]
    }
    fn has_own_phase(&self) -> bool {
        true
    }
    fn in_sensor(&self) -> bool {
        true
    }
}

impl EffectSearch for EncoderEccentricity {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let turn = span.rig.turn.filter(|turn| span.travel() / turn > LEAST_TURNS);
        turn.into_iter().map(|turn| once_a_turn(name, turn)).collect()
    }
    fn freedom(&self, effect: &Effect, recordings: usize) -> usize {
        waves::freedom(effect, recordings)
    }
}

impl EffectReport for EncoderEccentricity {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("amplitude", waves::amplitude(fitted), fitted.length)]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.05
    }
    fn variable(&self) -> &'static str {
        "angle"
    }
}
