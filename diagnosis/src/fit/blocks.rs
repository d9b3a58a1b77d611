//! A recording cut into blocks of rows, so that a filter can run over it fast and without
//! differencing.
//!
//! A block's position is the mean of its rows; an input is held row by row and enters as what it
//! does to velocity, to position and to the block's mean, so that time stamps are used as they are
//! and nothing is resampled. Nothing here changes once a recording is cut.

use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::fit::input::Input;
use crate::fit::reading_lag::LagStep;
use crate::fit::skew_columns;
use crate::fit::slices::Slices;

/// The data of a recording, block by block. All vectors have one entry per block unless said
/// otherwise.
#[derive(Debug, Clone)]
pub(crate) struct Blocks {
    pub(crate) file: String,
    /// The time left out before the first row, s.
    pub(crate) lead_s: f64,
    /// Travel per turn of the motor where it is known, rad or m.
    pub(crate) turn: Option<f64>,
    /// The encoder's position at zero travel, rad or m; it means something where the encoder is
    /// absolute.
    pub(crate) origin: f64,
    /// The place at zero travel from which laws of the travel count, rad or m: the origin where the
    /// encoder is absolute, zero where recordings are to start at one place.
    pub(crate) first_place: f64,
    /// Start of each block since the first row, s.
    pub(crate) start: Vec<f64>,
    /// Length, s.
    pub(crate) span: Vec<f64>,
    /// Mean over the rows of the time since the block's start, s, and of half its square, s².
    pub(crate) tau1: Vec<f64>,
    pub(crate) tau2: Vec<f64>,
    /// Time constant of a filter of the reading that the rig declares, s, and how the reading lags
    /// over each block; empty where it declares none.
    pub(crate) filter_s: Option<f64>,
    pub(crate) reading_lag: Vec<LagStep>,
    /// Mean reading since the first row, rad or m.
    pub(crate) z: Vec<f64>,
    /// Variance of that mean from quantisation alone.
    pub(crate) quantum: Vec<f64>,
    /// Block means.
    pub(crate) tilt: Option<Vec<f64>>,
    pub(crate) force: Option<Vec<f64>>,
    pub(crate) reference: Option<Vec<f64>>,
    /// Bounds of the segments that gains are counted in, as block indices; one more than segments.
    pub(crate) segments: Vec<usize>,
    /// Speed from which the rig's dry friction stops the axis within half a block.
    pub(crate) stops_from: f64,
}

/// The rows of a recording, as far as they fill whole blocks.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    /// Rows per block.
    pub(crate) per_block: usize,
    /// Time of each row since the first, and the length for which its command is held (one fewer
    /// than rows), s.
    pub(crate) time: Vec<f64>,
    pub(crate) hold: Vec<f64>,
    /// Command per row.
    pub(crate) command: Vec<f64>,
    /// The input of the command over each block.
    pub(crate) command_input: Input,
    /// Change of the command's input per row that it acts late.
    pub(crate) lateness_input: Input,
    /// Change of the command's input per part of it that acts in the row before and as much in the
    /// row after.
    pub(crate) spread_input: Input,
    /// Rows taken together for a resonance or a contact, and for a grip.
    pub(crate) of_contact: Slices,
    pub(crate) of_grip: Slices,
    /// Mean command of each of these slices.
    pub(crate) contact_command: Vec<f64>,
    pub(crate) grip_command: Vec<f64>,
}

/// Blocks per second that are wanted: enough for friction, few enough for a minute at 10 kHz.
const BLOCK_BUDGET: f64 = 20_000.0;
const SLOWEST_BLOCKS_HZ: f64 = 330.0;
const FASTEST_BLOCKS_HZ: f64 = 400.0;
/// Shortest segment, s, and how many segments a recording is cut into at most.
const SEGMENT_S: f64 = 0.2;
const SEGMENTS: f64 = 60.0;
/// Rows closer than this are taken together for a second mass, s: its resonances are below 200 Hz,
/// and a grip has none.
const CONTACT_STEP_S: f64 = 6e-4;
const GRIP_STEP_S: f64 = 1e-3;

impl Rows {
    /// Cuts the rows of a recording into blocks.
    pub(crate) fn new(recording: &Recording, rig: &Rig) -> Self {
        let rows = recording.len() - 1;
        let t0 = recording.time_s[0];
        let time: Vec<f64> = recording.time_s.iter().map(|t| t - t0).collect();
        let hold: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
        let wanted = (BLOCK_BUDGET / recording.duration_s()).clamp(SLOWEST_BLOCKS_HZ, FASTEST_BLOCKS_HZ);
        let per_block = ((recording.rate_hz() / wanted).round() as usize).max(1);
        let limit = rig.actuator.limit.unwrap_or(f64::INFINITY);
        let command = as_known(rig, recording.command[..rows].iter().map(|u| u.clamp(-limit, limit)), &hold);
        let blocks = rows / per_block;
        let last = time[(blocks - 1) * per_block];
        let block_rate = blocks as f64 / (last + (time[blocks * per_block] - last));
        let slices = |longest: f64| {
            let rows = (longest * block_rate * per_block as f64).round() as usize;
            Slices::new(&hold, per_block, rows.clamp(1, per_block))
        };
        let (of_contact, of_grip) = (slices(CONTACT_STEP_S), slices(GRIP_STEP_S));
        let none = || Input::Held(Vec::new());
        Self {
            per_block,
            time,
            hold,
            command: Vec::new(),
            command_input: none(),
            lateness_input: none(),
            spread_input: none(),
            of_contact,
            of_grip,
            contact_command: Vec::new(),
            grip_command: Vec::new(),
        }
        .with_command(command)
    }

