//! An analogue inclinometer of the kind whose voltage is proportional to the sine of its tilt.

use super::{Reading, Smoother, TiltError, TiltSource, angle::from_sine};

/// A 12-bit converter on the sensor's output.
pub trait ReadCode {
    /// Converts once, within some tens of microseconds.
    fn read_code(&mut self) -> u16;
}

/// Codes at level: half of the supply, to which such sensors are ratiometric.
const LEVEL_CODE: i32 = 2048;
/// Codes for 1 g: 0.66 V at 3.3 V, as after a divider of a sensor with 1 V/g at 5 V. A calibration
/// value.
const CODES_PER_G: i32 = 819;
/// Beyond 1.2 g nothing at rest can be: a broken wire, a short circuit, or a hard blow.
const LARGEST_CODES: i32 = CODES_PER_G * 6 / 5;

/// The inclinometer.
pub struct Inclinometer<C> {
    converter: C,
    smoother: Smoother,
}

impl<C: ReadCode> Inclinometer<C> {
    /// On `converter`.
    pub fn new(converter: C) -> Self {
        Self { converter, smoother: Smoother::default() }
    }
}

impl<C: ReadCode> TiltSource for Inclinometer<C> {
    fn read(&mut self) -> Reading {
        let codes = i32::from(self.converter.read_code()) - LEVEL_CODE;
        if codes.abs() > LARGEST_CODES {
            return Reading::Failed(TiltError::Nonsense);
        }
        Reading::New(self.smoother.take(from_sine(codes * 1000 / CODES_PER_G)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control_core::units::Milliradians;

    struct Code(u16);
    impl ReadCode for Code {
        fn read_code(&mut self) -> u16 {
            self.0
        }
    }

    fn read(code: u16) -> Reading {
        Inclinometer::new(Code(code)).read()
    }

    #[test]
    fn reads_the_sine() {
        assert_eq!(read(2048), Reading::New(Milliradians(0)));
        // Half of 1 g is 30°: 524 mrad.
        let Reading::New(tilt) = read(2048 + 819 / 2) else { panic!("a tilt") };
        assert!((520..=526).contains(&tilt.0), "{tilt}");
        let Reading::New(tilt) = read(2048 - 819 / 2) else { panic!("a tilt") };
        assert!((-526..=-520).contains(&tilt.0), "{tilt}");
    }

    #[test]
    fn a_broken_wire_is_nonsense() {
        for code in [0, 4095] {
            assert_eq!(read(code), Reading::Failed(TiltError::Nonsense));
        }
    }
}
