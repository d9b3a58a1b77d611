//! Dry friction that grows with the measured external load: `-coefficient·|force|·sgn(q̇)`.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span,
};
use super::law::sign;
use super::{Effect, EffectName, State};

#[derive(Debug, Clone)]
struct LoadDependentFrictionLaw;

impl ForceLaw for LoadDependentFrictionLaw {
    fn names(&self) -> Vec<String> {
        vec!["coefficient".into()]
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        out[0] = -sign(velocity) * state.external.abs();
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct LoadDependentFriction;

impl EffectLaw for LoadDependentFriction {
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(LoadDependentFrictionLaw))
    }
    fn is_dry(&self) -> bool {
        true
    }
}

impl EffectSearch for LoadDependentFriction {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        if span.force { vec![Effect::shaped(name, &[])] } else { Vec::new() }
    }
}

impl EffectReport for LoadDependentFriction {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        fitted.one_force("coefficient", "1".into())
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.03
    }
}
