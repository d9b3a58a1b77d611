//! A clip that falls with speed: the supply's voltage against back-EMF. The drive's force is that
//! of `command` held between `-limit·(1 + q̇/no_load_speed)` and `limit·(1 - q̇/no_load_speed)`.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, Movable, Reported, Span};
use super::shape::{ShapeKey, shape};
use super::{CommandLaw, Effect, EffectName};

shape! {
    /// The line that the supply draws.
    struct Shape {
        /// Speed at which back-EMF is all of the supply's voltage, rad/s or m/s.
        no_load_speed: needed,
        /// Largest command that passes at rest, in the command's unit.
        limit: needed,
    }
}

/// Limits at rest over the largest command, and speeds without load over the fast speed, from which
/// a search starts.
const LIMITS: [f64; 5] = [0.6, 0.85, 1.2, 1.7, 2.4];
const SPEEDS: [f64; 4] = [1.05, 1.3, 1.8, 2.6];

pub(super) struct SupplyLimit;

impl EffectLaw for SupplyLimit {
    fn command_law(&self, effect: &Effect) -> Option<CommandLaw> {
        let Shape { limit, no_load_speed } = Shape::of(effect);
        Some(CommandLaw::Supply { limit, no_load_speed })
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
}

impl EffectSearch for SupplyLimit {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let line = |limit: f64, speed: f64| {
            let shape = [("limit", limit * span.command), ("no_load_speed", speed * span.speed)];
            Effect::shaped(name, &shape)
        };
        // A line above the largest command at the fast speed takes nothing.
        let binds = |limit: f64, speed: f64| limit * (1.0 - 1.0 / speed) < 1.0;
        let all = LIMITS.iter().flat_map(|limit| SPEEDS.iter().map(move |speed| (*limit, *speed)));
        all.filter(|(limit, speed)| binds(*limit, *speed)).map(|(limit, speed)| line(limit, speed)).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        let (command, speed) = (span.command, span.speed);
        vec![("no_load_speed", 1.01 * speed, 5.0 * speed), ("limit", 0.9 * span.clip * command, 5.0 * command)]
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        0
    }
}

impl EffectReport for SupplyLimit {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let speed = Reported::new("no_load_speed", fitted.shape("no_load_speed"), format!("{}/s", fitted.length));
        vec![speed, Reported::new("limit", fitted.shape("limit"), fitted.command.clone())]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.05
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::CommandSaturation)
            .then_some("the same large command at rest and at the highest speed")
    }
}
