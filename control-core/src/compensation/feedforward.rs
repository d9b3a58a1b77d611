//! A tick of the feedforward: computes a torque from the rotor's angle, the speed and the tilt,
//! which is added to the law's.
//!
//! Waves are summed in even ticks and ripple in odd ones, weight and gains follow every sixteenth:
//! at 100 mm/s an order of 50 turns by a tenth of a radian in the tick that this costs.

use super::{Compensation, Gains, MAX_RIPPLES, MAX_WAVES, Wave};
use crate::config::Device;
use crate::math::{magnitude, sine, truncating_product, upper_half};
use crate::passivity::Account;
use crate::sine::sine as sine_of;
use crate::units::{MillimetresPerSecond, Milliradians};
use fixed::types::{I2F30, I16F16};

/// The turn, of sixteen ticks, in which weight and gains are renewed; the controller's other turns
/// leave it free.
const RENEW_TURN: u32 = 1;
/// By how much a gain moves at each renewal: from 0 to 1 in 0.2 s, so that no change of it is a
/// step.
const GAIN_STEP: I16F16 = I16F16::from_bits(512);

/// Friction lets go by 2^−11 of itself a tick: with a time constant of 0.2 s.
const RELEASE_PLACES: u32 = 11;

/// A compensation ready for the tick: every division done. [`super::check::prepare`] makes it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FeedforwardPlan {
    /// True if there is anything to feed forward.
    pub(super) is_some: bool,
    /// mN·m·s/mm, inwards and outwards.
    pub(super) viscous: [I2F30; 2],
    /// 1/(full speed − rest speed), s/mm.
    pub(super) per_blend: I2F30,
    /// 1/(2 · half width of the deadband), 1/(mN·m).
    pub(super) per_deadband: I16F16,
    /// The energy that waves by angle may store, mN·m·counts in Q16.
    pub(super) store: i64,
    pub(super) angle: [ReadyWave; MAX_WAVES],
    pub(super) ripple: [ReadyWave; MAX_RIPPLES],
}

/// A [`Wave`] in numbers of which nothing is to be shifted; by default one that adds nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReadyWave {
    /// The phase of a count; 2^32 are a period.
    per_count: u32,
    /// The phase where the rotor's angle is zero.
    phase: u32,
    /// Q18: an amplitude stays below 2^13.
    amplitude: i32,
}

impl ReadyWave {
    /// Prepares a wave of a rotor, each of whose counts is `turn_per_count` of a turn in 2^-32.
    pub(super) fn new(Wave { order, amplitude, phase }: Wave, turn_per_count: u32) -> Self {
        Self {
            per_count: turn_per_count.wrapping_mul(order.into()),
            phase: u32::from(phase) << 16,
            amplitude: amplitude.to_bits() << 2,
        }
    }
}

/// The rotor's angle and the needle's speed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RotorState {
    /// The encoder's absolute count, in the direction of insertion.
    pub(crate) count: i32,
    pub(crate) speed: MillimetresPerSecond,
}

/// The feedforward with its memory.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Feedforward {
    is_on: bool,
    /// The gains that were asked for, and those in force: of angle, friction, weight, drive.
    wanted: [I16F16; 4],
    gains: [I16F16; 4],
    /// The absolute count at which the rotor's angle is zero, once it is known.
    index: Option<i32>,
    /// Weight and offset, mN·m in the direction of insertion, to give.
    steady: I16F16,
    /// The sum of the waves, mN·m to give.
    waves: I16F16,
    /// The sum of the ripple's waves, times its gain.
    ripple: I16F16,
    /// Friction that is given back at a gain of 1, mN·m.
    rubbing: I16F16,
    /// The torque that was added in the tick before.
    fed: I16F16,
    /// The compensation of the tick before, without weight and offset, and its place.
    given: I16F16,
    count: i32,
    account: Account,
}

impl Feedforward {
    /// The gains from now on.
    pub(crate) fn set_gains(&mut self, gains: Gains) {
        self.wanted = gains.each().map(super::Gain::share);
    }

