//! Trials of what was found: all of it, then without its parts, the most harmful first, until the
//! hand feels no phase more than before.

use super::angle::Angle;
use super::plan;
use super::residual_force::{self, ResidualForce};
use super::step::{CompensationStep, Part};
use super::turns::{excitations, play, seconds};
use crate::bench::DeviceDialogue;
use control_core::Device;
use control_core::compensation::Gain;
use device_sim::error::Error;

/// A phase counts as worse where it is felt by more than this beyond what it was: so far two runs
/// of the same device differ.
const REPEATS_N: f64 = 2e-3;
const REPEATS_SHARE: f64 = 0.05;

/// A device as it was tried, and what a hand would feel of it.
pub(super) struct Trial {
    device: Device,
    pub(super) residual: ResidualForce,
}

/// The device while parts are tried on it.
pub(super) struct Trials<'a, 'b, A> {
    pub(super) bench: &'a mut DeviceDialogue<'b>,
    pub(super) ask: &'a mut A,
    /// The inertia that was found, kg·m².
    pub(super) inertia: f64,
    /// The most motion of all of it, s.
    pub(super) motion_s: f64,
    /// True once the device has another part than before.
    pub(super) is_changed: &'a mut bool,
}

impl<A: AsyncFnMut(CompensationStep) -> Result<(), Error>> Trials<'_, '_, A> {
    /// Tries all that was found, and takes parts back, the most harmful first, until no phase is
    /// felt more than before. None where nothing is left.
    pub(super) async fn keep_what_helps(
        &mut self,
        full: &Device,
        before: &ResidualForce,
        angle: Option<Angle>,
    ) -> Result<(Option<Trial>, Vec<String>), Error> {
        let (turns, hold) = excitations(self.inertia, full.roller_radius.0.to_num(), true);
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
                if self.bench.played_s() + trial_s > self.motion_s {
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
        angle: Option<Angle>,
        step: CompensationStep,
    ) -> Result<Trial, Error> {
        (self.ask)(step).await?;
        self.bench.settle().await?;
        self.configure(device, angle).await?;
        let residual = self.residual_with(device).await?;
        Ok(Trial { device: *device, residual })
    }

    /// Plays the turns and the hold with what `device`, as which it is configured, feeds forward.
    pub(super) async fn residual_with(&mut self, device: &Device) -> Result<ResidualForce, Error> {
        let radius = device.roller_radius.0.to_num::<f64>();
        let (turns, hold) = excitations(self.inertia, radius, true);
        let fed = play(self.bench, &turns, &hold).await?;
        residual_force::measure(&plan(device)?, (&turns, &fed.0), (&hold, &fed.1))
    }

    async fn configure(&mut self, device: &Device, angle: Option<Angle>) -> Result<(), Error> {
        *self.is_changed = true;
        self.bench.configure(device).await?;
        match angle {
            Some(angle) => self.bench.index(angle.count).await,
            None => Ok(()),
        }
    }
}

/// A trial, unless the hand felt less with what the device fed forward before.
pub(super) fn unless_felt_more(
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
