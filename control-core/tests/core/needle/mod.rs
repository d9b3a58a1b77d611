//! A needle that a test moves through the core, tick by tick.

use control_core::units::{Counts, Milliradians};
use control_core::{Config, Controller, Order, TickInput, TickOutput};

/// The position of a new needle: counts, and as mm along the needle at the default roller's 15.7 µm
/// a count.
const BEGINS_COUNTS: i32 = -60;
const BEGINS_MM: f64 = -0.94;

/// A needle at a place along it in mm and a tilt.
pub(crate) struct Needle {
    pub(crate) core: Controller,
    pub(crate) at_mm: f64,
    pub(crate) tilt: Milliradians,
}

impl Needle {
    /// Outside, started.
    pub(crate) fn new(config: &Config, tilt: Milliradians) -> Self {
        let mut core = Controller::new(config.plan().expect("it is sound"));
        core.tick(TickInput { count: Counts(BEGINS_COUNTS), tilt });
        core.order(Order::Start);
        Self { core, at_mm: BEGINS_MM, tilt }
    }

    /// One tick where it is.
    pub(crate) fn tick(&mut self) -> TickOutput {
        let per_count = self.core.plan().mm_per_count().to_num::<f64>();
        self.core.order(Order::Heartbeat);
        self.core.tick(TickInput { count: Counts((self.at_mm / per_count).round() as i32), tilt: self.tilt })
    }

    /// Goes to `mm` at a constant speed.
    pub(crate) fn go(&mut self, mm: f64, mm_per_s: f64, mut see: impl FnMut(&TickOutput)) {
        let step = mm_per_s / 1e4 * (mm - self.at_mm).signum();
        while (mm - self.at_mm).abs() > step.abs() {
            self.at_mm += step;
            see(&self.tick());
        }
    }

    /// Stays where it is; the last tick.
    pub(crate) fn rest(&mut self, seconds: f64) -> TickOutput {
        (0..(seconds * 1e4) as usize).map(|_| self.tick()).last().expect("a tick")
    }
}

/// The law's force in N.
pub(crate) fn force(out: &TickOutput) -> f64 {
    out.force.0.to_num()
}