    /// Another configuration: its gains; and the rotor's angle is to be found again where it may be
    /// another one.
    pub(crate) fn configure(&mut self, before: &Device, after: &Device) {
        let counted = |device: &Device| {
            (
                device.compensation.angle,
                device.compensation.ripple,
                device.counts_per_turn,
                device.encoder_reversed,
            )
        };
        if counted(before) != counted(after) {
            self.index = None;
        }
        self.set_gains(after.compensation.gains);
    }

    /// The absolute count at which the rotor's angle is zero; `None` if it is not known.
    pub(crate) fn set_index(&mut self, index: Option<i32>) {
        self.index = index;
        (self.waves, self.ripple) = (I16F16::ZERO, I16F16::ZERO);
    }

    /// Begins from nothing at an absolute count, where anything is to be fed forward.
    pub(crate) fn restart(&mut self, plan: &FeedforwardPlan, count: i32, is_wanted: bool) {
        let (wanted, index) = (self.wanted, self.index);
        *self = Self { is_on: plan.is_some && is_wanted, wanted, index, count, ..Self::default() };
    }

    /// True if [`Self::tick`] has anything to do.
    pub(crate) fn is_on(&self) -> bool {
        self.is_on
    }

    /// Returns the torque that was added in the tick before.
    pub(crate) fn fed(&self) -> I16F16 {
        self.fed
    }

    /// One tick, number `turn` modulo 16: the torque to ask for instead of `wanted`, and whether
    /// the passivity observer has held some of it back. Out of line: a tick that feeds nothing
    /// forward is not to pay for it. Not `cold`: that costs such a tick five instructions. In
    /// pairs, which registers hold.
    #[inline(never)]
    pub(crate) fn tick(
        &mut self,
        found: &Compensation,
        plan: &FeedforwardPlan,
        rotor: RotorState,
        (turn, tilt): (u32, Milliradians),
        wanted: I16F16,
    ) -> (I16F16, bool) {
        let [angle, friction, _, drive] = self.gains;
        if turn == RENEW_TURN {
            self.renew(found, tilt);
        } else if let Some(index) = self.index {
            let count = rotor.count.wrapping_sub(index).cast_unsigned();
            if turn.is_multiple_of(2) {
                self.waves = -at_gain(sum(&plan.angle, count), angle);
            } else {
                self.ripple = at_gain(sum(&plan.ripple, count), drive);
            }
        }
        let way = rotor.count.wrapping_sub(self.count);
        self.count = rotor.count;
        let rubs = rubbing(found, plan, rotor.speed);
        let found_friction = rubs.found;
        self.rubbing = released(self.rubbing, rubs);
        let given = self.waves + at_gain(self.rubbing, friction);
        let (given, is_held) = self.account.allow(plan.store, self.given, found_friction, way, given);
        self.given = given;
        let asked = wanted.saturating_add(given).saturating_add(self.steady);
        let straightened = asked.saturating_sub(at_gain(asked, self.ripple));
        let torque = straightened.saturating_add(self.over_deadband(found, plan, straightened, drive));
        self.fed = torque.saturating_sub(wanted);
        (torque, is_held)
    }

    /// Weight, offset and gains, which are slow.
    fn renew(&mut self, found: &Compensation, tilt: Milliradians) {
        for (gain, &wanted) in self.gains.iter_mut().zip(&self.wanted) {
            *gain = wanted.min(*gain + GAIN_STEP).max(*gain - GAIN_STEP);
        }
        let [_, _, weight, drive] = self.gains;
        let sine = sine(Milliradians(tilt.0.saturating_abs()));
        let pulls = I16F16::from_bits(truncating_product(found.weight.0.to_bits(), sine.to_bits(), 30));
        let pulls = if tilt.0 < 0 { -pulls } else { pulls };
        self.steady = -at_gain(pulls, weight) - at_gain(found.offset.0, drive);
    }

