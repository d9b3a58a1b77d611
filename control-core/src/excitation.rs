//! Signals that separate one physical effect from another (`characterise`). The device plays them
//! with no hand on the needle: a reference that a soft position servo follows, a torque on top, or
//! both. The safety limits stay in force.
//!
//! The reference is a pure function of the signal and the tick, so the PC can write down what the
//! servo was asked to follow: it plays the same [`Reference`].

mod player;
mod reference;
mod sequence;

use crate::plan::Plan;
use crate::refusal::{Field, Refusal, within};
use crate::units::{Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use fixed::types::{I8F24, I16F16, I32F32};
use heapless::Vec;
pub(crate) use player::Player;
pub use player::{MAX_SEGMENTS, Prepared, Segments};
pub use reference::{Reach, Reference, Target};
pub use sequence::{MAX_SEQUENCE_MS, Sequence, SequenceRefusal};
use serde::{Deserialize, Serialize};

/// The most sines of a multisine.
pub const MAX_LINES: usize = 12;

/// The largest torque that a device gives before it has been commissioned: 2 mN·m.
pub const GENTLE_TORQUE: MillinewtonMetres = MillinewtonMetres(I16F16::from_bits(2 << 16));

/// The signal to play.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Excitation {
    /// The signal.
    pub signal: Signal,
    /// The duration, 10–600,000 ms; torque goes off at the end.
    pub duration_ms: u32,
    /// Gains of the servo that follows the reference.
    pub servo: Servo,
    /// Largest distance from where it began, 1–1,000 mm along the roller; beyond it is a fault.
    pub travel: Millimetres,
    /// With what the device feeds forward: shows the rest of the mechanism. Without, the mechanism
    /// as it is.
    pub compensated: bool,
}

/// A soft position servo: `F = K·(r − x) + D·(ṙ − ẋ)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Servo {
    /// K, up to the plan's stiffness limit; 0 plays torque alone.
    pub stiffness: Stiffness,
    /// D, 0–0.02 N·s/mm.
    pub damping: Damping,
}

/// The signals, each for the effects that it distinguishes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Signal {
    /// Constant speeds, each there and back, each `ratio` times the one before; begins again after
    /// the last. Tells Stribeck friction from quadratic drag and viscosity.
    SpeedStaircase {
        /// The first speed.
        slowest: MillimetresPerSecond,
        /// From one speed to the next, 1–4.
        ratio: I16F16,
        /// Number of speeds, 1–32.
        steps: u8,
        /// Time at a speed, one way, 50–10,000 ms.
        dwell_ms: u16,
    },
    /// There and back at one speed, over many turns. Shows what depends on the angle and on the
    /// travel.
    Triangle {
        /// From one end to the other.
        stroke: Millimetres,
        /// Speed.
        speed: MillimetresPerSecond,
    },
    /// Reversals of growing amplitude: there and back over each, each `ratio` times the one before;
    /// begins again after the last. Tells presliding from backlash.
    ReversalLadder {
        /// The first amplitude.
        smallest: Millimetres,
        /// From one amplitude to the next, 1–4.
        ratio: I16F16,
        /// Number of amplitudes, 1–16.
        steps: u8,
        /// Speed.
        speed: MillimetresPerSecond,
    },
    /// Sines of equal torque around the reference at rest, with Schroeder's phases. Tells delay
    /// from electrical lag.
    Multisine {
        /// Amplitude of each sine.
        torque: MillinewtonMetres,
        /// Frequencies in Hz.
        frequencies: Vec<u16, MAX_LINES>,
    },
    /// Torque that rises from zero until the motor breaks away, there and back. Shows dry friction
    /// at rest.
    BreakawayRamps {
        /// Largest torque.
        torque: MillinewtonMetres,
        /// Time from zero to the largest, 50–10,000 ms.
        ramp_ms: u16,
    },
    /// The reference at rest while a person tilts the device. Shows a weight.
    Hold,
}

