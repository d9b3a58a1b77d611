//! A recording in blocks with what is known of it so far: the motion that a model sees in it, jumps
//! of its reading, and the blocks that may not judge.

use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::fit::blocks::{Blocks, Rows};
use crate::fit::filter::Observed;
use crate::fit::input::{Input, Total};
use crate::fit::kept::{BlockMotion, ColumnCache};
use crate::fit::slices::Slice;
use std::sync::Arc;

/// Jumps of the reading that were found, block by block.
#[derive(Debug, Clone, Default)]
pub(crate) struct Jumps {
    /// Travel that the encoder seems to have lost so far, rad or m.
    pub(crate) lost: Vec<f64>,
    /// The price of the jump that begins in each block, nats; zero where none does.
    pub(crate) price: Vec<f64>,
}

/// A recording in blocks.
#[derive(Debug, Clone)]
pub(crate) struct BlockedRecording {
    pub(crate) blocks: Arc<Blocks>,
    pub(crate) rows: Arc<Rows>,
    pub(crate) motion: BlockMotion,
    pub(crate) jumps: Jumps,
    /// Blocks of which the model that is judged knows nothing.
    pub(crate) unknown: Vec<bool>,
    /// Its place among the fitted recordings; none where it is held out.
    pub(crate) place: Option<usize>,
    /// Acceleration by the force that is there all the time, of a model fitted before.
    pub(crate) bias: f64,
    /// Its nominal columns as they were under some noises.
    pub(super) kept: ColumnCache,
}

impl BlockedRecording {
    /// Cuts a checked recording into blocks, long rests at its ends left out.
    pub(crate) fn moving(recording: &Recording, rig: &Rig) -> Self {
        let (part, lead_s) = recording.without_idle_ends();
        Self::cut(&part, rig, lead_s)
    }

    /// Cuts a checked recording into blocks.
    #[cfg(test)]
    pub(crate) fn new(recording: &Recording, rig: &Rig) -> Self {
        Self::cut(recording, rig, 0.0)
    }

    fn cut(recording: &Recording, rig: &Rig, lead_s: f64) -> Self {
        let mut rows = Rows::new(recording, rig);
        let blocks = Blocks::new(recording, rig, &rows, lead_s);
        rows.of_contact.place_in(&blocks.span);
        rows.of_grip.place_in(&blocks.span);
        let n = blocks.span.len();
        let motion = BlockMotion {
            x: blocks.z.clone(),
            v: vec![0.0; n],
            rest: vec![false; n],
            any_force: vec![false; n],
            stuck: vec![false; n],
            speed_floor: 0.0,
        };
        Self {
            blocks: Arc::new(blocks),
            rows: Arc::new(rows),
            motion,
            jumps: Jumps { lost: vec![0.0; n], price: vec![0.0; n] },
            unknown: vec![false; n],
            place: None,
            bias: 0.0,
            kept: ColumnCache::default(),
        }
    }

    /// Gives the recording another command.
    pub(crate) fn set_command(&mut self, command: Vec<f64>) {
        self.rows = Arc::new(Rows::clone(&self.rows).with_command(command));
    }

