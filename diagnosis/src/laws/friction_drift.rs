//! Friction that changes over the time of the recording, as it warms up: `-(coulomb·sgn(q̇) +
//! viscous·q̇)·(1 - exp(-t/time_constant))`.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Movable, Reported, Span,
};
use super::law::{first_or_both, sign};
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State, experiments};
use numerics::golden_section::logarithmic;

shape! {
    /// The course of the drift.
    struct Shape {
        /// Time in which it has come to 1 - 1/e, s.
        time_constant: needed,
        /// True if only dry friction drifts, because the rig has no viscous friction.
        dry_only: flag,
    }
}

#[derive(Debug, Clone)]
struct FrictionDriftLaw(Shape);

impl ForceLaw for FrictionDriftLaw {
    fn names(&self) -> Vec<String> {
        first_or_both("coulomb", "viscous", !self.0.dry_only)
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        let settled = 1.0 - (-state.time / self.0.time_constant).exp();
        out[0] = -sign(velocity) * settled;
        if let Some(viscous) = out.get_mut(1) {
            *viscous = -velocity * settled;
        }
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct FrictionDrift;

impl EffectLaw for FrictionDrift {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(FrictionDriftLaw(Shape::of(effect))))
    }
    fn is_dry(&self) -> bool {
        true
    }
    fn drifts(&self) -> bool {
        true
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
}

impl EffectSearch for FrictionDrift {
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let settling_in = |time_constant: f64| {
            let mut drift = Effect::shaped(name, &[("time_constant", time_constant)]);
            if !span.rig.has_viscous {
                drift.shape.insert("dry_only".into(), 1.0);
            }
            drift
        };
        logarithmic(0.08 * span.duration, 2.0 * span.duration, 5).into_iter().map(settling_in).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("time_constant", 0.02 * span.duration, 5.0 * span.duration)]
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        2
    }
}

impl EffectReport for FrictionDrift {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let (change, sd) = fitted.term(0);
        let base = if fitted.own_dry == 0.0 { fitted.dry.unwrap_or(0.0) } else { fitted.own_dry }.abs();
        let size = if base > 0.0 {
            Reported::new("change", (change / base, sd / base), "1")
        } else {
            // There is no dry friction of which it could be a part.
            Reported::new("coulomb", fitted.scaled((change, sd)), fitted.force)
        };
        vec![size, Reported::new("time_constant", fitted.shape("time_constant"), "s")]
    }
    fn is_size(&self, value: &str) -> bool {
        value != "time_constant"
    }
    fn form_sd(&self, value: &str) -> f64 {
        if value == "time_constant" { 0.06 } else { 0.04 }
    }
    fn variable(&self) -> &'static str {
        "time"
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::GainDrift).then_some(experiments::LATE)
    }
}
