//! The way out of the tick: converter and amplifier enable, in the order that never lets the amplifier see a code that was
//! not meant for it. Enable is raised last and dropped first.

use control_core::TickOutput;
use control_core::config::DacWidth;
use control_core::units::DacCode;
use embedded_hal::digital::OutputPin;

/// A converter that drives the servo amplifier's set value. Mid-scale is zero torque; code 0 is *full* torque.
pub trait MotorDac {
    /// Resolution of this converter.
    const WIDTH: DacWidth;

    /// Puts out `code`, which lies within [`Self::WIDTH`]. Called from the tick: takes a few bus cycles and never waits.
    /// Where codes wait for an instant set by hardware, one that has missed it gives way to the next tick's.
    fn put(&mut self, code: DacCode);

    /// Zero torque.
    fn put_zero_torque(&mut self) {
        self.put(DacCode(Self::WIDTH.mid_scale()));
    }
}

/// Eight lines that change together, such as half a GPIO port.
pub trait ByteBus {
    /// Sets all eight.
    fn put(&mut self, byte: u8);
}

/// A DAC0800 or the like on eight lines, as in Paper 001.
pub struct ParallelDac<B>(pub B);

impl<B: ByteBus> MotorDac for ParallelDac<B> {
    const WIDTH: DacWidth = DacWidth::Bits8;

    fn put(&mut self, code: DacCode) {
        // A wider code has its low eight bits cut only after it was clamped: 0 would be full torque.
        self.0.put(u8::try_from(code.0).unwrap_or(u8::MAX));
    }
}

/// Both converters and the amplifier's enable line.
pub struct Drive<D12, D8, E> {
    twelve: D12,
    eight: D8,
    enable: E,
    is_enabled: bool,
}

impl<D12: MotorDac, D8: MotorDac, E: OutputPin> Drive<D12, D8, E> {
    /// Off: enable low, then both converters at zero torque.
    pub fn new(twelve: D12, eight: D8, enable: E) -> Self {
        let mut drive = Self { twelve, eight, enable, is_enabled: true };
        drive.off();
        drive
    }

    /// Gives out what a tick has computed, to the converter that the plan in force is for. The other one stays at zero
    /// torque: a plan changes only while torque is off, and [`Self::off`] sets both.
    pub fn apply(&mut self, width: DacWidth, output: &TickOutput) {
        if !output.enable {
            // Said again in every tick, so that nothing that disturbs a register once stays.
            self.off();
            return;
        }
        match width {
            DacWidth::Bits12 => self.twelve.put(output.dac),
            DacWidth::Bits8 => self.eight.put(output.dac),
        }
        if !self.is_enabled {
            // A port pin of the microcontroller cannot fail.
            let _ = self.enable.set_high();
            self.is_enabled = true;
        }
    }

    /// Puts a code out at the 12-bit converter while the amplifier stays off: for the test of the board, which looks at the pin.
    pub fn put_while_off(&mut self, code: DacCode) {
        self.off();
        self.twelve.put(code);
    }

    /// Amplifier off, then zero torque.
    pub fn off(&mut self) {
        let _ = self.enable.set_low();
        self.is_enabled = false;
        self.twelve.put_zero_torque();
        self.eight.put_zero_torque();
    }

