//! The tilt task: the sensor's inclination to the tick; a sensor that does not measure, as an
//! interlock, which ends a run too ([`super::supervisor`]).

use super::shared::Shared;
use crate::log;
use crate::port::Board;
use crate::supervision::Task;
use crate::tilt::{Reading, TiltError, TiltSource, TiltWatch};
use control_core::interlock::Interlock;
use link::frames::Stage;

/// The tilt task's own state.
pub struct Tilt<B: Board> {
    shared: &'static Shared,
    source: B::Tilt,
    watch: TiltWatch,
    error: Option<TiltError>,
}

impl<B: Board> Tilt<B> {
    /// Reads `source`; until it has measured, the device does not start.
    pub fn new(shared: &'static Shared, source: B::Tilt) -> Self {
        shared.conditions.set(Interlock::TiltSensor, true);
        Self { shared, source, watch: TiltWatch::default(), error: None }
    }

    /// One reading.
    pub fn run(&mut self) {
        let entered = B::cycles();
        let reading = self.source.read();
        if let Reading::New(tilt) = reading {
            self.shared.set_tilt(tilt);
            self.shared.conditions.set(Interlock::TiltSensor, false);
        }
        let error = self.watch.judge(reading).err();
        if error.is_some() {
            self.shared.conditions.set(Interlock::TiltSensor, true);
        }
        if error != self.error {
            match error {
                Some(TiltError::Absent) => log::error!("the tilt sensor does not answer"),
                Some(TiltError::Stuck) => log::error!("the tilt sensor is stuck"),
                Some(TiltError::Nonsense) => log::error!("the tilt sensor answers nonsense"),
                None => log::info!("the tilt sensor measures"),
            }
            self.error = error;
        }
        self.shared.reports.alive(Task::Tilt);
        self.shared.stages.note(Stage::Tilt, B::cycles().wrapping_sub(entered));
    }
}