impl Excitation {
    /// True if a device may play it whose wiring is not yet known: no servo, which would drive the
    /// wrong way, and no more than [`GENTLE_TORQUE`].
    pub fn is_gentle(&self) -> bool {
        let torque = match &self.signal {
            Signal::Multisine { torque, frequencies } => {
                torque.0.saturating_mul_int(frequencies.len() as i32)
            }
            Signal::BreakawayRamps { torque, .. } => torque.0,
            Signal::Hold
            | Signal::SpeedStaircase { .. }
            | Signal::Triangle { .. }
            | Signal::ReversalLadder { .. } => I16F16::ZERO,
        };
        let has_servo = self.servo.stiffness.0 != I16F16::ZERO || self.servo.damping.0 != I8F24::ZERO;
        torque <= GENTLE_TORQUE.0 && !has_servo
    }

    /// The fastest speed of the reference: zero where it is at rest.
    pub fn fastest(&self) -> MillimetresPerSecond {
        match &self.signal {
            Signal::SpeedStaircase { slowest, ratio, steps, .. } => {
                MillimetresPerSecond(power(slowest.0, *ratio, steps.saturating_sub(1)))
            }
            Signal::Triangle { speed, .. } | Signal::ReversalLadder { speed, .. } => *speed,
            Signal::Multisine { .. } | Signal::BreakawayRamps { .. } | Signal::Hold => {
                MillimetresPerSecond::default()
            }
        }
    }

    /// Checks that the device may play it under `plan`.
    pub fn check(&self, plan: &Plan) -> Result<(), Refusal> {
        let limits = &plan.device().limits;
        // A sequence of weeks has more milliseconds than the number holds.
        let seconds = I16F16::saturating_from_num(I32F32::saturating_from_num(self.duration_ms) / 1000);
        within(Field::DurationSeconds, seconds, thousandth(10), I16F16::from_num(600))?;
        within(Field::Travel, self.travel.0, I16F16::ONE, I16F16::from_num(1000))?;
        within(Field::ServoStiffness, self.servo.stiffness.0, I16F16::ZERO, limits.stiffness.0)?;
        within(Field::Damping, I16F16::from_num(self.servo.damping.0), I16F16::ZERO, thousandth(20))?;
        self.signal.check(self.travel.0, plan.torque_limits.torque)
    }
}

impl Signal {
    /// Refuses a value that no device may play, a way of more than `travel` in mm, and a torque of
    /// more than `most` in mN·m.
    fn check(&self, travel: I16F16, most: I16F16) -> Result<(), Refusal> {
        let torque = |t: I16F16| within(Field::TorqueLimit, t, I16F16::ZERO, most);
        let length = |l: I16F16| within(Field::Travel, l, thousandth(10), travel);
        match self {
            Signal::SpeedStaircase { slowest, ratio, steps, dwell_ms } => {
                check_speed(slowest.0)?;
                check_ratio(*ratio)?;
                check_steps(*steps, 32)?;
                check_dwell(*dwell_ms)?;
                let fastest = power(slowest.0, *ratio, steps - 1);
                check_speed(fastest)?;
                length((fastest / 1000).saturating_mul_int(i32::from(*dwell_ms)))
            }
            Signal::Triangle { stroke, speed } => {
                length(stroke.0)?;
                check_speed(speed.0)
            }
            Signal::ReversalLadder { smallest, ratio, steps, speed } => {
                check_speed(speed.0)?;
                check_ratio(*ratio)?;
                check_steps(*steps, 16)?;
                length(smallest.0)?;
                length(power(smallest.0, *ratio, steps - 1))
            }
            Signal::Multisine { torque: each, frequencies } => {
                torque(each.0.saturating_mul_int(frequencies.len() as i32))?;
                frequencies.iter().try_for_each(|hz| check_frequency(*hz))
            }
            Signal::BreakawayRamps { torque: largest, ramp_ms } => {
                torque(largest.0)?;
                check_dwell(*ramp_ms)
            }
            Signal::Hold => Ok(()),
        }
    }
}