    /// Whether the amplifier is on.
    pub fn is_enabled(&self) -> bool {
        self.is_enabled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control_core::controller::{Order, TickInput};
    use control_core::{Config, Controller};
    use core::cell::RefCell;
    use core::convert::Infallible;
    use embedded_hal::digital::ErrorType;
    use std::vec;
    use std::vec::Vec;

    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Write {
        Twelve(u16),
        Eight(u8),
        Enable(bool),
    }

    struct Twelve<'a>(&'a RefCell<Vec<Write>>);
    impl MotorDac for Twelve<'_> {
        const WIDTH: DacWidth = DacWidth::Bits12;
        fn put(&mut self, code: DacCode) {
            self.0.borrow_mut().push(Write::Twelve(code.0));
        }
    }

    struct Bus<'a>(&'a RefCell<Vec<Write>>);
    impl ByteBus for Bus<'_> {
        fn put(&mut self, byte: u8) {
            self.0.borrow_mut().push(Write::Eight(byte));
        }
    }

    struct Pin<'a>(&'a RefCell<Vec<Write>>);
    impl ErrorType for Pin<'_> {
        type Error = Infallible;
    }
    impl OutputPin for Pin<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().push(Write::Enable(false));
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().push(Write::Enable(true));
            Ok(())
        }
    }

    fn output(enable: bool, dac: u16) -> TickOutput {
        let plan = Config::commissioned_virtual().plan().unwrap();
        let mut controller = Controller::new(plan);
        let mut output = controller.tick(TickInput::default());
        output.enable = enable;
        output.dac = DacCode(dac);
        output
    }

    #[test]
    fn enable_is_raised_last_and_dropped_first() {
        let writes = RefCell::new(vec![]);
        let mut drive = Drive::new(Twelve(&writes), ParallelDac(Bus(&writes)), Pin(&writes));
        let off = [Write::Enable(false), Write::Twelve(2048), Write::Eight(128)];
        assert_eq!(writes.take(), off);
        drive.apply(DacWidth::Bits12, &output(true, 2050));
        assert_eq!(writes.take(), [Write::Twelve(2050), Write::Enable(true)]);
        drive.apply(DacWidth::Bits12, &output(true, 2060));
        assert_eq!(writes.take(), [Write::Twelve(2060)]);
        drive.apply(DacWidth::Bits12, &output(false, 2060));
        assert_eq!(writes.take(), off);
        drive.apply(DacWidth::Bits12, &output(false, 2060));
        assert_eq!(writes.take(), off);
        assert!(!drive.is_enabled());
    }

    #[test]
    fn a_code_put_while_off_leaves_the_amplifier_off() {
        for (code, powered) in [(1, true), (4095, true), (4095, false)] {
            let writes = RefCell::new(vec![]);
            let mut drive = Drive::new(Twelve(&writes), ParallelDac(Bus(&writes)), Pin(&writes));
            if powered {
                drive.apply(DacWidth::Bits12, &output(true, 2050));
            }
            writes.take();
            drive.put_while_off(DacCode(code));
            let off = [Write::Enable(false), Write::Twelve(2048), Write::Eight(128)];
            assert_eq!(writes.take(), [off.as_slice(), &[Write::Twelve(code)]].concat());
            assert!(!drive.is_enabled());
        }
    }

    #[test]
    fn an_eight_bit_plan_leaves_the_other_converter_alone() {
        let writes = RefCell::new(vec![]);
        let mut drive = Drive::new(Twelve(&writes), ParallelDac(Bus(&writes)), Pin(&writes));
        writes.take();
        drive.apply(DacWidth::Bits8, &output(true, 130));
        assert_eq!(writes.take(), [Write::Eight(130), Write::Enable(true)]);
    }

    #[test]
    fn a_code_too_wide_for_eight_lines_is_clamped() {
        let writes = RefCell::new(vec![]);
        ParallelDac(Bus(&writes)).put(DacCode(256));
        assert_eq!(writes.take(), [Write::Eight(255)]);
    }

    /// The drive of a real controller: powered by a start, off by a stop, both within the tick.
    #[test]
    fn a_controller_switches_the_drive() {
        let writes = RefCell::new(vec![]);
        let mut drive = Drive::new(Twelve(&writes), ParallelDac(Bus(&writes)), Pin(&writes));
        let mut controller = Controller::new(Config::commissioned_virtual().plan().unwrap());
        let mut tick = |controller: &mut Controller| {
            drive.apply(DacWidth::Bits12, &controller.tick(TickInput::default()));
            drive.is_enabled()
        };
        assert!(!tick(&mut controller));
        controller.order(Order::Start);
        assert!(tick(&mut controller));
        controller.order(Order::Stop);
        assert!(!tick(&mut controller));
    }
}
