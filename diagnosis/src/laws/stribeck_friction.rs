//! Friction that falls as speed rises from zero: `-peak·exp(-(|q̇|/speed)^exponent)·sgn(q̇)`
//! (Stribeck 1902; Bo and Pavelescu 1982).

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Movable, Reported,
    Span,
};
use super::joint_terms::{Drop, JointTerms};
use super::law::sign;
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State, Variable};
use numerics::golden_section::logarithmic;

#[derive(Debug, Clone)]
struct StribeckFrictionLaw {
    speed: f64,
    exponent: f64,
}

impl ForceLaw for StribeckFrictionLaw {
    fn names(&self) -> Vec<String> {
        vec!["peak".into()]
    }
    fn terms(&mut self, _state: &State, velocity: f64, out: &mut [f64]) {
        out[0] = -sign(velocity) * (-(velocity.abs() / self.speed).powf(self.exponent)).exp();
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

shape! {
    /// The drop towards sliding speed.
    struct Shape {
        /// Speed at which the drop has fallen to 1/e, rad/s or m/s.
        speed: needed,
        /// Power of the speed in the exponent.
        exponent: 2.0,
    }
}

pub(super) struct StribeckFriction;

impl EffectLaw for StribeckFriction {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let Shape { speed, exponent } = Shape::of(effect);
        Some(Box::new(StribeckFrictionLaw { speed, exponent }))
    }
    fn is_dry(&self) -> bool {
        true
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        let Shape { speed, exponent } = Shape::of(effect);
        joint.drop = (exponent == 2.0).then(|| Drop { peak: effect.coefficient("peak"), speed });
        joint.drop.is_some()
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Speed)
    }
}

impl EffectSearch for StribeckFriction {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let from = (2.0 * span.speed_floor).max(0.004 * span.speed);
        let falls = |exponent: f64| {
            logarithmic(from, 0.4 * span.speed, 8)
                .into_iter()
                .map(move |speed| Effect::shaped(name, &[("speed", speed), ("exponent", exponent)]))
        };
        falls(1.0).chain(falls(2.0)).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("speed", 0.002 * span.speed, span.speed), ("exponent", 0.7, 2.3)]
    }
}

impl EffectReport for StribeckFriction {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![
            Reported::new("peak", fitted.scaled(fitted.term(0)), fitted.force),
            Reported::new("speed", fitted.shape("speed"), format!("{}/s", fitted.length)),
        ]
    }
    fn form_sd(&self, value: &str) -> f64 {
        if value == "peak" { 0.2 } else { 0.18 }
    }
}
