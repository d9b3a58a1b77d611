//! The supervisor: sets off the tasks that run by the clock, feeds the watchdog only while everybody reports, and decides
//! what a debugger may stop.

use super::shared;
use super::supply::SupplyLevel;
use crate::board::{DriveLines, EncoderLines};
use control_core::event::Fault;
use control_core::interlock::Interlock;
use core::sync::atomic::Ordering::Relaxed;
use cortex_m::peripheral::DWT;
use firmware::lines::WireWatch;
use firmware::monitor::{Asked, DriveMonitor};
use firmware::reset::{Crash, CrashKind};
use firmware::supervision::Supervisor;
use firmware::timing::{SUPERVISOR_HZ, TILT_PERIOD_MS};
use link::frames::Stage;
use stm32f4xx_hal::pac::{DBGMCU, Interrupt};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

const _: () = assert!(SUPERVISOR_HZ == 1_000, "what follows counts its runs as milliseconds");

/// The supervisor's own state.
pub(crate) struct Watch {
    watchdog: IndependentWatchdog,
    debug: DBGMCU,
    supply: SupplyLevel,
    encoder: (EncoderLines, WireWatch),
    drive: (DriveLines, DriveMonitor),
    supervisor: Supervisor,
    ms: u32,
    said: bool,
}

impl Watch {
    /// Feeds `watchdog`, which runs already.
    pub(crate) fn new(
        watchdog: IndependentWatchdog,
        debug: DBGMCU,
        supply: SupplyLevel,
        encoder: EncoderLines,
        drive: DriveLines,
    ) -> Self {
        let (encoder, drive) = ((encoder, WireWatch::new()), (drive, DriveMonitor::new()));
        Self { watchdog, debug, supply, encoder, drive, supervisor: Supervisor::new(), ms: 0, said: false }
    }

    /// What keeps the device from being started ends a run too.
    fn look_at_conditions(&mut self) {
        self.supply.look();
        let (lines, watch) = &mut self.encoder;
        shared::CONDITIONS.set(Interlock::EncoderWire, watch.look(lines));
        let (lines, monitor) = &mut self.drive;
        let powered = shared::POWERED.load(Relaxed);
        let verdict = monitor.look(&lines.read(), Asked { powered, code: shared::given() });
        for (interlock, is_on) in verdict.conditions() {
            shared::CONDITIONS.set(interlock, is_on);
        }
        if powered && let Some(fault) = verdict.fault {
            shared::TRIPS.raise(fault);
        }
        if powered
            && let Some(interlock) = shared::CONDITIONS.get().first()
            && interlock != Interlock::Saving
        {
            shared::TRIPS.raise(interlock.fault());
        }
    }

    /// One millisecond.
    pub(crate) fn run(&mut self) {
        let entered = DWT::cycle_count();
        self.ms = self.ms.wrapping_add(1);
        shared::SUPERVISED_MS.store(self.ms, Relaxed);
        self.look_at_conditions();
        match self.supervisor.look(&shared::REPORTS) {
            Ok(()) => self.watchdog.feed(),
            Err(task) => {
                // Torque goes with the next tick, the device follows when the watchdog ends.
                shared::TRIPS.raise(Fault::Watchdog);
                shared::LAST_WORDS.crash(Crash { kind: CrashKind::HungTask, detail: task as u32 });
                if !self.said {
                    self.said = true;
                    defmt::error!("task {} hangs", task as u8);
                }
            }
        }
        // A debugger that halts the core stops the watchdog too, except while torque is on: then the watchdog ends the
        // halt, and with it the torque, within its time.
        self.watchdog.stop_on_debug(&self.debug, !shared::POWERED.load(Relaxed));
        rtic::pend(Interrupt::OTG_FS);
        rtic::pend(Interrupt::USART2);
        if self.ms.is_multiple_of(TILT_PERIOD_MS) {
            rtic::pend(Interrupt::USART3);
        }
        shared::STAGES.note(Stage::Supervisor, DWT::cycle_count().wrapping_sub(entered));
    }
}
