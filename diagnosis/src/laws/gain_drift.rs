//! A torque constant that changes over the recording, as magnets and winding heat:
//! `change·drive·h`. Either h follows the time alone, `1 - exp(-t/time_constant)`, or, with
//! `mean_square`, the copper loss: `time_constant·dh/dt = u²/mean_square - h` with u the effective
//! command and h zero at the start, the first-order thermal model of a motor (one thermal
//! resistance, one capacity). With `at_once_s` the load changes at once, which has no name and
//! speaks only against others.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Movable, Reported, Span, Unnamed,
};
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State, experiments};
use numerics::golden_section::logarithmic;

shape! {
    /// The course of the drift.
    struct Shape {
        /// Time in which it has come to 1 - 1/e under a constant load, s.
        time_constant: needed,
        /// Time at which the drift comes all at once, s.
        at_once_s: (f64::INFINITY),
        /// Square of the command under which the heat settles at one; none where it follows the
        /// time alone.
        mean_square: optional,
    }
}

#[derive(Debug, Clone)]
struct GainDriftLaw {
    shape: Shape,
    heat: f64,
}

impl GainDriftLaw {
    /// The heat in the middle of a step, which it moves on to the step's end.
    fn heated(&mut self, state: &State, mean_square: f64) -> f64 {
        let from = self.heat;
        let settled = state.command * state.command / mean_square;
        self.heat += (settled - from) * -(-state.dt / self.shape.time_constant).exp_m1();
        0.5 * (from + self.heat)
    }
}

impl ForceLaw for GainDriftLaw {
    fn names(&self) -> Vec<String> {
        vec!["change".into()]
    }
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        out[0] = if let Some(mean_square) = self.shape.mean_square {
            state.drive * self.heated(state, mean_square)
        } else if !self.shape.at_once_s.is_finite() {
            state.drive * (1.0 - (-state.time / self.shape.time_constant).exp())
        } else if state.time >= self.shape.at_once_s {
            state.drive
        } else {
            0.0
        };
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

/// Times, as parts of the longest recording, at which a load may change at once.
const CHANGES: usize = 40;

pub(super) struct GainDrift;

impl EffectLaw for GainDrift {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(GainDriftLaw { shape: Shape::of(effect), heat: 0.0 }))
    }
    fn scales_drive(&self) -> bool {
        true
    }
    fn reads_command(&self, effect: &Effect) -> bool {
        Shape::of(effect).mean_square.is_some()
    }
    fn drifts(&self) -> bool {
        true
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
}

impl EffectSearch for GainDrift {
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let by_time = |time_constant: f64| Effect::shaped(name, &[("time_constant", time_constant)]);
        let by_loss = |time_constant: f64| {
            let shape = [("time_constant", time_constant), ("mean_square", span.mean_square)];
            Effect::shaped(name, &shape)
        };
        let times = logarithmic(0.08 * span.duration, 2.0 * span.duration, 5);
        let mut all: Vec<Effect> = times.iter().map(|time| by_time(*time)).collect();
        if span.mean_square > 0.0 {
            all.extend(times.iter().map(|time| by_loss(*time)));
        }
        all
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("time_constant", 0.02 * span.duration, 5.0 * span.duration)]
    }
    fn unnamed(&self, name: EffectName, fitted: Option<&Effect>, span: &Span) -> Vec<Unnamed> {
        if fitted.is_some_and(|effect| effect.name != name) {
            return Vec::new();
        }
        let sudden_load = |i: usize| {
            let time = span.duration * i as f64 / CHANGES as f64;
            let effect = Effect::shaped(name, &[("time_constant", span.duration), ("at_once_s", time)]);
            Unnamed { effect, freedom: 4.0, what: format!("a load that changes at once, at {time:.1} s,") }
        };
        (1..CHANGES).map(sudden_load).collect()
    }
}

impl EffectReport for GainDrift {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let (change, sd) = fitted.term(0);
        vec![
            Reported::new("change", (change / fitted.ratio, (sd / fitted.ratio).abs()), "1"),
            Reported::new("time_constant", fitted.shape("time_constant"), "s"),
        ]
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
        (other == EffectName::FrictionDrift).then_some(experiments::LATE)
    }
}

#[cfg(test)]
mod tests {
    use crate::laws::{Effect, EffectName, Law, State};

    #[test]
    fn heat_follows_the_square_of_the_command_and_fades_without() {
        let shape = [("time_constant", 2.0), ("mean_square", 0.04)];
        let mut law = Law::new(&Effect::shaped(EffectName::GainDrift, &shape)).unwrap();
        let mut after = |command: f64, seconds: f64| {
            let mut out = [0.0];
            for _ in 0..(1000.0 * seconds) as usize {
                law.terms(&State { command, drive: 3.0, dt: 1e-3, ..State::default() }, &mut out);
            }
            out[0] / 3.0
        };
        let near =
            |heat: f64, expected: f64| assert!((heat - expected).abs() < 1e-3, "{heat} for {expected}");
        let settled = 1.0 - (-1.0_f64).exp();
        near(after(-0.2, 2.0), settled);
        near(after(0.0, 2.0), settled * (-1.0_f64).exp());
        near(after(0.4, 40.0), 4.0);
    }
}