    /// Returns the view of the recording that the filter needs.
    pub(crate) fn observed(&self) -> Observed<'_> {
        let Blocks { start, span, tau1, tau2, reading_lag, z, quantum, .. } = &*self.blocks;
        let BlockMotion { any_force, stuck, .. } = &self.motion;
        Observed { start, span, tau1, tau2, reading_lag, z, quantum, any_force, stuck }
    }

    /// Number of blocks.
    pub(crate) fn block_count(&self) -> usize {
        self.blocks.span.len()
    }

    /// Blocks per second.
    pub(crate) fn block_rate(&self) -> f64 {
        let n = self.block_count();
        n as f64 / (self.blocks.start[n - 1] + self.blocks.span[n - 1])
    }

    /// The place in the middle of a block, on which laws of the travel depend, rad or m.
    pub(crate) fn place_at(&self, block: usize) -> f64 {
        self.blocks.first_place + self.motion.x[block]
    }

    /// The places of all blocks.
    pub(crate) fn places(&self) -> impl Iterator<Item = f64> + '_ {
        self.motion.x.iter().map(|x| self.blocks.first_place + x)
    }

    /// Mean tilt over a block, rad, and mean load, N·m or N; zero where not recorded.
    pub(crate) fn tilt_at(&self, block: usize) -> f64 {
        self.blocks.tilt.as_ref().map_or(0.0, |tilt| tilt[block])
    }
    pub(crate) fn force_at(&self, block: usize) -> f64 {
        self.blocks.force.as_ref().map_or(0.0, |force| force[block])
    }

    /// Acceleration in the middle of a block, rad/s² or m/s².
    pub(crate) fn acceleration(&self, block: usize) -> f64 {
        let (a, b) = (block.saturating_sub(1), (block + 1).min(self.block_count() - 1));
        let middle = |block: usize| self.blocks.start[block] + 0.5 * self.blocks.span[block];
        if b > a { (self.motion.v[b] - self.motion.v[a]) / (middle(b) - middle(a)) } else { 0.0 }
    }

    /// Velocity in the middle of a slice of a block, between those in the middles of the blocks.
    pub(crate) fn velocity_within(&self, block: usize, slice: &Slice) -> f64 {
        let other = match slice.is_late {
            true => (block + 1).min(self.block_count() - 1),
            false => block.saturating_sub(1),
        };
        self.motion.v[block] + slice.aside * (self.motion.v[other] - self.motion.v[block])
    }

    /// Returns the input of an effective command; without one, that of the command as sent.
    pub(crate) fn drive(&self, effective: Option<&[f64]>) -> Input {
        effective.map_or_else(|| Input::clone(&self.rows.command_input), |command| self.rows.input(command))
    }

    /// Adds `factor` times an input to a total; where the axis is stuck, no force acts.
    pub(crate) fn add_input(&self, total: &mut Total, input: &Input, factor: f64) {
        match input {
            Input::Held(a) => {
                for (j, a) in a.iter().enumerate().filter(|(j, _)| !self.motion.stuck[*j]) {
                    let (a, h) = (a * factor, self.blocks.span[j]);
                    total.dv[j] += a * h;
                    total.dq[j] += 0.5 * a * h * h;
                    total.dz[j] += a * self.blocks.tau2[j];
                }
            }
            Input::Rows { dv, dq, dz } => {
                for j in (0..dv.len()).filter(|j| !self.motion.stuck[*j]) {
                    total.dv[j] += factor * dv[j];
                    total.dq[j] += factor * dq[j];
                    total.dz[j] += factor * dz[j];
                }
            }
            Input::Sensor(a) => {
                for (z, a) in total.dz.iter_mut().zip(a) {
                    *z += factor * a;
                }
            }
        }
    }

    /// Returns the input of the command alone; `gain` is the acceleration per unit of it.
    pub(crate) fn command_total(&self, gain: f64) -> Total {
        let mut total = Total::zero(self.block_count());
        self.add_input(&mut total, &self.rows.command_input, gain);
        total
    }

    /// Mean over each block of a signal held row by row.
    pub(crate) fn block_mean(&self, signal: &[f64]) -> Vec<f64> {
        let m = self.rows.per_block;
        signal
            .chunks_exact(m)
            .zip(self.rows.hold.chunks_exact(m))
            .zip(&self.blocks.span)
            .map(|((a, h), span)| a.iter().zip(h).map(|(a, h)| a * h).sum::<f64>() / span)
            .collect()
    }

    /// Mean error over a block's rows of reading whole counts where the smoothed motion is.
    pub(crate) fn counting_error(&self, block: usize, count: f64) -> f64 {
        let m = self.rows.per_block;
        let first = block * m;
        let middle = self.blocks.start[block] + 0.5 * self.blocks.span[block];
        let sum: f64 = (first..first + m)
            .map(|row| {
                let x =
                    (self.motion.x[block] + self.motion.v[block] * (self.rows.time[row] - middle)) / count;
                0.5 - (x - x.floor())
            })
            .sum();
        sum / m as f64 * count
    }

    /// True if dry friction may have stopped the axis for a part of a block: it is that slow there,
    /// and faster on both sides, but not so much faster that it is driven through a reversal with
    /// twice the friction.
    pub(crate) fn stops_within(&self, block: usize) -> bool {
        let near = [block.saturating_sub(2), (block + 2).min(self.block_count() - 1)];
        let [before, after] = near.map(|other| self.motion.v[other]);
        let (speed, stops_from) = (self.motion.v[block].abs(), self.blocks.stops_from);
        // In two blocks friction alone takes off four times what it stops within half a block.
        let is_driven = before * after < 0.0 && before.abs().min(after.abs()) >= 4.0 * stops_from;
        speed < stops_from && speed < 0.5 * before.abs().min(after.abs()) && !is_driven
    }

    /// Says of each segment whether the model knows all but a few of its blocks.
    pub(crate) fn known_segments(&self) -> impl Iterator<Item = bool> + '_ {
        self.blocks.segments.windows(2).map(|w| {
            let unknown = self.unknown[w[0]..w[1]].iter().filter(|x| **x).count();
            10 * unknown <= w[1] - w[0]
        })
    }

    /// The segment of a block.
    pub(crate) fn segment_count(&self) -> usize {
        self.blocks.segments.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dip_that_friction_can_stop_is_a_stop_within_a_block() {
        let time_s: Vec<f64> = (0..101).map(|i| f64::from(i) * 2.5e-3).collect();
        let recording = Recording {
            command: vec![0.0; time_s.len()],
            position_counts: time_s.clone(),
            time_s,
            ..Recording::default()
        };
        // 5 rad/s² stop 6.25 mrad/s within half a block.
        let mut track = BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.05));
        track.motion.v.fill(-1.0);
        track.motion.v[50] = 0.004;
        track.motion.v[70] = 0.3;
        assert!(track.stops_within(50));
        assert!(!track.stops_within(49) && !track.stops_within(70));
        // 12.5 mrad/s are what friction takes off in a block.
        let turns_at = |speed: f64| (-2..=2).map(move |k| (50 + k, 0.004 + speed * k as f64));
        turns_at(0.015).for_each(|(block, v)| track.motion.v[block as usize] = v);
        assert!(!track.stops_within(50), "it is driven through with more than twice the friction");
        turns_at(0.008).for_each(|(block, v)| track.motion.v[block as usize] = v);
        assert!(track.stops_within(50));
        track.motion.v.fill(0.004);
        assert!((0..100).all(|block| !track.stops_within(block)));
    }
}
