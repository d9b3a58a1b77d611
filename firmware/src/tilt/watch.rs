//! From single readings to the verdict that the sensor is broken: one bad transfer is not enough.

use super::TiltError;
use crate::timing;
use control_core::units::Milliradians;

/// The result of a look at the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// A new measurement.
    New(Milliradians),
    /// None since the last look.
    Unchanged,
    /// Something is wrong.
    Failed(TiltError),
}

/// Counts what is wrong in a row.
#[derive(Clone, Debug, Default)]
pub struct TiltWatch {
    bad: u32,
    stale: u32,
}

impl TiltWatch {
    /// Takes a reading; returns an error that has lasted.
    pub fn judge(&mut self, reading: Reading) -> Result<(), TiltError> {
        match reading {
            Reading::New(_) => {
                *self = Self::default();
                Ok(())
            }
            Reading::Unchanged => {
                self.stale = self.stale.saturating_add(1);
                if self.stale >= timing::TILT_STALE_READINGS { Err(TiltError::Stuck) } else { Ok(()) }
            }
            Reading::Failed(error) => {
                self.bad = self.bad.saturating_add(1);
                if self.bad >= timing::TILT_BAD_READINGS { Err(error) } else { Ok(()) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_that_lasts_is_reported_and_a_measurement_ends_it() {
        let mut watch = TiltWatch::default();
        for _ in 1..timing::TILT_BAD_READINGS {
            assert_eq!(watch.judge(Reading::Failed(TiltError::Absent)), Ok(()));
        }
        assert_eq!(watch.judge(Reading::Failed(TiltError::Absent)), Err(TiltError::Absent));
        assert_eq!(watch.judge(Reading::New(Milliradians(1))), Ok(()));
        assert_eq!(watch.judge(Reading::Failed(TiltError::Absent)), Ok(()));
    }

    #[test]
    fn a_sensor_that_measures_nothing_new_is_stuck() {
        let mut watch = TiltWatch::default();
        for _ in 1..timing::TILT_STALE_READINGS {
            assert_eq!(watch.judge(Reading::Unchanged), Ok(()));
        }
        assert_eq!(watch.judge(Reading::Unchanged), Err(TiltError::Stuck));
    }
}
