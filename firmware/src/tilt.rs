//! The inclination of the insertion axis, from either accelerometer of the STM32F4DISCOVERY or from
//! an analogue inclinometer, and what is wrong with a sensor that does not give it.

mod accelerometer;
mod angle;
mod inclinometer;
mod watch;

pub use accelerometer::Accelerometer;
pub use inclinometer::{Inclinometer, ReadCode};
pub use watch::{Reading, TiltWatch};

use control_core::units::Milliradians;

/// Something that measures the inclination. Called from the tilt task at `TILT_PERIOD_MS`; it may
/// wait for a bus, not for a measurement.
pub trait TiltSource {
    /// The latest measurement.
    fn read(&mut self) -> Reading;
}

/// The error that one reading shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TiltError {
    /// Nothing answers, or something else does.
    Absent,
    /// It answers and does not measure.
    Stuck,
    /// It measures what cannot be.
    Nonsense,
}

/// A vector of acceleration in mg, in the board's axes: x along the needle, towards its tip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Acceleration {
    /// Along the needle.
    pub x_mg: i32,
    /// Across it.
    pub y_mg: i32,
    /// Out of the board.
    pub z_mg: i32,
}

/// Low-pass over the measurements, an eighth of the difference at a time: 80 ms at 100 Hz. It turns
/// the 18 mg steps of the coarser accelerometer into a few milliradians. Holds 1/256 mrad.
#[derive(Clone, Copy, Debug, Default)]
pub struct Smoother(Option<i32>);

impl Smoother {
    /// Takes a measurement, gives the smoothed one.
    pub fn take(&mut self, tilt: Milliradians) -> Milliradians {
        let new = i32::from(tilt.0) << 8;
        let smooth = self.0.map_or(new, |old| old + (new - old) / 8);
        self.0 = Some(smooth);
        Milliradians(((smooth + 128) >> 8) as i16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smoother_arrives_within_a_milliradian() {
        let mut smoother = Smoother::default();
        assert_eq!(smoother.take(Milliradians(-300)), Milliradians(-300));
        let last = (0..100).map(|_| smoother.take(Milliradians(500))).last().unwrap();
        assert!((499..=500).contains(&last.0), "{last}");
    }
}
