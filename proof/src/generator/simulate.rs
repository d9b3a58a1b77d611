//! The integrator: position Verlet (second order, symplectic) with impulse-level dry friction (Moreau's time stepping), at
//! steps of 10 µs or less. A step that would reverse the motion under friction ends at rest, so stick and slip are events
//! and no speed threshold decides them. Commands change only at row stamps: the zero-order hold of the contract.

use super::drive::{Loop, Segment};
use super::plant::{Foreign, Plant, Presliding, Train, harmonic_sum, sign};
use crate::rng::Rng;

/// The longest step of a recording, in s: 100 kHz.
pub(crate) const STEP: f64 = 10e-6;

/// A slow or noisy signal on an even grid, held between its points.
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    pub(crate) interval: f64,
    pub(crate) values: Vec<f64>,
}

impl Series {
    /// The value at time `t`; zero where the series is empty, its last value beyond the end.
    pub(crate) fn at(&self, t: f64) -> f64 {
        if self.values.is_empty() {
            return 0.0;
        }
        let x = (t / self.interval).max(0.0);
        let i = (x as usize).min(self.values.len() - 1);
        let next = self.values[(i + 1).min(self.values.len() - 1)];
        self.values[i] + (next - self.values[i]) * (x - i as f64).clamp(0.0, 1.0)
    }
}

/// The true values of the terms that the rig's author knows; zero for a term that is not in the nominal model.
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
    /// Reading − travel, quantisation included, without the zero; of it, the part that the hidden physics makes.
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

struct State {
    q: f64,
    v: f64,
    load_q: f64,
    load_v: f64,
    current: f64,
    bristle: f64,
    elements: Vec<f64>,
    creep: f64,
    phase: f64,
    lost: f64,
    /// Speed of a flywheel behind a one-way clutch.
    flywheel: f64,
    /// Latches that have snapped over, one bit each.
    latched: u32,
}

