//! A weight that acts through the tilt, where the nominal model has none: `weight·sin(tilt)`.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, NominalTerm, Plain, Reported, Span,
};
use super::{Effect, EffectName, State};

#[derive(Debug, Clone)]
struct TiltGravityLaw;

impl ForceLaw for TiltGravityLaw {
    fn names(&self) -> Vec<String> {
        vec!["weight".into()]
    }
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        out[0] = state.tilt.sin();
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct TiltGravity;

impl EffectLaw for TiltGravity {
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(TiltGravityLaw))
    }
    fn nominal_term(&self) -> Option<NominalTerm> {
        Some(NominalTerm::Weight)
    }
}

impl EffectSearch for TiltGravity {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        if span.tilt { vec![Effect::shaped(name, &[])] } else { Vec::new() }
    }
    fn plain(&self, _effect: &Effect) -> Option<Plain> {
        Some(Plain { rank: 2, has_twin: false })
    }
}

impl EffectReport for TiltGravity {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        fitted.one_force("weight", fitted.force.into())
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.03
    }
    fn variable(&self) -> &'static str {
        "tilt"
    }
}
