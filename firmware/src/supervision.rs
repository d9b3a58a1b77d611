//! Who has to report before the watchdog is fed, and what is wrong when one does not. One missing
//! task is enough: a device that half works does not hold torque.

use crate::timing;
use control_core::event::Fault;
use control_core::interlock::{Interlock, Interlocks};
use core::sync::atomic::{AtomicU16, AtomicU32, Ordering::Relaxed};

/// A task that reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Task {
    /// The control tick.
    Tick = 0,
    /// USB.
    Usb = 1,
    /// Telemetry.
    Telemetry = 2,
    /// Tilt.
    Tilt = 3,
}

impl Task {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Tick, Self::Usb, Self::Telemetry, Self::Tilt];

    /// Returns the milliseconds for which it may be silent.
    pub(crate) const fn allowance_ms(self) -> u32 {
        match self {
            Task::Tick => timing::TICK_SILENCE_MS,
            Task::Usb | Task::Telemetry => timing::TASK_SILENCE_MS,
            Task::Tilt => timing::TILT_SILENCE_MS,
        }
    }
}

/// The reports of the tasks: a bit each, set by the task, taken by the supervisor.
#[derive(Default)]
pub struct Reports(AtomicU32);

impl Reports {
    /// Nobody has reported.
    pub const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// `task` is alive.
    pub fn alive(&self, task: Task) {
        let bit = 1 << task as u32;
        // Mostly set already: the tick reports ten times between two looks.
        if self.0.load(Relaxed) & bit == 0 {
            self.0.fetch_or(bit, Relaxed);
        }
    }

    fn take(&self) -> u32 {
        self.0.swap(0, Relaxed)
    }
}

/// Looks at the reports every millisecond.
#[derive(Default)]
pub struct Supervisor {
    silent_ms: [u32; Task::ALL.len()],
    hung: Option<Task>,
}

impl Supervisor {
    /// Everybody counts as just having reported.
    pub const fn new() -> Self {
        Self { silent_ms: [0; Task::ALL.len()], hung: None }
    }

    /// A millisecond has passed: the watchdog may be fed, or the task that hangs. Once one has
    /// hung, the watchdog is never fed again: whatever else that task has left undone, only a reset
    /// puts right.
    pub fn look(&mut self, reports: &Reports) -> Result<(), Task> {
        let reported = reports.take();
        for (task, silent) in Task::ALL.into_iter().zip(&mut self.silent_ms) {
            *silent = if reported & (1 << task as u32) != 0 { 0 } else { silent.saturating_add(1) };
            if *silent > task.allowance_ms() && self.hung.is_none() {
                self.hung = Some(task);
            }
        }
        self.hung.map_or(Ok(()), Err)
    }
}

/// Faults and stops on their way from the tasks below to the tick, which takes torque away: a bit
/// for each fault, and one for a stop.
#[derive(Default)]
pub struct Trips(AtomicU32);

/// The bit of a stop.
const STOP: u32 = 1 << 31;
const _: () = assert!(Fault::ALL.len() <= 31, "a bit each");

impl Trips {
    /// None.
    pub const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Asks the tick to take torque away.
    pub fn raise(&self, fault: Fault) {
        self.0.fetch_or(1 << fault as u16, Relaxed);
    }

    /// Asks the tick to stop.
    pub fn raise_stop(&self) {
        self.0.fetch_or(STOP, Relaxed);
    }

    /// True if nothing waits; cheap, for the tick.
    pub fn is_empty(&self) -> bool {
        self.0.load(Relaxed) == 0
    }

    /// Takes the stop; true if there was one.
    pub fn take_stop(&self) -> bool {
        self.0.fetch_and(!STOP, Relaxed) & STOP != 0
    }

    /// Takes the fault with the lowest number; the others of the same moment follow from it and are
    /// forgotten.
    pub fn take(&self) -> Option<Fault> {
        let raised = self.0.fetch_and(STOP, Relaxed);
        Fault::ALL.get(raised.trailing_zeros() as usize).copied()
    }
}

/// The conditions under which no torque is given, as the tasks that see them say; read by the tick
/// and by telemetry.
#[derive(Default)]
pub struct Conditions(AtomicU16);

impl Conditions {
    /// None.
    pub const fn new() -> Self {
        Self(AtomicU16::new(0))
    }

    /// `interlock` is on or off from now on.
    pub fn set(&self, interlock: Interlock, is_on: bool) {
        let bit = Interlocks::of(interlock).0;
        match (self.0.load(Relaxed) & bit != 0, is_on) {
            (false, true) => drop(self.0.fetch_or(bit, Relaxed)),
            (true, false) => drop(self.0.fetch_and(!bit, Relaxed)),
            _ => {}
        }
    }

    /// All that are on.
    pub fn get(&self) -> Interlocks {
        Interlocks(self.0.load(Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report_all_but(reports: &Reports, silent: Option<Task>) {
        Task::ALL.into_iter().filter(|&task| Some(task) != silent).for_each(|task| reports.alive(task));
    }

    #[test]
    fn feeds_only_while_every_task_reports() {
        for silent in Task::ALL {
            let (reports, mut supervisor) = (Reports::new(), Supervisor::new());
            for _ in 0..1000 {
                report_all_but(&reports, None);
                assert_eq!(supervisor.look(&reports), Ok(()));
            }
            for _ in 0..silent.allowance_ms() {
                report_all_but(&reports, Some(silent));
                assert_eq!(supervisor.look(&reports), Ok(()), "{silent:?}");
            }
            report_all_but(&reports, Some(silent));
            assert_eq!(supervisor.look(&reports), Err(silent));
            // A late report does not make up for it.
            report_all_but(&reports, None);
            assert_eq!(supervisor.look(&reports), Err(silent));
        }
    }

    #[test]
    fn each_task_may_be_silent_for_its_own_time() {
        assert_eq!(Task::ALL.map(Task::allowance_ms), [2, 5, 5, 11]);
    }

    #[test]
    fn every_fault_arrives_as_itself() {
        for fault in Fault::ALL {
            let trips = Trips::new();
            assert!(trips.is_empty());
            trips.raise(fault);
            assert!(!trips.is_empty());
            assert_eq!(trips.take(), Some(fault));
            assert!(trips.is_empty());
            assert_eq!(trips.take(), None);
        }
    }

    #[test]
    fn a_condition_lasts_until_it_is_taken_back() {
        let conditions = Conditions::new();
        assert_eq!(conditions.get().first(), None);
        for _ in 0..2 {
            conditions.set(Interlock::EncoderWire, true);
            conditions.set(Interlock::Supply, true);
        }
        assert_eq!(conditions.get().first(), Some(Interlock::Supply));
        conditions.set(Interlock::Supply, false);
        assert_eq!(conditions.get().first(), Some(Interlock::EncoderWire));
        conditions.set(Interlock::EncoderWire, false);
        assert_eq!(conditions.get().first(), None);
    }

    #[test]
    fn of_two_faults_one_is_reported() {
        let trips = Trips::new();
        trips.raise(Fault::Watchdog);
        trips.raise(Fault::Tilt);
        assert_eq!(trips.take(), Some(Fault::Tilt));
        assert_eq!(trips.take(), None);
    }
}