/// Plays the run. Steps are at most `max_step` ([`STEP`] for recordings; coarser only while a strength is being sought).
pub(crate) fn simulate(
    plant: &Plant,
    believed: &Believed,
    run: &Run,
    max_step: f64,
) -> Result<Vec<Row>, Diverged> {
    let mut random = run.random.clone();
    let mut segment = 0_usize;
    let mut control: Option<Loop> = run.segments.first().and_then(|s| s.control.clone());
    let mut away = 0.0;
    let elements = match &plant.dry.presliding {
        Some(Presliding::MaxwellSlip { elements }) => elements.len(),
        _ => 0,
    };
    let mut s = State {
        q: run.start,
        v: 0.0,
        load_q: run.start,
        load_v: 0.0,
        current: 0.0,
        bristle: 0.0,
        elements: vec![0.0; elements],
        creep: run.start,
        phase: random.range(0.0, std::f64::consts::TAU),
        lost: 0.0,
        flywheel: 0.0,
        latched: 0,
    };
    let hum_phase = s.phase;
    let duration = run.times.last().copied().unwrap_or(0.0);
    let start_angle_error = eccentric(plant, s.q);
    let mut rows: Vec<Row> = Vec::with_capacity(run.times.len());
    let mut delayed = 0_usize;
    for (k, &time) in run.times.iter().enumerate() {
        let interval = run.times.get(k + 1).map(|next| next - time);
        // The encoder: eccentricity, then whole counts, then what was lost.
        let error = eccentric(plant, s.q) - start_angle_error;
        if let (Some(lost), Some(interval)) = (plant.lost, interval)
            && s.v.abs() > lost.above_speed
            && random.chance(1.0 - (-lost.rate * interval).exp())
        {
            // A burst never exceeds what passed since the row before would allow by much; against the motion.
            let side = if lost.both_ways { random.sign() } else { 1.0 };
            s.lost += side * sign(s.v) * (lost.burst * random.range(0.6, 1.4)).round();
        }
        let noise = if run.noise_counts > 0.0 { run.noise_counts * random.normal() } else { 0.0 };
        let counts = (plant.counts_per_unit * (s.q + error) + run.zero_counts + noise).floor() - s.lost;
        let reading = (counts - run.zero_counts) / plant.counts_per_unit;
        while run.segments.get(segment + 1).is_some_and(|next| next.from <= time) {
            segment += 1;
            control = run.segments[segment].control.clone();
            away = reading - run.start;
        }
        let playing = &run.segments[segment];
        let own = time - playing.from;
        let (mut command, reference) = match &mut control {
            // Nothing is followed: the reference is where the machine is.
            None => (playing.drive.command(own), counts),
            Some(l) => {
                let (target, target_speed, target_acceleration) =
                    playing.reference(own, away, run.return_speed);
                let wanted =
                    l.command(reading - run.start, target, target_speed, target_acceleration, interval);
                let reference = ((run.start + target) * plant.counts_per_unit + run.zero_counts).round();
                (wanted + playing.drive.injected(own), reference)
            }
        };
        command = (command.clamp(-run.limit, run.limit) / run.command_step).round() * run.command_step;
        rows.push(Row {
            time,
            stamp: time,
            command,
            counts,
            reference_counts: reference,
            tilt: run.tilt.at(time),
            force: run.force.at(time),
            q: s.q,
            v: s.v,
            reading_error: reading - s.q,
            sensor_effect: error - s.lost / plant.counts_per_unit,
            missing: 0.0,
            disturbance: 0.0,
            moving: true,
        });
        let Some(interval) = interval else { break };
        let steps = (interval / max_step).ceil().max(1.0);
        let h = interval / steps;
        let (mut believed_impulse, mut disturbance_sum, mut at_rest) = (0.0, 0.0, false);
        let before = s.v;
        for i in 0..steps as usize {
            let t = time + (i as f64 + 0.5) * h;
            while delayed + 1 < rows.len() && rows[delayed + 1].time <= t - plant.delay {
                delayed += 1;
            }
            let arrived = if t < plant.delay { 0.0 } else { rows[delayed].command };
            let disturbance = run.disturbance.at(t);
            let (tilt, external) = (run.tilt.at(t), run.force.at(t));
            let share = advance(plant, run, &mut s, t, h, arrived, disturbance, duration, hum_phase);
            // At rest dry friction is whatever holds: nothing is missing there.
            believed_impulse += if share.at_rest {
                believed.inertia * share.speed_change
            } else {
                h * (believed.gain * command
                    - believed.viscous * share.mean_speed
                    - believed.coulomb * sign(share.mean_speed)
                    + believed.offset
                    + run.offset
                    + believed.weight * tilt.sin()
                    + external
                    + disturbance)
            };
            disturbance_sum += disturbance;
            at_rest |= share.at_rest;
        }
        if !s.v.is_finite() || s.v.abs() > run.speed_bound {
            return Err(Diverged);
        }
        let row = rows.last_mut().expect("a row was pushed above");
        row.missing = (believed.inertia * (s.v - before) - believed_impulse) / interval;
        row.disturbance = disturbance_sum / steps;
        row.moving = !at_rest;
    }
    if rows.len() > 1 {
        let n = rows.len();
        let previous = rows[n - 2];
        rows[n - 1].missing = previous.missing;
        rows[n - 1].disturbance = previous.disturbance;
        rows[n - 1].moving = previous.moving;
    }
    Ok(rows)
}

fn eccentric(plant: &Plant, q: f64) -> f64 {
    plant.eccentricity.map_or(0.0, |(amplitude, phase)| amplitude * (plant.angle(q) + phase).sin())
}

struct Share {
    mean_speed: f64,
    speed_change: f64,
    at_rest: bool,
}

