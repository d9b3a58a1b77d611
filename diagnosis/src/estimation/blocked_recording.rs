//! A recording cut into blocks of rows, so that a filter can run over it fast and without differencing.
//!
//! A block's position is the mean of its rows; an input is held row by row and enters as what it does to velocity, to
//! position and to the block's mean, so that time stamps are used as they stand and nothing is resampled.

use crate::estimation::input::{Input, Total};
use crate::estimation::reading_lag::LagStep;
use crate::estimation::slices::Slices;
use crate::io::recording::Recording;
use crate::io::rig::Rig;
use std::sync::Arc;

/// A recording in blocks. All vectors have one entry per block unless said otherwise.
#[derive(Debug, Clone)]
pub(crate) struct BlockedRecording {
    pub(crate) file: String,
    /// How much of the file was left out before the first row, s.
    pub(crate) lead_s: f64,
    /// Travel per turn of the motor where it is known, rad or m.
    pub(crate) turn: Option<f64>,
    /// Position at which travel is nought, rad or m; the encoder's, which means something where it is absolute.
    pub(crate) origin: f64,
    /// Rows per block.
    pub(crate) rows_per_block: usize,
    /// Start of each block since the first row, s.
    pub(crate) start: Vec<f64>,
    /// Length, s.
    pub(crate) span: Vec<f64>,
    /// Mean over the rows of the time since the block's start, s, and of half its square, s².
    pub(crate) tau1: Vec<f64>,
    pub(crate) tau2: Vec<f64>,
    /// Time constant of a filter of the reading that the rig declares, s, and how the reading lags over each block; empty
    /// where it declares none.
    pub(crate) filter_s: Option<f64>,
    pub(crate) reading_lag: Vec<LagStep>,
    /// Mean reading since the first row, rad or m.
    pub(crate) z: Vec<f64>,
    /// Variance of that mean from quantisation alone.
    pub(crate) quantum: Vec<f64>,
    /// Time of each row since the first, and the length for which its command is held (one fewer than rows).
    pub(crate) row_time: Arc<[f64]>,
    pub(crate) row_hold: Arc<[f64]>,
    /// Command per row.
    pub(crate) command: Arc<[f64]>,
    /// What the command does over each block.
    pub(crate) command_input: Arc<Input>,
    /// Rows taken together for a resonance or a contact, and for a grip.
    pub(crate) of_contact: Arc<Slices>,
    pub(crate) of_grip: Arc<Slices>,
    /// Block means.
    pub(crate) tilt: Option<Vec<f64>>,
    pub(crate) force: Option<Vec<f64>>,
    pub(crate) reference: Option<Vec<f64>>,
    /// Position and velocity at the middle of each block: from the smoother where the recording is fitted, from the filter where it judges.
    pub(crate) x: Vec<f64>,
    pub(crate) v: Vec<f64>,
    /// Blocks where the axis rests or the sign of its speed is not known.
    pub(crate) rest: Vec<bool>,
    /// Blocks in the middle of a rest: friction is a reaction there and cancels every input.
    pub(crate) stuck: Vec<bool>,
    /// Blocks of which the model that is judged knows nothing.
    pub(crate) unknown: Vec<bool>,
    /// Bounds of the segments that gains are counted in, as block indices; one more than segments.
    pub(crate) segments: Vec<usize>,
    /// Its place among the fitted recordings; none where it is held out.
    pub(crate) place: Option<usize>,
    /// Acceleration by the force that is there all the time, of a model fitted before.
    pub(crate) bias: f64,
    /// Travel that the encoder seems to have lost so far, where steps were found.
    pub(crate) lost: Vec<f64>,
    /// What each block pays for a jump that was found to begin in it, nats.
    pub(crate) loss_price: Vec<f64>,
    /// Speed below which its sign is not known.
    pub(crate) speed_floor: f64,
    /// Speed from which the rig's dry friction stops the axis within half a block.
    pub(crate) stops_from: f64,
}

