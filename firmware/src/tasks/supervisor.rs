//! The supervisor: sets off the tasks that run by the clock, feeds the watchdog only while
//! everybody reports, and decides what a debugger may stop.

use super::shared::Shared;
use crate::log;
use crate::monitor::{DriveMonitor, DriveRequest};
use crate::port::{Board, ReadDrive, SupplyLevel, Watchdog};
use crate::reset::{Crash, CrashKind};
use crate::supervision::Supervisor;
use crate::timing::{SUPERVISOR_HZ, TILT_PERIOD_MS};
use crate::wire_check::WireWatch;
use control_core::config::Sensors;
use control_core::event::Fault;
use control_core::interlock::Interlock;
use core::sync::atomic::Ordering::Relaxed;
use link::frames::Stage;

const _: () = assert!(SUPERVISOR_HZ == 1_000, "what follows counts its runs as milliseconds");

/// The supervisor's own state.
pub struct Watch<B: Board> {
    shared: &'static Shared,
    watchdog: B::Watchdog,
    supply: B::Supply,
    encoder: (B::EncoderLines, WireWatch),
    drive: (B::DriveLines, DriveMonitor),
    supervisor: Supervisor,
    ms: u32,
    said: bool,
}

impl<B: Board> Watch<B> {
    /// Feeds `watchdog`, which runs already.
    pub fn new(
        shared: &'static Shared,
        watchdog: B::Watchdog,
        supply: B::Supply,
        encoder: B::EncoderLines,
        drive: B::DriveLines,
    ) -> Self {
        let (encoder, drive) = ((encoder, WireWatch::new()), (drive, DriveMonitor::new()));
        Self { shared, watchdog, supply, encoder, drive, supervisor: Supervisor::new(), ms: 0, said: false }
    }

    /// A cause that keeps the device from being started ends a run too.
    fn look_at_conditions(&mut self) {
        self.shared.conditions.set(Interlock::Supply, self.supply.is_low());
        let (lines, watch) = &mut self.encoder;
        let wires = watch.look(lines, self.shared.count());
        self.shared.conditions.set(Interlock::EncoderWire, wires.off);
        self.shared.lines_agree.store(wires.agree, Relaxed);
        let (lines, monitor) = &mut self.drive;
        let powered = self.shared.is_powered();
        let readings = lines.read();
        self.shared
            .set_fitted(Sensors { encoder_supply: wires.supply_sensed, current: readings.current.is_some() });
        let verdict = monitor.look(&readings, DriveRequest { powered, code: self.shared.given() });
        for (interlock, is_on) in verdict.conditions() {
            self.shared.conditions.set(interlock, is_on);
        }
        if powered && let Some(fault) = verdict.fault {
            self.shared.trips.raise(fault);
        }
        if powered
            && let Some(interlock) = self.shared.conditions.get().first()
            && interlock != Interlock::Saving
        {
            self.shared.trips.raise(interlock.fault());
        }
    }

    /// One millisecond.
    pub fn run(&mut self) {
        let entered = B::cycles();
        self.ms = self.ms.wrapping_add(1);
        self.shared.supervised_ms.store(self.ms, Relaxed);
        self.look_at_conditions();
        match self.supervisor.look(&self.shared.reports) {
            Ok(()) => self.watchdog.feed(),
            Err(task) => {
                // Torque goes with the next tick, the device follows when the watchdog ends.
                self.shared.trips.raise(Fault::Watchdog);
                self.shared.last_words.crash(&Crash::new(CrashKind::HungTask, task as u32));
                if !self.said {
                    self.said = true;
                    log::error!("task {} hangs", task as u8);
                }
            }
        }
        // A debugger that halts the core stops the watchdog too, except while torque is on: then
        // the watchdog ends the halt, and with it the torque, within its time.
        self.watchdog.stop_on_debug(!self.shared.is_powered());
        B::wake_usb();
        B::wake_telemetry();
        if self.ms.is_multiple_of(TILT_PERIOD_MS) {
            B::wake_tilt();
        }
        self.shared.stages.note(Stage::Supervisor, B::cycles().wrapping_sub(entered));
    }
}
