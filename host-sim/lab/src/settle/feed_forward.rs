//! The use of what was settled: the device feeds it forward, a hand's force is measured before and
//! after, and what is not better is taken back.

use super::subject::Subject;
use super::{Progress, Settings};
use crate::compensate::residual_force::ResidualForce;
use crate::compensate::{self, CompensationOutcome, Wish, files};
use device_sim::error::Error;
use diagnosis::rig::Rig;

/// The force that the mechanism adds to a hand, before and after.
#[derive(Clone, Debug)]
pub struct Feel {
    /// With nothing fed forward.
    pub before: ResidualForce,
    /// With what it feeds forward.
    pub after: ResidualForce,
    /// The motion that it took to feed forward and to compare, s.
    pub motion_s: f64,
    /// The parts that were taken back or cannot be fed forward, a sentence each.
    pub notes: Vec<String>,
}

/// Feeds forward what `rig` has beyond its plain values, and writes the page and the device's part
/// next to `settle.html`; the roller has a radius of `radius_mm`. Returns a sentence with the
/// reason if nothing is fed forward.
///
/// # Errors
/// A sentence if it ends after the roller has moved, for whatever reason, or a file cannot be
/// written.
pub(super) fn apply(
    subject: &mut Subject,
    rig: &Rig,
    settings: &Settings,
    (radius_mm, wish): (f64, Wish),
    progress: &mut impl FnMut(Progress) -> Result<(), Error>,
) -> Result<Result<Feel, String>, Error> {
    let mut has_begun = false;
    let outcome = subject.talk(radius_mm, |line| {
        compensate::compensate(line, rig, wish, |step| {
            has_begun = true;
            progress(Progress::Feeds(step))
        })
    });
    let outcome = match outcome {
        Ok(outcome) => outcome,
        // Nobody has touched the device: this is only what it cannot feed forward.
        Err(why) if !has_begun => return Ok(Err(format!("nothing is fed forward: {why}"))),
        Err(why) => return Err(why),
    };
    files::write(&settings.out, &settings.device, &outcome)?;
    let was = outcome.as_it_was.as_ref().map(|was| {
        format!(
            "the device fed something forward before, with which the hand felt {:.1} mN rms",
            was.all() * 1e3
        )
    });
    let notes: Vec<String> =
        outcome.taken_back.iter().chain(&outcome.left_out).chain(&was).cloned().collect();
    if !outcome.is_compensated {
        return Ok(Err(format!("nothing is fed forward: {}", notes.join("; "))));
    }
    let CompensationOutcome { before, after, motion_s, .. } = outcome;
    Ok(Ok(Feel { before, after, motion_s, notes }))
}
