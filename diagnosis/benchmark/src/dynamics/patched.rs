//! The force that a patched rig leaves on a recording.

use super::band::{Band, spread};
use super::laws::{Forces, effective_command, forces, is_along_travel, is_over};
use super::rig::Rig;

/// Encoder zeros that are tried along the shortest wave, and along the spread of starts to either
/// side.
const PHASES: f64 = 24.0;
const PLACES: i32 = 8;
/// Encoder zeros that are tried round a turn for a table over the angle.
const ANGLES: i32 = 64;

/// Rms of what the patched rig leaves, over the best place of the encoder's zero.
pub(super) fn left(nominal: &Rig, patched: &Rig, band: &Band) -> Result<f64, String> {
    if patched.effects.iter().any(|e| e.name == "missed_counts") {
        return Err("lost counts come at times of their own, which no rig can tell beforehand".into());
    }
    let command = effective_command(patched, &band.motion);
    let biased = nominal.offset.is_some();
    let mut places = vec![0.0];
    if patched.effects.iter().any(is_along_travel) {
        let span = nominal.start_spread.unwrap_or(0.0);
        places.extend((1..=PLACES).flat_map(|i| {
            let place = span * f64::from(i) / f64::from(PLACES);
            [place, -place]
        }));
    }
    if let (true, Some(turn)) = (patched.effects.iter().any(|e| is_over(e, "angle")), nominal.turn) {
        places.extend((1..ANGLES).map(|i| turn * f64::from(i) / f64::from(ANGLES)));
    }
    let mut best = f64::INFINITY;
    for along in places {
        let Forces { sum, waves } = forces(patched, &band.motion, &command, along)?;
        let forces = band.see(|i| sum[i]);
        let left: Vec<f64> =
            forces.iter().zip(band.acceleration()).map(|(f, a)| f - patched.inertia * a).collect();
        let columns: Vec<[Vec<f64>; 2]> =
            waves.iter().map(|w| [band.see(|i| w.cos[i]), band.see(|i| w.sin[i])]).collect();
        if waves.is_empty() {
            best = best.min(spread(&left, biased));
            continue;
        }
        let shortest = waves.iter().map(|w| std::f64::consts::TAU / w.wave).fold(f64::MAX, f64::min);
        let longest = waves.iter().map(|w| std::f64::consts::TAU / w.wave).fold(0.0, f64::max);
        // Once round: a turn where it is known, else the longest wave.
        let round = nominal.turn.unwrap_or(longest).max(longest);
        let count = (PHASES * round / shortest).ceil().clamp(1.0, 2000.0) as usize;
        let sums = ResidualSums::of(&left, &columns, biased);
        for i in 0..count {
            let shift = round * i as f64 / count as f64;
            let weights: Vec<f64> = waves
                .iter()
                .flat_map(|w| {
                    let [c, d] = w.coefficients;
                    let (sin, cos) = (w.wave * shift).sin_cos();
                    [c * cos + d * sin, d * cos - c * sin]
                })
                .collect();
            best = best.min(sums.left(&weights));
        }
    }
    Ok(best)
}

/// Second moments of the residual and the columns of the waves, so that a shift costs no pass over
/// the rows.
struct ResidualSums {
    rows: f64,
    energy: f64,
    cross: Vec<f64>,
    gram: Vec<Vec<f64>>,
}

impl ResidualSums {
    fn of(left: &[f64], columns: &[[Vec<f64>; 2]], biased: bool) -> Self {
        let centred = |x: &[f64]| -> Vec<f64> {
            let mean = if biased { x.iter().sum::<f64>() / x.len().max(1) as f64 } else { 0.0 };
            x.iter().map(|x| x - mean).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let left = centred(left);
        let flat: Vec<Vec<f64>> = columns.iter().flatten().map(|c| centred(c)).collect();
        Self {
            rows: left.len().max(1) as f64,
            energy: dot(&left, &left),
            cross: flat.iter().map(|c| dot(c, &left)).collect(),
            gram: flat.iter().map(|a| flat.iter().map(|b| dot(a, b)).collect()).collect(),
        }
    }

    /// Rms of the residual once the weighted columns are added.
    fn left(&self, weights: &[f64]) -> f64 {
        let mut total = self.energy;
        for (i, a) in weights.iter().enumerate() {
            total += 2.0 * a * self.cross[i];
            total += weights.iter().zip(&self.gram[i]).map(|(b, g)| a * b * g).sum::<f64>();
        }
        (total.max(0.0) / self.rows).sqrt()
    }
}
