//! The microcontroller: STM32F405/407 and STM32F42x/43x, one family under one manual, RM0090.
//! Everything that its boards have in common is here; which pin does what is the board's
//! (`crate::board`), but for pins that leave no choice: PA4 is the converter's output, PA11 and
//! PA12 are USB.
//!
//! Nothing here may name a board.

mod brownout;
mod clock;
mod encoder;
mod flash;
mod lamps;
mod monitors;
mod outputs;
mod pin;
mod sleep;
mod start;
mod supply;
mod tick_timer;
mod usb;
mod watchdog;

pub(crate) use clock::Source;
pub(crate) use encoder::init as encoder;
pub(crate) use lamps::Lamps;
pub(crate) use monitors::{DriveLines, Line};
pub(crate) use outputs::{InclinometerPin, Lines, OnChipDac, amplifier_off, converters};
pub(crate) use pin::{Pin, Placed};
pub(crate) use sleep::sleep;
pub(crate) use start::{Begun, Own, Parts, Statics, Wired, own};
pub(crate) use supply::Supply;

// A test of the board starts these by itself.
#[allow(unused_imports, reason = "the tests of the board use them")]
pub(crate) use {
    start::serial_number, supply::is_falling, tick_timer::TickTimer, usb::init as usb, watchdog::Watchdog,
};

use control_core::ceilings::Ceilings;
use core::marker::PhantomData;
use cortex_m::peripheral::DWT;
use embedded_hal::digital::OutputPin;
use firmware::drive::{ParallelDac, Two};
use firmware::port::Board;
use firmware::store::Nor;
use firmware::tilt::TiltSource;
use link::frames::GuardRefusal;
use stm32f4xx_hal::pac::{Interrupt, Peripherals};

/// The properties of a board with this microcontroller. The rest of [`Board`] is the
/// microcontroller's.
pub(crate) trait Wiring: 'static {
    /// The amplifier's enable line: its pin.
    type Enable: OutputPin + Placed;
    /// The tilt sensors that may be there.
    type Tilt: TiltSource;

    /// The most that this board may ever be configured for.
    const CEILINGS: Ceilings;
    /// The enable line past its owner.
    const ENABLE: Pin = <Self::Enable as Placed>::PIN;
    /// The output that changes its level as often as the watchdog is fed, each millisecond, for a
    /// monostable outside.
    const ALIVE: Pin;

    /// Sets every pin up, the amplifier first; nothing is started and nothing written.
    fn init(core: cortex_m::Peripherals, device: Peripherals) -> Parts<Self>
    where
        Self: Sized;
}

/// A board with this microcontroller, wired as `W` says.
pub(crate) struct Stm32F4<W>(PhantomData<W>);

impl<W: Wiring> Board for Stm32F4<W> {
    type Timer = tick_timer::TickTimer;
    type Encoder = encoder::Encoder;
    type Converters = Two<OnChipDac, ParallelDac<Lines>>;
    type Enable = W::Enable;
    type EncoderLines = encoder::EncoderLines;
    type DriveLines = DriveLines;
    type Supply = supply::SupplyLevel;
    type Watchdog = watchdog::Watchdog;
    type Tilt = W::Tilt;
    type Lamps = Lamps;
    type Serial = usb::Port;
    type Flash = Nor<flash::Sectors>;

    fn cycles() -> u32 {
        DWT::cycle_count()
    }

    fn wake_usb() {
        rtic::pend(Interrupt::OTG_FS);
    }

    fn wake_telemetry() {
        rtic::pend(Interrupt::USART2);
    }

    fn wake_tilt() {
        rtic::pend(Interrupt::USART3);
    }

    fn allow_usb(allowed: bool) {
        usb::allow_interrupt(allowed);
    }

    fn guard_supply(set: bool) -> Result<(), GuardRefusal> {
        if supply::is_falling() {
            return Err(GuardRefusal::SupplyLow);
        }
        brownout::guard(set)
    }
}

/// The converters to zero torque after a crash: nobody who owned them ever runs again.
pub(crate) fn outputs_to_zero_torque() {
    outputs::dac_to_zero_torque();
    outputs::lines_to_zero_torque();
}
