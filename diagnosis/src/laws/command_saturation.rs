//! A drive that clips below its declared limit, at once or softly, as amplifiers near their supply
//! do.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, Movable, Reported, Span};
use super::joint_terms::JointTerms;
use super::shape::{ShapeKey, shape};
use super::{CommandLaw, Effect, EffectName, Variable, experiments};
use numerics::golden_section::logarithmic;

shape! {
    /// The clip.
    struct Shape {
        /// Largest command that passes, in the command's unit.
        limit: needed,
        /// Reciprocal of the power with which commands approach the limit; a hard clip has none.
        softness: 0.0,
    }
}

/// The softness from which a search starts.
const SOFTNESS: f64 = 0.1;

pub(super) struct CommandSaturation;

impl EffectLaw for CommandSaturation {
    fn command_law(&self, effect: &Effect) -> Option<CommandLaw> {
        let Shape { limit, softness } = Shape::of(effect);
        Some(CommandLaw::Clip { limit, softness })
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        let Shape { limit: clip, softness } = Shape::of(effect);
        joint.limit = Some(joint.limit.map_or(clip, |limit| limit.min(clip)));
        softness <= 0.0
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Command)
    }
}

impl EffectSearch for CommandSaturation {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let limits: Vec<f64> = logarithmic(span.clip * span.command, 0.945 * span.command, 10);
        let hard = limits.iter().map(|&limit| Effect::shaped(name, &[("limit", limit)]));
        let soft =
            limits.iter().map(|&limit| Effect::shaped(name, &[("limit", limit), ("softness", SOFTNESS)]));
        hard.chain(soft).collect()
    }
    fn movable(&self, effect: &Effect, span: &Span) -> Vec<Movable> {
        let limit = ("limit", 0.9 * span.clip * span.command, span.command);
        if Shape::of(effect).softness > 0.0 { vec![limit, ("softness", 0.03, 0.25)] } else { vec![limit] }
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        0
    }
}

impl EffectReport for CommandSaturation {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let limit = Reported::new("limit", fitted.shape("limit"), fitted.command.clone());
        let is_soft = Shape::of(fitted.effect).softness > 0.0;
        let softness = is_soft.then(|| Reported::new("softness", fitted.shape("softness"), "1"));
        std::iter::once(limit).chain(softness).collect()
    }
    fn form_sd(&self, value: &str) -> f64 {
        if value == "limit" { 0.02 } else { 0.2 }
    }
    fn variable(&self) -> &'static str {
        "command"
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::RollerSlip).then_some(experiments::BLOCKED)
    }
}