    /// Returns the addition that lifts a torque over the drive's deadband: the half width for
    /// torques of at least twice that, less below, so that there is no step at zero.
    fn over_deadband(
        &self,
        found: &Compensation,
        plan: &FeedforwardPlan,
        asked: I16F16,
        drive: I16F16,
    ) -> I16F16 {
        let width = found.deadband.0;
        if width == I16F16::ZERO {
            return I16F16::ZERO;
        }
        let reach = width + width;
        let within = asked.min(reach).max(-reach);
        let share = I16F16::from_bits(truncating_product(within.to_bits(), plan.per_deadband.to_bits(), 16));
        at_gain(I16F16::from_bits(truncating_product(width.to_bits(), share.to_bits(), 16)), drive)
    }
}

/// Friction at a speed, mN·m.
struct Rubbing {
    /// As found, against the needle's way.
    found: I16F16,
    /// The friction compensation at a gain of 1, along the motion: zero at rest, the whole friction
    /// from the full speed on.
    given_back: I16F16,
    /// The direction of the needle, if it moves.
    moves_outwards: Option<bool>,
}

fn rubbing(found: &Compensation, plan: &FeedforwardPlan, speed: MillimetresPerSecond) -> Rubbing {
    let [inwards, outwards] = plan.viscous;
    let is_outwards = speed.0 < I16F16::ZERO;
    let (dry, viscous) =
        if is_outwards { (found.outwards.dry.0, outwards) } else { (found.inwards.dry.0, inwards) };
    let speed = magnitude(speed.0);
    let above = speed.saturating_sub(found.rest_speed.0);
    if above <= I16F16::ZERO {
        return Rubbing { found: dry, given_back: I16F16::ZERO, moves_outwards: None };
    }
    let force =
        dry.saturating_add(I16F16::from_bits(truncating_product(speed.to_bits(), viscous.to_bits(), 30)));
    let given_back = if above >= found.full_speed.0.saturating_sub(found.rest_speed.0) {
        force
    } else {
        // t²·(3 − 2t), t in Q30.
        let part = truncating_product(above.to_bits(), plan.per_blend.to_bits(), 16);
        let smooth = upper_half(upper_half(part, part), (3 << 29) - part);
        // Q28 times Q29 without 32 places.
        I16F16::from_bits(truncating_product(force.to_bits(), smooth, 25))
    };
    let given_back = if is_outwards { -given_back } else { given_back };
    Rubbing { found: force, given_back, moves_outwards: Some(is_outwards) }
}

/// Friction follows its law at once where it grows or turns round, and lets go slowly: a hand that
/// slows down creeps to its end, and below the rest speed it would feel all of the friction at
/// once. Never is it more than what was found at this speed.
fn released(before: I16F16, Rubbing { found, given_back, moves_outwards }: Rubbing) -> I16F16 {
    let has_turned = moves_outwards.is_some_and(|outwards| outwards != before.is_negative());
    let held = magnitude(before);
    if has_turned || magnitude(given_back) >= held {
        return given_back;
    }
    // A last place more, so that it comes to an end.
    let less = I16F16::from_bits((held.to_bits() >> RELEASE_PLACES) + 1);
    let left = held.saturating_sub(less).min(found);
    if before.is_negative() { -left } else { left }
}

/// `force·gain`, with a gain below 1.
fn at_gain(force: I16F16, gain: I16F16) -> I16F16 {
    I16F16::from_bits(truncating_product(force.to_bits(), gain.to_bits(), 16))
}

/// The sum of waves at a count past the rotor's zero. All of them: to ask each whether it is the
/// last takes the longest tick two instructions a wave.
fn sum(waves: &[ReadyWave], count: u32) -> I16F16 {
    waves.iter().fold(I16F16::ZERO, |sum, wave| {
        let phase = count.wrapping_mul(wave.per_count).wrapping_add(wave.phase);
        sum + I16F16::from_bits(upper_half(wave.amplitude, sine_of(phase).to_bits()))
    })
}
