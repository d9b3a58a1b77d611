//! STM32F4DISCOVERY (MB997, STM32F407VG), the default board.
//!
//! | pin | does | remark |
//! | --- | --- | --- |
//! | PA15, PA1 | encoder A, B (TIM2, 32 bit) | 3.3 V only; both free on the board; PA0 has the button, PA5 the accelerometer |
//! | PE7 | the encoder's supply, high while it is there | pulled down inside; optional |
//! | PA4 | motor set value, 12 bit (DAC 1) | shared with the audio codec, which is held in reset |
//! | PD4 | codec reset | low, always |
//! | PE8–PE15 | motor set value, 8 bit (DAC0800), PE8 the lowest bit | for a configuration that says so |
//! | PD7 | amplifier enable, high is on | needs an external pull-down of 10 kΩ; read back |
//! | PD6 | alive: changes its level each millisecond | to a monostable that holds the enable path |
//! | PE4 | emergency stop: to 3 V while it may run | pulled down inside: a jumper to 3 V where there is no stop |
//! | PE5 | amplifier ready: to 3 V while it is | pulled down inside: a jumper to 3 V where it has no such output |
//! | PC2, PE6 | motor current, scaled as PA4 (ADC 2, channel 12); PE6 to 3 V where it is fitted | read at start-up |
//! | PA5, PA6, PA7, PE3 | accelerometer: SCK, MISO, MOSI, select | on the board |
//! | PB1 | to 3 V: an analogue inclinometer is fitted | pulled down inside; read at start-up |
//! | PC1 | analogue inclinometer (ADC 1, channel 11) | free on the board |
//! | PA11, PA12 | USB | the micro-USB connector CN5 |
//! | PC0 | power switch of CN5, for a host; low is on | always high: this is a device (UM1472, OTG) |
//! | PD12, PD13, PD14 | lamps: green, running; orange, torque is on; red, a fault | LD4, LD3, LD5 on the board |

use crate::chip::{
    self, Begun, DriveLines, InclinometerPin, Lamps, Line, Parts, Pin, Placed, Source, Wired, Wiring,
};
use control_core::ceilings::Ceilings;
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use firmware::drive::Drive;
use firmware::tilt::{Accelerometer, Inclinometer, Reading, TiltSource};
use firmware::timing;
use stm32f4xx_hal::gpio::{Analog, Output, PA5, PA6, PA7, PC1, PD6, PD7, PE3, PinState};
use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::spi::{Mode, Phase, Polarity, Spi};

/// This board.
pub(crate) struct Discovery;

impl Wiring for Discovery {
    type Enable = PD7<Output>;
    type Tilt = BoardTilt;

    /// 10 N at a roller of 10 mm, the most that Paper 002 asks for, and 0.6 m/s, half as fast again
    /// as the overspeed trip of a usual encoder. Another motor is another image.
    const CEILINGS: Ceilings = Ceilings::new(100, 600);
    const ALIVE: Pin = <PD6 as Placed>::PIN;

    fn init(core: cortex_m::Peripherals, device: pac::Peripherals) -> Parts<Self> {
        let mut begun = Begun::new(device.RCC, Source::Crystal);
        let rcc = &mut begun.rcc;
        let gpioa = device.GPIOA.split(rcc);
        let gpiob = device.GPIOB.split(rcc);
        let gpioc = device.GPIOC.split(rcc);
        let gpiod = device.GPIOD.split(rcc);
        let gpioe = device.GPIOE.split(rcc);

        // The amplifier before anything else: off, then zero torque.
        let enable = chip::amplifier_off(gpiod.pd7);
        gpiod.pd4.into_push_pull_output().set_low();
        gpiod.pd6.into_push_pull_output();
        // High before it is an output: low switches the host's 5 V on.
        gpioc.pc0.into_push_pull_output_in_state(PinState::High);
        let drive = Drive::new(chip::converters!(device, gpioa, gpioe, rcc), enable);

        let strap = gpiob.pb1.into_pull_down_input();
        // Whatever charge the pin had, its pull has taken away by then.
        cortex_m::asm::delay(timing::PULL_SETTLE_CYCLES);
        let is_analogue = strap.is_high();
        let tilt = if is_analogue {
            let pin = InclinometerPin::new(device.ADC1, gpioc.pc1.into_analog(), rcc);
            BoardTilt::Analogue(Inclinometer::new(pin))
        } else {
            accelerometer(device.SPI1, (gpioa.pa5, gpioa.pa6, gpioa.pa7), gpioe.pe3, rcc)
        };

        let drive_lines = DriveLines::new(
            [Line::new(gpioe.pe4), Line::new(gpioe.pe5), Line::new(gpioe.pe6)],
            Self::ENABLE,
            (device.ADC2, gpioc.pc2.into_analog()),
            rcc,
        );
        // PA15 is the debugger's JTDI out of reset (RM0090 8.3.2); from here on it is the timer's.
        let tracks = (gpioa.pa15.into_pull_up_input(), gpioa.pa1.into_pull_up_input());
        let encoder = chip::encoder(device.TIM2, tracks, gpioe.pe7, rcc);
        let lamps = Lamps::new(gpiod.pd12, gpiod.pd13, gpiod.pd14);

        let wired = Wired { encoder, drive, drive_lines, tilt, lamps };
        Parts::new(begun, core, chip::own!(device, gpioa), wired)
    }
}

/// The accelerometer on the board, alone on its bus: its pins are SCK, MISO and MOSI.
fn accelerometer(
    spi: pac::SPI1,
    (sck, miso, mosi): (PA5, PA6, PA7),
    select: PE3,
    rcc: &mut Rcc,
) -> BoardTilt {
    let mode = Mode { polarity: Polarity::IdleHigh, phase: Phase::CaptureOnSecondTransition };
    let bus = spi.spi((Some(sck), Some(miso), Some(mosi)), mode, timing::TILT_SPI_ASKED_HZ.Hz(), rcc);
    let Ok(device) = ExclusiveDevice::new_no_delay(bus, select.into_push_pull_output());
    BoardTilt::OnBoard(Accelerometer::new(device))
}

/// Either tilt sensor.
pub(crate) enum BoardTilt {
    OnBoard(Accelerometer<ExclusiveDevice<Spi<pac::SPI1>, PE3<Output>, NoDelay>>),
    Analogue(Inclinometer<InclinometerPin<PC1<Analog>>>),
}

impl TiltSource for BoardTilt {
    fn read(&mut self) -> Reading {
        match self {
            BoardTilt::OnBoard(accelerometer) => accelerometer.read(),
            BoardTilt::Analogue(inclinometer) => inclinometer.read(),
        }
    }
}
