//! Friction that grows with speed, where the nominal model has none: `-viscous·q̇`.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, NominalTerm, Plain, Reported,
    Span,
};
use super::joint_terms::JointTerms;
use super::{Effect, EffectName, State, Variable};

#[derive(Debug, Clone)]
struct ViscousFrictionLaw;

impl ForceLaw for ViscousFrictionLaw {
    fn names(&self) -> Vec<String> {
        vec!["viscous".into()]
    }
    fn terms(&mut self, _state: &State, velocity: f64, out: &mut [f64]) {
        out[0] = -velocity;
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct ViscousFriction;

impl EffectLaw for ViscousFriction {
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(ViscousFrictionLaw))
    }
    fn nominal_term(&self) -> Option<NominalTerm> {
        Some(NominalTerm::Viscous)
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        joint.viscous += effect.coefficient("viscous");
        true
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Speed)
    }
}

impl EffectSearch for ViscousFriction {
    fn grid(&self, name: EffectName, _span: &Span) -> Vec<Effect> {
        vec![Effect::shaped(name, &[])]
    }
    fn plain(&self, _effect: &Effect) -> Option<Plain> {
        Some(Plain { rank: 1, has_twin: false })
    }
}

impl EffectReport for ViscousFriction {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        fitted.one_force("viscous", format!("{}·s/{}", fitted.force, fitted.length))
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::StribeckFriction).then_some(super::experiments::SPEEDS)
    }
}