/// Blocks per second that are wanted: enough for friction, few enough for a minute at 10 kHz.
const BLOCK_BUDGET: f64 = 20_000.0;
const SLOWEST_BLOCKS_HZ: f64 = 330.0;
const FASTEST_BLOCKS_HZ: f64 = 400.0;
/// Shortest segment, s, and how many segments a recording is cut into at the most.
const SEGMENT_S: f64 = 0.2;
const SEGMENTS: f64 = 60.0;
/// Rows closer than this are taken together for a second mass, s: its resonances are below 200 Hz, and a grip has none.
const CONTACT_STEP_S: f64 = 6e-4;
const GRIP_STEP_S: f64 = 1e-3;

impl BlockedRecording {
    /// Cuts a checked recording into blocks, long rests at its ends left out.
    pub(crate) fn moving(recording: &Recording, rig: &Rig) -> Self {
        let (part, lead_s) = recording.without_idle_ends();
        Self { lead_s, ..Self::new(&part, rig) }
    }

    /// Cuts a checked recording into blocks.
    pub(crate) fn new(recording: &Recording, rig: &Rig) -> Self {
        let scale = 1.0 / rig.encoder.counts_per_unit;
        let rows = recording.len() - 1;
        let t0 = recording.time_s[0];
        let row_time: Vec<f64> = recording.time_s.iter().map(|t| t - t0).collect();
        let row_hold: Vec<f64> = row_time.windows(2).map(|w| w[1] - w[0]).collect();
        let wanted = (BLOCK_BUDGET / recording.duration_s()).clamp(SLOWEST_BLOCKS_HZ, FASTEST_BLOCKS_HZ);
        let m = ((recording.rate_hz() / wanted).round() as usize).max(1);
        let n = rows / m;
        let limit = rig.actuator.limit.unwrap_or(f64::INFINITY);
        let zero = recording.position_counts[0];
        let mut track = Self {
            file: recording.file.clone(),
            lead_s: 0.0,
            turn: rig.turn(),
            origin: zero * scale,
            rows_per_block: m,
            start: Vec::with_capacity(n),
            span: Vec::with_capacity(n),
            tau1: Vec::with_capacity(n),
            tau2: Vec::with_capacity(n),
            filter_s: rig.encoder.filter_s.filter(|s| *s > 0.0),
            reading_lag: Vec::new(),
            z: Vec::with_capacity(n),
            quantum: Vec::with_capacity(n),
            command: as_known(
                rig,
                recording.command[..rows].iter().map(|u| u.clamp(-limit, limit)),
                &row_hold,
            )
            .into(),
            command_input: Arc::new(Input::Held(Vec::new())),
            of_contact: Arc::default(),
            of_grip: Arc::default(),
            tilt: None,
            force: None,
            reference: None,
            x: Vec::new(),
            v: vec![0.0; n],
            rest: vec![false; n],
            stuck: vec![false; n],
            unknown: vec![false; n],
            segments: Vec::new(),
            place: None,
            bias: 0.0,
            lost: vec![0.0; n],
            loss_price: vec![0.0; n],
            speed_floor: 0.0,
            stops_from: 0.5 * recording.duration_s() / n.max(1) as f64 * rig.model.coulomb.unwrap_or(0.0)
                / rig.model.inertia,
            row_time: row_time.into(),
            row_hold: row_hold.into(),
        };
        let mean = |column: &[f64]| -> Vec<f64> {
            column.chunks_exact(m).take(n).map(|c| c.iter().sum::<f64>() / m as f64).collect()
        };
        for j in 0..n {
            let (first, end) = (j * m, (j + 1) * m);
            let start = track.row_time[first];
            let (mut one, mut two, mut sum) = (0.0, 0.0, 0.0);
            for row in first..end {
                let tau = track.row_time[row] - start;
                one += tau;
                two += 0.5 * tau * tau;
                sum += recording.position_counts[row] - zero;
            }
            let count = m as f64;
            track.start.push(start);
            track.span.push(track.row_time[end] - start);
            track.tau1.push(one / count);
            track.tau2.push(two / count);
            track.z.push(sum / count * scale);
            if let Some(filter) = track.filter_s {
                let rows = track.row_time[first..end].iter().map(|t| t - start);
                track.reading_lag.push(LagStep::new(filter, track.span[j], rows));
            }
            // Rows within one count tell no more than one of them.
            let moved = (recording.position_counts[end - 1] - recording.position_counts[first]).abs();
            let noise = rig.encoder.noise_counts.unwrap_or(0.0);
            track
                .quantum
                .push(scale * scale * (1.0 / 12.0 / (1.0 + moved.min(count - 1.0)) + noise * noise / count));
        }
        track.inflate_where_slow(scale);
        track.command_input = track.rows_input(&track.command).into();
        let slices = |longest: f64| {
            let rows = (longest * track.block_rate() * m as f64).round() as usize;
            Arc::new(Slices::new(&track.row_hold, m, rows.clamp(1, m)))
        };
        (track.of_contact, track.of_grip) = (slices(CONTACT_STEP_S), slices(GRIP_STEP_S));
        track.x = track.z.clone();
        track.tilt = recording.tilt_rad.as_deref().map(mean);
        track.force = recording.force.as_deref().map(mean);
        track.reference = recording.reference_counts.as_deref().map(mean);
        let duration = track.row_time[rows];
        let wanted = (duration / SEGMENT_S).floor().clamp(1.0, SEGMENTS);
        let length = (n as f64 / wanted).ceil().max(1.0) as usize;
        track.segments = (0..n).step_by(length).chain([n]).collect();
        track
    }

