//! The tilt task: the sensor's inclination to the tick; a sensor that is broken, as a fault.

use super::shared;
use crate::board::BoardTilt;
use control_core::event::Fault;
use cortex_m::peripheral::DWT;
use firmware::supervision::Task;
use firmware::tilt::{Reading, TiltSource, TiltTrouble, TiltWatch};
use link::frames::Stage;

/// The tilt task's own state.
pub(crate) struct Tilt {
    source: BoardTilt,
    watch: TiltWatch,
    trouble: Option<TiltTrouble>,
}

impl Tilt {
    /// Reads `source`.
    pub(crate) fn new(source: BoardTilt) -> Self {
        Self { source, watch: TiltWatch::default(), trouble: None }
    }

    /// One reading.
    pub(crate) fn run(&mut self) {
        let entered = DWT::cycle_count();
        let reading = self.source.read();
        if let Reading::New(tilt) = reading {
            shared::set_tilt(tilt);
        }
        let trouble = self.watch.judge(reading).err();
        if trouble.is_some() && shared::POWERED.load(core::sync::atomic::Ordering::Relaxed) {
            shared::TRIPS.raise(Fault::Tilt);
        }
        if trouble != self.trouble {
            match trouble {
                Some(TiltTrouble::Absent) => defmt::error!("the tilt sensor does not answer"),
                Some(TiltTrouble::Stuck) => defmt::error!("the tilt sensor is stuck"),
                Some(TiltTrouble::Nonsense) => defmt::error!("the tilt sensor answers nonsense"),
                None => defmt::info!("the tilt sensor measures"),
            }
            self.trouble = trouble;
        }
        shared::REPORTS.alive(Task::Tilt);
        shared::STAGES.note(Stage::Tilt, DWT::cycle_count().wrapping_sub(entered));
    }
}
