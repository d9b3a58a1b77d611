//! Ways to a device for commissioning and compensation: a serial port, with or without a guide that
//! shows what comes in.

pub use device_setup::bench::{Act, Line};

use control_core::controller::Sample;
use device_sim::device::Wire;
use device_sim::error::Error;
use link::crash::Crash;
use server::guide::{Guide, Reading};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The longest single wait for a real device.
const PATIENCE: Duration = Duration::from_millis(2);

/// A line whose readings a guide shows.
pub struct GuidedLine<L> {
    /// The way to the device.
    pub line: L,
    /// The guide that shows the steps, if there is one.
    pub guide: Option<Guide>,
}

impl<L: Line> Line for GuidedLine<L> {
    fn exchange(&mut self, out: &[u8], into: &mut Vec<u8>) -> Result<Duration, Error> {
        self.line.exchange(out, into)
    }

    fn act(&mut self, act: Act) {
        self.line.act(act);
    }

    fn saw(&mut self, newest: &Sample) {
        if let Some(guide) = &self.guide {
            let tilt_deg = (f64::from(newest.tilt_mrad) * 1e-3).to_degrees();
            guide.read(Reading { counts: newest.count, tilt_deg });
        }
    }

    fn restores(&mut self) {
        self.line.restores();
    }

    fn crashed(&mut self, crash: &Crash) {
        eprintln!("host-sim: {crash}");
    }
}

/// A device behind a wire, in real time.
pub struct WireLine<'a> {
    wire: Box<dyn Wire>,
    begin: Instant,
    stop: &'a AtomicBool,
    /// The device gets back what it had, also after a stop.
    is_restoring: bool,
}

impl<'a> WireLine<'a> {
    /// `stop` ends the conversation.
    pub fn new(wire: Box<dyn Wire>, stop: &'a AtomicBool) -> Self {
        Self { wire, begin: Instant::now(), stop, is_restoring: false }
    }
}

impl Line for WireLine<'_> {
    fn exchange(&mut self, out: &[u8], into: &mut Vec<u8>) -> Result<Duration, Error> {
        let gone = |cause: std::io::Error| {
            Error::failed(format_args!("the device went away ({cause}); plug it in and begin again"))
        };
        if self.stop.load(Ordering::Relaxed) && !self.is_restoring {
            // A device whose heartbeat ends takes its torque away by itself.
            return Err(Error::failed("stopped before the end; begin again from the first step"));
        }
        if !out.is_empty() {
            self.wire.write(out).map_err(gone)?;
        }
        let mut bytes = [0; 1 << 12];
        let count = self.wire.read(&mut bytes, PATIENCE).map_err(gone)?;
        into.extend(&bytes[..count]);
        Ok(self.begin.elapsed())
    }

    fn restores(&mut self) {
        self.is_restoring = true;
    }

    fn act(&mut self, _: Act) {}
}
