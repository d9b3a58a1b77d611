//! `commission`: finds out how a device is wired and built before anybody holds its needle, and
//! gives it its part of the configuration. The encoder is known before the motor moves, and the
//! motor moves with at most 2 mN·m: more the device itself refuses until it has been commissioned.

pub mod findings;
pub mod weigh;

use crate::bench::{Act, DeviceDialogue, Line, ticks};
use control_core::compensation::Compensation;
use control_core::config::Sensors;
use control_core::event::Fault;
use control_core::excitation::{Excitation, GENTLE_TORQUE, Servo, Signal};
use control_core::units::{Damping, Millimetres, Milliradians, Stiffness};
use control_core::{Device, stiffest};
use device_sim::device::device_config;
use device_sim::error::Error;
use findings::{CommissioningError, Mechanism};
use fixed::types::I16F16;
use link::commissioning::Record;
use link::frames::GuardRefusal;
use std::fmt;
use std::time::Duration;

/// A person begins to turn, and ends, within this.
const HAND: Duration = Duration::from_secs(60);
/// A roller that has not moved for this long has been turned to its end.
const REST: Duration = Duration::from_millis(1_500);
/// The time over which a tilt is averaged, and the time that a person has to reach it.
const LOOK: Duration = Duration::from_millis(500);
const TILTING: Duration = Duration::from_secs(6);
/// The tilt of the virtual hand; a person's may be anything from 15° on.
const DOWN_RAD: f64 = 0.8;
/// The pulses: each rises from zero in this time, there and back, so often.
const PULSE_MS: u16 = 100;
const PULSES: u32 = 6;
/// The furthest that they may move the roller, along its surface.
const PULSE_TRAVEL_MM: i32 = 450;

/// The facts that a person gives about the device.
#[derive(Clone, Copy, Debug)]
pub struct Wish {
    /// Turns of the roller by hand.
    pub turns: u32,
    /// Length of the pull.
    pub pull_mm: f64,
    /// Counts a turn where the encoder's are known.
    pub counts_per_turn: Option<u16>,
}

/// The next step, announced before it is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CommissioningStep {
    /// The device sets the brown-out reset, which is off.
    GuardSupply,
    /// The person turns the roller.
    Turn(u32),
    /// The person draws something through.
    Pull(f64),
    /// The person lays the needle flat.
    LayFlat,
    /// The person points the needle down.
    PointDown,
    /// The motor moves.
    Pulses,
    /// The needle straight down, moved by the motor with nothing on it.
    PointStraightDown,
    /// The same with a weight of so many g.
    HangWeight(f64),
}

impl CommissioningStep {
    /// True if the motor moves in it.
    pub fn moves(self) -> bool {
        use CommissioningStep::{HangWeight, PointStraightDown, Pulses};
        matches!(self, Pulses | PointStraightDown | HangWeight(_))
    }
}

impl fmt::Display for CommissioningStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            CommissioningStep::GuardSupply => f.write_str(
                "torque stays off: the brown-out reset, which ends a core whose supply fails, is off on this board and is set now, in its option bytes; leave the board's power on meanwhile",
            ),
            CommissioningStep::Turn(turns) => write!(
                f,
                "torque stays off: turn the roller by exactly {turns} turns in the direction of insertion, then let go"
            ),
            CommissioningStep::Pull(mm) => write!(
                f,
                "torque stays off: draw a strip of paper through under the roller, {mm} mm in the direction of insertion, then let go"
            ),
            CommissioningStep::LayFlat => f.write_str(
                "torque stays off: lay the needle as flat as on the skin and hold it still for six seconds",
            ),
            CommissioningStep::PointDown => f.write_str(
                "torque stays off: point the needle down by some 45° and hold it still for six seconds",
            ),
            CommissioningStep::Pulses => write!(
                f,
                "the motor moves now: {PULSES} pulses both ways, of at most 2 mN·m, {} s in all; the needle out and hands off the roller",
                f64::from(PULSES) * f64::from(PULSE_MS) * 2e-3
            ),
            CommissioningStep::PointStraightDown => f.write_str(
                "fix the needle straight down, nothing on it, and let go: after four seconds the motor moves it slowly down and up by 6 mm, for 10 s",
            ),
            CommissioningStep::HangWeight(grams) => write!(
                f,
                "hang {grams} g on the needle and hold them up, a soft pad below: the motor moves now, slowly down and up by 6 mm; let the weight go gently within three seconds; after 10 s the torque goes off and it falls"
            ),
        }
    }
}

