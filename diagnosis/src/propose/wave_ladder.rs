//! Mean cosine and sine over each block of waves whose numbers are evenly spaced: a wave follows
//! from the one before it by the addition of angles, in a fifth of the time that its own sine and
//! cosine take.

use crate::fit::blocked_recording::BlockedRecording;
use crate::laws::{sinc, wave_mean};

/// The mean cosine and sine of one wave over each block.
pub(crate) type Means = (Vec<f64>, Vec<f64>);

/// A point on the unit circle.
#[derive(Clone, Copy)]
struct Turn {
    cos: f64,
    sin: f64,
}

impl Turn {
    fn of(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self { cos, sin }
    }

    fn plus(self, by: Self) -> Self {
        Self { cos: self.cos * by.cos - self.sin * by.sin, sin: self.sin * by.cos + self.cos * by.sin }
    }
}

/// A wave over one block, and what the next wave adds.
struct Block {
    /// Phase at the middle, and its step.
    middle: (Turn, Turn),
    /// Half the phase passed, rad, as an angle and on the circle, and its step.
    half: (f64, f64),
    half_turn: (Turn, Turn),
}

impl Block {
    fn mean(&self) -> (f64, f64) {
        let part = match self.half.0.abs() > 0.3 {
            true => self.half_turn.0.sin / self.half.0,
            false => sinc(self.half.0),
        };
        (part * self.middle.0.cos, part * self.middle.0.sin)
    }

    fn advance(&mut self) {
        self.middle.0 = self.middle.0.plus(self.middle.1);
        self.half_turn.0 = self.half_turn.0.plus(self.half_turn.1);
        self.half.0 += self.half.1;
    }
}

/// The middle of a block's travel and the travel passed within it, rad or m; none is passed at
/// rest.
pub(crate) fn places(track: &BlockedRecording) -> Vec<(f64, f64)> {
    let passed = |j: usize| match track.motion.rest[j] {
        true => 0.0,
        false => track.motion.v[j] * track.blocks.span[j],
    };
    (0..track.block_count()).map(|j| (track.motion.x[j], passed(j))).collect()
}

/// Means of one wave, rad per unit of travel, over the blocks at some places.
pub(crate) fn means(places: &[(f64, f64)], wave: f64) -> Means {
    places.iter().map(|(position, passed)| wave_mean(wave, *position, *passed)).unzip()
}

/// Means of `count` waves from `first` on in steps of `step`, rad per unit of travel.
pub(crate) fn ladder(places: &[(f64, f64)], first: f64, step: f64, count: usize) -> Vec<Means> {
    let block = |(position, passed): &(f64, f64)| {
        let half = (0.5 * first * passed, 0.5 * step * passed);
        Block {
            middle: (Turn::of(first * position), Turn::of(step * position)),
            half,
            half_turn: (Turn::of(half.0), Turn::of(half.1)),
        }
    };
    let mut blocks: Vec<Block> = places.iter().map(block).collect();
    let next = |_| {
        let means = blocks.iter().map(Block::mean).unzip();
        blocks.iter_mut().for_each(Block::advance);
        means
    };
    (0..count).map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_by_addition_of_angles_is_the_wave_itself() {
        let places: Vec<(f64, f64)> =
            (0..50).map(|j| (0.37 * f64::from(j) - 4.0, 0.02 * f64::from(j % 9) - 0.06)).collect();
        let (first, step) = (3.0, 2.5);
        for (k, (cos, sin)) in ladder(&places, first, step, 16).into_iter().enumerate() {
            let (own_cos, own_sin) = means(&places, first + step * k as f64);
            for (a, b) in cos.iter().zip(&own_cos).chain(sin.iter().zip(&own_sin)) {
                assert!((a - b).abs() < 1e-12, "wave {k}: {a} is not {b}");
            }
        }
    }
}
