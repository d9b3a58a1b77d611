//! The tilt task: the sensor's inclination to the tick; a sensor that is broken, as a fault.

use super::shared::Shared;
use crate::log;
use crate::port::Board;
use crate::supervision::Task;
use crate::tilt::{Reading, TiltSource, TiltTrouble, TiltWatch};
use control_core::event::Fault;
use link::frames::Stage;

/// The tilt task's own state.
pub struct Tilt<B: Board> {
    shared: &'static Shared,
    source: B::Tilt,
    watch: TiltWatch,
    trouble: Option<TiltTrouble>,
}

impl<B: Board> Tilt<B> {
    /// Reads `source`.
    pub fn new(shared: &'static Shared, source: B::Tilt) -> Self {
        Self { shared, source, watch: TiltWatch::default(), trouble: None }
    }

    /// One reading.
    pub fn run(&mut self) {
        let entered = B::cycles();
        let reading = self.source.read();
        if let Reading::New(tilt) = reading {
            self.shared.set_tilt(tilt);
        }
        let trouble = self.watch.judge(reading).err();
        if trouble.is_some() && self.shared.is_powered() {
            self.shared.trips.raise(Fault::Tilt);
        }
        if trouble != self.trouble {
            match trouble {
                Some(TiltTrouble::Absent) => log::error!("the tilt sensor does not answer"),
                Some(TiltTrouble::Stuck) => log::error!("the tilt sensor is stuck"),
                Some(TiltTrouble::Nonsense) => log::error!("the tilt sensor answers nonsense"),
                None => log::info!("the tilt sensor measures"),
            }
            self.trouble = trouble;
        }
        self.shared.reports.alive(Task::Tilt);
        self.shared.stages.note(Stage::Tilt, B::cycles().wrapping_sub(entered));
    }
}
