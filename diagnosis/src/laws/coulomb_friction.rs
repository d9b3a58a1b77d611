//! Dry friction, where the nominal model has none: `-coulomb·sgn(q̇)`.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, NominalTerm, Plain, Reported, Span,
};
use super::joint_terms::JointTerms;
use super::law::sign;
use super::{Effect, EffectName, State, Variable};

#[derive(Debug, Clone)]
struct CoulombFrictionLaw;

impl ForceLaw for CoulombFrictionLaw {
    fn names(&self) -> Vec<String> {
        vec!["coulomb".into()]
    }
    fn terms(&mut self, _state: &State, velocity: f64, out: &mut [f64]) {
        out[0] = -sign(velocity);
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct CoulombFriction;

impl EffectLaw for CoulombFriction {
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(CoulombFrictionLaw))
    }
    fn is_dry(&self) -> bool {
        true
    }
    fn nominal_term(&self) -> Option<NominalTerm> {
        Some(NominalTerm::Coulomb)
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        joint.dry += effect.coefficient("coulomb");
        true
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Speed)
    }
}

impl EffectSearch for CoulombFriction {
    fn grid(&self, name: EffectName, _span: &Span) -> Vec<Effect> {
        vec![Effect::shaped(name, &[])]
    }
    fn plain(&self, _effect: &Effect) -> Option<Plain> {
        Some(Plain { rank: 0, has_twin: false })
    }
}

impl EffectReport for CoulombFriction {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        fitted.one_force("coulomb", fitted.force.into())
    }
}