    /// The same rows with another command.
    pub(crate) fn with_command(self, command: Vec<f64>) -> Self {
        let command_input = self.input(&command);
        let lateness_input = self.input(&skew_columns::per_row_late(&command));
        let spread_input = self.input(&skew_columns::per_part_spread(&command));
        let contact_command = self.of_contact.means(&command, &self.hold);
        let grip_command = self.of_grip.means(&command, &self.hold);
        Self { command, command_input, lateness_input, spread_input, contact_command, grip_command, ..self }
    }

    /// Number of whole blocks.
    fn blocks(&self) -> usize {
        self.hold.len() / self.per_block
    }

    /// Returns the input of a signal held row by row.
    pub(crate) fn input(&self, signal: &[f64]) -> Input {
        let m = self.per_block;
        let n = self.blocks();
        let (mut dv, mut dq, mut dz) = (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
        for (a, h) in signal.chunks_exact(m).zip(self.hold.chunks_exact(m)).take(n) {
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
}

/// The command behind the delay and the lag that the rig already knows.
fn as_known(rig: &Rig, command: impl Iterator<Item = f64>, hold: &[f64]) -> Vec<f64> {
    let mut laws = rig.known_command_laws();
    command.zip(hold).map(|(u, h)| laws.iter_mut().fold(u, |u, law| law.step(u, 0.0, *h))).collect()
}

impl Blocks {
    /// Cuts a recording into the blocks of its rows; `lead_s` was left out of its file before the
    /// first row.
    pub(crate) fn new(recording: &Recording, rig: &Rig, rows: &Rows, lead_s: f64) -> Self {
        let scale = 1.0 / rig.encoder.counts_per_unit;
        let (n, m) = (rows.blocks(), rows.per_block);
        let mean = |column: &[f64]| -> Vec<f64> {
            column.chunks_exact(m).take(n).map(|c| c.iter().sum::<f64>() / m as f64).collect()
        };
        let length = segment_length(rows.time[recording.len() - 1], n);
        let mut blocks = Self {
            file: recording.file.clone(),
            lead_s,
            turn: rig.turn(),
            origin: recording.position_counts[0] * scale,
            first_place: if rig.encoder.absolute { recording.position_counts[0] * scale } else { 0.0 },
            start: Vec::with_capacity(n),
            span: Vec::with_capacity(n),
            tau1: Vec::with_capacity(n),
            tau2: Vec::with_capacity(n),
            filter_s: rig.encoder.filter_s.filter(|s| *s > 0.0),
            reading_lag: Vec::new(),
            z: Vec::with_capacity(n),
            quantum: Vec::with_capacity(n),
            tilt: recording.tilt_rad.as_deref().map(mean),
            force: recording.force.as_deref().map(mean),
            reference: recording.reference_counts.as_deref().map(mean),
            segments: (0..n).step_by(length).chain([n]).collect(),
            stops_from: 0.5 * recording.duration_s() / n.max(1) as f64 * rig.model.coulomb.unwrap_or(0.0)
                / rig.model.inertia,
        };
        let noise = rig.encoder.noise_counts.unwrap_or(0.0);
        for j in 0..n {
            blocks.push(&recording.position_counts, &rows.time, (j * m, (j + 1) * m), scale, noise);
        }
        blocks.inflate_where_slow(scale);
        blocks
    }

    /// Adds the block of rows `first` to `end`; one count is `scale`, and a reading has `noise`
    /// counts of noise.
    fn push(
        &mut self,
        counts: &[f64],
        row_time: &[f64],
        (first, end): (usize, usize),
        scale: f64,
        noise: f64,
    ) {
        let (start, zero) = (row_time[first], counts[0]);
        let (mut one, mut two, mut sum) = (0.0, 0.0, 0.0);
        for row in first..end {
            let tau = row_time[row] - start;
            one += tau;
            two += 0.5 * tau * tau;
            sum += counts[row] - zero;
        }
        let count = (end - first) as f64;
        let span = row_time[end] - start;
        self.start.push(start);
        self.span.push(span);
        self.tau1.push(one / count);
        self.tau2.push(two / count);
        self.z.push(sum / count * scale);
        if let Some(filter) = self.filter_s {
            let rows = row_time[first..end].iter().map(|t| t - start);
            self.reading_lag.push(LagStep::new(filter, span, rows));
        }
        // Rows within one count say no more than one of them.
        let moved = (counts[end - 1] - counts[first]).abs();
        self.quantum
            .push(scale * scale * (1.0 / 12.0 / (1.0 + moved.min(count - 1.0)) + noise * noise / count));
    }

    /// Inflates the errors of slow counts: if a count lasts several blocks, its error is the same
    /// in all of them and counts once.
    fn inflate_where_slow(&mut self, count: f64) {
        let n = self.span.len();
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
}

/// Blocks per segment of a recording of some length, s.
fn segment_length(duration: f64, blocks: usize) -> usize {
    let wanted = (duration / SEGMENT_S).floor().clamp(1.0, SEGMENTS);
    (blocks as f64 / wanted).ceil().max(1.0) as usize
}
