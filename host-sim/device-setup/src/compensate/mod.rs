//! `compensate`: turns what a diagnosis found of a device's own forces into what the device feeds
//! forward, finds the rotor's angle, and shows what a hand would have felt before and feels after.
//! The needle is out; the same commands and bytes serve a real device and the virtual one.

pub mod angle;
pub mod coefficients;
pub mod residual_force;
pub mod step;
pub mod weight;

use crate::bench::{Act, Bench, Line};
use crate::servo::servo;
use coefficients::Found;
use control_core::compensation::Gain;
use control_core::controller::Sample;
use control_core::excitation::{Excitation, Signal};
use control_core::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres};
use control_core::{Device, Patient, Plan};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use fixed::types::I16F16;
use link::commissioning::Record;
use residual_force::ResidualForce;
use std::f64::consts::TAU;
use std::time::Duration;
pub use step::{CompensationStep, Part};

/// Speed of the slow turns, mm/s: a slow insertion.
const SPEED_MM_S: f64 = 10.0;
/// Turns of the roller each way.
const TURNS: f64 = 1.05;
/// The time for which the roller is held.
const HOLD_MS: u32 = 6_000;
/// The time that a person has to tilt the device, and the tilt of the virtual hand, rad.
const TILTING: Duration = Duration::from_secs(4);
const DOWN_RAD: f64 = 0.5;

/// A tilt that differs by less says too little of a weight, rad.
const LEAST_TILT_RAD: f64 = 0.15;
/// A phase counts as worse where it is felt by more than this beyond what it was: so far two runs
/// of the same device differ.
const REPEATS_N: f64 = 2e-3;
const REPEATS_SHARE: f64 = 0.05;

/// The result.
#[derive(Clone, Debug)]
pub struct CompensationOutcome {
    /// The device's part, as the device has it now, under its seal.
    pub record: Record,
    /// The rotor's angle, if any part depends on it.
    pub angle: Option<angle::Angle>,
    /// The force of the mechanism that a hand would feel without compensation.
    pub before: ResidualForce,
    /// The force that it felt before, with what the device fed forward; none where it fed nothing
    /// forward.
    pub as_it_was: Option<ResidualForce>,
    /// The force that it feels with what the device feeds forward now.
    pub after: ResidualForce,
    /// The weight that was measured because the report had none, in mN·m.
    pub weight_mnm: Option<f64>,
    /// The findings that cannot be fed forward, a sentence each.
    pub left_out: Vec<String>,
    /// The parts that were tried and undone because the hand would have felt more than before, a
    /// sentence each.
    pub taken_back: Vec<String>,
    /// False where everything was taken back: the device is configured as it was before.
    pub is_compensated: bool,
    /// The motion that all of it took, s.
    pub motion_s: f64,
}

impl CompensationOutcome {
    /// Returns the result, one line each.
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.weight_mnm.iter().map(|weight| format!("weight measured={weight:.3} mN·m")).collect();
        lines.extend(self.taken_back.iter().chain(&self.left_out).cloned());
        let (before, after) = (&self.before, &self.after);
        let rows = [
            ("insertion", before.insertion, after.insertion),
            ("hold", before.hold, after.hold),
            ("withdrawal", before.withdrawal, after.withdrawal),
            ("all", before.all(), after.all()),
        ];
        lines.extend(rows.map(|(what, before, after)| {
            format!("{what} before={:.1} after={:.1} mN rms", before * 1e3, after * 1e3)
        }));
        lines
    }

    /// Returns the reason why nothing is fed forward, where everything was taken back.
    pub fn refusal(&self) -> Option<Error> {
        (!self.is_compensated).then(|| {
            Error::failed(format_args!(
                "the device is as it was before: {}; characterise and diagnose again",
                self.taken_back.join("; ")
            ))
        })
    }
}

/// The wishes of whoever compensates.
#[derive(Clone, Copy, Debug)]
pub struct Wish {
    /// The gains, as a share of the most that is usual, 0 to 1.
    pub share: f64,
    /// The most motion of all of it, s.
    pub motion_s: f64,
}

impl Default for Wish {
    fn default() -> Self {
        Self { share: 1.0, motion_s: f64::INFINITY }
    }
}

