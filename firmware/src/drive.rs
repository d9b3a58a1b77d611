//! The way out of the tick: converter and amplifier enable, in the order that never lets the
//! amplifier see a code that was not meant for it. Enable is raised last and dropped first.

use control_core::TickOutput;
use control_core::config::DacWidth;
use control_core::units::DacCode;
use embedded_hal::digital::OutputPin;

/// A converter that drives the servo amplifier's set value. Mid-scale is zero torque; code 0 is
/// *full* torque.
pub trait MotorDac {
    /// Resolution of this converter.
    const WIDTH: DacWidth;

    /// Puts out `code`, which is within [`Self::WIDTH`]. Called from the tick: takes a few bus
    /// cycles and never waits. Where codes wait for an instant set by hardware, one that has missed
    /// it gives way to the next tick's.
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
    const WIDTH: DacWidth = DacWidth::BITS_8;

    fn put(&mut self, code: DacCode) {
        // A wider code has its low eight bits cut only after it was clamped: 0 would be full
        // torque.
        self.0.put(u8::try_from(code.0).unwrap_or(u8::MAX));
    }
}

/// A converter of 16 bits on a serial bus, such as an AD5662 or a DAC8551, with its command before
/// the code.
pub trait CodeBus {
    /// Sends `code` without waiting for it to be out.
    fn send(&mut self, code: u16);
}

/// [`CodeBus`] as a [`MotorDac`].
pub struct SerialDac<B>(pub B);

impl<B: CodeBus> MotorDac for SerialDac<B> {
    const WIDTH: DacWidth = DacWidth::BITS_16;

    fn put(&mut self, code: DacCode) {
        self.0.send(code.0);
    }
}

/// A timer's pulse width, for an amplifier that takes its set value so, with a line for the
/// direction.
pub trait Pulse {
    /// Sets the width to `on` of 32,767 parts of the period, from the next period on; 0 gives no
    /// pulses.
    fn set_width(&mut self, on: u16);
}

/// Pulse width and direction as a [`MotorDac`]: the distance from mid-scale is the width, its sign
/// the direction.
pub struct PulseAndDirection<P, D> {
    /// The pulses.
    pub pulse: P,
    /// High where the code is above mid-scale.
    pub direction: D,
}

impl<P: Pulse, D: OutputPin> MotorDac for PulseAndDirection<P, D> {
    const WIDTH: DacWidth = DacWidth::BITS_16;

    fn put(&mut self, code: DacCode) {
        let zero = Self::WIDTH.mid_scale();
        // A port pin of the microcontroller cannot fail. The direction first: the old width, which
        // goes on to the end of its period, then goes the new way already.
        let _ = if code.0 > zero { self.direction.set_high() } else { self.direction.set_low() };
        self.pulse.set_width(code.0.abs_diff(zero).min(Self::WIDTH.span()));
    }
}

/// The converters of a board, of which the device's configuration chooses one by its width.
pub trait Converters {
    /// The narrowest and the widest; one that is alone is there twice.
    const WIDTHS: [DacWidth; 2];

    /// Gives `code` to the converter of this width, which is one of [`Self::WIDTHS`]:
    /// [`control_core::ceilings::Ceilings`] has seen to it.
    fn put(&mut self, width: DacWidth, code: DacCode);

    /// Zero torque at all of them.
    fn put_zero_torque(&mut self);
}

/// A board with one converter.
pub struct One<D>(pub D);

impl<D: MotorDac> Converters for One<D> {
    const WIDTHS: [DacWidth; 2] = [D::WIDTH; 2];

    #[inline]
    fn put(&mut self, _width: DacWidth, code: DacCode) {
        self.0.put(code);
    }

    #[inline]
    fn put_zero_torque(&mut self) {
        self.0.put_zero_torque();
    }
}

/// A board with two converters. The one that is not chosen stays at zero torque: a plan changes
/// only while torque is off, and then both are there.
pub struct Two<W, N> {
    /// The wider one.
    pub wide: W,
    /// The narrower one.
    pub narrow: N,
}

impl<W: MotorDac, N: MotorDac> Converters for Two<W, N> {
    const WIDTHS: [DacWidth; 2] = [N::WIDTH, W::WIDTH];

    #[inline]
    fn put(&mut self, width: DacWidth, code: DacCode) {
        if width == W::WIDTH { self.wide.put(code) } else { self.narrow.put(code) }
    }

    #[inline]
    fn put_zero_torque(&mut self) {
        self.wide.put_zero_torque();
        self.narrow.put_zero_torque();
    }
}

/// The converters and the amplifier's enable line.
pub struct Drive<C, E> {
    converters: C,
    enable: E,
    is_enabled: bool,
}

impl<C: Converters, E: OutputPin> Drive<C, E> {
    /// Off: enable low, then all converters at zero torque.
    pub fn new(converters: C, enable: E) -> Self {
        let mut drive = Self { converters, enable, is_enabled: true };
        drive.off();
        drive
    }

    /// Gives out what a tick has computed, to the converter that the plan in force is for.
    pub fn apply(&mut self, width: DacWidth, output: &TickOutput) {
        if !output.enable {
            // Said again in every tick, so that nothing that disturbs a register once stays.
            self.off();
            return;
        }
        self.converters.put(width, output.dac);
        if !self.is_enabled {
            // A port pin of the microcontroller cannot fail.
            let _ = self.enable.set_high();
            self.is_enabled = true;
        }
    }

