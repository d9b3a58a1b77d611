//! Whether the force of a spring fades while it stays bent: such a spring creeps, and no effect of the library is one.
//! Nothing here is named; it only speaks against a name.

use crate::effects::EffectName;
use crate::fit::Fit;
use crate::select::{Bench, Candidate, PER_COEFFICIENT};

/// Times in which a force may fade, s.
const FADES_S: [f64; 6] = [0.1, 0.25, 0.6, 1.5, 4.0, 10.0];
/// Part of what the spring gains that a fading one must gain beside it: a law of slightly another form gains a little.
const MUCH: f64 = 0.1;

/// Time in which the force of a fitted spring fades, s, where one that fades explains surely more; `gain` is the spring's
/// own.
pub(crate) fn fades(bench: &Bench, fitted: &Candidate, effect: usize, gain: f64) -> Option<f64> {
    if fitted.model.effects[effect].name != EffectName::PositionSpring {
        return None;
    }
    let likelihood = |time: f64| {
        let mut model = fitted.model.clone();
        model.effects[effect].shape.insert("fades_s".into(), time);
        (Fit::new(&model, bench.nominal, bench.tracks, &fitted.noise).log_likelihood, time)
    };
    let best = FADES_S.map(likelihood).into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let more = best.0 - fitted.fit.log_likelihood;
    (more > (MUCH * gain).max(4.0 * PER_COEFFICIENT)).then_some(best.1)
}