    /// Where a count lasts several blocks its error is the same in all of them: count it once.
    fn inflate_where_slow(&mut self, count: f64) {
        let n = self.blocks();
        let reach = 20.min(n / 4).max(1);
        let factor: Vec<f64> = (0..n)
            .map(|j| {
                let (a, b) = (j.saturating_sub(reach), (j + reach).min(n - 1));
                let moved = (self.z[b] - self.z[a]).abs() / count;
                ((b - a) as f64 / moved.max(1.0)).max(1.0)
            })
            .collect();
        for (quantum, factor) in self.quantum.iter_mut().zip(factor) {
            *quantum *= factor;
        }
    }

    /// Number of blocks.
    pub(crate) fn blocks(&self) -> usize {
        self.span.len()
    }

    /// Blocks per second.
    pub(crate) fn block_rate(&self) -> f64 {
        let n = self.blocks();
        n as f64 / (self.start[n - 1] + self.span[n - 1])
    }

    /// Mean tilt over a block, rad, and mean load, N·m or N; nought where not recorded.
    pub(crate) fn tilt_at(&self, block: usize) -> f64 {
        self.tilt.as_ref().map_or(0.0, |tilt| tilt[block])
    }
    pub(crate) fn force_at(&self, block: usize) -> f64 {
        self.force.as_ref().map_or(0.0, |force| force[block])
    }

    /// Acceleration in the middle of a block, rad/s² or m/s².
    pub(crate) fn acceleration(&self, block: usize) -> f64 {
        let (a, b) = (block.saturating_sub(1), (block + 1).min(self.blocks() - 1));
        let middle = |block: usize| self.start[block] + 0.5 * self.span[block];
        if b > a { (self.v[b] - self.v[a]) / (middle(b) - middle(a)) } else { 0.0 }
    }

    /// Velocity at a time since the start of a block, s, between those in the middles of the blocks.
    pub(crate) fn velocity_within(&self, block: usize, time: f64) -> f64 {
        let part = time / self.span[block] - 0.5;
        let other = if part < 0.0 { block.saturating_sub(1) } else { (block + 1).min(self.blocks() - 1) };
        self.v[block] + part.abs() * (self.v[other] - self.v[block])
    }

    /// What an effective command does over each block; that of the command as it was sent where there is none.
    pub(crate) fn drive(&self, effective: Option<&[f64]>) -> Input {
        effective.map_or_else(|| Input::clone(&self.command_input), |command| self.rows_input(command))
    }

