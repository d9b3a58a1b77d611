//! The fit of a model to the force in the band that people see: least squares of what the report's
//! estimator leaves, over the blocks that move.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::fit::input::Total;
use crate::fit::linear_fit::{Fit, Prepared};
use crate::fit::model::total;
use crate::fit::whitened::grams;
use numerics::parallel;

/// Times that the scale of the residual, against which the rig's priors count, is found again.
const ROUNDS: usize = 2;

/// The values of a fitted model that leave least of the force in the estimator's band. The rig's
/// priors count once for each stretch that the band keeps apart, not once for each block.
pub(crate) fn in_band(fit: Fit, tracks: &[BlockedRecording], estimator: &Estimator) -> Fit {
    let log_likelihood = fit.log_likelihood;
    let of_band: Vec<(&Prepared, &BlockedRecording)> = fit.prepared.iter().zip(tracks).collect();
    let mut prepared = parallel::map_all(&of_band, |(one, track)| seen(one, track, estimator));
    let moving: f64 = tracks.iter().map(|t| estimator.moving(t).iter().filter(|x| **x).count() as f64).sum();
    let rate = tracks.iter().map(BlockedRecording::block_rate).fold(f64::INFINITY, f64::min);
    let apart = (2.0 * estimator.bandwidth_hz / rate).min(1.0);
    let mut fit = Fit::solve(prepared);
    for _ in 0..ROUNDS {
        let left: f64 = (0..tracks.len()).map(|r| fit.residual(r).iter().map(|x| x * x).sum::<f64>()).sum();
        let scale = (apart * moving / left.max(1e-300)).sqrt();
        prepared = fit.prepared;
        prepared.iter_mut().for_each(|one| one.scale(scale));
        fit = Fit::solve(prepared);
    }
    Fit { log_likelihood, ..fit }
}

/// A model over one recording as the estimator sees it: zero where the axis does not move.
fn seen(one: &Prepared, track: &BlockedRecording, estimator: &Estimator) -> Prepared {
    let moving = estimator.moving(track);
    let masked = |mut x: Vec<f64>| {
        x.iter_mut().zip(&moving).filter(|(_, moving)| !**moving).for_each(|(x, _)| *x = 0.0);
        x
    };
    let residual_of = |theta: &[f64]| estimator.residual(track, &total(track, &one.columns, theta));
    let residual = masked(residual_of(&one.reference));
    let response = |column: usize| {
        let mut input = Total::zero(track.block_count());
        track.add_input(&mut input, &one.columns[column].input, 1.0);
        masked(estimator.response(track, &input))
    };
    let responses = parallel::map(one.columns.len(), response);
    let segments = grams(track, &responses, &residual, None);
    one.over(residual, responses, segments)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::fit::filter::Noise;
    use crate::fit::model::Model;
    use crate::fit::nominal::{Key, Nominal};
    use std::f64::consts::TAU;

    /// An axis with a load on a spring: within the band it moves with the load, and far beyond it
    /// alone.
    #[test]
    fn a_fit_in_the_band_knows_nothing_of_faster_motion() {
        let (dt, slow_hz, fast_hz) = (1e-3, 2.0, 60.0);
        let (slow_gain, fast_gain) = (1.0, 2.0);
        let swing = |hz: f64, gain: f64, t: f64| -gain * (TAU * hz * t).sin() / (TAU * hz).powi(2);
        let time_s: Vec<f64> = (0..10_000).map(|row| f64::from(row) * dt).collect();
        let command =
            |t: &f64| (TAU * slow_hz * (t + 0.5 * dt)).sin() + (TAU * fast_hz * (t + 0.5 * dt)).sin();
        let counts = |t: &f64| 1e7 * (swing(slow_hz, slow_gain, *t) + swing(fast_hz, fast_gain, *t));
        let recording = Recording {
            command: time_s.iter().map(command).collect(),
            position_counts: time_s.iter().map(counts).map(f64::round).collect(),
            time_s,
            ..Recording::default()
        };
        let mut rig = Rig::of_values(1.0, 0.0, 0.0);
        rig.encoder.counts_per_unit = 1e7;
        rig.actuator.gain = 1.3;
        rig.uncertainty.inertia = Some(0.9);
        let tracks = [BlockedRecording::new(&recording, &rig)];
        let noise = Noise { sensor: 1.0, white: 1e-3, slow: 0.0, tau: 1.0, rest: 0.0, blur: 0.0 };
        let fit = Fit::new(&Model::default(), &Nominal::of(&rig), &tracks, &noise);
        let everywhere = fit.value(Key::Gain).expect("it has one");
        assert!(everywhere > 1.2 * slow_gain, "{everywhere} over all frequencies");
        let fit = in_band(fit, &tracks, &Estimator { bandwidth_hz: 8.0 });
        let in_band = fit.value(Key::Gain).expect("it has one");
        assert!((in_band / slow_gain - 1.0).abs() < 0.03, "{in_band} in the band");
    }
}
