//! A loss in proportion to the drive's own force, as a gear or a screw has:
//! `-fraction·|drive|·sgn(q̇)`.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span};
use super::law::sign;
use super::{Effect, EffectName, State};

#[derive(Debug, Clone)]
struct DriveLossLaw;

impl ForceLaw for DriveLossLaw {
    fn names(&self) -> Vec<String> {
        vec!["fraction".into()]
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        out[0] = -sign(velocity) * state.drive.abs();
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct DriveLoss;

impl EffectLaw for DriveLoss {
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(DriveLossLaw))
    }
    fn reads_command(&self, _effect: &Effect) -> bool {
        true
    }
    fn is_relative_to_gain(&self) -> bool {
        true
    }
    fn is_dry(&self) -> bool {
        true
    }
}

impl EffectSearch for DriveLoss {
    fn grid(&self, name: EffectName, _span: &Span) -> Vec<Effect> {
        vec![Effect::shaped(name, &[])]
    }
}

impl EffectReport for DriveLoss {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let (loss, sd) = fitted.term(0);
        let ratio = fitted.ratio.abs();
        vec![Reported::new("fraction", (loss / ratio, sd / ratio), "1")]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.03
    }
}
