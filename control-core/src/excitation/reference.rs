//! The reference of an excitation: a pure function of the signal and the tick.

use super::{MAX_LINES, Signal};
use crate::TICK_HZ;
use crate::math::truncating_product;
use crate::sine::sine;
use crate::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres};
use fixed::types::{I16F16, I32F32};

/// The servo's reference at one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Target {
    /// Position along the needle, from where the excitation began.
    pub position: Millimetres,
    /// Its speed.
    pub speed: MillimetresPerSecond,
    /// Torque on top of the servo's.
    pub torque: MillinewtonMetres,
}

/// Plays the reference of an excitation, tick by tick.
#[derive(Clone, Debug)]
pub struct Reference {
    signal: Signal,
    position: I32F32,
    step: u8,
    /// Speed of the staircase or amplitude of the ladder at this step.
    stage: I16F16,
    leg: Leg,
    lines: [Line; MAX_LINES],
}

/// One sine of a multisine. Of its phase 2^32 is a turn.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    phase: u32,
    phase_per_tick: u32,
}

/// One straight run of the reference.
#[derive(Clone, Copy, Debug)]
struct Leg {
    outwards: bool,
    /// Away from where it began, or back.
    speed: I16F16,
    /// The way of a tick at that speed.
    way_per_tick: I32F32,
    remaining_ticks: u32,
}

impl Reference {
    /// From the beginning. The signal has passed `Excitation::check`.
    pub fn new(signal: &Signal) -> Self {
        let mut reference = Self {
            signal: signal.clone(),
            position: I32F32::ZERO,
            step: 0,
            stage: first_stage(signal),
            leg: Leg { outwards: true, speed: I16F16::ZERO, way_per_tick: I32F32::ZERO, remaining_ticks: 0 },
            lines: [Line::default(); MAX_LINES],
        };
        if let Signal::Multisine { frequencies, .. } = signal {
            // Schroeder: phase of line i is π·i²/n, which keeps the peak low.
            let n = (frequencies.len() as u64).max(1);
            for ((i, line), frequency) in (0_u64..).zip(&mut reference.lines).zip(frequencies) {
                line.phase = (((i * i) << 31) / n) as u32;
                line.phase_per_tick = ((u64::from(*frequency) * PHASE_PER_HZ_Q8) >> 8) as u32;
            }
        }
        reference.begin_leg(true);
        reference
    }

    /// The target of the next tick.
    pub fn tick(&mut self) -> Target {
        if self.leg.remaining_ticks == 0 {
            self.next_leg();
        }
        self.leg.remaining_ticks = self.leg.remaining_ticks.saturating_sub(1);
        let mut target = Target::default();
        match &self.signal {
            Signal::Hold => {}
            Signal::Multisine { torque, frequencies } => {
                target.torque.0 = multisine(self.lines.iter_mut().take(frequencies.len()), torque.0);
            }
            Signal::BreakawayRamps { torque, ramp_ms } => {
                let whole = u32::from(*ramp_ms) * (TICK_HZ / 1000);
                let elapsed = i64::from(whole.saturating_sub(self.leg.remaining_ticks));
                let rising = i64::from(torque.0.to_bits()) * elapsed / i64::from(whole.max(1));
                let rising = I16F16::from_bits(i32::try_from(rising).unwrap_or(0));
                target.torque.0 = if self.leg.outwards { rising } else { -rising };
            }
            Signal::SpeedStaircase { .. } | Signal::Triangle { .. } | Signal::ReversalLadder { .. } => {
                self.position = self.position.saturating_add(self.leg.way_per_tick);
                target.speed.0 = self.leg.speed;
            }
        }
        target.position = self.position();
        target
    }

    /// Returns the reference's position now, from where it began.
    pub fn position(&self) -> Millimetres {
        Millimetres(self.position.saturating_to_num())
    }

    fn next_leg(&mut self) {
        if self.leg.outwards {
            return self.begin_leg(false);
        }
        // Back where it began, to the last bit: nothing adds up over a long run.
        self.position = I32F32::ZERO;
        let (steps, ratio) = steps_and_ratio(&self.signal);
        (self.step, self.stage) = if self.step + 1 >= steps {
            (0, first_stage(&self.signal))
        } else {
            (self.step + 1, self.stage.saturating_mul(ratio))
        };
        self.begin_leg(true);
    }

