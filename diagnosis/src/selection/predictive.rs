//! How well a fitted model predicts blocks of the fitted recordings that were left out of its fit (K-fold cross-validation).
//!
//! Noise and shapes stay as they were fitted to all blocks; every coefficient, each recording's offset and phases among them, is fitted
//! anew without the blocks that it is judged on. A model with more freedom pays for it here by itself.

use crate::estimation::fit::{Fit, normal_of};
use crate::numerics::linear::{Prior, bounded};

/// Parts that segments are dealt into.
const FOLDS: usize = 6;
/// Neighbouring segments that are left out together: what a disturbance remembers must not tell of the block that is judged.
const TOGETHER: usize = 3;

/// Cost of each segment of each recording, in log-likelihood, predicted by a fit to the other folds.
pub(crate) fn left_out_costs(fit: &Fit) -> Vec<f64> {
    let mut costs: Vec<Vec<f64>> = fit.prepared.iter().map(|one| vec![0.0; one.segments.len()]).collect();
    let fold_of = |recording: usize, segment: usize| (segment / TOGETHER + recording) % FOLDS;
    let mut priors = vec![Prior::FREE; fit.keys.len()];
    for (one, places) in fit.prepared.iter().zip(&fit.places) {
        for (column, place) in one.columns.iter().zip(places) {
            let p = column.prior;
            priors[*place] = Prior { mean: 0.0, sd: p.sd, low: p.low - p.mean, high: p.high - p.mean };
        }
    }
    for fold in 0..FOLDS {
        let kept = |recording: usize, segment: usize| fold_of(recording, segment) != fold;
        let (m, b) = normal_of(&fit.prepared, &fit.places, fit.keys.len(), kept);
        let solution = bounded(&m, &b, &priors);
        for (r, (one, places)) in fit.prepared.iter().zip(&fit.places).enumerate() {
            for (s, cost) in one.costs(places, &solution.x).into_iter().enumerate() {
                if fold_of(r, s) == fold {
                    costs[r][s] = cost;
                }
            }
        }
    }
    costs.concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Effect, EffectName};
    use crate::estimation::blocked_recording::BlockedRecording;
    use crate::estimation::filter::Noise;
    use crate::estimation::model::{Model, Nominal};
    use crate::io::recording::Recording;
    use crate::io::rig::Rig;

    /// Gain of an effect on left-out blocks of a recording of nothing but noise and, where asked, drag.
    fn gain(drag: f64) -> f64 {
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let (h, rows) = (1e-3, 12_000);
        let mut random = crate::numerics::bootstrap::Random::new(5);
        let (mut x, mut v) = (0.0, 0.0);
        let mut recording = Recording::default();
        for i in 0..rows {
            let t = h * f64::from(i);
            let u = (1.3 * t).sin() + 0.6 * (4.1 * t).sin();
            recording.time_s.push(t);
            recording.command.push(u);
            recording.position_counts.push((1000.0_f64 * x).floor());
            let push = (random.below(2001) as f64 / 1000.0 - 1.0) * 2.0;
            let a: f64 = 10.0 * u - drag * v * f64::abs(v) + push;
            x += v * h + 0.5 * a * h * h;
            v += a * h;
        }
        let mut track = BlockedRecording::new(&recording, &rig);
        let v: Vec<f64> = (0..track.blocks())
            .map(|j| {
                let (a, b) = (j.saturating_sub(3), (j + 3).min(track.blocks() - 1));
                (track.z[b] - track.z[a]) / (track.start[b] - track.start[a])
            })
            .collect();
        track.v = v;
        let tracks = [track];
        let nominal = Nominal { rig, external: 0.0, anchor: None, is_balanced: true, virtual_inertia: 0.0 };
        let noise = Noise { sensor: 1.0, white: 2e-3, slow: 1e-9, tau: 0.1, rest: 1.0 };
        let cost = |effects: Vec<Effect>| -> f64 {
            let model = Model { effects, ..Model::default() };
            left_out_costs(&Fit::new(&model, &nominal, &tracks, &noise)).iter().sum()
        };
        cost(Vec::new()) - cost(vec![Effect::shaped(EffectName::QuadraticDrag, &[])])
    }

    #[test]
    fn what_is_there_predicts_blocks_that_were_left_out_and_what_is_not_does_not() {
        assert!(gain(0.3) > 50.0, "{}", gain(0.3));
        assert!(gain(0.0) < 3.0, "{}", gain(0.0));
    }
}
