//! The accelerometers of the board's two revisions, on SPI 1: LIS302DL and LIS3DSH, and what goes
//! wrong with them.

use rigless::chip::{Timeline, spi::Peer};
use serde::{Deserialize, Serialize};

const WHO_AM_I: u8 = 0x0F;
/// LIS302DL `CTRL_REG1`, LIS3DSH `CTRL_REG4`, and what either holds out of its reset: power-down.
const CONTROL: u8 = 0x20;
const POWERED_DOWN: u8 = 0x07;
/// The first output register of either chip is the X axis; the LIS302DL has one byte an axis, in
/// every second register, the LIS3DSH two.
const OUT_X: u8 = 0x28;
const STATUS: u8 = 0x27;
/// The last output register; reading it takes the measurement.
const OUT_LAST: u8 = 0x2D;
/// Both measure a hundred times a second as the firmware sets them up.
const MEASURE_EVERY: u64 = 10_000_000;

/// The model of the accelerometer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Model {
    /// LIS302DL: 8 bits, 18 mg a digit.
    Lis302dl,
    /// LIS3DSH: 16 bits, 0.06 mg a digit.
    Lis3dsh,
}

/// The sensor's fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Health {
    /// Nothing.
    Good,
    /// Nothing answers: the line stays low.
    Absent,
    /// It answers, and never has a new measurement.
    Stuck,
    /// It has new measurements, and they are all the same, without the noise a sensor has.
    Frozen,
    /// Every register reads whatever a random line would give.
    Nonsense,
}

/// One accelerometer.
#[derive(Debug, Serialize, Deserialize)]
pub struct Accelerometer {
    model: Model,
    /// Its fault, if any.
    pub health: Health,
    registers: Vec<u8>,
    /// The address the next byte goes to or comes from, once the first byte has come.
    address: Option<u8>,
    reading: bool,
    steps: bool,
    noise: u64,
    transfers: u64,
    axes: [i32; 3],
    /// The time of the next measurement, in nanoseconds.
    next: u64,
}

impl Accelerometer {
    /// The registers of a chip that has just been given power.
    fn reset(model: Model) -> Vec<u8> {
        let mut registers = vec![0; 128];
        registers[usize::from(WHO_AM_I)] = match model {
            Model::Lis302dl => 0x3B,
            Model::Lis3dsh => 0x3F,
        };
        registers[usize::from(CONTROL)] = POWERED_DOWN;
        // LIS3DSH: CTRL_REG6.ADD_INC is set out of reset.
        registers[0x25] = 0x10;
        registers
    }

    /// Removes its power for a moment, and only its own: it loses its settings.
    pub fn lose_power(&mut self) {
        self.registers = Self::reset(self.model);
        self.address = None;
    }

    /// True if it measures: LIS302DL `PD` set (data sheet 7.2), LIS3DSH `ODR` not zero (data sheet
    /// 8.5).
    fn is_awake(&self) -> bool {
        let control = self.registers[usize::from(CONTROL)];
        match self.model {
            Model::Lis302dl => control & 0x40 != 0,
            Model::Lis3dsh => control & 0xF0 != 0,
        }
    }

    /// A chip on a needle that points 30° down, as a hand holds it to a vein: X, along the needle,
    /// measures half a gravity.
    #[must_use]
    pub fn new(model: Model) -> Self {
        let mut chip = Self {
            model,
            health: Health::Good,
            registers: Self::reset(model),
            address: None,
            reading: false,
            steps: false,
            noise: 0x9E37_79B9_7F4A_7C15,
            transfers: 0,
            axes: [-500, 0, 866],
            next: 0,
        };
        chip.measure();
        chip
    }

    /// Sets its measurements along X, Y and Z from now on, in thousandths of a gravity.
    pub fn set_milligravities(&mut self, axes: [i32; 3]) {
        self.axes = axes;
    }

    /// Puts a new measurement in the outputs.
    fn measure(&mut self) {
        for (axis, milligravities) in (0u8..).zip(self.axes) {
            let at = usize::from(OUT_X + 2 * axis);
            match self.model {
                Model::Lis302dl => {
                    let digits = (milligravities / 18).clamp(-128, 127) as i8;
                    self.registers[at + 1] = digits as u8;
                }
                Model::Lis3dsh => {
                    // It resolves its own noise, some digits wide.
                    let noise = i32::from(self.random() % 7) - 3;
                    let digits = (milligravities * 100 / 6 + noise).clamp(-32_768, 32_767) as i16;
                    self.registers[at..at + 2].copy_from_slice(&digits.to_le_bytes());
                }
            }
        }
    }

    /// Measures if a hundredth of a second has passed.
    fn advance(&mut self, now: u64) {
        if now < self.next || self.health == Health::Stuck || !self.is_awake() {
            return;
        }
        self.next = now - now % MEASURE_EVERY + MEASURE_EVERY;
        if self.health != Health::Frozen {
            self.measure();
        }
        self.registers[usize::from(STATUS)] = 0x0F;
    }

    /// The bytes that crossed the wires since the board was switched on.
    #[must_use]
    pub fn transfers(&self) -> u64 {
        self.transfers
    }