/// The result.
#[derive(Clone, Debug)]
pub struct CommissioningOutcome {
    /// The device's part, as the device has it now, under its seal.
    pub record: Record,
    /// The channels were swapped, as the device was configured before.
    pub channels_swapped: bool,
    /// The motor's leads were reversed, as the device was configured before.
    pub leads_reversed: bool,
    /// The roller's radius.
    pub radius_mm: f64,
    /// The moving mechanism.
    pub mechanism: Mechanism,
    /// The device allowed a stiffness that its mechanism does not bear.
    pub stiffness_lowered: bool,
}

impl CommissioningOutcome {
    /// Returns the result, one line each.
    pub fn lines(&self) -> Vec<String> {
        let (device, m) = (&self.record.device, &self.mechanism);
        let way =
            |wrong: bool, right: &'static str, swapped: &'static str| if wrong { swapped } else { right };
        vec![
            format!("encoder {} counts a turn", device.counts_per_turn),
            format!(
                "encoder channels {}",
                way(self.channels_swapped, "right", "swapped: counted the other way from now on")
            ),
            format!(
                "motor leads {}",
                way(self.leads_reversed, "right", "reversed: driven the other way from now on")
            ),
            format!("converter zero {} codes", device.dac_zero),
            format!("roller radius {:.2} mm", self.radius_mm),
            format!("inertia {:.2} g·cm²", m.inertia * 1e7),
            format!("dry friction {:.3} mN·m, viscous {:.2} µN·m·s", m.dry * 1e3, m.viscous * 1e6),
            format!(
                "stiffest wall {:.2} N/mm{}",
                device.limits.stiffness.0,
                if self.stiffness_lowered {
                    ", lowered: with this friction and mass more would ring"
                } else {
                    ""
                }
            ),
            format!("tilt with the needle flat {} mrad", device.skin_tilt.0),
            format!(
                "encoder's supply {}, motor's current {}",
                if device.sensors.encoder_supply { "sensed: no start without it" } else { "not sensed" },
                if device.sensors.current { "measured: no start without it" } else { "not measured" },
            ),
        ]
    }

    /// Returns the device's part as a file, with the findings as comments.
    pub fn to_toml(&self, name: &str) -> Result<String, Error> {
        to_toml(name, &self.lines(), &self.record)
    }
}

fn to_toml(name: &str, lines: &[String], record: &Record) -> Result<String, Error> {
    let found: String = lines.iter().map(|line| format!("# {line}\n")).collect();
    Ok(found + &device_config::to_toml(name, record)?)
}

impl From<CommissioningError> for Error {
    fn from(error: CommissioningError) -> Self {
        Error::failed(error)
    }
}

/// Commissions the device behind `line`; `ask` is called with each step before it is done, and may
/// end it.
pub async fn commission(
    line: &mut dyn Line,
    wish: &Wish,
    mut ask: impl AsyncFnMut(CommissioningStep) -> Result<(), Error>,
) -> Result<CommissioningOutcome, Error> {
    let mut bench = DeviceDialogue::open(line).await?;
    guard_supply(&mut bench, &mut ask).await?;
    let before = bench.device().await?;
    // Whatever it was: until it has passed again it is not commissioned, and the forces that were
    // found are another device's.
    let mut device = Device {
        commissioned: false,
        compensation: Compensation::NONE,
        sensors: Sensors::default(),
        // Found with another roller.
        torque_uncertainty: 0,
        ..before
    };
    let rests = |samples: &[_]| findings::has_moved_and_rests(samples, ticks(REST));

    ask(CommissioningStep::Turn(wish.turns)).await?;
    bench.settle().await?;
    let turned = bench.watch(Act::Turn(wish.turns), HAND, rests).await?;
    let (counts_per_turn, channels_swapped) =
        findings::counts_a_turn(turned, wish.turns, wish.counts_per_turn)?;
    ask(CommissioningStep::Pull(wish.pull_mm)).await?;
    bench.settle().await?;
    let pulled = bench.watch(Act::Pull(wish.pull_mm), HAND, rests).await?;
    let radius_mm = findings::roller_radius(pulled, wish.pull_mm, counts_per_turn)?;
    ask(CommissioningStep::LayFlat).await?;
    bench.settle().await?;
    let flat = findings::mean_tilt(bench.watch(Act::Tilt(0.0), TILTING, |_| false).await?, ticks(LOOK));
    ask(CommissioningStep::PointDown).await?;
    bench.settle().await?;
    let down = findings::mean_tilt(bench.watch(Act::Tilt(DOWN_RAD), TILTING, |_| false).await?, ticks(LOOK));
    findings::check_tilt(flat, down)?;

    device.counts_per_turn = counts_per_turn;
    device.encoder_reversed ^= channels_swapped;
    device.roller_radius = Millimetres(I16F16::from_num(radius_mm));
    device.skin_tilt = Milliradians(flat.round() as i16);
    device.limits.max_counts_per_tick = findings::counts_per_tick(radius_mm, counts_per_turn);
    device.limits.stiffness = before.limits.stiffness.min(stiffest(&device));
    bench.configure(&device).await?;

    let outcome = prove(&mut bench, &mut device, before.limits.stiffness, &mut ask).await?;
    Ok(CommissioningOutcome { channels_swapped, ..outcome })
}

