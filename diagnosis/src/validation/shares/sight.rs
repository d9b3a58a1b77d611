//! One recording as a regression sees it: the drive's force and the columns of the motion in one
//! band, at blocks that move.

use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::filter::Noise;
use crate::estimation::force_residual::Estimator;
use crate::estimation::input::{Input, Total};
use crate::estimation::model::Model;
use crate::estimation::nominal::{Key, Nominal};
use crate::selection::predictive::fold_of;
use numerics::linear::Prior;

/// Rows per period of the highest frequency of the band; more add no information.
const ROWS_PER_PERIOD: f64 = 4.0;
/// Most rows that are used of a recording.
const MOST_ROWS: usize = 4000;
/// Part of a column's square that swings about its mean below which the column is constant.
const CONSTANT: f64 = 1e-3;
/// Fewest rows of a recording that is used.
pub(crate) const FEWEST_ROWS: usize = 25;

/// A recording in one band.
pub(crate) struct Sight<'a> {
    pub(crate) track: &'a BlockedRecording,
    estimator: Estimator,
    /// The estimator's answer to one block of force, its middle in the middle.
    kernel: Vec<f64>,
    kept: Vec<usize>,
    /// The fold in which each kept row is left out.
    pub(crate) fold: Vec<usize>,
    /// The acceleration in the band, block by block.
    acceleration: Vec<f64>,
    /// The nominal columns, block by block, acceleration first.
    unseen: Vec<Vec<f64>>,
    /// The drive's force, N·m or N, and the nominal columns at the kept rows.
    pub(crate) target: Vec<f64>,
    pub(crate) nominal: Vec<Vec<f64>>,
}

/// Values of the rig that scale the regression.
#[derive(Clone, Copy)]
pub(crate) struct Scale {
    pub(crate) gain: f64,
    pub(crate) inertia: f64,
}

impl Scale {
    pub(crate) fn of(nominal: &Nominal) -> Self {
        let gain = nominal.rig.actuator.gain;
        Self { gain, inertia: (gain / nominal.known_gain()).abs() }
    }
}

/// Priors of the nominal columns, as forces, in their order.
pub(crate) fn priors(nominal: &Nominal, track: &BlockedRecording, noise: &Noise) -> Vec<Prior> {
    let Scale { gain, inertia } = Scale::of(nominal);
    let sd = nominal.anchor.map_or(nominal.gain_sd(), |(_, sd)| sd);
    let reach = nominal.gain_reach();
    let mean = inertia * gain.signum();
    let (a, b) = (mean / reach, mean * reach);
    let first = Prior { mean, sd: sd * inertia, low: a.min(b), high: a.max(b) };
    let others = Model::default().columns(nominal, track, noise).into_iter().filter_map(|column| {
        let p = column.prior;
        let is_other = !matches!(column.key, Key::Gain | Key::Offset | Key::Skew | Key::Spread);
        let of = |x: f64| x * inertia;
        is_other.then(|| Prior { mean: of(p.mean), sd: of(p.sd), low: of(p.low), high: of(p.high) })
    });
    std::iter::once(first).chain(others).collect()
}

impl<'a> Sight<'a> {
    pub(crate) fn new(
        track: &'a BlockedRecording,
        place: usize,
        nominal: &Nominal,
        noise: &Noise,
        estimator: Estimator,
    ) -> Self {
        let rate = track.block_rate();
        let moving = estimator.moving(track);
        let by_band = (rate / (ROWS_PER_PERIOD * estimator.bandwidth_hz)) as usize;
        let stride = by_band.max(moving.iter().filter(|moves| **moves).count() / MOST_ROWS).max(1);
        let kept: Vec<usize> = (0..track.block_count()).filter(|j| moving[*j]).step_by(stride).collect();
        let segment = |j: &usize| track.blocks.segments.partition_point(|from| from <= j) - 1;
        let fold = kept.iter().map(|j| fold_of(place, segment(j))).collect();
        let acceleration = estimator.residual(track, &Total::zero(track.block_count()));
        let mut sight = Self {
            track,
            estimator,
            kernel: estimator.kernel(track),
            kept,
            fold,
            acceleration,
            unseen: Vec::new(),
            target: Vec::new(),
            nominal: Vec::new(),
        };
        let scale = Scale::of(nominal);
        for column in Model::default().columns(nominal, track, noise) {
            let block = sight.blocks_of(&column.input);
            match column.key {
                Key::Gain => {
                    let force: Vec<f64> = block.iter().map(|u| scale.gain * u).collect();
                    sight.target = sight.see(&force);
                }
                Key::Offset | Key::Skew | Key::Spread => {}
                _ => {
                    let against: Vec<f64> = block.iter().map(|x| -x).collect();
                    sight.nominal.push(sight.see(&against));
                    sight.unseen.push(against);
                }
            }
        }
        let seen = sight.centred(sight.kept.iter().map(|j| sight.acceleration[*j]).collect());
        sight.nominal.insert(0, seen);
        sight
    }

