//! `compensate`: turns what a diagnosis found of a device's own forces into what the device feeds
//! forward, finds the rotor's angle, and shows what a hand would have felt before and feels after.
//! The needle is out; the same commands and bytes serve a real device and the virtual one.

pub mod angle;
pub mod coefficients;
mod outcome;
pub mod residual_force;
pub mod step;
mod trials;
mod turns;
pub mod weight;

use crate::bench::{Act, DeviceDialogue, Line};
use coefficients::Found;
use control_core::controller::Sample;
use control_core::excitation::Excitation;
use control_core::units::MillinewtonMetres;
use control_core::{Device, Patient, Plan};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use fixed::types::I16F16;
pub use outcome::CompensationOutcome;
use std::time::Duration;
pub use step::{CompensationStep, Part};
use trials::{Trials, unless_felt_more};
use turns::{excitations, play, played, seconds};

/// The time that a person has to tilt the device, and the tilt of the virtual hand, rad.
const TILTING: Duration = Duration::from_secs(4);
const DOWN_RAD: f64 = 0.5;

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
    let mut bench = DeviceDialogue::open(line).await?;
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
    bench: &'a mut DeviceDialogue<'b>,
    /// As it was.
    before: Device,
    found: Found,
    ask: &'a mut A,
    wish: Wish,
    /// True once the device has another part than before.
    is_changed: bool,
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
        let mut trials = Trials {
            bench: self.bench,
            ask: self.ask,
            inertia: self.found.inertia,
            motion_s: self.wish.motion_s,
            is_changed: &mut self.is_changed,
        };
        let as_it_was = if was_fed { Some(trials.residual_with(&self.before).await?) } else { None };
        let (kept, mut taken_back) = trials.keep_what_helps(&full, &before, angle).await?;
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
}

/// Finds the rotor's angle again on a device that was compensated and then restarted.
pub async fn align(line: &mut dyn Line, rig: &Rig) -> Result<angle::Angle, Error> {
    let mut bench = DeviceDialogue::open(line).await?;
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
