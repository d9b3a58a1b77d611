//! The speed of a simulated device: real time, or as fast as possible.

use std::time::{Duration, Instant};

/// Further behind than this (a busy or suspended computer) the clock is set anew rather than caught
/// up with.
const LARGEST_LAG: Duration = Duration::from_millis(200);
/// A device may be this far ahead of the clock on the wall before it waits: waking every
/// millisecond cost a fifth of what it uses of a core. Not longer than a frame of 32 samples takes
/// to fill.
const LARGEST_LEAD: Duration = Duration::from_millis(3);

/// The speed of a simulated device.
#[derive(Clone, Copy, Debug)]
pub enum RealtimeClock {
    /// As fast as it goes.
    Free,
    /// With the clock on the wall.
    RealTime {
        /// The beginning of the device's own time.
        zero: Instant,
    },
}

/// The clock on the wall has run away and was set anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Late;

impl RealtimeClock {
    /// With the clock on the wall, from now on.
    pub fn real_time() -> Self {
        Self::RealTime { zero: Instant::now() }
    }

    /// Waits until it is `elapsed` on the device's own clock, unless that is hardly ahead of the
    /// clock on the wall: the next call then waits for both.
    pub fn wait(&mut self, elapsed: Duration) -> Result<(), Late> {
        let Self::RealTime { zero } = self else { return Ok(()) };
        let now = Instant::now();
        let due = *zero + elapsed;
        if now > due + LARGEST_LAG {
            *zero += now - due;
            return Err(Late);
        }
        let lead = due.saturating_duration_since(now);
        if lead >= LARGEST_LEAD {
            std::thread::sleep(lead);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_runs_ahead_for_less_than_a_frame() {
        let begin = Instant::now();
        let mut clock = RealtimeClock::real_time();
        for elapsed_ms in 1..=100 {
            let elapsed = Duration::from_millis(elapsed_ms);
            assert_eq!(clock.wait(elapsed), Ok(()));
            assert!(begin.elapsed() + LARGEST_LEAD > elapsed);
        }
    }

    #[test]
    fn a_computer_that_slept_is_late_once_and_goes_on_from_there() {
        let begin = Instant::now();
        let mut clock = RealtimeClock::real_time();
        assert_eq!(clock.wait(Duration::from_millis(20)), Ok(()));
        assert!(begin.elapsed() >= Duration::from_millis(20));
        std::thread::sleep(Duration::from_millis(250));
        assert_eq!(clock.wait(Duration::from_millis(21)), Err(Late));
        assert_eq!(clock.wait(Duration::from_millis(22)), Ok(()));
        assert!(RealtimeClock::Free.wait(Duration::from_secs(1_000)).is_ok());
    }
}
