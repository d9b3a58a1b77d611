//! Torque periodic in the angle and proportional to the command: commutation. Its orders are sought
//! in the residual.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span};
use super::shape::ShapeKey;
use super::waves::{self, Waves};
use super::{Effect, EffectName};

pub(super) struct TorqueRipple;

impl EffectLaw for TorqueRipple {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(Waves::new(effect, true)))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[waves::KEYS]
    }
    fn has_own_phase(&self) -> bool {
        true
    }
    fn scales_drive(&self) -> bool {
        true
    }
}

impl EffectSearch for TorqueRipple {
    fn is_periodic(&self) -> bool {
        true
    }
    fn grid(&self, _name: EffectName, _span: &Span) -> Vec<Effect> {
        Vec::new()
    }
    fn freedom(&self, effect: &Effect, recordings: usize) -> usize {
        waves::freedom(effect, recordings)
    }
}

impl EffectReport for TorqueRipple {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        waves::report(fitted, true)
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.03
    }
    fn variable(&self) -> &'static str {
        "command"
    }
}
