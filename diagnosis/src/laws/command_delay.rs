//! A pure transport delay between command and force.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, Movable, Reported, Span};
use super::joint_terms::JointTerms;
use super::shape::{ShapeKey, shape};
use super::{CommandLaw, Effect, EffectName, experiments};
use numerics::golden_section::logarithmic;

/// Longest delay worth looking for, s: a few rows of a slow controller.
fn longest(span: &Span) -> f64 {
    (5.0 * span.row).max(0.03)
}

shape! {
    /// The delay.
    struct Shape {
        /// Time between command and force, s.
        delay: needed,
    }
}

pub(super) struct CommandDelay;

impl EffectLaw for CommandDelay {
    fn command_law(&self, effect: &Effect) -> Option<CommandLaw> {
        Some(CommandLaw::of_delay(Shape::of(effect).delay))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        joint.delay += Shape::of(effect).delay;
        true
    }
}

impl EffectSearch for CommandDelay {
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let delays = logarithmic((0.2 * span.row).max(1e-5), longest(span), 16);
        delays.into_iter().map(|delay| Effect::shaped(name, &[("delay", delay)])).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("delay", 1e-6, 2.0 * longest(span))]
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        0
    }
}

impl EffectReport for CommandDelay {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("delay", fitted.shape("delay"), "s")]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.015
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::ElectricalLag).then_some(experiments::PHASE)
    }
    fn fault_of_a_log(&self) -> Option<&'static str> {
        // Only the time between the two columns is in a log.
        Some(
            "readings that are logged late look the same as this delay: compare the clocks of command and reading before the drive is changed",
        )
    }
}