/// Compensates the device behind `line` for what `rig` found; `ask` is called with each step before
/// it is done, and may end it. Afterwards a hand feels no phase more than before, and it feels less
/// over all phases together: a part that makes a phase worse is taken back. If it ends early, the
/// device gets back what it had before.
pub async fn compensate(
    line: &mut dyn Line,
    rig: &Rig,
    wish: Wish,
    mut ask: impl AsyncFnMut(CompensationStep) -> Result<(), Error>,
) -> Result<CompensationOutcome, Error> {
    let mut bench = Bench::open(line).await?;
    let device = bench.device().await?;
    if !device.commissioned {
        return Err(Error::failed("the device has not been commissioned; run host-sim commission first"));
    }
    let found = coefficients::found(rig, &device, wish.share)?;
    plan(&Device { compensation: found.compensation, ..device })?;
    let mut work = Work { bench: &mut bench, before: device, found, ask: &mut ask, wish, is_changed: false };
    let outcome = work.run().await;
    let is_changed = work.is_changed;
    match outcome {
        Ok(outcome) => Ok(outcome),
        Err(error) => match bench.restore(&device).await {
            Err(why) if is_changed => Err(Error::failed(format_args!(
                "{error}; the device may still feed forward what was being tried ({why}); compensate again"
            ))),
            _ => Err(error),
        },
    }
}

fn plan(device: &Device) -> Result<Plan, Error> {
    Plan::new(device, &Patient::nobody())
        .map_err(|why| Error::input(format_args!("the device would refuse this: {why}")))
}

/// The device while it is compensated.
struct Work<'a, 'b, A> {
    bench: &'a mut Bench<'b>,
    /// As it was.
    before: Device,
    found: Found,
    ask: &'a mut A,
    wish: Wish,
    /// True once the device has another part than before.
    is_changed: bool,
}

/// A device as it was tried, and what a hand would feel of it.
struct Trial {
    device: Device,
    residual: ResidualForce,
}

impl<A: AsyncFnMut(CompensationStep) -> Result<(), Error>> Work<'_, '_, A> {
    async fn run(&mut self) -> Result<CompensationOutcome, Error> {
        let radius = self.before.roller_radius.0.to_num::<f64>();
        let (turns, hold) = excitations(self.found.inertia, radius, false);
        let was_fed = Part::ALL.into_iter().any(|part| part.is_fed(&self.before.compensation));
        self.may_move(&turns, &hold, if was_fed { 3.0 } else { 2.0 })?;
        let level = if self.found.has_weight { None } else { Some(self.turn_level(&turns).await?) };
        (self.ask)(CompensationStep::Tilt).await?;
        self.bench.settle().await?;
        self.bench.watch(Act::Tilt(DOWN_RAD), TILTING, |_| false).await?;
        (self.ask)(CompensationStep::Before).await?;
        let bare = play(self.bench, &turns, &hold).await?;
        let weight_mnm = level.and_then(|level| self.take_weight(&level, &bare.0));
        let full = Device { compensation: self.found.compensation, ..self.before };
        let before = residual_force::measure(&plan(&full)?, (&turns, &bare.0), (&hold, &bare.1))?;
        let angle = if self.found.compensation.needs_angle() {
            Some(find_angle(&full, &self.found, &bare.0)?)
        } else {
            None
        };
        let device = self.before;
        let as_it_was = if was_fed { Some(self.residual_with(&device).await?) } else { None };
        let (kept, mut taken_back) = self.keep_what_helps(&full, &before, angle).await?;
        let kept = unless_felt_more(kept, as_it_was.as_ref(), &mut taken_back);
        let is_compensated = kept.is_some();
        if !is_compensated {
            self.bench.configure(&self.before).await?;
            let waves = |device: &Device| (device.compensation.angle, device.compensation.ripple);
            if self.before.compensation.needs_angle() && waves(&self.before) != waves(&full) {
                taken_back.push(
                    "its own waves stay off until the rotor's angle is found again: compensate --align"
                        .into(),
                );
            }
        }
        Ok(CompensationOutcome {
            record: self.bench.record().await?,
            angle,
            before,
            as_it_was,
            after: kept.map_or(as_it_was.unwrap_or(before), |kept| kept.residual),
            weight_mnm,
            left_out: std::mem::take(&mut self.found.left_out),
            taken_back,
            is_compensated,
            motion_s: self.bench.played_s(),
        })
    }

