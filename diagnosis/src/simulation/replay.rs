//! Simulates a rig for comparison with a recording: free run from the first row, windows started
//! from the measured state, and under the recorded reference. The command is held from row to row,
//! as the contract has it.

use super::{Motion, Plant, PositionLoop, Surroundings};
use crate::data::recording::Recording;
use crate::data::rig::Rig;

/// Longest step of the plant, s.
const STEP_S: f64 = 1e-4;
/// Time before a window in which the plant is led along the measured motion, so that delays, lags
/// and bristles are under way.
const LEAD_S: f64 = 0.15;
/// Most seconds of windows of one length.
const MOST_S: f64 = 12.0;
/// The same while a start is searched, which takes many runs.
const SEARCH_S: f64 = 2.0;
/// A simulation this many travels away has left the recording permanently.
const GONE: f64 = 1e3;
/// Places within a turn at which a start is tried.
const STARTS: usize = 32;

/// Window lengths, s.
pub const WINDOWS_S: [f64; 7] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];

/// A simulated motion at the rows of the recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trajectory {
    /// rad or m, from the first row.
    pub position: Vec<f64>,
    /// rad/s or m/s.
    pub velocity: Vec<f64>,
}

/// Root mean squares of what a simulation is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// rad or m.
    pub position: f64,
    /// rad/s or m/s.
    pub velocity: f64,
}

impl Deviation {
    fn of(sum: (f64, f64), rows: usize) -> Self {
        let mean = |x: f64| (x / rows.max(1) as f64).sqrt();
        Self { position: mean(sum.0), velocity: mean(sum.1) }
    }
}

impl Trajectory {
    /// Its errors.
    pub fn deviation(&self, motion: &Motion) -> Deviation {
        let square = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
        let sum = (square(&self.position, &motion.position), square(&self.velocity, &motion.velocity));
        Deviation::of(sum, motion.time.len())
    }
}

/// A recording with which simulations are compared.
#[derive(Debug)]
pub struct Beside<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// Its motion.
    pub motion: Motion,
    /// The first row's place on the mechanism, rad or m: only terms that depend on the travel use
    /// it.
    pub start: f64,
}

impl<'a> Beside<'a> {
    /// A recording under a rig; the start is where absolute counts say, else where the rig's
    /// periodic effects fit the recording best.
    pub fn new(recording: &'a Recording, rig: &Rig) -> Self {
        Self::in_motion(recording, Motion::new(recording, rig), rig)
    }

    /// The same where the motion is known.
    pub(super) fn in_motion(recording: &'a Recording, motion: Motion, rig: &Rig) -> Self {
        let mut beside = Self { recording, motion, start: 0.0 };
        if rig.encoder.absolute || rig.model.gravity.is_some_and(|gravity| gravity != 0.0) {
            // Its counts have one zero, from which places and the gravity's angle count.
            beside.start = recording.position_counts[0] / rig.encoder.counts_per_unit;
        } else if let Some(turn) = period(rig) {
            let mut off = |start: f64| {
                beside.start = start;
                beside.spread(rig, 0.2, SEARCH_S).position
            };
            let starts = (0..STARTS).map(|k| turn * k as f64 / STARTS as f64);
            let best = starts.map(|start| (off(start), start)).min_by(|a, b| a.0.total_cmp(&b.0));
            beside.start = best.map_or(0.0, |(_, start)| start);
        }
        beside
    }

    /// Runs the plant over rows `from..to`, telling each row's place and speed.
    fn run(
        &self,
        plant: &mut Plant,
        from: usize,
        to: usize,
        feedback: Option<PositionLoop>,
        tell: &mut dyn FnMut(usize, f64, f64) -> bool,
    ) {
        let time = &self.motion.time;
        for i in from..to {
            let (position, velocity) = (plant.reading() - self.start, plant.velocity());
            if !tell(i, position, velocity) || i + 1 == to {
                return;
            }
            let around = self.around(i);
            let recorded = self.recording.command[i];
            let length = time[i + 1] - time[i];
            let steps = (length / STEP_S).ceil().clamp(1.0, 1e5) as usize;
            let dt = length / steps as f64;
            // A digital loop holds its command between rows.
            let command = recorded
                - feedback.map_or(0.0, |gains| {
                    gains.proportional * (position - self.motion.position[i])
                        + gains.derivative * (velocity - self.motion.velocity[i])
                });
            for _ in 0..steps {
                plant.step(command, around, dt);
            }
        }
    }

    fn around(&self, i: usize) -> Surroundings {
        let value = |column: &Option<Vec<f64>>| column.as_ref().map_or(0.0, |c| c[i]);
        Surroundings { tilt: value(&self.recording.tilt_rad), external: value(&self.recording.force) }
    }

    fn whole(&self, rig: &Rig, feedback: Option<PositionLoop>) -> Trajectory {
        let mut plant = Plant::new(rig);
        plant.place(self.start, self.motion.velocity[0]);
        let n = self.motion.time.len();
        let far = GONE * self.motion.travel().max(1e-12);
        let mut out = Trajectory { position: Vec::with_capacity(n), velocity: Vec::with_capacity(n) };
        self.run(&mut plant, 0, n, feedback, &mut |_, position, velocity| {
            out.position.push(position);
            out.velocity.push(velocity);
            position.abs() < far
        });
        // A simulation that is gone stays where it was seen last.
        let last = (out.position.last().copied().unwrap_or(0.0), out.velocity.last().copied().unwrap_or(0.0));
        out.position.resize(n, if last.0.is_finite() { last.0 } else { far });
        out.velocity.resize(n, if last.1.is_finite() { last.1 } else { 0.0 });
        out
    }

