//! The wiring and the mechanism of a device, found from recordings of its first movements. Pure
//! calculation.

use control_core::controller::Sample;
use control_core::units::{Grams, Newtons};
use control_core::{Device, TICK_HZ, config};
use fixed::types::I16F16;
use std::f64::consts::TAU;
use std::fmt;

/// Fewer edges than this are no movement.
const LEAST_EDGES: u32 = 20;
/// A hand that turns by a mark is within this share of a turn.
const HAND_ACCURACY: f64 = 0.01;
/// Lines a turn of encoders that are sold; a count is a quarter of one.
const USUAL_LINES: [u16; 26] = [
    64, 100, 128, 200, 250, 256, 300, 360, 400, 500, 512, 600, 720, 800, 900, 1_000, 1_024, 1_200, 1_250,
    1_500, 2_000, 2_048, 2_500, 3_600, 4_096, 5_000,
];
/// Ticks over which a speed is taken, and over which its change is set against the torque: 4 ms and
/// 10 ms.
const SPEED_TICKS: usize = 40;
const WINDOW_TICKS: usize = 100;
/// Slower than this a motor may be about to stick, in rad/s.
const MOVING: f64 = 1.0;
/// Windows that a fit of four numbers needs.
const LEAST_WINDOWS: usize = 20;
/// Faster than a hand, in mm/s.
const LARGEST_SPEED: f64 = 400.0;
/// Turned by less than this, the tilt sensor does not follow; in mrad.
const LEAST_TILT: f64 = 200.0;

/// The reasons why a device cannot be commissioned as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CommissioningError {
    /// No edge at all.
    EncoderSilent,
    /// Up and down again, never on.
    DeadChannel,
    /// No encoder that is sold counts so.
    UnusualCounts(f64),
    /// No edge, or up and down, while the pull went on.
    PullNotSeen,
    /// The pull's length and its counts make a roller that cannot be.
    Radius(f64),
    /// The tilt falls when the needle points down.
    TiltBackwards,
    /// The tilt does not follow.
    TiltSilent,
    /// The motor does not move.
    NotDriven,
    /// The motor moves on without being asked to.
    RunsOn,
    /// The movement does not fit an inertia with friction.
    NoFit,
    /// The converter's zero is too far off.
    Zero(f64),
}

impl fmt::Display for CommissioningError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            CommissioningError::EncoderSilent => f.write_str(
                "the encoder counted nothing while the roller was turned: check its supply, its plug and both wires",
            ),
            CommissioningError::DeadChannel => f.write_str(
                "one of the encoder's channels is dead: the other one's counts go to and fro; check the wires of A and B",
            ),
            CommissioningError::UnusualCounts(found) => write!(
                f,
                "{found:.0} counts a turn is what no usual encoder has: turn it again by the mark, or give --counts-per-turn"
            ),
            CommissioningError::PullNotSeen => {
                f.write_str("the roller did not turn during the pull: see that what is drawn does not slip, and commission again")
            }
            CommissioningError::Radius(mm) => write!(
                f,
                "the pull makes a roller of {mm:.1} mm radius, and it must be from 4 to 25: measure again and give --pull-mm"
            ),
            CommissioningError::TiltBackwards => f.write_str(
                "the tilt falls when the needle points down: the tilt sensor is mounted the wrong way round; turn the board by 180°",
            ),
            CommissioningError::TiltSilent => {
                f.write_str("the tilt did not follow when the needle was pointed down: check how the tilt sensor is mounted")
            }
            CommissioningError::NotDriven => f.write_str(
                "the motor did not move under 2 mN·m: check its leads and the amplifier's supply and enable, and that nothing brakes the roller",
            ),
            CommissioningError::RunsOn => f.write_str(
                "the roller ran on by itself: the amplifier's offset is larger than the friction; trim it to zero and commission again",
            ),
            CommissioningError::NoFit => f.write_str(
                "the roller did not move as an inertia with friction does: see that nothing touches it, and commission again",
            ),
            CommissioningError::Zero(codes) => write!(
                f,
                "the amplifier gives no torque at {codes:.0} codes from the middle: trim its offset to less than 100 and commission again"
            ),
        }
    }
}