    /// Refuses what would take more motion than is allowed, if the turns and the hold are played
    /// `times` times.
    fn may_move(&self, turns: &Excitation, hold: &Excitation, times: f64) -> Result<(), Error> {
        let level = if self.found.has_weight { 0.0 } else { seconds(turns) };
        let needed = level + times * (seconds(turns) + seconds(hold));
        if needed <= self.wish.motion_s {
            return Ok(());
        }
        Err(Error::failed(format_args!(
            "turns of this roller before and after take {needed:.0} s of motion, and {:.0} s are allowed; run host-sim compensate with the report, which has no limit of motion",
            self.wish.motion_s.max(0.0)
        )))
    }

    /// The slow turns with the device level.
    async fn turn_level(&mut self, turns: &Excitation) -> Result<Vec<Sample>, Error> {
        (self.ask)(CompensationStep::Level).await?;
        self.bench.settle().await?;
        self.bench.watch(Act::Tilt(0.0), TILTING, |_| false).await?;
        (self.ask)(CompensationStep::Weight).await?;
        played(self.bench, turns).await
    }

    /// Takes the weight over that the same turns show, level and tilted; says so where they cannot
    /// show it.
    fn take_weight(&mut self, level: &[Sample], tilted: &[Sample]) -> Option<f64> {
        match weight::find(level, tilted, &self.before) {
            Ok(weight_mnm) => {
                self.found.compensation.weight = MillinewtonMetres(I16F16::saturating_from_num(weight_mnm));
                Some(weight_mnm)
            }
            Err(why) => {
                self.found.left_out.push(why);
                None
            }
        }
    }

    /// Tries all that was found, and takes parts back, the most harmful first, until no phase is
    /// felt more than before. None where nothing is left.
    async fn keep_what_helps(
        &mut self,
        full: &Device,
        before: &ResidualForce,
        angle: Option<angle::Angle>,
    ) -> Result<(Option<Trial>, Vec<String>), Error> {
        let (turns, hold) = excitations(self.found.inertia, full.roller_radius.0.to_num(), true);
        let trial_s = seconds(&turns) + seconds(&hold);
        let mut taken_back = Vec::new();
        let mut kept = self.try_it(full, angle, CompensationStep::After).await?;
        while excess(before, &kept.residual) > 0.0 {
            let mut best: Option<(Part, Trial)> = None;
            let fed = |device: &Device| Part::ALL.map(|part| (part, part.is_fed(&device.compensation)));
            let parts: Vec<Part> =
                fed(&kept.device).into_iter().filter(|(_, is_fed)| *is_fed).map(|(part, _)| part).collect();
            // Without its last part it is the device as it was.
            for part in parts.iter().copied().filter(|_| parts.len() > 1) {
                if self.bench.played_s() + trial_s > self.wish.motion_s {
                    taken_back.push("the motion allowed does not suffice to try without each part".into());
                    break;
                }
                let mut device = kept.device;
                *part.gain(&mut device.compensation.gains) = Gain(0);
                let trial = self.try_it(&device, angle, CompensationStep::Without(part)).await?;
                let order = |residual: &ResidualForce| (excess(before, residual), residual.all());
                if best.as_ref().is_none_or(|(_, other)| order(&trial.residual) < order(&other.residual)) {
                    best = Some((part, trial));
                }
            }
            let Some((part, trial)) = best else {
                taken_back.extend(parts.into_iter().map(|part| said(part, before, &kept.residual)));
                return Ok((None, taken_back));
            };
            taken_back.push(said(part, before, &kept.residual));
            kept = trial;
        }
        if kept.residual.all() >= before.all() {
            taken_back.push(format!(
                "all of it was taken back: with it the hand felt {:.1} mN rms, {:.1} before",
                kept.residual.all() * 1e3,
                before.all() * 1e3
            ));
            return Ok((None, taken_back));
        }
        // The last one tried need not be the one that is kept.
        self.configure(&kept.device, angle).await?;
        Ok((Some(kept), taken_back))
    }

    async fn try_it(
        &mut self,
        device: &Device,
        angle: Option<angle::Angle>,
        step: CompensationStep,
    ) -> Result<Trial, Error> {
        (self.ask)(step).await?;
        self.bench.settle().await?;
        self.configure(device, angle).await?;
        let residual = self.residual_with(device).await?;
        Ok(Trial { device: *device, residual })
    }