    /// Adds `factor` times an input to a total; where the axis is stuck, no force acts.
    pub(crate) fn add_input(&self, total: &mut Total, input: &Input, factor: f64) {
        match input {
            Input::Held(a) => {
                for (j, a) in a.iter().enumerate().filter(|(j, _)| !self.stuck[*j]) {
                    let (a, h) = (a * factor, self.span[j]);
                    total.dv[j] += a * h;
                    total.dq[j] += 0.5 * a * h * h;
                    total.dz[j] += a * self.tau2[j];
                }
            }
            Input::Rows { dv, dq, dz } => {
                for j in (0..dv.len()).filter(|j| !self.stuck[*j]) {
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

    /// What the command alone does, with `gain` the acceleration per unit of it.
    pub(crate) fn command_total(&self, gain: f64) -> Total {
        let mut total = Total::zero(self.blocks());
        self.add_input(&mut total, &self.command_input, gain);
        total
    }

    /// What a signal held row by row does over each block.
    pub(crate) fn rows_input(&self, signal: &[f64]) -> Input {
        let m = self.rows_per_block;
        let n = self.blocks();
        let (mut dv, mut dq, mut dz) = (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
        for (a, h) in signal.chunks_exact(m).zip(self.row_hold.chunks_exact(m)).take(n) {
            let (mut v, mut q, mut sum) = (0.0, 0.0, 0.0);
            for (a, h) in a.iter().zip(h) {
                sum += q;
                q += (v + 0.5 * a * h) * h;
                v += a * h;
            }
            dv.push(v);
            dq.push(q);
            dz.push(sum / m as f64);
        }
        Input::Rows { dv, dq, dz }
    }

    /// Mean over each block of a signal held row by row.
    pub(crate) fn block_mean(&self, signal: &[f64]) -> Vec<f64> {
        let m = self.rows_per_block;
        signal
            .chunks_exact(m)
            .zip(self.row_hold.chunks_exact(m))
            .zip(&self.span)
            .map(|((a, h), span)| a.iter().zip(h).map(|(a, h)| a * h).sum::<f64>() / span)
            .collect()
    }

    /// Mean error over a block's rows of reading whole counts where the smoothed motion is.
    pub(crate) fn counting_error(&self, block: usize, count: f64) -> f64 {
        let m = self.rows_per_block;
        let first = block * m;
        let middle = self.start[block] + 0.5 * self.span[block];
        let sum: f64 = (first..first + m)
            .map(|row| {
                let x = (self.x[block] + self.v[block] * (self.row_time[row] - middle)) / count;
                0.5 - (x - x.floor())
            })
            .sum();
        sum / m as f64 * count
    }

    /// Whether dry friction may have stopped the axis for a part of a block: it is that slow there, and faster on both sides.
    pub(crate) fn stops_within(&self, block: usize) -> bool {
        let near = [block.saturating_sub(2), (block + 2).min(self.blocks() - 1)];
        let speed = self.v[block].abs();
        speed < self.stops_from && near.iter().all(|other| speed < 0.5 * self.v[*other].abs())
    }

    /// Whether each segment is known all but for a few blocks.
    pub(crate) fn known_segments(&self) -> impl Iterator<Item = bool> + '_ {
        self.segments.windows(2).map(|w| {
            let unknown = self.unknown[w[0]..w[1]].iter().filter(|x| **x).count();
            10 * unknown <= w[1] - w[0]
        })
    }

    /// The segment of a block.
    pub(crate) fn segment_count(&self) -> usize {
        self.segments.len() - 1
    }
}

/// The command behind the delay and the lag that the rig already knows.
fn as_known(rig: &Rig, command: impl Iterator<Item = f64>, hold: &[f64]) -> Vec<f64> {
    let mut laws = rig.known_command_laws();
    command.zip(hold).map(|(u, h)| laws.iter_mut().fold(u, |u, law| law.step(u, *h))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_within_a_block_is_a_dip_to_what_friction_stops_and_neither_a_crawl_nor_a_slower_stretch() {
        let time_s: Vec<f64> = (0..101).map(|i| f64::from(i) * 2.5e-3).collect();
        let recording = Recording {
            command: vec![0.0; time_s.len()],
            position_counts: time_s.clone(),
            time_s,
            ..Recording::default()
        };
        // 5 rad/s² stop 6.25 mrad/s within half a block.
        let mut track = BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.05));
        track.v.fill(-1.0);
        track.v[50] = 0.004;
        track.v[70] = 0.3;
        assert!(track.stops_within(50));
        assert!(!track.stops_within(49) && !track.stops_within(70));
        track.v.fill(0.004);
        assert!((0..100).all(|block| !track.stops_within(block)));
    }
}
