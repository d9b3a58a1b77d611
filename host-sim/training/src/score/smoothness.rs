//! Smoothness of a movement as its spectral arc length (Balasubramanian, Melendez-Calderon,
//! Roby-Brami and Burdet 2015, doi:10.1186/s12984-015-0090-9): the length of the line that the
//! normalised spectrum of speed draws, with its sign turned. It knows a speed profile and nothing
//! of needles.

use std::f64::consts::TAU;

/// Frequencies above this say nothing of a movement, Hz (ω_c^max = 40π rad/s in the paper).
pub(crate) const HIGHEST_HZ: f64 = 20.0;
/// The level of the normalised spectrum below which it is noise (V̄ in the paper).
pub(crate) const THRESHOLD: f64 = 0.05;
/// The factor by which padding refines the spectrum (2⁴ in the paper).
const PADDING: usize = 16;
/// A movement in fewer samples than this has no spectrum to speak of.
const FEWEST: usize = 8;

/// Spectral arc length of `speed` (any unit, evenly sampled at `rate_hz`): about −1.4 for one
/// smooth movement, the more negative the less smooth. None where nothing moved, or for too short a
/// time.
pub(crate) fn spectral_arc_length(speed: &[f64], rate_hz: f64) -> Option<f64> {
    if speed.len() < FEWEST || rate_hz.is_nan() || rate_hz <= 0.0 {
        return None;
    }
    let padded = speed.len().next_power_of_two() * PADDING;
    let step_hz = rate_hz / padded as f64;
    let bins = ((HIGHEST_HZ.min(rate_hz / 2.0) / step_hz).floor() as usize).max(1);
    let spectrum: Vec<f64> = (0..=bins).map(|bin| magnitude(speed, bin as f64 / padded as f64)).collect();
    let largest = spectrum.iter().copied().fold(0.0, f64::max);
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    let last = spectrum.iter().rposition(|m| *m >= THRESHOLD * largest).unwrap_or(0).max(1);
    let along = 1.0 / last as f64;
    let length: f64 =
        spectrum[..=last].windows(2).map(|pair| along.hypot((pair[1] - pair[0]) / largest)).sum();
    Some(-length)
}

/// |Σ x·e^{−2πi·n·f}|, `f` in cycles a sample.
fn magnitude(samples: &[f64], cycles_per_sample: f64) -> f64 {
    let (turn_sin, turn_cos) = (TAU * cycles_per_sample).sin_cos();
    let (mut cos, mut sin) = (1.0_f64, 0.0_f64);
    let (mut re, mut im) = (0.0, 0.0);
    for sample in samples {
        re += sample * cos;
        im += sample * sin;
        (cos, sin) = (cos * turn_cos - sin * turn_sin, cos * turn_sin + sin * turn_cos);
    }
    re.hypot(im)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 100.0;

    fn gauss(sigma_s: f64, centres_s: &[f64], seconds: f64) -> Vec<f64> {
        let at = |t: f64| centres_s.iter().map(|c| (-0.5 * ((t - c) / sigma_s).powi(2)).exp()).sum();
        (0..(seconds * RATE_HZ) as usize).map(|n| at(n as f64 / RATE_HZ)).collect()
    }

    /// The spectrum of a Gaussian is `e^{−2π²σ²f²}`: it falls to 1/20 at f_c, and over x = f/f_c it
    /// is `20^{−x²}`, whatever its σ. The length of that line from 0 to 1, by hand: chords between
    /// x = 0, ¼, ½, ¾ and 1, where it is 1, 0.8293, 0.4729, 0.1854 and 0.05, are 0.3027 + 0.4353 +
    /// 0.3810 + 0.2843 = 1.4033; by Simpson's rule on `√(1 + (2·ln 20·x·20^{−x²})²)`, 1.4165.
    #[test]
    fn a_gaussian_movement_has_the_arc_length_worked_by_hand() {
        const BY_HAND: f64 = 1.4165;
        for sigma_s in [0.08, 0.3] {
            let got = spectral_arc_length(&gauss(sigma_s, &[2.0], 4.0), RATE_HZ).expect("it moves");
            assert!((got + BY_HAND).abs() < 0.003, "σ {sigma_s} s: {got}");
        }
    }

    #[test]
    fn it_does_not_depend_on_size_and_falls_with_every_stop() {
        let one = spectral_arc_length(&gauss(0.1, &[1.0], 5.0), RATE_HZ).expect("moves");
        let large: Vec<f64> = gauss(0.1, &[1.0], 5.0).iter().map(|v| 1e3 * v).collect();
        assert!((spectral_arc_length(&large, RATE_HZ).expect("moves") - one).abs() < 1e-9);
        let two = spectral_arc_length(&gauss(0.1, &[1.0, 2.0], 5.0), RATE_HZ).expect("moves");
        let three = spectral_arc_length(&gauss(0.1, &[1.0, 2.0, 3.2], 5.0), RATE_HZ).expect("moves");
        assert!(three < two && two < one - 0.5, "{one}, {two}, {three}");
    }

    #[test]
    fn what_does_not_move_has_none() {
        assert_eq!(spectral_arc_length(&[0.0; 100], RATE_HZ), None);
        assert_eq!(spectral_arc_length(&[1.0; 4], RATE_HZ), None);
        assert_eq!(spectral_arc_length(&[f64::NAN; 100], RATE_HZ), None);
        assert_eq!(spectral_arc_length(&[1.0; 100], 0.0), None);
    }
}
