//! A drive that slips above a force limit; the law is in `load`.

use super::definition::{
    Coupling, EffectLaw, EffectReport, EffectSearch, Factors, Fitted, ForceLaw, Movable, Reported, Span,
};
use super::load::{Load, MOST_OF_DRY, Machine, RATIOS, own_friction};
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State, experiments};
use numerics::golden_section::logarithmic;

#[derive(Debug, Clone)]
struct RollerSlipLaw(Load);

impl ForceLaw for RollerSlipLaw {
    fn names(&self) -> Vec<String> {
        vec!["inertia_ratio".into()]
    }
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        out[0] = self.0.by_grip(state);
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

/// Least force that a grip carries over its load's own friction, about which the rig says no more.
const HOLDS: f64 = 0.9;

shape! {
    /// The grip.
    struct Shape {
        /// Largest force that it carries, as a command, in the command's unit.
        limit: needed,
        /// Half the creep at which it slips, rad/s or m/s.
        creep: needed,
    }
}

pub(super) struct RollerSlip;

impl EffectLaw for RollerSlip {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let Shape { limit, creep } = Shape::of(effect);
        Some(Box::new(RollerSlipLaw(Load::in_grip(effect, limit, creep))))
    }
    fn coupling(&self) -> Option<Coupling> {
        Some(Coupling::Grip)
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS, Machine::KEYS]
    }
}

impl EffectSearch for RollerSlip {
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let mut out = Vec::new();
        // What slips under friction alone never held.
        let least =
            (span.rig.dry / span.rig.per_command.abs()).clamp(0.02 * span.command, 0.5 * span.command);
        let own = [("coast", span.rig.dry), ("ratio", 1.0)];
        for creep in [0.003, 0.02].map(|part| part * span.speed) {
            for limit in logarithmic(least, 0.945 * span.command, 10) {
                let shape = [("limit", limit), ("creep", creep)];
                out.push(Effect::shaped(name, &[shape.as_slice(), &own, &span.rig.machine].concat()));
            }
        }
        out
    }
    fn movable(&self, effect: &Effect, span: &Span) -> Vec<Movable> {
        let Machine { dry, .. } = Machine::of(effect);
        // Beyond the largest command: what the load's own friction takes a grip carries too. One
        // that holds even then never slips.
        let friction = span.rig.dry / span.rig.per_command.abs();
        vec![
            ("limit", 0.01 * span.command, span.command + friction.min(span.command)),
            ("creep", 1e-4 * span.speed, 0.3 * span.speed),
            ("coast", 0.35 * dry, 2.5 * dry),
            ("ratio", RATIOS.0, RATIOS.1),
        ]
    }
    fn is_possible(&self, effect: &Effect) -> bool {
        // The load's own friction is no more than the machine's, and a grip holds its load against
        // it, or it never held.
        let Machine { dry, per_command, coast, .. } = Machine::of(effect);
        own_friction(effect) <= MOST_OF_DRY * dry
            && Shape::of(effect).limit * per_command.abs() >= HOLDS * coast
    }
    fn start_factors(&self) -> &'static [Factors] {
        &[("limit", &[0.72, 0.85, 1.0, 1.2]), ("coast", &[0.6, 0.8, 1.0, 1.3]), ("ratio", &[0.6, 1.0, 1.7])]
    }
}

impl EffectReport for RollerSlip {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        // The load's part of what the drive would need to press as hard.
        let (limit, s) = fitted.shape("limit");
        let ((x, x_sd), ratio) = (fitted.term(0), fitted.ratio);
        let ratio_of_load = (x / ratio).abs();
        let part = ratio_of_load / (1.0 + ratio_of_load);
        let part_sd = (x_sd / ratio).abs() / (1.0 + ratio_of_load).powi(2);
        let drive = limit * fitted.inertia * Machine::of(fitted.effect).per_command.abs();
        let value = part * drive;
        let sd = ((part * s / limit * drive).powi(2)
            + (part_sd * drive).powi(2)
            + (value * fitted.common).powi(2))
        .sqrt();
        vec![Reported::new("ceiling", (value, sd), fitted.force)]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.15
    }
    fn variable(&self) -> &'static str {
        "command"
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::CommandSaturation).then_some(experiments::BLOCKED)
    }
}
