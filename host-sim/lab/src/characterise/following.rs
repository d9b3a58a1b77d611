//! The reference that the device follows, played along on the PC so that it can be written down.

use super::programme::ProgrammeStep;
use control_core::TICK_HZ;
use control_core::excitation::Reference;

/// The reference of steps that play without a rest between them.
pub(super) struct Following<'a> {
    steps: &'a [ProgrammeStep],
    reference: Reference,
    /// The place at which the reference of this step began, in counts.
    begin: f64,
    remaining_ticks: u32,
    mm_per_count: f64,
}

impl<'a> Following<'a> {
    /// From the place in counts at which the motor was one tick before; none if there is no step.
    pub(super) fn new(steps: &'a [ProgrammeStep], begin: f64, mm_per_count: f64) -> Option<Self> {
        let first = steps.first()?;
        let (reference, remaining_ticks) = begun(first);
        Some(Self { steps, reference, begin, remaining_ticks, mm_per_count })
    }

    /// The reference in counts at the next tick, in which the motor is at `count`.
    pub(super) fn tick(&mut self, count: i32) -> f64 {
        if self.remaining_ticks == 0
            && let [ended, rest @ ..] = self.steps
            && let Some(next) = rest.first()
        {
            // As the device does: from where the reference is, or from where the motor is if no
            // servo held it there.
            self.begin =
                if ended.excitation.servo.stiffness.0 == 0 { f64::from(count) } else { self.place() };
            self.steps = rest;
            (self.reference, self.remaining_ticks) = begun(next);
        }
        self.remaining_ticks = self.remaining_ticks.saturating_sub(1);
        self.reference.tick();
        self.place()
    }

    fn place(&self) -> f64 {
        self.begin + self.reference.position().0.to_num::<f64>() / self.mm_per_count
    }
}

fn begun(step: &ProgrammeStep) -> (Reference, u32) {
    let ticks = step.excitation.duration_ms.saturating_mul(TICK_HZ / 1000);
    (Reference::new(&step.excitation.signal), ticks)
}
