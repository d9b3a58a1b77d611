//! Deadband of width w: u′ = 0 for |u| ≤ w; otherwise u′ = u, or u − w·sgn u.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, Movable, Reported, Span};
use super::shape::{ShapeKey, shape};
use super::{CommandLaw, Effect, EffectName, Variable};
use numerics::golden_section::logarithmic;

shape! {
    /// The band.
    struct Shape {
        /// Largest command that does nothing, in the command's unit.
        half_width: 0.0,
        /// True if larger commands lose the width; they pass whole otherwise.
        shift: flag,
    }
}

pub(super) struct CommandDeadband;

impl EffectLaw for CommandDeadband {
    fn command_law(&self, effect: &Effect) -> Option<CommandLaw> {
        let Shape { half_width, shift } = Shape::of(effect);
        Some(CommandLaw::Deadband { half_width, shift })
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Command)
    }
}

impl EffectSearch for CommandDeadband {
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let bands = |shift: f64| {
            logarithmic(0.01 * span.command, 0.85 * span.dead, 11)
                .into_iter()
                .map(move |width| Effect::shaped(name, &[("half_width", width), ("shift", shift)]))
        };
        bands(0.0).chain(bands(1.0)).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("half_width", 0.001 * span.command, span.dead)]
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        0
    }
}

impl EffectReport for CommandDeadband {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("half_width", fitted.shape("half_width"), fitted.command.clone())]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.03
    }
    fn variable(&self) -> &'static str {
        "command"
    }
    fn experiment(&self, _other: EffectName) -> Option<&'static str> {
        Some("a slow triangle of small commands through zero while the axis is kept moving by another load")
    }
}
