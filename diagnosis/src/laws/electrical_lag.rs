//! A first-order lag (L/R) between command and force.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, Movable, Reported, Span};
use super::joint_terms::JointTerms;
use super::shape::{ShapeKey, shape};
use super::{CommandLaw, Effect, EffectName, experiments};
use numerics::golden_section::logarithmic;

shape! {
    /// The lag.
    struct Shape {
        /// L/R, s.
        time_constant: needed,
    }
}

pub(super) struct ElectricalLag;

impl EffectLaw for ElectricalLag {
    fn command_law(&self, effect: &Effect) -> Option<CommandLaw> {
        Some(CommandLaw::of_lag(Shape::of(effect).time_constant))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        joint.lag += Shape::of(effect).time_constant;
        true
    }
}

impl EffectSearch for ElectricalLag {
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let times = logarithmic((0.2 * span.row).max(1e-5), 0.05, 9);
        times.into_iter().map(|time| Effect::shaped(name, &[("time_constant", time)])).collect()
    }
    fn movable(&self, _effect: &Effect, _span: &Span) -> Vec<Movable> {
        vec![("time_constant", 1e-6, 0.2)]
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        0
    }
}

impl EffectReport for ElectricalLag {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("time_constant", fitted.shape("time_constant"), "s")]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.04
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::CommandDelay).then_some(experiments::PHASE)
    }
}
