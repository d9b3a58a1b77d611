//! A drive that clips below its declared limit.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, Movable, Reported, Shown, Span};
use super::joint_terms::JointTerms;
use super::shape::{ShapeKey, shape};
use super::{CommandLaw, Effect, EffectName, Subsystem, Variable, experiments};

shape! {
    /// The clip.
    struct Shape {
        /// Largest command that passes, in the command's unit.
        limit: needed,
    }
}

pub(super) struct Defined;

impl EffectLaw for Defined {
    fn command_law(&self, effect: &Effect) -> Option<CommandLaw> {
        Some(CommandLaw::Clip { limit: Shape::of(effect).limit })
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        let clip = Shape::of(effect).limit;
        joint.limit = Some(joint.limit.map_or(clip, |limit| limit.min(clip)));
        true
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Command)
    }
}

impl EffectSearch for Defined {
    fn is_of_command(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let part = |i: i32| span.clip + (0.945 - span.clip) / 9.0 * f64::from(i);
        (0..10).map(|i| Effect::shaped(name, &[("limit", span.command * part(i))])).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("limit", 0.9 * span.clip * span.command, span.command)]
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        0
    }
    fn twins(&self, _effect: &Effect, _shown: &Shown) -> Vec<EffectName> {
        // A drive that clips, and a roller that slips at a constant force.
        vec![EffectName::RollerSlip]
    }
}

impl EffectReport for Defined {
    fn subsystem(&self) -> Subsystem {
        Subsystem::Actuator
    }
    fn words(&self) -> &'static str {
        "the drive clips large commands"
    }
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("limit", fitted.shape("limit"), fitted.command.clone())]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.02
    }
    fn variable(&self) -> &'static str {
        "command"
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::RollerSlip).then_some(experiments::BLOCKED)
    }
}
