//! Both accelerometers that STM32F4DISCOVERY boards carry: LIS302DL (MB997B and before) and LIS3DSH
//! (MB997C and later). They share connector, SPI mode and the place of the identity, and little
//! else. Found by its identity, found again after it was gone.

use super::{Acceleration, Reading, Smoother, TiltError, TiltSource, angle::below_horizontal};
use crate::timing;
use embedded_hal::spi::SpiDevice;

/// Set in the first byte of a transfer that reads.
const READ: u8 = 0x80;
/// Set there, on the LIS302DL, to go on to the next register; the LIS3DSH does so by itself.
const INCREMENT: u8 = 0x40;
const WHO_AM_I: u8 = 0x0F;
/// LIS302DL `CTRL_REG1`, LIS3DSH `CTRL_REG4`: data rate, power, axes.
const CONTROL: u8 = 0x20;
/// `STATUS_REG`; the outputs follow.
const STATUS: u8 = 0x27;
/// `ZYXDA` of the status: new values on all axes.
const NEW_DATA: u8 = 0x08;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Model {
    Lis302dl,
    Lis3dsh,
}

impl Model {
    fn from_identity(identity: u8) -> Option<Self> {
        match identity {
            0x3B => Some(Self::Lis302dl),
            0x3F => Some(Self::Lis3dsh),
            _ => None,
        }
    }

    /// The settings that make it measure at 100 Hz on three axes, ±2 g.
    fn control(self) -> u8 {
        match self {
            // Power on, X, Y, Z.
            Self::Lis302dl => 0x47,
            // 100 Hz, both bytes of a value from the same measurement, X, Y, Z.
            Self::Lis3dsh => 0x6F,
        }
    }

    /// From the seven registers that begin at the status.
    fn acceleration(self, registers: [u8; 7]) -> Acceleration {
        let [_, x_low, x, y_low, y, z_low, z] = registers;
        match self {
            // One byte an axis at every other address, 18 mg a digit.
            Self::Lis302dl => {
                let mg = |byte: u8| i32::from(byte.cast_signed()) * 18;
                Acceleration { x_mg: mg(x), y_mg: mg(y), z_mg: mg(z) }
            }
            // 0.06 mg a digit.
            Self::Lis3dsh => {
                let mg = |low, high| i32::from(i16::from_le_bytes([low, high])) * 6 / 100;
                Acceleration { x_mg: mg(x_low, x), y_mg: mg(y_low, y), z_mg: mg(z_low, z) }
            }
        }
    }

    /// True if it resolves its own noise, so that the same values over and over mean that it hangs.
    fn shows_noise(self) -> bool {
        self == Self::Lis3dsh
    }
}

/// Whichever accelerometer answers.
pub struct Accelerometer<D> {
    device: D,
    model: Option<Model>,
    smoother: Smoother,
    last: [u8; 7],
    repeats: u32,
}

impl<D: SpiDevice> Accelerometer<D> {
    /// On `device`, a bus in SPI mode 3 with the sensor's select line, which may have other sensors
    /// on it too.
    pub fn new(device: D) -> Self {
        Self { device, model: None, smoother: Smoother::default(), last: [0; 7], repeats: 0 }
    }

    fn transfer(&mut self, bytes: &mut [u8]) -> Result<(), TiltError> {
        self.device.transfer_in_place(bytes).map_err(|_| TiltError::Absent)
    }

    /// Looks for the sensor and sets it up if it has just appeared or has lost its settings: a
    /// sensor that alone loses its power comes back with its reset values, in power-down, under the
    /// identity that it had before.
    fn find(&mut self) -> Result<Model, TiltError> {
        let mut identity = [READ | WHO_AM_I, 0];
        self.transfer(&mut identity)?;
        let found = Model::from_identity(identity[1]);
        let is_set_up = match found {
            Some(model) if found == self.model => {
                let mut control = [READ | CONTROL, 0];
                self.transfer(&mut control)?;
                control[1] == model.control()
            }
            _ => false,
        };
        if !is_set_up {
            if let Some(model) = found {
                self.transfer(&mut [CONTROL, model.control()])?;
            }
            self.smoother = Smoother::default();
            self.model = found;
        }
        found.ok_or(TiltError::Absent)
    }

    fn measure(&mut self) -> Result<Reading, TiltError> {
        let model = self.find()?;
        let mut bytes = [0; 8];
        bytes[0] = READ | STATUS | if model == Model::Lis302dl { INCREMENT } else { 0 };
        self.transfer(&mut bytes)?;
        let [_, registers @ ..] = bytes;
        if registers[0] & NEW_DATA == 0 {
            return Ok(Reading::Unchanged);
        }
        self.repeats = if registers[1..] == self.last[1..] { self.repeats.saturating_add(1) } else { 0 };
        self.last = registers;
        if model.shows_noise() && self.repeats >= timing::TILT_FROZEN_MEASUREMENTS {
            return Err(TiltError::Stuck);
        }
        let acceleration = model.acceleration(registers);
        if !is_plausible(acceleration) {
            return Err(TiltError::Nonsense);
        }
        Ok(Reading::New(self.smoother.take(below_horizontal(acceleration))))
    }
}

impl<D: SpiDevice> TiltSource for Accelerometer<D> {
    fn read(&mut self) -> Reading {
        self.measure().unwrap_or_else(Reading::Failed)
    }
}