/// Counts from the first sample to the last, and edges on the way.
fn travelled(samples: &[Sample]) -> (i32, u32) {
    let edges = samples.windows(2).map(|pair| pair[1].count.wrapping_sub(pair[0].count).unsigned_abs()).sum();
    let counts = match samples {
        [first, .., last] => last.count.wrapping_sub(first.count),
        _ => 0,
    };
    (counts, edges)
}

/// True if the roller has been moved and then rested for `rest_ticks`.
pub(crate) fn has_moved_and_rests(samples: &[Sample], rest_ticks: usize) -> bool {
    let Some((begin, tail)) = samples.len().checked_sub(rest_ticks).map(|at| samples.split_at(at)) else {
        return false;
    };
    travelled(begin).1 >= LEAST_EDGES && travelled(tail).1 == 0
}

/// Signed counts of a movement that a hand made, where both channels are alive.
fn moved(samples: &[Sample]) -> Result<i32, CommissioningError> {
    let (counts, edges) = travelled(samples);
    match (counts.unsigned_abs(), edges) {
        (_, edges) if edges < LEAST_EDGES => Err(CommissioningError::EncoderSilent),
        (counts, edges) if counts < edges / 4 => Err(CommissioningError::DeadChannel),
        _ => Ok(counts),
    }
}

/// Counts a turn and their sign from `turns` turns of the roller in the direction of insertion;
/// `known` where a person knows better.
pub(crate) fn counts_a_turn(
    samples: &[Sample],
    turns: u32,
    known: Option<u16>,
) -> Result<(u16, bool), CommissioningError> {
    let counts = moved(samples)?;
    let found = f64::from(counts.unsigned_abs()) / f64::from(turns.max(1));
    let off = |counts: u16| (found / f64::from(counts) - 1.0).abs();
    let usual = USUAL_LINES.iter().map(|lines| lines * 4).min_by(|a, b| off(*a).total_cmp(&off(*b)));
    let best = known.or(usual.filter(|&counts| off(counts) <= HAND_ACCURACY));
    best.map(|counts_per_turn| (counts_per_turn, counts < 0)).ok_or(CommissioningError::UnusualCounts(found))
}

/// The roller's radius in mm from a pull of `mm`.
pub fn roller_radius(samples: &[Sample], mm: f64, counts_per_turn: u16) -> Result<f64, CommissioningError> {
    let counts = moved(samples).map_err(|_| CommissioningError::PullNotSeen)?;
    let radius = mm * f64::from(counts_per_turn) / (TAU * f64::from(counts.abs()));
    if (4.0..=25.0).contains(&radius) { Ok(radius) } else { Err(CommissioningError::Radius(radius)) }
}

/// Mean tilt of the last `ticks`, mrad.
pub(crate) fn mean_tilt(samples: &[Sample], ticks: usize) -> f64 {
    let tail = &samples[samples.len().saturating_sub(ticks)..];
    tail.iter().map(|sample| f64::from(sample.tilt_mrad)).sum::<f64>() / tail.len().max(1) as f64
}

/// Checks that the tilt follows a needle that is pointed down, from `flat` to `down` in mrad.
pub(crate) fn check_tilt(flat: f64, down: f64) -> Result<(), CommissioningError> {
    match down - flat {
        turned if turned <= -LEAST_TILT => Err(CommissioningError::TiltBackwards),
        turned if turned < LEAST_TILT => Err(CommissioningError::TiltSilent),
        _ => Ok(()),
    }
}

/// The moving mechanism, as seen from the motor's shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanism {
    /// kg·m². Negative: the motor turns against its torque.
    pub inertia: f64,
    /// N·m·s.
    pub viscous: f64,
    /// N·m.
    pub dry: f64,
    /// N·m that the motor gives beyond what is asked for.
    pub offset: f64,
}

