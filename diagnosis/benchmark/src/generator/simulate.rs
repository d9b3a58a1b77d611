//! A run of a plant and its recording: the encoder is read, the command sent and a row written at
//! every stamp, and the plant moves on between them. Commands change only at row stamps: the
//! zero-order hold of the contract.

use super::drive::{Loop, Segment};
use super::plant::{Plant, sign};
use super::series::Series;
use super::step::{Instant, State, advance};
use crate::rng::Rng;

/// The longest step of a recording, in s: 100 kHz.
pub(crate) const STEP: f64 = 10e-6;

/// The true values of the terms that the rig's author knows; zero for a term that is not in the
/// nominal model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Believed {
    pub(crate) inertia: f64,
    pub(crate) viscous: f64,
    pub(crate) coulomb: f64,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
    pub(crate) weight: f64,
}

/// One run: what happens around the plant.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) times: Vec<f64>,
    /// One after another; the first begins at the start.
    pub(crate) segments: Vec<Segment>,
    /// Speed at which a loop comes back to the place where it has to begin, u/s.
    pub(crate) return_speed: f64,
    /// Largest |command| that is sent.
    pub(crate) limit: f64,
    /// Resolution of the command.
    pub(crate) command_step: f64,
    pub(crate) tilt: Series,
    /// External load on q, positive in the insertion direction.
    pub(crate) force: Series,
    /// Noise and wander of the force, already scaled.
    pub(crate) disturbance: Series,
    /// Offset of this recording beyond the plant's.
    pub(crate) offset: f64,
    /// Mechanical place at the start.
    pub(crate) start: f64,
    /// The encoder's count at mechanical zero.
    pub(crate) zero_counts: f64,
    /// Standard deviation of a reading beyond its rounding, counts.
    pub(crate) noise_counts: f64,
    /// The time for which the machine has been running already, for effects that warm up, s.
    pub(crate) warm: f64,
    /// |speed| beyond which the run counts as diverged.
    pub(crate) speed_bound: f64,
    pub(crate) random: Rng,
}

/// One row as recorded, and what only the generator knows.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Row {
    pub(crate) time: f64,
    /// Time as the recorder wrote it down.
    pub(crate) stamp: f64,
    pub(crate) command: f64,
    pub(crate) counts: f64,
    pub(crate) reference_counts: f64,
    pub(crate) tilt: f64,
    pub(crate) force: f64,
    /// True travel, speed.
    pub(crate) q: f64,
    pub(crate) v: f64,
    /// Reading − travel, quantisation included, without the zero; of it, the part that the hidden
    /// physics makes.
    pub(crate) reading_error: f64,
    pub(crate) sensor_effect: f64,
    /// Mean over the interval that follows: force missing from the believed terms, and disturbance.
    pub(crate) missing: f64,
    pub(crate) disturbance: f64,
    /// No instant of the interval at rest.
    pub(crate) moving: bool,
}

/// The reason why a run gave no recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Diverged;

/// Plays the run. Steps are at most `max_step` ([`STEP`] for recordings; coarser only while a
/// strength is being sought).
pub(crate) fn simulate(
    plant: &Plant,
    believed: &Believed,
    run: &Run,
    max_step: f64,
) -> Result<Vec<Row>, Diverged> {
    let mut recorder = Recorder::new(plant, believed, run);
    for (k, &time) in run.times.iter().enumerate() {
        let interval = run.times.get(k + 1).map(|next| next - time);
        recorder.record(time, interval);
        let Some(interval) = interval else { break };
        recorder.advance(time, interval, max_step)?;
    }
    let mut rows = recorder.rows;
    if let [.., previous, last] = rows.as_mut_slice() {
        last.missing = previous.missing;
        last.disturbance = previous.disturbance;
        last.moving = previous.moving;
    }
    Ok(rows)
}

/// A run as it is being recorded.
struct Recorder<'a> {
    plant: &'a Plant,
    believed: &'a Believed,
    run: &'a Run,
    random: Rng,
    state: State,
    encoder: Encoder,
    player: Player,
    /// The row whose command reaches the plant now.
    delayed: usize,
    rows: Vec<Row>,
}

impl<'a> Recorder<'a> {
    fn new(plant: &'a Plant, believed: &'a Believed, run: &'a Run) -> Self {
        let mut random = run.random.clone();
        let phase = random.range(0.0, std::f64::consts::TAU);
        let state = State::new(plant, run.start, phase);
        Self {
            plant,
            believed,
            run,
            random,
            encoder: Encoder { start_error: eccentric(plant, state.q), lost: 0.0 },
            state,
            player: Player::new(run),
            delayed: 0,
            rows: Vec::with_capacity(run.times.len()),
        }
    }

    /// Reads the encoder, sends the command and writes the row. `interval` is the time to the next
    /// row, in s.
    fn record(&mut self, time: f64, interval: Option<f64>) {
        let (run, s) = (self.run, &self.state);
        let Reading { counts, place, error } =
            self.encoder.read(self.plant, run, s.q, s.v, interval, &mut self.random);
        let (command, reference_counts) = self.player.command(self.plant, run, time, counts, place, interval);
        self.rows.push(Row {
            time,
            stamp: time,
            command,
            counts,
            reference_counts,
            tilt: run.tilt.at(time),
            force: run.force.at(time),
            q: s.q,
            v: s.v,
            reading_error: place - s.q,
            sensor_effect: error - self.encoder.lost / self.plant.counts_per_unit,
            missing: 0.0,
            disturbance: 0.0,
            moving: true,
        });
    }

