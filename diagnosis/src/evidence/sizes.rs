//! The size that an effect would have on each recording alone. Nothing here judges.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;

/// Least mean square of an effect on a recording, relative to the largest on any, for the recording
/// to count as exciting it.
const PLAYED: f64 = 0.03;

/// Returns the sizes on the recordings that excite an effect, fitted ones first.
pub(crate) fn played(fitted: Vec<Size>, holdout: Vec<Size>) -> Vec<f64> {
    let most = fitted.iter().chain(&holdout).map(|size| size.square).fold(0.0, f64::max);
    let factors = |sizes: Vec<Size>| -> Vec<f64> {
        sizes.iter().filter(|size| size.square >= PLAYED * most).map(|size| size.factor).collect()
    };
    let (fitted, holdout) = (factors(fitted), factors(holdout));
    if fitted.is_empty() || holdout.is_empty() { Vec::new() } else { [fitted, holdout].concat() }
}

/// The size of an effect on one recording.
pub(crate) struct Size {
    /// Factor on its force that would leave the least residual.
    factor: f64,
    /// Mean square of its force.
    square: f64,
}

/// Returns the size of an effect on each recording; its force is the difference of the residuals
/// with it and without it.
pub(crate) fn sizes_on(
    estimator: &Estimator,
    tracks: &[BlockedRecording],
    with: &[Vec<f64>],
    without: &[Vec<f64>],
) -> Vec<Size> {
    let size = |(track, (with, without)): (&BlockedRecording, (&Vec<f64>, &Vec<f64>))| {
        let (mut along, mut square, mut moving) = (0.0, 0.0, 0.0);
        for (j, _) in estimator.moving(track).iter().enumerate().filter(|(_, moving)| **moving) {
            let done = without[j] - with[j];
            along += done * with[j];
            square += done * done;
            moving += 1.0;
        }
        Size { factor: 1.0 + along / f64::max(square, 1e-300), square: square / f64::max(moving, 1.0) }
    };
    tracks.iter().zip(with.iter().zip(without)).map(size).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_with_little_of_an_effect_has_no_size() {
        let size = |factor, square| Size { factor, square };
        let fitted = || vec![size(1.0, 1.0), size(1.8, 0.01)];
        assert_eq!(played(fitted(), vec![size(0.9, 0.5)]), [1.0, 0.9]);
        assert!(played(fitted(), vec![size(0.9, 0.01)]).is_empty(), "no held-out one plays it");
    }
}