fn thousandth(t: i64) -> I16F16 {
    I16F16::from_num(t) / 1000
}

/// Checks a speed in mm/s.
fn check_speed(speed: I16F16) -> Result<(), Refusal> {
    within(Field::Speed, speed, thousandth(10), I16F16::from_num(2000))
}

fn check_ratio(ratio: I16F16) -> Result<(), Refusal> {
    within(Field::Ratio, ratio, I16F16::ONE, I16F16::from_num(4))
}

fn check_steps(steps: u8, most: u8) -> Result<(), Refusal> {
    within(Field::Steps, I16F16::from_num(steps), I16F16::ONE, I16F16::from_num(most))
}

fn check_dwell(ms: u16) -> Result<(), Refusal> {
    let dwell = I16F16::from_num(ms.min(30_000));
    within(Field::DwellMs, dwell, I16F16::from_num(50), I16F16::from_num(10_000))
}

fn check_frequency(hz: u16) -> Result<(), Refusal> {
    within(Field::Frequency, I16F16::from_num(hz.min(30_000)), I16F16::ONE, I16F16::from_num(2000))
}

/// `base · ratio^exponent`, saturating.
fn power(base: I16F16, ratio: I16F16, exponent: u8) -> I16F16 {
    (0..exponent).fold(base, |product, _| product.saturating_mul(ratio))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test")]
mod tests {
    use super::*;
    use crate::Config;

    fn staircase() -> Signal {
        Signal::SpeedStaircase {
            slowest: MillimetresPerSecond(I16F16::from_num(2)),
            ratio: I16F16::from_num(2),
            steps: 7,
            dwell_ms: 500,
        }
    }

    #[test]
    fn a_staircase_covers_two_decades_and_comes_back_each_time() {
        let mut reference = Reference::new(&staircase());
        let targets = (0..7 * 10_000).map(|_| reference.tick());
        let (mut fastest, mut furthest, mut turned) = (0.0_f64, 0.0_f64, 0);
        let mut outwards = true;
        let mut last = Target::default();
        for target in targets {
            fastest = fastest.max(target.speed.0.to_num());
            furthest = furthest.max(target.position.0.to_num());
            turned += u32::from((target.speed.0 > 0) != outwards);
            outwards = target.speed.0 > 0;
            last = target;
        }
        assert_eq!(fastest, 128.0);
        assert!((furthest - 64.0).abs() < 0.1, "{furthest} mm at half a second of 128 mm/s");
        assert_eq!(turned, 13);
        assert!(last.position.0.to_num::<f64>().abs() < 0.1, "{last:?}");
    }

    #[test]
    fn what_would_leave_the_travel_or_the_torque_is_refused() {
        let plan = Config::commissioned_virtual().plan().unwrap();
        let servo = Servo { stiffness: Stiffness(I16F16::from_num(0.1)), damping: Damping::default() };
        let travel = Millimetres(I16F16::from_num(100));
        let sound =
            Excitation { signal: staircase(), duration_ms: 10_000, servo, travel, compensated: false };
        assert_eq!(sound.check(&plan), Ok(()));
        let short = Excitation { travel: Millimetres(I16F16::from_num(50)), ..sound.clone() };
        assert!(matches!(short.check(&plan), Err(Refusal::OutOfRange { field: Field::Travel, .. })));
        let strong = Signal::Multisine {
            torque: MillinewtonMetres(I16F16::from_num(10)),
            frequencies: [10, 20, 40].into_iter().collect(),
        };
        let strong = Excitation { signal: strong, ..sound };
        assert!(matches!(strong.check(&plan), Err(Refusal::OutOfRange { field: Field::TorqueLimit, .. })));
    }
}
