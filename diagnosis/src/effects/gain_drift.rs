//! A torque constant that changes over the recording, as it heats: `change·drive·(1 - exp(-t/time_constant))`; with `at_once_s` the
//! load changes at once, which has no name and speaks only against others.

use super::definition::{Allowed, Definition, Fitted, ForceLaw, Movable, Reported, Shown, Span};
use super::{Effect, EffectName, State, Subsystem, experiments};
use crate::numerics::golden::logarithmic;

#[derive(Debug, Clone)]
struct Law {
    time_constant: f64,
    /// Time at which the drift comes all at once, s.
    at_once_s: f64,
}

impl ForceLaw for Law {
    fn names(&self) -> Vec<String> {
        vec!["change".into()]
    }
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        out[0] = if !self.at_once_s.is_finite() {
            state.drive * (1.0 - (-state.time / self.time_constant).exp())
        } else if state.time >= self.at_once_s {
            state.drive
        } else {
            0.0
        };
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct Defined;

impl Definition for Defined {
    fn subsystem(&self) -> Subsystem {
        Subsystem::Actuator
    }
    fn words(&self) -> &'static str {
        "the torque constant changes as the recording goes on"
    }
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let time_constant = effect.shape_or("time_constant", 1.0);
        Some(Box::new(Law { time_constant, at_once_s: effect.shape_or("at_once_s", f64::INFINITY) }))
    }
    fn scales_drive(&self) -> bool {
        true
    }
    fn is_of_command(&self) -> bool {
        true
    }
    fn drifts(&self) -> bool {
        true
    }
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn needed(&self) -> &'static [&'static str] {
        &["time_constant"]
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let at = |time_constant: f64| Effect::shaped(name, &[("time_constant", time_constant)]);
        logarithmic(0.08 * span.duration, 2.0 * span.duration, 5).into_iter().map(at).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("time_constant", 0.02 * span.duration, 5.0 * span.duration)]
    }
    fn limits(&self, _term: usize, allowed: &Allowed) -> (f64, f64) {
        // At most this part of the smallest gain that the rig allows: a drive that drifts to nothing is no drift.
        let least = 0.6 * allowed.gain.abs() / allowed.gain_reach;
        (-least, least)
    }
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let (change, sd) = fitted.term(0);
        vec![
            Reported::new("change", (change / fitted.ratio, (sd / fitted.ratio).abs()), "1"),
            Reported::new("time_constant", fitted.shape("time_constant"), "s"),
        ]
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
    fn twins(&self, _effect: &Effect, shown: &Shown) -> Vec<EffectName> {
        shown.one_speed.then_some(EffectName::FrictionDrift).into_iter().collect()
    }
}
