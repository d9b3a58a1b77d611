//! The totals of a run: samples, punctures, the largest force. It counts exactly the requested
//! number of samples.

use crate::messages::Hello;
use control_core::controller::Sample;
use link::frames::{Event, EventKind};

/// Totals of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunStats {
    /// Samples taken.
    pub samples: u64,
    /// Walls that gave way.
    pub punctures: u64,
    /// Vessel walls among them.
    pub vessels: u64,
    /// Faults that latched.
    pub faults: u64,
    /// Largest magnitude of the force that was commanded of the motor, N.
    pub peak_force_n: f64,
    scale: Option<Hello>,
    limit: Option<u64>,
}

impl RunStats {
    /// Takes at most `limit` samples.
    pub fn new(limit: Option<u64>) -> Self {
        Self { limit, ..Self::default() }
    }

    /// Sets the scale of the device that sends from now on.
    pub fn hello(&mut self, hello: Hello) {
        self.scale = Some(hello);
    }

    /// Takes samples; those of them that still count.
    pub fn samples<'a>(&mut self, samples: &'a [Sample]) -> &'a [Sample] {
        let room = self.limit.map_or(u64::MAX, |limit| limit - self.samples);
        let taken = &samples[..samples.len().min(usize::try_from(room).unwrap_or(usize::MAX))];
        self.samples += taken.len() as u64;
        if let Some(scale) = &self.scale {
            let largest = taken.iter().map(|s| scale.force_n(s.dac).abs()).fold(0.0, f64::max);
            self.peak_force_n = self.peak_force_n.max(largest);
        }
        taken
    }

    /// Takes an event.
    pub fn event(&mut self, event: &Event) {
        match event.kind {
            EventKind::Puncture { .. } => self.punctures += 1,
            EventKind::Vessel { .. } => self.vessels += 1,
            EventKind::Fault { .. } => self.faults += 1,
            _ => {}
        }
    }

    /// True if all requested samples have been taken.
    pub fn is_full(&self) -> bool {
        self.limit.is_some_and(|limit| self.samples >= limit)
    }
}
