//! Counts that the encoder loses permanently: steps of what it reads. The steps are found before
//! any effect is.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span};
use super::shape::{Missing, ShapeKey};
use super::{Effect, EffectName, State};

#[derive(Debug, Clone)]
struct MissedCountsLaw {
    names: Vec<String>,
    times: Vec<f64>,
}

impl ForceLaw for MissedCountsLaw {
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        for (term, time) in out.iter_mut().zip(&self.times) {
            *term = if state.time >= *time { 1.0 } else { 0.0 };
        }
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct MissedCounts;

impl EffectLaw for MissedCounts {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let steps = effect.shape.iter().filter_map(|(key, time)| Some((key.strip_prefix("time_")?, *time)));
        let (names, times) = steps.map(|(n, time)| (format!("step_{n}"), time)).unzip();
        Some(Box::new(MissedCountsLaw { names, times }))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        const { &[&[ShapeKey::new("time_", Missing::Numbered)]] }
    }
    fn in_sensor(&self) -> bool {
        true
    }
    fn is_of_jumps(&self) -> bool {
        true
    }
    fn put_jumps(&self, effect: &mut Effect, jumps: &[(f64, f64)]) {
        for (time, step) in jumps {
            let n = effect.shape.len() + 1;
            effect.shape.insert(format!("time_{n}"), *time);
            effect.coefficients.insert(format!("step_{n}"), *step);
        }
    }
}

impl EffectSearch for MissedCounts {
    fn grid(&self, name: EffectName, _span: &Span) -> Vec<Effect> {
        vec![Effect::shaped(name, &[])]
    }
}

impl EffectReport for MissedCounts {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        // All the counts that were lost in the fitted recordings, whichever way.
        let sum = fitted.lost * fitted.term(0).0;
        vec![Reported::new("lost", (sum, ((0.05 * sum).powi(2) + 1.0).sqrt()), "counts")]
    }
    fn variable(&self) -> &'static str {
        "time"
    }
}
