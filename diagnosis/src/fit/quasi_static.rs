//! Machines whose inertia hardly matters: slow motion in which the drive works against friction and
//! load alone.
//!
//! If J·q̈ ≈ 0, all-zero coefficients fit best, so ΔJ is added to both sides: `(J + ΔJ)·q̈ = (u +
//! ΔJ·q̈/gain)·gain − …`. That changes no force, and no refit can take it away. The acceleration is
//! that of the recording, smoothed; nothing here fits.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::fit::input::Total;
use crate::fit::noise;
use crate::fit::nominal::Nominal;
use crate::fit::refit::seen_acceleration;

/// Part of the drive's force below which the inertia's own hardly matters.
const HARDLY: f64 = 0.004;
/// Part of the drive's force that is added as inertia's.
const ADDED: f64 = 0.012;
/// Relative uncertainty of an inertia that was added.
const KNOWN: f64 = 0.02;

/// Adds inertia to rig and commands where the machine's own hardly matters; says nothing where it
/// does.
pub(crate) fn add_inertia(
    nominal: &mut Nominal,
    fit: &mut [BlockedRecording],
    holdout: &mut [BlockedRecording],
) {
    let gain = nominal.rig.actuator.gain;
    let square: f64 = fit.iter().flat_map(|track| track.rows.command.iter()).map(|u| u * u).sum();
    let rows: f64 = fit.iter().map(|track| track.rows.command.len() as f64).sum();
    let drive = gain.abs() * (square / rows).sqrt();
    let seen = fit.iter().map(seen_acceleration).fold(0.0, f64::max);
    let inertia = nominal.rig.model.inertia;
    if seen <= 0.0 || drive <= 0.0 || inertia * seen > HARDLY * drive {
        return;
    }
    let estimator = Estimator::new(fit, &noise::guess(fit, seen), seen);
    let accelerations = |tracks: &[BlockedRecording]| -> Vec<Vec<f64>> {
        tracks.iter().map(|track| estimator.residual(track, &Total::zero(track.block_count()))).collect()
    };
    let on_fit = accelerations(fit);
    let smooth = estimator.rms(&on_fit, fit);
    let added = ADDED * drive / smooth.max(1e-300) - inertia;
    if !(added.is_finite() && added > 0.0) {
        return;
    }
    let on_holdout = accelerations(holdout);
    for (track, acceleration) in fit.iter_mut().zip(&on_fit).chain(holdout.iter_mut().zip(&on_holdout)) {
        let m = track.rows.per_block;
        let command: Vec<f64> = track
            .rows
            .command
            .iter()
            .enumerate()
            .map(|(row, u)| u + added / gain * acceleration[(row / m).min(acceleration.len() - 1)])
            .collect();
        track.set_command(command);
    }
    // How unsure the machine's own inertia is matters as little as the inertia itself.
    let own = nominal.rig.inertia_sd().min(1.0) * inertia / (inertia + added);
    nominal.rig.uncertainty.inertia = Some(own.max(KNOWN));
    nominal.rig.model.inertia = inertia + added;
    nominal.virtual_inertia = added;
}