    fn random(&mut self) -> u8 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        self.noise as u8
    }

    fn byte(&mut self, mosi: u8) -> u8 {
        self.transfers += 1;
        let Some(address) = self.address else {
            self.reading = mosi & 0x80 != 0;
            (self.address, self.steps) = match self.model {
                // Bit 6 asks for the address to step.
                Model::Lis302dl => (Some(mosi & 0x3F), mosi & 0x40 != 0),
                Model::Lis3dsh => (Some(mosi & 0x7F), self.registers[0x25] & 0x10 != 0),
            };
            return 0;
        };
        let register = &mut self.registers[usize::from(address & 0x7F)];
        let answer = if self.reading {
            *register
        } else {
            // The identity and the outputs are read only.
            if address >= 0x20 && !(STATUS..=OUT_LAST).contains(&address) {
                *register = mosi;
            }
            0
        };
        if self.reading && address == OUT_LAST {
            self.registers[usize::from(STATUS)] = 0;
        }
        if self.steps {
            self.address = Some(address.wrapping_add(1) & 0x7F);
        }
        match self.health {
            Health::Good | Health::Stuck | Health::Frozen => answer,
            Health::Absent => 0,
            Health::Nonsense => self.random(),
        }
    }
}

rigless::store!(Accelerometer);

impl Peer for Accelerometer {
    fn transfer(&mut self, mosi: u32, bits: u8, _context: &mut Timeline<'_, '_>) -> u32 {
        if bits > 8 {
            let high = self.byte((mosi >> 8) as u8);
            let low = self.byte(mosi as u8);
            return u32::from(high) << 8 | u32::from(low);
        }
        self.byte(mosi as u8).into()
    }

    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.advance(context.now().0);
        self.address = None;
    }

    fn deselect(&mut self, _context: &mut Timeline<'_, '_>) {
        self.address = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(chip: &mut Accelerometer, first: u8, bytes: usize) -> Vec<u8> {
        chip.address = None;
        chip.byte(first);
        (0..bytes).map(|_| chip.byte(0)).collect()
    }

    #[test]
    fn each_chip_says_who_it_is() {
        assert_eq!(read(&mut Accelerometer::new(Model::Lis302dl), 0x8F, 1), [0x3B]);
        assert_eq!(read(&mut Accelerometer::new(Model::Lis3dsh), 0x8F, 1), [0x3F]);
    }

    #[test]
    fn one_gravity_reads_as_one_gravity() {
        let level = |model| {
            let mut chip = Accelerometer::new(model);
            chip.set_milligravities([0, 0, 1_000]);
            chip.measure();
            chip
        };
        assert_eq!(read(&mut level(Model::Lis302dl), 0xE9, 5), [0, 0, 0, 0, 55], "55 digits of 18 mg");
        let bytes = read(&mut level(Model::Lis3dsh), 0xA8, 6);
        assert!(i16::from_le_bytes([bytes[4], bytes[5]]).abs_diff(16_666) <= 3);
    }

    /// Writes the control register as a driver does that wants measurements.
    fn wake(chip: &mut Accelerometer) {
        chip.address = None;
        chip.byte(CONTROL);
        chip.byte(0x6F);
    }

    #[test]
    fn a_chip_without_power_forgets_and_sleeps() {
        for model in [Model::Lis302dl, Model::Lis3dsh] {
            let mut chip = Accelerometer::new(model);
            wake(&mut chip);
            chip.advance(0);
            assert_eq!(read(&mut chip, 0xA7, 1), [0x0F]);
            chip.lose_power();
            chip.advance(MEASURE_EVERY);
            assert_eq!(read(&mut chip, 0xA7, 1), [0]);
        }
    }

    #[test]
    fn a_measurement_is_ready_once_and_taken_once() {
        let mut chip = Accelerometer::new(Model::Lis302dl);
        wake(&mut chip);
        chip.advance(0);
        assert_eq!(read(&mut chip, 0xE7, 7)[0], 0x0F);
        chip.advance(MEASURE_EVERY - 1);
        assert_eq!(read(&mut chip, 0xE7, 7)[0], 0);
        chip.advance(MEASURE_EVERY);
        assert_eq!(read(&mut chip, 0xE7, 7)[0], 0x0F);
    }

    #[test]
    fn each_illness_shows() {
        let mut chip = Accelerometer::new(Model::Lis3dsh);
        wake(&mut chip);
        chip.health = Health::Frozen;
        let before = read(&mut chip, 0xA8, 6);
        chip.set_milligravities([1_000, 0, 0]);
        chip.advance(MEASURE_EVERY);
        assert_eq!(read(&mut chip, 0xA7, 1), [0x0F]);
        assert_eq!(read(&mut chip, 0xA8, 6), before);
        chip.health = Health::Stuck;
        chip.advance(2 * MEASURE_EVERY);
        assert_eq!(read(&mut chip, 0xA7, 1), [0]);
        chip.health = Health::Absent;
        assert_eq!(read(&mut chip, 0x8F, 1), [0]);
    }
}