    /// Moves the plant on from the row at `time` to the next one, and writes into the row what
    /// acted meanwhile.
    fn advance(&mut self, time: f64, interval: f64, max_step: f64) -> Result<(), Diverged> {
        let (believed, run) = (self.believed, self.run);
        let row = self.rows.len() - 1;
        let command = self.rows[row].command;
        let steps = (interval / max_step).ceil().max(1.0);
        let h = interval / steps;
        let (mut believed_impulse, mut disturbance_sum, mut at_rest) = (0.0, 0.0, false);
        let before = self.state.v;
        for i in 0..steps as usize {
            let at = self.instant(time + (i as f64 + 0.5) * h, h);
            let step = advance(self.plant, &mut self.state, &at);
            // At rest dry friction is whatever holds: nothing is missing there.
            believed_impulse += if step.at_rest {
                believed.inertia * step.speed_change
            } else {
                h * (believed.gain * command
                    - believed.viscous * step.mean_speed
                    - believed.coulomb * sign(step.mean_speed)
                    + believed.offset
                    + run.offset
                    + believed.weight * at.tilt.sin()
                    + at.external
                    + at.disturbance)
            };
            disturbance_sum += at.disturbance;
            at_rest |= step.at_rest;
        }
        let v = self.state.v;
        if !v.is_finite() || v.abs() > run.speed_bound {
            return Err(Diverged);
        }
        let row = &mut self.rows[row];
        row.missing = (believed.inertia * (v - before) - believed_impulse) / interval;
        row.disturbance = disturbance_sum / steps;
        row.moving = !at_rest;
        Ok(())
    }

    /// Returns what acts on the plant in the step of length `h` whose middle is at `t`, both in s.
    fn instant(&mut self, t: f64, h: f64) -> Instant {
        while self.rows.get(self.delayed + 1).is_some_and(|next| next.time <= t - self.plant.delay) {
            self.delayed += 1;
        }
        let run = self.run;
        Instant {
            t,
            h,
            warm: t + run.warm,
            end: run.times.last().copied().unwrap_or(0.0),
            command: if t < self.plant.delay { 0.0 } else { self.rows[self.delayed].command },
            tilt: run.tilt.at(t),
            external: run.force.at(t),
            offset: run.offset,
            disturbance: run.disturbance.at(t),
        }
    }
}

/// The encoder: eccentricity, then whole counts, then what was lost.
struct Encoder {
    /// Error of the angle at the start, in u; readings are relative to it.
    start_error: f64,
    /// Counts lost so far.
    lost: f64,
}

/// A reading of the encoder.
struct Reading {
    counts: f64,
    /// The place that the counts mean, in u.
    place: f64,
    /// Error by eccentricity, in u.
    error: f64,
}

impl Encoder {
    /// Reads the encoder at `q` with speed `v`. `interval` is the time to the next row, in s.
    fn read(
        &mut self,
        plant: &Plant,
        run: &Run,
        q: f64,
        v: f64,
        interval: Option<f64>,
        random: &mut Rng,
    ) -> Reading {
        let error = eccentric(plant, q) - self.start_error;
        if let (Some(lost), Some(interval)) = (plant.lost, interval)
            && v.abs() > lost.above_speed
            && random.chance(1.0 - (-lost.rate * interval).exp())
        {
            // A burst never exceeds what passed since the row before would allow by much; against
            // the motion.
            let side = if lost.both_ways { random.sign() } else { 1.0 };
            self.lost += side * sign(v) * (lost.burst * random.range(0.6, 1.4)).round();
        }
        let noise = if run.noise_counts > 0.0 { run.noise_counts * random.normal() } else { 0.0 };
        let counts = (plant.counts_per_unit * (q + error) + run.zero_counts + noise).floor() - self.lost;
        Reading { counts, place: (counts - run.zero_counts) / plant.counts_per_unit, error }
    }
}

fn eccentric(plant: &Plant, q: f64) -> f64 {
    plant.eccentricity.map_or(0.0, |(amplitude, phase)| amplitude * (plant.angle(q) + phase).sin())
}

/// Plays the segments of a run one after another.
struct Player {
    segment: usize,
    control: Option<Loop>,
    /// Distance from the run's start at the start of the segment, in u.
    away: f64,
}

impl Player {
    fn new(run: &Run) -> Self {
        let control = run.segments.first().and_then(|s| s.control.clone());
        Self { segment: 0, control, away: 0.0 }
    }

    /// Returns the command at a row, limited and rounded as the drive does it, and the reference in
    /// counts.
    fn command(
        &mut self,
        plant: &Plant,
        run: &Run,
        time: f64,
        counts: f64,
        place: f64,
        interval: Option<f64>,
    ) -> (f64, f64) {
        while run.segments.get(self.segment + 1).is_some_and(|next| next.from <= time) {
            self.segment += 1;
            self.control = run.segments[self.segment].control.clone();
            self.away = place - run.start;
        }
        let playing = &run.segments[self.segment];
        let own = time - playing.from;
        let (command, reference) = match &mut self.control {
            // Nothing is followed: the reference is where the machine is.
            None => (playing.drive.command(own), counts),
            Some(control) => {
                let (target, speed, acceleration) = playing.reference(own, self.away, run.return_speed);
                let wanted = control.command(place - run.start, target, speed, acceleration, interval);
                let reference = ((run.start + target) * plant.counts_per_unit + run.zero_counts).round();
                (wanted + playing.drive.injected(own), reference)
            }
        };
        let limited = command.clamp(-run.limit, run.limit);
        ((limited / run.command_step).round() * run.command_step, reference)
    }
}