    /// From the first row to the last under the recorded command.
    pub fn free_run(&self, rig: &Rig) -> Trajectory {
        self.whole(rig, None)
    }

    /// The same under the recorded reference, with the loop that ran then.
    pub(crate) fn under_reference(&self, rig: &Rig, feedback: PositionLoop) -> Trajectory {
        self.whole(rig, Some(feedback))
    }

    /// Windows of `seconds`, each started from the measured state, one after the other or, in long
    /// recordings, spread over it.
    pub fn windows(&self, rig: &Rig, seconds: f64) -> Deviation {
        self.spread(rig, seconds, MOST_S)
    }

    /// Windows of `seconds`, of `most` s together.
    fn spread(&self, rig: &Rig, seconds: f64, most: f64) -> Deviation {
        let time = &self.motion.time;
        let whole = self.motion.seconds();
        let count = ((whole / seconds).floor() as usize).clamp(1, ((most / seconds) as usize).max(4));
        let mut sum = (0.0, 0.0);
        let mut rows = 0;
        let fresh = Plant::new(rig);
        for k in 0..count {
            let begin = (whole - seconds).max(0.0) * k as f64 / (count - 1).max(1) as f64;
            let from = time.partition_point(|t| *t < begin);
            let to = time.partition_point(|t| *t <= begin + seconds + 1e-9);
            if to < from + 2 {
                continue;
            }
            let mut plant = fresh.clone();
            self.lead(&mut plant, from);
            plant.place(self.start + self.motion.position[from], self.motion.velocity[from]);
            self.run(&mut plant, from, to, None, &mut |i, position, velocity| {
                let off = (position - self.motion.position[i], velocity - self.motion.velocity[i]);
                sum = (sum.0 + off.0 * off.0, sum.1 + off.1 * off.1);
                rows += 1;
                true
            });
        }
        Deviation::of(sum, rows)
    }

    /// Returns the position errors at every `every`th row, in windows of `seconds` one after the
    /// other, or in one run where that is longer than the recording.
    pub(super) fn off(&self, rig: &Rig, seconds: f64, every: usize) -> Vec<f64> {
        let time = &self.motion.time;
        let (mut from, mut out) = (0, Vec::new());
        while from + 1 < time.len() {
            let to = time.partition_point(|t| *t < time[from] + seconds).max(from + 2).min(time.len());
            let mut plant = Plant::new(rig);
            self.lead(&mut plant, from);
            plant.place(self.start + self.motion.position[from], self.motion.velocity[from]);
            self.run(&mut plant, from, to, None, &mut |i, position, _| {
                if i % every == 0 {
                    out.push(position - self.motion.position[i]);
                }
                true
            });
            from = to;
        }
        out
    }

    /// Position at every row in windows of `seconds` one after the other, each started from the
    /// measured state.
    pub(super) fn started_every(&self, rig: &Rig, seconds: f64) -> Vec<f64> {
        let off = self.off(rig, seconds, 1);
        // A last row alone is no window.
        self.motion.position.iter().enumerate().map(|(i, q)| q + off.get(i).unwrap_or(&0.0)).collect()
    }

    /// Inertia times the acceleration that a rig asks for along the recorded motion, N·m or N, as
    /// smooth as the speeds are.
    pub fn force(&self, rig: &Rig) -> Vec<f64> {
        let time = &self.motion.time;
        let mut plant = Plant::new(rig);
        let mut out = Vec::with_capacity(time.len());
        for i in 0..time.len().saturating_sub(1) {
            let (velocity, dt) = (self.motion.velocity[i], (time[i + 1] - time[i]).max(1e-9));
            plant.place(self.start + self.motion.position[i], velocity);
            plant.step(self.recording.command[i], self.around(i), dt);
            out.push(rig.model.inertia * (plant.velocity() - velocity) / dt);
        }
        out.push(out.last().copied().unwrap_or(0.0));
        self.motion.smoothed(&out)
    }

    /// Leads a plant along the measured motion up to a row.
    fn lead(&self, plant: &mut Plant, to: usize) {
        let time = &self.motion.time;
        let from = time.partition_point(|t| *t < time[to] - LEAD_S);
        plant.begin(time[from]);
        for i in from..to {
            plant.place(self.start + self.motion.position[i], self.motion.velocity[i]);
            plant.step(self.recording.command[i], self.around(i), time[i + 1] - time[i]);
        }
    }
}

/// The travel after which a rig's periodic effects come again; none where it has none.
fn period(rig: &Rig) -> Option<f64> {
    let longest = |effect: &crate::laws::Effect| {
        let slowest =
            effect.waves().iter().map(|wave| wave.1.abs()).filter(|w| *w > 0.0).fold(f64::INFINITY, f64::min);
        std::f64::consts::TAU / slowest
    };
    let of_waves = rig
        .effects
        .iter()
        .filter(|e| e.name.definition().has_own_phase())
        .map(longest)
        .filter(|p| p.is_finite())
        .fold(0.0, f64::max);
    if of_waves == 0.0 {
        return None;
    }
    Some(rig.turn().filter(|turn| *turn > of_waves).unwrap_or(of_waves))
}