    fn begin_leg(&mut self, outwards: bool) {
        let ticks_per_ms = TICK_HZ / 1000;
        let (speed, remaining_ticks) = match &self.signal {
            Signal::SpeedStaircase { dwell_ms, .. } => (self.stage, u32::from(*dwell_ms) * ticks_per_ms),
            Signal::Triangle { stroke, speed } => (speed.0, ticks_over(stroke.0, speed.0)),
            Signal::ReversalLadder { speed, .. } => (speed.0, ticks_over(self.stage, speed.0)),
            Signal::BreakawayRamps { ramp_ms, .. } => (I16F16::ZERO, u32::from(*ramp_ms) * ticks_per_ms),
            Signal::Multisine { .. } | Signal::Hold => (I16F16::ZERO, u32::MAX),
        };
        let way = way_per_tick(speed);
        let (speed, way_per_tick) = if outwards { (speed, way) } else { (-speed, -way) };
        self.leg = Leg { outwards, speed, way_per_tick, remaining_ticks: remaining_ticks.max(1) };
    }
}

/// Returns the largest distance of a reference from where it began; it never goes the other way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reach {
    /// Its position at the end.
    pub end: Millimetres,
    /// Its furthest position until then.
    pub furthest: Millimetres,
}

impl Reach {
    /// Returns the state of a signal that so many calls of [`Reference::tick`] lead to, computed
    /// leg by leg and without the cycles that begin again.
    pub fn after(signal: &Signal, ticks: u32) -> Self {
        let legs = 2 * u32::from(steps_and_ratio(signal).0);
        let mut walk =
            Walk { reference: Reference::new(signal), furthest: I32F32::ZERO, remaining_ticks: ticks };
        walk.go(legs);
        // It is where it began after a whole cycle, and the furthest of it is known.
        let cycle_ticks = ticks - walk.remaining_ticks;
        walk.remaining_ticks = walk.remaining_ticks.checked_rem(cycle_ticks).unwrap_or(0);
        walk.go(legs);
        let furthest = Millimetres(walk.furthest.saturating_to_num());
        Self { end: walk.reference.position(), furthest }
    }
}

/// A reference that is followed leg by leg.
struct Walk {
    reference: Reference,
    furthest: I32F32,
    remaining_ticks: u32,
}

impl Walk {
    /// Follows at most so many legs.
    fn go(&mut self, legs: u32) {
        for _ in 0..legs {
            if self.remaining_ticks == 0 {
                return;
            }
            if self.reference.leg.remaining_ticks == 0 {
                self.reference.next_leg();
            }
            let leg = &mut self.reference.leg;
            let ticks = leg.remaining_ticks.min(self.remaining_ticks);
            leg.remaining_ticks -= ticks;
            self.remaining_ticks -= ticks;
            let way = I32F32::from_bits(leg.way_per_tick.to_bits().saturating_mul(i64::from(ticks)));
            self.reference.position = self.reference.position.saturating_add(way);
            self.furthest = self.furthest.max(self.reference.position);
        }
    }
}

/// The number of steps of a series, and the ratio of one to the one before; one step if the signal
/// has none.
fn steps_and_ratio(signal: &Signal) -> (u8, I16F16) {
    match signal {
        Signal::SpeedStaircase { steps, ratio, .. } | Signal::ReversalLadder { steps, ratio, .. } => {
            (*steps, *ratio)
        }
        _ => (1, I16F16::ONE),
    }
}

/// The quantity that grows from step to step, at the first one.
fn first_stage(signal: &Signal) -> I16F16 {
    match signal {
        Signal::SpeedStaircase { slowest, .. } => slowest.0,
        Signal::ReversalLadder { smallest, .. } => smallest.0,
        _ => I16F16::ZERO,
    }
}

/// The way of a tick at `speed`, which is not negative, in two divisions of a word: the board has
/// none for more.
fn way_per_tick(speed: I16F16) -> I32F32 {
    let bits = speed.to_bits().unsigned_abs();
    let (whole, rest) = (bits / TICK_HZ, bits % TICK_HZ);
    I32F32::from_bits((i64::from(whole) << 16) + i64::from((rest << 16) / TICK_HZ))
}

/// Ticks to cover a length at a speed.
fn ticks_over(length: I16F16, speed: I16F16) -> u32 {
    let ticks = i64::from(length.to_bits()) * i64::from(TICK_HZ) / i64::from(speed.to_bits().max(1));
    u32::try_from(ticks).unwrap_or(1)
}

/// 2^32 / 10,000 Hz, in Q8: the frequency error stays below 1e-7 of a hertz.
const PHASE_PER_HZ_Q8: u64 = (1 << 40) / TICK_HZ as u64;

fn multisine<'a>(lines: impl Iterator<Item = &'a mut Line>, torque: I16F16) -> I16F16 {
    lines.fold(I16F16::ZERO, |sum, line| {
        let value = truncating_product(torque.to_bits(), sine(line.phase).to_bits(), 30);
        line.phase = line.phase.wrapping_add(line.phase_per_tick);
        sum.saturating_add(I16F16::from_bits(value))
    })
}
