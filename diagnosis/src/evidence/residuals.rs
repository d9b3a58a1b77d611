//! Residual forces as people see them: under the nominal, the refitted and the patched model, and
//! what one takes from the other.

use crate::evidence::holdout_likelihood::evaluate_all;
use crate::evidence::parameters;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::fit::input::Total;
use crate::fit::model::total;
use crate::fit::nominal::Nominal;
use crate::propose::context::FittedModel;
use numerics::bootstrap::{Gain, bootstrap};

/// Residual force of a model over recordings, per block.
pub(crate) fn forces(
    estimator: &Estimator,
    tracks: &[BlockedRecording],
    totals: &[Total],
    inertia: f64,
) -> Vec<Vec<f64>> {
    tracks
        .iter()
        .zip(totals)
        .map(|(track, total)| estimator.residual(track, total).into_iter().map(|a| a * inertia).collect())
        .collect()
}

/// Part of the inertia's force below which the drive is not what moves the axis.
const DRIVES: f64 = 0.2;

/// The force that moves the axis, the drive's where it has one, per block, as an estimator of this
/// bandwidth sees it.
pub(crate) fn drive_force(
    nominal: &Nominal,
    estimator: &Estimator,
    tracks: &[BlockedRecording],
) -> Vec<Vec<f64>> {
    let drive: Vec<Total> = tracks.iter().map(|track| track.command_total(nominal.gain())).collect();
    let none: Vec<Total> = tracks.iter().map(|track| Total::zero(track.block_count())).collect();
    let j0 = nominal.rig.model.inertia;
    let all = forces(estimator, tracks, &none, j0);
    let less = forces(estimator, tracks, &drive, j0);
    let drive: Vec<Vec<f64>> =
        all.iter().zip(&less).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect();
    // Where the drive does little, what accelerates the axis is the force.
    if estimator.rms(&drive, tracks) < DRIVES * estimator.rms(&all, tracks) { all } else { drive }
}

/// Residual force per recording and block under the three models, and the drive's force, all by one
/// estimator.
pub(crate) struct Residuals {
    pub(crate) force: Vec<Vec<f64>>,
    pub(crate) nominal: Vec<Vec<f64>>,
    pub(crate) refit: Vec<Vec<f64>>,
    pub(crate) patched: Vec<Vec<f64>>,
}

/// The residuals of some recordings; `holdout` where offsets and phases are not fitted.
pub(crate) fn residuals(
    nominal: &Nominal,
    estimator: &Estimator,
    tracks: &[BlockedRecording],
    holdout: bool,
    refit: &FittedModel,
    patched: &FittedModel,
) -> Residuals {
    let model = crate::fit::model::Model::default();
    let plain = Nominal { anchor: None, ..nominal.clone() };
    let at_nominal: Vec<Total> = tracks
        .iter()
        .map(|track| {
            let columns = model.columns(&plain, track, &patched.noise);
            let theta: Vec<f64> = columns.iter().map(|c| c.prior.mean).collect();
            total(track, &columns, &theta)
        })
        .collect();
    let evaluate = |c: &FittedModel| -> Vec<Total> {
        if holdout {
            evaluate_all(c, nominal, tracks, &c.noise).into_iter().map(|evaluated| evaluated.total).collect()
        } else {
            c.fit.totals(tracks)
        }
    };
    Residuals {
        force: drive_force(nominal, estimator, tracks),
        nominal: forces(estimator, tracks, &at_nominal, nominal.rig.model.inertia),
        refit: forces(estimator, tracks, &evaluate(refit), parameters::scale(nominal, refit).0),
        patched: forces(estimator, tracks, &evaluate(patched), parameters::scale(nominal, patched).0),
    }
}

/// Returns the mean square of a residual above that of chance, and at least this part of its own.
pub(crate) fn above(residual: f64, chance: f64, least: f64) -> f64 {
    let whole = residual * residual;
    (whole - chance * chance).max(least * whole)
}

/// Part of the force that a refit must take from the held-out residual before values are called
/// wrong.
const REFIT_MATTERS: f64 = 0.02;

/// True if other values explain held-out recordings better than the rig's own, each recording's
/// bias left aside.
pub(crate) fn refit_matters(
    estimator: &Estimator,
    tracks: &[BlockedRecording],
    holdout: &Residuals,
    force: f64,
) -> bool {
    let unbiased = |residuals: &[Vec<f64>]| -> Vec<Vec<f64>> {
        residuals.iter().zip(tracks).map(|(x, track)| centred(x, &estimator.moving(track))).collect()
    };
    let (before, after) = (unbiased(&holdout.nominal), unbiased(&holdout.refit));
    let taken = estimator.rms(&before, tracks).powi(2) - estimator.rms(&after, tracks).powi(2);
    taken > (REFIT_MATTERS * force).powi(2) && relative_gain(estimator, tracks, &before, &after).low > 0.0
}

/// A residual less its mean where the axis moves.
fn centred(x: &[f64], moving: &[bool]) -> Vec<f64> {
    let moving: Vec<f64> = x.iter().zip(moving).filter(|(_, m)| **m).map(|(x, _)| *x).collect();
    let mean = moving.iter().sum::<f64>() / (moving.len() as f64).max(1.0);
    x.iter().map(|x| x - mean).collect()
}

/// Relative reduction of the held-out mean square.
pub(crate) fn relative_gain(
    estimator: &Estimator,
    tracks: &[BlockedRecording],
    before: &[Vec<f64>],
    after: &[Vec<f64>],
) -> Gain {
    let mut gains = Vec::new();
    let mut whole = 0.0;
    for ((track, a), b) in tracks.iter().zip(before).zip(after) {
        let moving = estimator.moving(track);
        for w in track.blocks.segments.windows(2) {
            let mut gain = 0.0;
            for j in w[0]..w[1] {
                if moving[j] {
                    gain += a[j] * a[j] - b[j] * b[j];
                    whole += a[j] * a[j];
                }
            }
            gains.push(gain);
        }
    }
    let whole = whole.max(1e-300);
    gains.iter_mut().for_each(|gain| *gain /= whole);
    bootstrap(&gains)
}