/// `J·dω = ∫(τ + offset − dry·sign(ω) − viscous·ω)·dt` over every 10 ms in which the roller moved
/// one way, by least squares.
pub fn mechanism(samples: &[Sample], device: &Device) -> Result<Mechanism, CommissioningError> {
    let (middle, span) = (f64::from(device.dac.mid_scale()), f64::from(device.dac.span()));
    let full_scale = device.full_scale_torque.0.to_num::<f64>() * 1e-3;
    let rad = TAU / f64::from(device.counts_per_turn);
    let dt = 1.0 / f64::from(TICK_HZ);
    let torque = |at: usize| (f64::from(samples[at].dac) - middle) / span * full_scale;
    let angle = |at: usize| f64::from(samples[at].count.wrapping_sub(samples[0].count)) * rad;
    let half = SPEED_TICKS / 2;
    let speed = |at: usize| (angle(at + half) - angle(at - half)) / (SPEED_TICKS as f64 * dt);
    if travelled(samples).1 < LEAST_EDGES {
        return Err(CommissioningError::NotDriven);
    }
    let (mut rows, mut at) = (Vec::new(), half);
    while at + WINDOW_TICKS + half < samples.len() {
        let (from, to) = (at, at + WINDOW_TICKS);
        let (first, last) = (speed(from), speed(to));
        let moves_one_way = (from..=to).step_by(half).all(|at| speed(at) * first > MOVING * first.abs());
        if moves_one_way {
            let time = WINDOW_TICKS as f64 * dt;
            let impulse: f64 = (from..to).map(torque).sum::<f64>() * dt;
            rows.push(([last - first, angle(to) - angle(from), first.signum() * time, -time], impulse));
        }
        at += half;
    }
    let [inertia, viscous, dry, offset] =
        least_squares(&rows).filter(|_| rows.len() >= LEAST_WINDOWS).ok_or(CommissioningError::NoFit)?;
    Ok(Mechanism { inertia, viscous, dry, offset })
}

/// The same as felt along the needle over a roller of this radius, with a drive that is late by
/// `delay_us`.
pub(crate) fn along_the_needle(found: &Mechanism, radius_mm: f64, delay_us: u16) -> config::Mechanism {
    let radius = radius_mm * 1e-3;
    config::Mechanism {
        mass: Grams(I16F16::saturating_from_num((found.inertia / radius / radius * 1e3).clamp(1.0, 1_000.0))),
        dry_friction: Newtons(I16F16::saturating_from_num((found.dry / radius).clamp(0.0, 10.0))),
        delay_us,
    }
}

/// The largest movement in a tick, in counts, that makes the device too fast at 0.4 m/s: its
/// ceiling of speed. The device trips at a sixth of it.
pub(crate) fn counts_per_tick(radius_mm: f64, counts_per_turn: u16) -> u16 {
    let per_count = TAU * radius_mm / f64::from(counts_per_turn);
    // Two is the least that the device takes.
    ((6.0 * LARGEST_SPEED / f64::from(TICK_HZ) / per_count).ceil() as u16).max(2)
}

/// The code of zero torque for a device that has `offset` N·m too much, where a code is `code` N·m.
pub(crate) fn converter_zero(device: &Device, offset: f64) -> Result<i16, CommissioningError> {
    let code = device.full_scale_torque.0.to_num::<f64>() * 1e-3 / f64::from(device.dac.span());
    let sign = if device.motor_reversed { -1.0 } else { 1.0 };
    let zero = f64::from(device.dac_zero) - sign * offset / code;
    let most = f64::from(device.dac.span() / 16);
    if zero.abs() <= most { Ok(zero.round() as i16) } else { Err(CommissioningError::Zero(zero)) }
}

/// Four unknowns from the normal equations, by elimination with the largest pivot; none where the
/// rows say too little.
fn least_squares(rows: &[([f64; 4], f64)]) -> Option<[f64; 4]> {
    // Each column by its own size: inertia and time are some nine powers of ten apart.
    let scale: [f64; 4] = std::array::from_fn(|i| rows.iter().map(|(x, _)| x[i] * x[i]).sum::<f64>().sqrt());
    if scale.contains(&0.0) {
        return None;
    }
    let mut system = [[0.0; 5]; 4];
    for (x, y) in rows {
        for i in 0..4 {
            for j in 0..4 {
                system[i][j] += x[i] * x[j] / scale[i] / scale[j];
            }
            system[i][4] += x[i] * y / scale[i];
        }
    }
    for column in 0..4 {
        let pivot =
            (column..4).max_by(|&a, &b| system[a][column].abs().total_cmp(&system[b][column].abs()))?;
        system.swap(column, pivot);
        if system[column][column].abs() < 1e-9 {
            return None;
        }
        let pivot = system[column];
        for row in (0..4).filter(|&row| row != column) {
            let factor = system[row][column] / pivot[column];
            system[row].iter_mut().zip(pivot).for_each(|(value, above)| *value -= factor * above);
        }
    }
    Some(std::array::from_fn(|i| system[i][4] / system[i][i] / scale[i]))
}