/// Half a g to one and a half: a device on a table, moved by hand.
fn is_plausible(acceleration: Acceleration) -> bool {
    let Acceleration { x_mg, y_mg, z_mg } = acceleration;
    (500_i32.pow(2)..=1500_i32.pow(2)).contains(&(x_mg * x_mg + y_mg * y_mg + z_mg * z_mg))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tilt::TiltWatch;
    use control_core::units::Milliradians;
    use core::convert::Infallible;
    use embedded_hal::spi::{ErrorType, Operation};

    /// Registers as either sensor answers.
    struct Sensor {
        registers: [u8; 0x30],
        present: bool,
    }

    impl Sensor {
        fn lis302dl(x: i8, y: i8, z: i8) -> Self {
            let mut registers = [0; 0x30];
            registers[0x0F] = 0x3B;
            (registers[0x29], registers[0x2B], registers[0x2D]) = (x as u8, y as u8, z as u8);
            registers[0x27] = 0x0F;
            Self { registers, present: true }
        }

        fn lis3dsh(axes: [i16; 3]) -> Self {
            let mut registers = [0; 0x30];
            registers[0x0F] = 0x3F;
            registers[0x27] = 0x0F;
            for (place, value) in registers[0x28..0x2E].chunks_mut(2).zip(axes) {
                place.copy_from_slice(&value.to_le_bytes());
            }
            Self { registers, present: true }
        }
    }

    impl ErrorType for Sensor {
        type Error = Infallible;
    }

    impl SpiDevice for Sensor {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
            let [Operation::TransferInPlace(bytes)] = operations else { unreachable!() };
            let (command, data) = bytes.split_first_mut().unwrap();
            let old = self.registers[0x0F] == 0x3B;
            let mut address = usize::from(*command & if old { 0x3F } else { 0x7F });
            for byte in data {
                if *command & READ == 0 {
                    self.registers[address] = *byte;
                } else {
                    *byte = if self.present { self.registers[address] } else { 0xFF };
                }
                if !old || *command & INCREMENT != 0 {
                    address += 1;
                }
            }
            Ok(())
        }
    }

    #[test]
    fn both_revisions_are_found_set_up_and_read() {
        // 30° below the horizontal: −0.5 g along the needle, 0.866 g out of the board.
        let old = (Sensor::lis302dl(-28, 0, 48), 0x47);
        let new = (Sensor::lis3dsh([-8333, 0, 14434]), 0x6F);
        for (sensor, control) in [old, new] {
            let mut accelerometer = Accelerometer::new(sensor);
            let Reading::New(tilt) = accelerometer.read() else { panic!("no measurement") };
            assert!((515..=535).contains(&tilt.0), "{tilt}");
            assert_eq!(accelerometer.device.registers[0x20], control);
        }
    }

    #[test]
    fn a_sensor_that_goes_and_comes_is_set_up_again() {
        let mut accelerometer = Accelerometer::new(Sensor::lis3dsh([0, 0, 16_667]));
        assert_eq!(accelerometer.read(), Reading::New(Milliradians(0)));
        accelerometer.device.present = false;
        accelerometer.device.registers[0x20] = 0;
        assert_eq!(accelerometer.read(), Reading::Failed(TiltError::Absent));
        accelerometer.device.present = true;
        assert_eq!(accelerometer.read(), Reading::New(Milliradians(0)));
        assert_eq!(accelerometer.device.registers[0x20], 0x6F);
    }

    #[test]
    fn a_sensor_that_lost_its_power_alone_is_set_up_again() {
        for (sensor, control) in [(Sensor::lis302dl(0, 0, 55), 0x47), (Sensor::lis3dsh([0, 0, 16_667]), 0x6F)]
        {
            let mut accelerometer = Accelerometer::new(sensor);
            accelerometer.read();
            // Out of its own reset; its identity is what it was.
            accelerometer.device.registers[0x20] = 0x07;
            accelerometer.read();
            assert_eq!(accelerometer.device.registers[0x20], control);
        }
    }

    #[test]
    fn half_a_g_to_one_and_a_half_is_plausible_in_any_direction() {
        for axis in 0..3 {
            for (mg, plausible) in [(499, false), (500, true), (1_500, true), (1_501, false)] {
                let along = |other: i32| if other == axis { -mg } else { 0 };
                let acceleration = Acceleration { x_mg: along(0), y_mg: along(1), z_mg: along(2) };
                assert_eq!(is_plausible(acceleration), plausible, "{acceleration:?}");
            }
        }
        assert!(is_plausible(Acceleration { x_mg: 300, y_mg: 300, z_mg: 300 }), "together 520 mg");
    }

    #[test]
    fn no_new_data_is_no_measurement() {
        let mut sensor = Sensor::lis302dl(0, 0, 55);
        sensor.registers[0x27] = 0;
        assert_eq!(Accelerometer::new(sensor).read(), Reading::Unchanged);
    }

    #[test]
    fn what_cannot_be_is_nonsense() {
        for sensor in [Sensor::lis302dl(127, 127, 127), Sensor::lis302dl(0, 0, 0), Sensor::lis3dsh([0; 3])] {
            let reading = Accelerometer::new(sensor).read();
            assert_eq!(reading, Reading::Failed(TiltError::Nonsense));
        }
    }

    #[test]
    fn a_fine_sensor_without_noise_is_stuck_and_a_coarse_one_is_not() {
        let verdict = |sensor| {
            let mut accelerometer = Accelerometer::new(sensor);
            let mut watch = TiltWatch::default();
            (0..1000).map(|_| watch.judge(accelerometer.read())).last().unwrap()
        };
        assert_eq!(verdict(Sensor::lis3dsh([0, 0, 16_667])), Err(TiltError::Stuck));
        assert_eq!(verdict(Sensor::lis302dl(0, 0, 55)), Ok(()));
    }
}