    /// Plays the turns and the hold with what `device`, as which it is configured, feeds forward.
    async fn residual_with(&mut self, device: &Device) -> Result<ResidualForce, Error> {
        let radius = device.roller_radius.0.to_num::<f64>();
        let (turns, hold) = excitations(self.found.inertia, radius, true);
        let fed = play(self.bench, &turns, &hold).await?;
        residual_force::measure(&plan(device)?, (&turns, &fed.0), (&hold, &fed.1))
    }

    async fn configure(&mut self, device: &Device, angle: Option<angle::Angle>) -> Result<(), Error> {
        self.is_changed = true;
        self.bench.configure(device).await?;
        match angle {
            Some(angle) => self.bench.index(angle.count).await,
            None => Ok(()),
        }
    }
}

/// A trial, unless the hand felt less with what the device fed forward before.
fn unless_felt_more(
    trial: Option<Trial>,
    as_it_was: Option<&ResidualForce>,
    taken_back: &mut Vec<String>,
) -> Option<Trial> {
    let (Some(residual), Some(was)) = (trial.as_ref().map(|trial| trial.residual.all()), as_it_was) else {
        return trial;
    };
    if residual < was.all() {
        return trial;
    }
    taken_back.push(format!(
        "all of it was taken back: with it the hand felt {:.1} mN rms, and {:.1} with what the device fed forward before",
        residual * 1e3,
        was.all() * 1e3
    ));
    None
}

/// By how much the phases that are felt more than before are so, beyond what two runs differ, in N.
fn excess(before: &ResidualForce, after: &ResidualForce) -> f64 {
    let phases = before.phases().into_iter().zip(after.phases());
    phases.map(|((_, was), (_, is))| (is - was - f64::max(REPEATS_N, REPEATS_SHARE * was)).max(0.0)).sum()
}

/// Returns the reason why a part was undone, in a sentence.
fn said(part: Part, before: &ResidualForce, after: &ResidualForce) -> String {
    let phases = before.phases().into_iter().zip(after.phases());
    let worst = phases.max_by(|a, b| (a.1.1 - a.0.1).total_cmp(&(b.1.1 - b.0.1)));
    worst.map_or_else(String::new, |((name, was), (_, is))| {
        format!(
            "{part} was taken back: with it the {name} was felt with {:.0} mN rms, {:.0} before",
            is * 1e3,
            was * 1e3
        )
    })
}

/// Finds the rotor's angle again on a device that was compensated and then restarted.
pub async fn align(line: &mut dyn Line, rig: &Rig) -> Result<angle::Angle, Error> {
    let mut bench = Bench::open(line).await?;
    let device = bench.device().await?;
    let found = coefficients::found(rig, &device, 1.0)?;
    if !device.compensation.needs_angle() {
        return Err(Error::failed("nothing that this device feeds forward depends on the rotor's angle"));
    }
    let (turns, _) = excitations(found.inertia, device.roller_radius.0.to_num(), false);
    let samples = played(&mut bench, &turns).await?;
    let angle = find_angle(&device, &found, &samples)?;
    bench.index(angle.count).await?;
    Ok(angle)
}

fn find_angle(device: &Device, found: &Found, samples: &[Sample]) -> Result<angle::Angle, Error> {
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
        servo: servo(inertia, radius_mm),
        travel: Millimetres(I16F16::from_num(2.0 * stroke)),
        compensated,
    };
    let signal = Signal::Triangle {
        stroke: Millimetres(I16F16::from_num(stroke)),
        speed: MillimetresPerSecond(I16F16::from_num(SPEED_MM_S)),
    };
    (excitation(signal, (2.0 * stroke / SPEED_MM_S * 1e3) as u32), excitation(Signal::Hold, HOLD_MS))
}

fn seconds(excitation: &Excitation) -> f64 {
    f64::from(excitation.duration_ms) * 1e-3
}

async fn play(
    bench: &mut Bench<'_>,
    turns: &Excitation,
    hold: &Excitation,
) -> Result<(Vec<Sample>, Vec<Sample>), Error> {
    Ok((played(bench, turns).await?, played(bench, hold).await?))
}

async fn played(bench: &mut Bench<'_>, excitation: &Excitation) -> Result<Vec<Sample>, Error> {
    bench.settle().await?;
    let longest = Duration::from_millis(u64::from(excitation.duration_ms) + 5_000);
    match bench.play_within(excitation, longest).await? {
        (samples, None) => Ok(samples),
        (_, Some(fault)) => Err(Error::failed(format_args!(
            "{fault}; see that nothing holds the roller and compensate again"
        ))),
    }
}