/// Has the device prove itself by pulses under its new part and gives it what they show. Earlier it
/// allowed this `stiffness`.
async fn prove(
    bench: &mut DeviceDialogue<'_>,
    device: &mut Device,
    stiffness: Stiffness,
    ask: &mut impl AsyncFnMut(CommissioningStep) -> Result<(), Error>,
) -> Result<CommissioningOutcome, Error> {
    ask(CommissioningStep::Pulses).await?;
    bench.settle().await?;
    let (mechanism, leads_reversed) = find_mechanism(bench, device).await?;
    let radius_mm = device.roller_radius.0.to_num();
    device.dac_zero = findings::converter_zero(device, mechanism.offset)?;
    device.mechanism = findings::along_the_needle(&mechanism, radius_mm, device.mechanism.delay_us);
    // Never above what the pulses were driven with: the device takes nothing higher than it has
    // proved.
    device.limits.stiffness = device.limits.stiffness.min(stiffest(device));
    let stiffness_lowered = device.limits.stiffness < stiffness;
    bench.configure(device).await?;
    let record = bench.commission(device).await?;
    Ok(CommissioningOutcome {
        record,
        channels_swapped: false,
        leads_reversed,
        radius_mm,
        mechanism,
        stiffness_lowered,
    })
}

/// Sees that a brown-out reset guards the supply, for no pulse is played without; one that is off
/// is set if the person agrees.
async fn guard_supply(
    bench: &mut DeviceDialogue<'_>,
    ask: &mut impl AsyncFnMut(CommissioningStep) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut answer = bench.guard_supply(false).await?;
    if answer == Err(GuardRefusal::Off) {
        ask(CommissioningStep::GuardSupply).await?;
        bench.settle().await?;
        answer = bench.guard_supply(true).await?;
    }
    answer.map_err(Error::failed)
}

/// Finds the mechanism by pulses, and whether the motor's leads are reversed; then the device
/// drives it the other way from now on.
async fn find_mechanism(
    bench: &mut DeviceDialogue<'_>,
    device: &mut Device,
) -> Result<(Mechanism, bool), Error> {
    if let Some(mechanism) = pulses(bench, device).await? {
        return Ok((mechanism, false));
    }
    device.motor_reversed = !device.motor_reversed;
    bench.configure(device).await?;
    // Otherwise it turns against its torque whichever way it is driven.
    let mechanism = pulses(bench, device).await?.ok_or(CommissioningError::NoFit)?;
    Ok((mechanism, true))
}

/// Plays the pulses and returns the mechanism; `None` if the motor turns against its torque.
async fn pulses(bench: &mut DeviceDialogue<'_>, device: &Device) -> Result<Option<Mechanism>, Error> {
    let excitation = Excitation {
        signal: Signal::BreakawayRamps { torque: GENTLE_TORQUE, ramp_ms: PULSE_MS },
        duration_ms: 2 * PULSES * u32::from(PULSE_MS),
        servo: Servo { stiffness: Stiffness::default(), damping: Damping::default() },
        travel: Millimetres(I16F16::from_num(PULSE_TRAVEL_MM)),
        compensated: false,
    };
    let (samples, fault) = bench.play(&excitation).await?;
    match fault {
        Some(Fault::WrongWay) => return Ok(None),
        Some(Fault::EncoderChannel) => return Err(CommissioningError::DeadChannel.into()),
        Some(Fault::Travel | Fault::EncoderJump) => return Err(CommissioningError::RunsOn.into()),
        Some(fault) => {
            return Err(Error::failed(format_args!(
                "{fault}; see that nothing holds the roller and commission again"
            )));
        }
        None => {}
    }
    let mechanism = findings::mechanism(&samples, device)?;
    Ok((mechanism.inertia > 0.0).then_some(mechanism))
}
