//! A board for the emulator: the part, its clock and rail, the chips and the cable.
//!
//! The emulator's part is the STM32F427: the STM32F429 without its display controller, and it has
//! everything of the STM32F407 that the firmware uses at the same addresses, and more memory than
//! that image is linked for.

use std::num::{NonZeroU32, NonZeroU64};
use std::sync::Arc;

use rigless::device::Level;
use rigless::emulator::Processor;
use rigless::machine::{Board, Target, armv7m};
use rigless::mcu::{Mcu, Operate, Wired};
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::peripherals::adc;
use rigless::soc::stm32f427::peripherals::gpio::Pin;
use rigless::soc::stm32f427::peripherals::spi::Select;
use rigless::soc::{Error, Gate, Window};
use rigless::time::VirtualNanos;

use super::Wiring;
use super::bus::{DAC, EXTI, INSTRUCTIONS_PER_SECOND, OTG};
use super::dac::Dac;
use super::exti::{self, Exti};
use super::flash::Flash;
use super::pins::{PartPin, Pins};
use super::probe::Probe;
use super::processor::Probed;
use super::tilt::Accelerometer;
use super::usb_port::{self, UsbPort};
use super::warm_core::{ImageKey, WarmCore};

/// The clock that every board brings, and its rail.
pub(super) const CLOCK_HZ: u64 = 8_000_000;
pub(super) const RAIL_MILLIVOLTS: u32 = 3_300;
const CORE_HZ: NonZeroU64 = NonZeroU64::new(INSTRUCTIONS_PER_SECOND).expect("not zero");
const MCU: &str = "stm32f407";
/// The board.
#[derive(Debug)]
pub(super) struct Machine {
    pub(super) mcu: Wired<Wired<Wired<Stm32f427, UsbPort>, Dac>, Exti>,
    image: ImageKey,
    probe: Probe,
    pub(super) flash: Flash,
    pins: Pins,
}

impl Machine {
    pub(super) fn new(wiring: &Wiring, image: ImageKey, probe: Probe, flash: Flash) -> Result<Self, Error> {
        let mut part = Stm32f427::new()?;
        part.set_supply(wiring.supply);
        for converter in &mut part.adc {
            converter.set_reference(RAIL_MILLIVOLTS);
            if wiring.inclinometer {
                let channel =
                    adc::Channel::new(wiring.pins.inclinometer).expect("a converter has sixteen pins");
                converter.set_input(channel, RAIL_MILLIVOLTS / 2);
            }
        }
        if let Some(model) = wiring.tilt {
            let select = Select { port: "GPIOE", pin: pin(3), active: Level::Low };
            part.spi[0].attach_selected(Accelerometer::new(model), select);
        }
        let size = |bytes| NonZeroU64::new(bytes).expect("not zero");
        let usb = Window::new("USB", OTG.2, size(OTG.1))
            .gated(Gate::by("RCC", "AHB2ENR", "OTGFSEN"))
            .raising(&usb_port::INTERRUPTS);
        let dac = Window::new("DAC1", DAC.2, size(DAC.1)).gated(Gate::by("RCC", "APB1ENR", "DACEN"));
        let exti = Window::new("EXTI line 16", EXTI.2, size(EXTI.1)).raising(&exti::INTERRUPTS);
        let with_usb = Wired::new(part, usb, UsbPort::default())?;
        let with_dac = Wired::new(with_usb, dac, Dac::default())?;
        let mcu = Wired::new(with_dac, exti, Exti::default())?;
        let mut machine = Self { mcu, image, probe, flash, pins: wiring.pins };
        // Where no strap holds it up, the pin is charged all the same until a pull has emptied it.
        if let Some(strap) = wiring.pins.strap {
            machine.drive(0, strap, Some(Level::High));
        }
        Ok(machine)
    }

    /// Drives a pin from outside, or lets it go.
    pub(super) fn drive(&mut self, at: u64, place: PartPin, level: Option<Level>) {
        self.part().drive_port(VirtualNanos(at), place.port, |gpio, registers, context| {
            gpio.drive(pin(place.index), level, registers, context);
        });
    }

    pub(super) fn part(&mut self) -> &mut Stm32f427 {
        &mut self.mcu.part.part.part
    }

    /// Shorts an output to the supply, which the part then reads back, or takes the short away.
    pub(super) fn short(&mut self, place: PartPin, shorted: bool) {
        self.probe.tally().shorted = shorted.then_some(place);
    }

    /// True for the part that ST made first: revision A, or what gives itself out as an STM32F2
    /// (errata sheet, "MCU device ID is incorrect").
    pub(super) fn is_first_revision(&self) -> bool {
        let identity = self.probe.tally().identity;
        identity.is_some_and(|identity| identity >> 16 == 0x1000 || identity & 0xFFF == 0x411)
    }

    /// The charge on the strap's pin has gone.
    pub(super) fn release_strap(&mut self, at: u64) {
        if let Some(strap) = self.pins.strap {
            self.drive(at, strap, None);
        }
    }

    pub(super) fn usb(&mut self) -> &mut UsbPort {
        self.mcu.part.part.chip_mut()
    }

    pub(super) fn dac(&self) -> &Dac {
        self.mcu.part.chip()
    }

    pub(super) fn dac_mut(&mut self) -> &mut Dac {
        self.mcu.part.chip_mut()
    }

    pub(super) fn exti(&mut self) -> &mut Exti {
        self.mcu.chip_mut()
    }
}

/// The pin at `index` of a port.
pub(super) fn pin(index: u8) -> Pin {
    Pin::new(index).expect("a port has sixteen pins")
}

rigless::store!(Machine { values: [], parts: [mcu, flash], built: [image, probe, pins] });

impl Board for Machine {
    fn name(&self) -> &'static str {
        "stm32f4discovery"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![MCU]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.mcu)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let lines = u32::from(self.mcu.cpu().interrupt_lines);
        let mut core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: CORE_HZ,
            interrupt_lines: NonZeroU32::new(lines).expect("a part with interrupts"),
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).expect("not zero"),
            instructions_per_second: CORE_HZ,
            boot: "flash",
        }
        .spec_with_parts(
            &rigless::cpu::armv7m::windows(self.mcu.bus()),
            armv7m::Fpu::FpV4Sp,
            armv7m::MpuRegions::Eight,
        );
        let (make, probe, flash) = (core.processor.clone(), self.probe.clone(), self.flash.clone());
        let image = self.image;
        core.processor = Arc::new(move |endian| {
            let core = WarmCore::lend(image, || make(endian))?;
            Ok(Box::new(Probed::new(core, probe.clone(), flash.clone())) as Box<dyn Processor>)
        });
        vec![Target::new(MCU, &mut self.mcu, core)]
    }
}