    /// Puts a code out at the widest converter while the amplifier stays off: for the test of the
    /// board, which looks at the pin.
    pub fn put_while_off(&mut self, code: DacCode) {
        self.off();
        self.converters.put(C::WIDTHS[1], code);
    }

    /// Amplifier off, then zero torque.
    pub fn off(&mut self) {
        let _ = self.enable.set_low();
        self.is_enabled = false;
        self.converters.put_zero_torque();
    }

    /// True if the amplifier is on.
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
        const WIDTH: DacWidth = DacWidth::BITS_12;
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

    fn both<'a>(writes: &'a RefCell<Vec<Write>>) -> Two<Twelve<'a>, ParallelDac<Bus<'a>>> {
        Two { wide: Twelve(writes), narrow: ParallelDac(Bus(writes)) }
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
        let mut drive = Drive::new(both(&writes), Pin(&writes));
        let off = [Write::Enable(false), Write::Twelve(2048), Write::Eight(128)];
        assert_eq!(writes.take(), off);
        drive.apply(DacWidth::BITS_12, &output(true, 2050));
        assert_eq!(writes.take(), [Write::Twelve(2050), Write::Enable(true)]);
        drive.apply(DacWidth::BITS_12, &output(true, 2060));
        assert_eq!(writes.take(), [Write::Twelve(2060)]);
        drive.apply(DacWidth::BITS_12, &output(false, 2060));
        assert_eq!(writes.take(), off);
        drive.apply(DacWidth::BITS_12, &output(false, 2060));
        assert_eq!(writes.take(), off);
        assert!(!drive.is_enabled());
    }

    #[test]
    fn a_code_put_while_off_leaves_the_amplifier_off() {
        for (code, powered) in [(1, true), (4095, true), (4095, false)] {
            let writes = RefCell::new(vec![]);
            let mut drive = Drive::new(both(&writes), Pin(&writes));
            if powered {
                drive.apply(DacWidth::BITS_12, &output(true, 2050));
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
        let mut drive = Drive::new(both(&writes), Pin(&writes));
        writes.take();
        drive.apply(DacWidth::BITS_8, &output(true, 130));
        assert_eq!(writes.take(), [Write::Eight(130), Write::Enable(true)]);
    }

    #[test]
    fn a_code_too_wide_for_eight_lines_is_clamped() {
        let writes = RefCell::new(vec![]);
        ParallelDac(Bus(&writes)).put(DacCode(256));
        assert_eq!(writes.take(), [Write::Eight(255)]);
    }

    #[derive(Default)]
    struct Sent(Vec<u16>);
    impl CodeBus for &RefCell<Sent> {
        fn send(&mut self, code: u16) {
            self.borrow_mut().0.push(code);
        }
    }
    impl Pulse for &RefCell<Sent> {
        fn set_width(&mut self, on: u16) {
            self.borrow_mut().0.push(on);
        }
    }

    /// Another converter, alone, is a number in the configuration and a `MotorDac`: the control law
    /// is the same.
    #[test]
    fn a_converter_of_16_bits_alone_is_enough() {
        let (sent, pins) = (RefCell::new(Sent::default()), RefCell::new(vec![]));
        let mut config = Config::commissioned_virtual();
        config.device.dac = DacWidth::BITS_16;
        let mut controller = Controller::new(config.plan().unwrap());
        let mut drive = Drive::new(One(SerialDac(&sent)), Pin(&pins));
        controller.order(Order::Start);
        // Into the skin: from zero torque to one that holds the needle back.
        for tick in 0..6_000 {
            controller.order(Order::Heartbeat);
            let count = control_core::units::Counts(tick / 30);
            let output = controller.tick(TickInput { count, ..TickInput::default() });
            assert_eq!(output.tripped, None);
            drive.apply(DacWidth::BITS_16, &output);
        }
        let codes = sent.take().0;
        assert_eq!((codes[0], codes[1]), (32_768, 32_768), "off, then zero torque while it fades in");
        let away = |code: &u16| code.abs_diff(32_768);
        assert!(codes.last().is_some_and(|code| away(code) > 500), "{:?}", codes.last());
        // Sixteen times finer than the converter of 12 bits.
        let steps: std::collections::BTreeSet<u16> = codes.iter().map(|code| away(code) % 16).collect();
        assert!(steps.len() > 10, "{steps:?}");
    }

    #[test]
    fn pulses_say_how_much_and_a_line_which_way() {
        let (sent, pins) = (RefCell::new(Sent::default()), RefCell::new(vec![]));
        let mut dac = PulseAndDirection { pulse: &sent, direction: Pin(&pins) };
        dac.put_zero_torque();
        for code in [1, 32_767, 32_769, 65_535, 0] {
            dac.put(DacCode(code));
        }
        assert_eq!(sent.take().0, [0, 32_767, 1, 1, 32_767, 32_767]);
        let ways = [false, false, false, true, true, false];
        assert_eq!(pins.take(), ways.map(Write::Enable));
    }

    /// The drive of a real controller: powered by a start, off by a stop, both within the tick.
    #[test]
    fn a_controller_switches_the_drive() {
        let writes = RefCell::new(vec![]);
        let mut drive = Drive::new(both(&writes), Pin(&writes));
        let mut controller = Controller::new(Config::commissioned_virtual().plan().unwrap());
        let mut tick = |controller: &mut Controller| {
            drive.apply(DacWidth::BITS_12, &controller.tick(TickInput::default()));
            drive.is_enabled()
        };
        assert!(!tick(&mut controller));
        controller.order(Order::Start);
        assert!(tick(&mut controller));
        controller.order(Order::Stop);
        assert!(!tick(&mut controller));
    }
}