    /// Mean acceleration of an input over each block; zero where no force acts.
    pub(crate) fn blocks_of(&self, input: &Input) -> Vec<f64> {
        let stuck = &self.track.motion.stuck;
        match input {
            Input::Held(a) => a.iter().zip(stuck).map(|(a, stuck)| if *stuck { 0.0 } else { *a }).collect(),
            Input::Rows { dv, .. } => dv
                .iter()
                .zip(&self.track.blocks.span)
                .zip(stuck)
                .map(|((dv, span), stuck)| if *stuck { 0.0 } else { dv / span })
                .collect(),
            Input::Sensor(_) => Vec::new(),
        }
    }

    /// An input as the regression sees it, an acceleration at the kept rows.
    pub(crate) fn see_input(&self, input: &Input) -> Vec<f64> {
        self.centred(self.in_band(input))
    }

    /// True if an input is the same force on all kept rows, so that the regression cannot see it.
    pub(crate) fn is_constant(&self, input: &Input) -> bool {
        let square = |column: &[f64]| column.iter().map(|x| x * x).sum::<f64>();
        let column = self.in_band(input);
        let all = square(&column);
        all > 0.0 && square(&self.centred(column)) <= CONSTANT * all
    }

    /// An input in the band at the kept rows.
    fn in_band(&self, input: &Input) -> Vec<f64> {
        let Input::Sensor(read) = input else {
            let blocks = self.blocks_of(input);
            return self.kept.iter().map(|j| self.at(&blocks, *j)).collect();
        };
        let mut total = Total::zero(read.len());
        total.dz.clone_from(read);
        let with = self.estimator.residual(self.track, &total);
        // The reading's error is taken for motion.
        self.kept.iter().map(|j| with[*j] - self.acceleration[*j]).collect()
    }

    /// A column of blocks in the band at the kept rows, its mean taken off: an offset is each
    /// recording's own.
    pub(crate) fn see(&self, column: &[f64]) -> Vec<f64> {
        self.centred(self.kept.iter().map(|j| self.at(column, *j)).collect())
    }

    fn at(&self, column: &[f64], block: usize) -> f64 {
        let half = self.kernel.len() / 2;
        let last = column.len() - 1;
        let end = |k: usize| column[(block + k).saturating_sub(half).min(last)];
        self.kernel.iter().enumerate().map(|(k, weight)| weight * end(k)).sum()
    }

    fn centred(&self, column: Vec<f64>) -> Vec<f64> {
        let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
        column.into_iter().map(|x| x - mean).collect()
    }

    /// The drive's force that the motion asks for by the nominal terms, block by block in the band;
    /// `force` is that of laws.
    pub(crate) fn asked(&self, coefficients: &[f64], force: &[f64]) -> Vec<f64> {
        let mut sum: Vec<f64> = force.to_vec();
        for (c, column) in coefficients[1..].iter().zip(&self.unseen) {
            sum.iter_mut().zip(column).for_each(|(sum, x)| *sum += c * x);
        }
        let out: Vec<f64> = (0..sum.len()).map(|j| self.at(&sum, j)).collect();
        out.iter().zip(&self.acceleration).map(|(sum, a)| sum + coefficients[0] * a).collect()
    }

    /// Mean of what the drive does more than a prediction at the kept rows.
    pub(crate) fn offset(&self, drive: &[f64], predicted: &[f64]) -> f64 {
        let sum: f64 = self.kept.iter().map(|j| self.at(drive, *j) - predicted[*j]).sum();
        sum / self.kept.len().max(1) as f64
    }

    pub(crate) fn bandwidth_hz(&self) -> f64 {
        self.estimator.bandwidth_hz
    }

    pub(crate) fn rows(&self) -> usize {
        self.kept.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::recording::Recording;
    use crate::io::rig::Rig;

    #[test]
    fn a_column_is_seen_as_the_estimator_sees_a_force() {
        let time_s: Vec<f64> = (0..6000).map(|row| f64::from(row) * 1e-3).collect();
        let recording = Recording {
            command: vec![0.0; time_s.len()],
            position_counts: time_s.iter().map(|t| (9000.0 * (3.0 * t).sin()).round()).collect(),
            time_s,
            ..Recording::default()
        };
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let track = BlockedRecording::new(&recording, &rig);
        let noise = Noise { sensor: 1.0, white: 1e-3, slow: 1.0, tau: 0.1, rest: 1.0, blur: 0.0 };
        let estimator = Estimator { bandwidth_hz: 12.0 };
        let sight = Sight::new(&track, 0, &Nominal::of(&rig), &noise, estimator);
        let force: Vec<f64> = track.blocks.start.iter().map(|t| (2.0 * t).sin() + (40.0 * t).cos()).collect();
        let mut total = Total::zero(track.block_count());
        track.add_input(&mut total, &Input::Held(force.clone()), 1.0);
        let with = estimator.residual(&track, &total);
        let half = sight.kernel.len();
        let inner = half..track.block_count() - half;
        for j in sight.kept.iter().filter(|j| inner.contains(j)) {
            let seen = sight.acceleration[*j] - with[*j];
            assert!((sight.at(&force, *j) - seen).abs() < 0.02, "{seen}");
        }
    }
}