/// One step of length `h` whose middle is at `t`.
#[allow(clippy::too_many_arguments)] // One call, all of it the state of one instant.
fn advance(
    plant: &Plant,
    run: &Run,
    s: &mut State,
    t: f64,
    h: f64,
    arrived: f64,
    disturbance: f64,
    duration: f64,
    hum_phase: f64,
) -> Share {
    let v_start = s.v;
    s.q += 0.5 * h * s.v;
    s.load_q += 0.5 * h * s.load_v;

    let shaped = plant.shaped_command(arrived);
    if plant.lag > 0.0 {
        s.current += (shaped - s.current) * (1.0 - (-h / plant.lag).exp());
    } else {
        s.current = shaped;
    }
    let drive = plant.force_constant(s.q, t + run.warm) * s.current;
    let external = run.force.at(t);
    let motor = drive + harmonic_sum(&plant.cogging, plant.angle(s.q));
    let (share, friction_share) = match plant.train {
        Train::Rigid => (0.0, 0.0),
        Train::Spring { load_share, friction_share, .. }
        | Train::Gap { load_share, friction_share, .. }
        | Train::Slip { load_share, friction_share, .. } => (load_share, friction_share),
    };
    let rigid = matches!(plant.train, Train::Rigid);
    let (lq, lv) = if rigid { (s.q, s.v) } else { (s.load_q, s.load_v) };
    let mut load = plant.offset + run.offset + plant.weight * run.tilt.at(t).sin() + external + disturbance;
    let mut inertia = plant.inertia;
    if let Some((amplitude, phase)) = plant.imbalance {
        load += amplitude * (plant.angle(lq) + phase + run.tilt.at(t)).sin();
    }
    if let Some((stiffness, rest, cubic)) = plant.spring {
        let x = lq - rest;
        load -= stiffness * x * (1.0 + cubic * x * x);
    }
    if let Some((span, shape)) = plant.damping_profile {
        load -= span * shape.at(lq) * lv;
    }
    load -= plant.drag * lv * lv.abs();
    for foreign in &plant.foreign {
        load += foreign_force(foreign, s, lq, lv, t, h, duration, hum_phase, &mut inertia);
    }

    if rigid {
        let level = |v: f64| plant.dry_level(v, s.q, t + run.warm, external, drive);
        let smooth = motor + load - plant.viscous * (1.0 + plant.viscous_asymmetry * sign(s.v)) * s.v;
        let at_rest;
        if let Some(presliding) = &plant.dry.presliding {
            let friction = presliding_force(presliding, level(s.v), s.v, h, &mut s.bristle, &mut s.elements);
            s.v += h / inertia * (smooth - friction);
            at_rest = false;
        } else {
            (s.v, at_rest) = under_friction(inertia * s.v + h * smooth, inertia, h, s.v, level);
        }
        s.q += 0.5 * h * s.v;
        s.load_q = s.q;
        s.load_v = s.v;
        return Share { mean_speed: 0.5 * (v_start + s.v), speed_change: s.v - v_start, at_rest };
    }

    let coupling = coupling_force(plant.train, s.q - s.load_q, s.v - s.load_v);
    let (jm, jl) = (inertia * (1.0 - share), inertia * share);
    let viscous = |v: f64, part: f64| plant.viscous * part * (1.0 + plant.viscous_asymmetry * sign(v)) * v;
    let motor_smooth = motor - coupling - viscous(s.v, 1.0 - friction_share);
    let load_smooth = load + coupling - viscous(s.load_v, friction_share);
    let level = |v: f64, q: f64, part: f64| part * plant.dry_level(v, q, t + run.warm, external, drive);
    let (q, load_q) = (s.q, s.load_q);
    let (v, at_rest) =
        under_friction(jm * s.v + h * motor_smooth, jm, h, s.v, |v| level(v, q, 1.0 - friction_share));
    let (load_v, _) = under_friction(jl * s.load_v + h * load_smooth, jl, h, s.load_v, |v| {
        level(v, load_q, friction_share)
    });
    s.v = v;
    s.load_v = load_v;
    s.q += 0.5 * h * s.v;
    s.load_q += 0.5 * h * s.load_v;
    Share { mean_speed: 0.5 * (v_start + s.v), speed_change: s.v - v_start, at_rest }
}

/// Dry friction as an impulse: it brings the momentum towards zero by at most `h · level` and never past it.
fn under_friction(
    momentum: f64,
    inertia: f64,
    h: f64,
    speed: f64,
    level: impl Fn(f64) -> f64,
) -> (f64, bool) {
    // At rest the direction is the one in which the rest would be left.
    let state = if speed == 0.0 { sign(momentum) * 1e-15 } else { speed };
    let most = h * level(state);
    if momentum.abs() <= most {
        return (0.0, true);
    }
    ((momentum - most * sign(momentum)) / inertia, false)
}

