//! The position loop that ran while a recording was made, found from its reference: what it takes
//! to simulate under that reference rather than under the recorded command.

use super::Motion;
use crate::data::recording::Recording;
use numerics::linear::{Factor, Square};

/// Part of the command's variance that a loop has to explain to be believed.
const BELIEVED: f64 = 0.5;

/// Gains of a loop on position and speed. What else the recorded command holds is left in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionLoop {
    /// Command per rad or m of deviation.
    pub proportional: f64,
    /// Command per rad/s or m/s of deviation.
    pub derivative: f64,
    /// Part of the command's variance that it explains.
    pub explained: f64,
}

impl PositionLoop {
    /// The loop that explains a command by its reference; none where there is no reference or no
    /// such loop. `gain` is the drive's, for the sign.
    pub fn fit(recording: &Recording, motion: &Motion, gain: f64) -> Option<Self> {
        let reference = motion.reference.as_ref()?;
        let columns: Vec<[f64; 3]> = reference
            .iter()
            .zip(&motion.position)
            .zip(&motion.velocity)
            .map(|((r, q), v)| [r - q, -v, 1.0])
            .collect();
        let norm: Vec<f64> =
            (0..3).map(|k| columns.iter().map(|c| c[k] * c[k]).sum::<f64>().sqrt().max(1e-300)).collect();
        let mut information = Square::zero(3);
        let mut score = vec![0.0; 3];
        for (c, u) in columns.iter().zip(&recording.command) {
            for i in 0..3 {
                score[i] += c[i] / norm[i] * u;
                for j in 0..3 {
                    information.add(i, j, c[i] / norm[i] * c[j] / norm[j]);
                }
            }
        }
        for i in 0..3 {
            information.add(i, i, 1e-12);
        }
        let theta: Vec<f64> =
            Factor::new(&information).solve(&score).iter().zip(&norm).map(|(x, n)| x / n).collect();
        let n = columns.len() as f64;
        let mean = recording.command.iter().sum::<f64>() / n;
        let (mut left, mut all) = (0.0, 0.0);
        for (c, u) in columns.iter().zip(&recording.command) {
            left += (u - c.iter().zip(&theta).map(|(a, b)| a * b).sum::<f64>()).powi(2);
            all += (u - mean).powi(2);
        }
        let explained = 1.0 - left / all.max(1e-300);
        let [proportional, derivative] = [theta[0], theta[1]];
        let holds = proportional * gain > 0.0 && derivative * gain >= 0.0 && explained > BELIEVED;
        holds.then_some(Self { proportional, derivative, explained })
    }
}
