//! `compensate`: turns what a diagnosis found of a device's own forces into what the device feeds forward, finds the rotor's
//! angle, and shows what a hand would have felt before and feels after. The needle is out; the same commands and bytes serve a
//! real device and the virtual one.

pub mod angle;
pub mod coefficients;
pub mod felt;
pub mod page;

use crate::characterise::programme;
use crate::commission::bench::{Act, Bench, Line};
use crate::failure::Failure;
use coefficients::Found;
use control_core::controller::Sample;
use control_core::excitation::{Excitation, Signal};
use control_core::units::{Millimetres, MillimetresPerSecond};
use control_core::{Device, Patient, Plan};
use diagnosis::rig::Rig;
use felt::Felt;
use fixed::types::I16F16;
use link::commissioning::Record;
use std::f64::consts::TAU;
use std::fmt;
use std::path::Path;
use std::time::Duration;

/// Speed of the slow turns, mm/s: a slow insertion.
const SPEED_MM_S: f64 = 10.0;
/// Turns of the roller each way.
const TURNS: f64 = 1.05;
/// How long the roller is held.
const HOLD_MS: u32 = 6_000;
/// How long a person has to tilt the device, and what the virtual hand tilts to, rad.
const TILTING: Duration = Duration::from_secs(4);
const DOWN_RAD: f64 = 0.5;

/// What comes next, said before it is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The person tilts the device.
    Tilt,
    /// The roller turns slowly, as it is.
    Before,
    /// The same, with what is fed forward.
    After,
}

impl Step {
    /// Whether the motor moves in it.
    pub fn moves(self) -> bool {
        self != Step::Tilt
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Step::Tilt => "torque stays off: point the device down by some 30° and leave it so until the end",
            Step::Before => "the roller turns slowly to and fro by one turn, then it is held: hands off",
            Step::After => "the same again, with what is fed forward: hands off",
        })
    }
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The device's part, as the device has it now, under its seal.
    pub record: Record,
    /// Where the rotor's angle is nought, where anything depends on it.
    pub angle: Option<angle::Angle>,
    /// What a hand would feel of the mechanism without and with it.
    pub before: Felt,
    /// With it.
    pub after: Felt,
    /// What was found and is not fed forward.
    pub left_out: Vec<String>,
}

/// The rig that a diagnosis' report folder holds.
pub fn read_report(dir: &Path) -> Result<Rig, Failure> {
    let path = dir.join("patched-rig.toml");
    if !path.is_file() {
        return Err(Failure::input(format_args!(
            "{}: no report of diagnose; give the folder that its --out wrote",
            dir.display()
        )));
    }
    Rig::read(&path).map_err(Failure::input)
}

/// Compensates the device behind `line` for what `rig` found, every gain at `share` of the most that is usual; `ask` is told each
/// step before it is done, and may end it. Where it ends early, the device keeps what it had before.
pub fn compensate(
    line: &mut dyn Line,
    rig: &Rig,
    share: f64,
    mut ask: impl FnMut(Step) -> Result<(), Failure>,
) -> Result<Outcome, Failure> {
    let mut bench = Bench::open(line)?;
    let before = bench.device()?;
    if !before.commissioned {
        return Err(Failure::failed(
            "nobody knows how this device is wired; run host-sim commission with it first",
        ));
    }
    let found = coefficients::found(rig, &before, share)?;
    let device = Device { compensation: found.compensation, ..before };
    let refuse =
        |why: control_core::Refusal| Failure::input(format_args!("the device would refuse this: {why}"));
    let plan = Plan::new(&device, &Patient::nobody()).map_err(refuse)?;
    let radius = device.roller_radius.0.to_num::<f64>();

    ask(Step::Tilt)?;
    bench.settle()?;
    bench.watch(Act::Tilt(DOWN_RAD), TILTING, |_| false)?;
    ask(Step::Before)?;
    let (turns, hold) = excitations(found.inertia, radius, false);
    let bare = play(&mut bench, &turns, &hold)?;
    let angle =
        if found.compensation.needs_angle() { Some(find_angle(&device, &found, &bare.0)?) } else { None };
    bench.configure(&device)?;
    if let Some(angle) = angle {
        bench.index(angle.count)?;
    }
    ask(Step::After)?;
    let (compensated_turns, compensated_hold) = excitations(found.inertia, radius, true);
    let fed = play(&mut bench, &compensated_turns, &compensated_hold)?;
    Ok(Outcome {
        record: bench.record()?,
        angle,
        before: felt::felt(&plan, (&turns, &bare.0), (&hold, &bare.1))?,
        after: felt::felt(&plan, (&turns, &fed.0), (&hold, &fed.1))?,
        left_out: found.left_out,
    })
}

/// Finds the rotor's angle again on a device that was compensated and then restarted.
pub fn align(line: &mut dyn Line, rig: &Rig) -> Result<angle::Angle, Failure> {
    let mut bench = Bench::open(line)?;
    let device = bench.device()?;
    let found = coefficients::found(rig, &device, 1.0)?;
    if !device.compensation.needs_angle() {
        return Err(Failure::failed("nothing that this device feeds forward depends on the rotor's angle"));
    }
    let (turns, _) = excitations(found.inertia, device.roller_radius.0.to_num(), false);
    let samples = played(&mut bench, &turns)?;
    let angle = find_angle(&device, &found, &samples)?;
    bench.index(angle.count)?;
    Ok(angle)
}

fn find_angle(device: &Device, found: &Found, samples: &[Sample]) -> Result<angle::Angle, Failure> {
    let per_code = device.full_scale_torque.0.to_num::<f64>() * 1e-3 / f64::from(device.dac.span());
    let scale =
        (f64::from(device.counts_per_turn), per_code, f64::from(device.dac.mid_scale()), found.inertia);
    angle::find(samples, &found.waves, scale)
}

/// The slow turns and the hold.
fn excitations(inertia: f64, radius_mm: f64, compensated: bool) -> (Excitation, Excitation) {
    let stroke = TURNS * TAU * radius_mm;
    let excitation = |signal, duration_ms| Excitation {
        signal,
        duration_ms,
        servo: programme::servo(inertia, radius_mm),
        travel: Millimetres(I16F16::from_num(2.0 * stroke)),
        compensated,
    };
    let signal = Signal::Triangle {
        stroke: Millimetres(I16F16::from_num(stroke)),
        speed: MillimetresPerSecond(I16F16::from_num(SPEED_MM_S)),
    };
    (excitation(signal, (2.0 * stroke / SPEED_MM_S * 1e3) as u32), excitation(Signal::Hold, HOLD_MS))
}

fn play(
    bench: &mut Bench,
    turns: &Excitation,
    hold: &Excitation,
) -> Result<(Vec<Sample>, Vec<Sample>), Failure> {
    Ok((played(bench, turns)?, played(bench, hold)?))
}

fn played(bench: &mut Bench, excitation: &Excitation) -> Result<Vec<Sample>, Failure> {
    bench.settle()?;
    let longest = Duration::from_millis(u64::from(excitation.duration_ms) + 5_000);
    match bench.play_within(excitation, longest)? {
        (samples, None) => Ok(samples),
        (_, Some(fault)) => Err(Failure::failed(format_args!(
            "{fault}; see that nothing holds the roller and compensate again"
        ))),
    }
}