fn presliding_force(
    law: &Presliding,
    level: f64,
    v: f64,
    h: f64,
    bristle: &mut f64,
    elements: &mut [f64],
) -> f64 {
    match law {
        Presliding::LuGre { stiffness, damping } => {
            // Implicit in z: stable at any speed.
            let z = (*bristle + h * v) / (1.0 + h * stiffness * v.abs() / level.max(1e-12));
            let rate = (z - *bristle) / h;
            *bristle = z;
            stiffness * z + damping * rate
        }
        Presliding::MaxwellSlip { elements: shares } => {
            let mut force = 0.0;
            for (state, &(share, stiffness)) in elements.iter_mut().zip(shares) {
                let most = share * level;
                *state = (*state + stiffness * v * h).clamp(-most, most);
                force += *state;
            }
            force
        }
    }
}

fn coupling_force(train: Train, twist: f64, rate: f64) -> f64 {
    match train {
        Train::Rigid => 0.0,
        Train::Spring { stiffness, damping, .. } => stiffness * twist + damping * rate,
        Train::Gap { gap, stiffness, damping, .. } => {
            let depth = twist.abs() - 0.5 * gap;
            if depth <= 0.0 {
                return 0.0;
            }
            // A contact pushes and never pulls.
            let side = sign(twist);
            side * (stiffness * depth + damping * rate * side).max(0.0)
        }
        Train::Slip { ceiling, creep, .. } => ceiling * (rate / creep).tanh(),
    }
}

#[allow(clippy::too_many_arguments)] // As `advance`.
fn foreign_force(
    foreign: &Foreign,
    s: &mut State,
    q: f64,
    v: f64,
    t: f64,
    h: f64,
    duration: f64,
    hum_phase: f64,
    inertia: &mut f64,
) -> f64 {
    match foreign {
        Foreign::CreepSpring { stiffness, relaxation } => {
            s.creep += (q - s.creep) * (h / relaxation);
            -stiffness * (q - s.creep)
        }
        Foreign::WhirlingForce { amplitude, base_hz, per_speed_hz, power } => {
            s.phase += std::f64::consts::TAU * h * (base_hz + per_speed_hz * v.abs().powf(*power));
            amplitude * s.phase.sin()
        }
        Foreign::Hum { amplitude, hertz } => {
            amplitude * (std::f64::consts::TAU * hertz * t + hum_phase).sin()
        }
        Foreign::Wells { wells } => wells
            .iter()
            .map(|&(depth, centre, width)| {
                let x = (q - centre) / width;
                -depth / width * x * (-0.5 * x * x).exp()
            })
            .sum(),
        Foreign::PayloadChange { share, at } => {
            if t > at * duration {
                *inertia *= 1.0 + share;
            }
            0.0
        }
        Foreign::Flywheel { share } => {
            // A one-way clutch: the flywheel is pushed along and never holds back.
            if v >= s.flywheel - 1e-12 {
                *inertia *= 1.0 + share;
                s.flywheel = v;
            } else {
                s.flywheel *= 1.0 - h / 0.5;
            }
            0.0
        }
        Foreign::Latch { force, places, side } => {
            for (i, &(up, down)) in places.iter().enumerate() {
                if q > up {
                    s.latched |= 1 << i;
                } else if q < down {
                    s.latched &= !(1 << i);
                }
            }
            if s.latched.count_ones() % 2 == 1 { *force * side } else { -force * side }
        }
        Foreign::Shuttle { amplitude, centre, scale } => {
            let x = (q - centre) * v / scale;
            amplitude * 2.0 * x / (1.0 + x * x)
        }
        Foreign::Linkage { share, centre, width } => {
            let x = (q - centre) / width;
            let bump = (-0.5 * x * x).exp();
            let slope = -x / width * bump * share * *inertia;
            *inertia *= 1.0 + share * bump;
            -0.5 * slope * v * v
        }
    }
}
