//! Friction that differs with direction: `-(viscous_difference·|q̇| + coulomb_difference·|sgn
//! q̇|)`. If the nominal model has an offset, that offset is the dry part, and only the viscous
//! part can be identified.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Plain, Reported, Span,
};
use super::joint_terms::JointTerms;
use super::law::{first_or_both, sign};
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State, Variable};

#[derive(Debug, Clone)]
struct AsymmetricFrictionLaw {
    viscous_only: bool,
}

impl ForceLaw for AsymmetricFrictionLaw {
    fn names(&self) -> Vec<String> {
        first_or_both("viscous_difference", "coulomb_difference", !self.viscous_only)
    }
    fn terms(&mut self, _state: &State, velocity: f64, out: &mut [f64]) {
        out[0] = -velocity.abs();
        if let Some(dry) = out.get_mut(1) {
            *dry = -sign(velocity).abs();
        }
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

shape! {
    /// The terms of the law.
    struct Shape {
        /// True if only viscous friction differs: a rig with an offset holds the dry part already.
        viscous_only: flag,
    }
}

pub(super) struct AsymmetricFriction;

impl EffectLaw for AsymmetricFriction {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(AsymmetricFrictionLaw { viscous_only: Shape::of(effect).viscous_only }))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn is_dry(&self) -> bool {
        true
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        // As long as the axis moves, dry friction that differs with direction is a bias in addition
        // to an even dry friction.
        joint.bias -= effect.coefficient("coulomb_difference");
        let difference = effect.coefficient("viscous_difference");
        if difference != 0.0 {
            joint.notes.push(format!(
                "asymmetric_friction: viscous friction is {:.6e} forward and {:.6e} backward; damping holds their mean",
                joint.viscous + difference,
                joint.viscous - difference
            ));
        }
        true
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Speed)
    }
    fn may_be_constant(&self) -> bool {
        true
    }
}

impl EffectSearch for AsymmetricFriction {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        // Any friction is one that differs with direction where there is one direction.
        if span.one_way {
            return Vec::new();
        }
        let known = [("viscous_only", 1.0)];
        vec![Effect::shaped(name, if span.rig.has_offset { &known } else { &[] })]
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        2
    }
    fn plain(&self, _effect: &Effect) -> Option<Plain> {
        Some(Plain { rank: 4, has_twin: true })
    }
}

impl EffectReport for AsymmetricFriction {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let mut out = Vec::new();
        let mut put = |name: &str, term: (f64, f64), friction: f64| {
            out.push(Reported::new(name, (term.0 / friction, (term.1 / friction).abs()), "1"));
        };
        if let Some(viscous) = fitted.viscous.filter(|b| *b != 0.0) {
            put("viscous_asymmetry", fitted.term(0), viscous);
        }
        if let (Some(dry), true) = (fitted.dry.filter(|c| *c != 0.0), fitted.term(1).1 > 0.0) {
            put("coulomb_asymmetry", fitted.term(1), dry);
        }
        out
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.025
    }
}
