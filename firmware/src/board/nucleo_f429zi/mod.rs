//! NUCLEO-F429ZI (MB1137, STM32F429ZI). No accelerometer is on it: an analogue inclinometer has to
//! be fitted. Connector and pin as in UM1974, section 6.12. Left alone, for the board uses them:
//! Ethernet (PA1, PA2, PA7, PB13, PC1, PC4, PC5, PG11, PG13), the debugger's serial port (PD8,
//! PD9), the button (PC13).
//!
//! | pin | does | remark |
//! | --- | --- | --- |
//! | PA15, PB3 | encoder A, B (TIM2, 32 bit) | CN7 9 and 15; 3.3 V only; PB3 is the debugger's SWO, which nobody uses |
//! | PE7 | the encoder's supply, high while it is there | CN10 20; pulled down inside; optional |
//! | PA4 | motor set value, 12 bit (DAC 1) | CN7 17 |
//! | PE8–PE15 | motor set value, 8 bit (DAC0800), PE8 the lowest bit | CN10 18, 4, 24, 6, 26, 10, 28, 30 |
//! | PF13 | amplifier enable, high is on | CN10 2; needs an external pull-down of 10 kΩ; read back |
//! | PG9 | alive: changes its level each millisecond | CN10 16; to a monostable that holds the enable path |
//! | PF14 | emergency stop: to 3.3 V while it may run | CN10 8; pulled down inside: a jumper to 3.3 V where there is no stop |
//! | PF15 | amplifier ready: to 3.3 V while it is | CN10 12; pulled down inside: a jumper to 3.3 V where it has no such output |
//! | PC2, PF12 | motor current, scaled as PA4 (ADC 2, channel 12); PF12 to 3.3 V where it is fitted | CN10 9, CN7 20; read at start-up |
//! | PC0 | analogue inclinometer (ADC 1, channel 10) | CN9 3; needs an external pull-down of 100 kΩ, which a wire that is off leaves it with |
//! | PA11, PA12 | USB | the micro-USB connector CN13 |
//! | PG6 | power switch of CN13, for a host | low, always: this is a device |
//! | PB0, PB7, PB14 | lamps: green, running; blue, torque is on; red, a fault | LD1, LD2, LD3 on the board |

use crate::chip::{
    self, Begun, DriveLines, InclinometerPin, Lamps, Line, Parts, Pin, Placed, Source, Wired, Wiring,
};
use control_core::ceilings::Ceilings;
use firmware::drive::Drive;
use firmware::tilt::Inclinometer;
use stm32f4xx_hal::gpio::{Analog, Output, PC0, PF13, PG9};
use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;

/// This board.
pub(crate) struct NucleoF429zi;

impl Wiring for NucleoF429zi {
    type Enable = PF13<Output>;
    type Tilt = Inclinometer<InclinometerPin<PC0<Analog>>>;

    /// As the Discovery's: 10 N at a roller of 10 mm, and 0.6 m/s. Another motor is another image.
    const CEILINGS: Ceilings = Ceilings::new(100, 600);
    const ALIVE: Pin = <PG9 as Placed>::PIN;

    fn init(core: cortex_m::Peripherals, device: pac::Peripherals) -> Parts<Self> {
        // 8 MHz from the debugger's own microcontroller, which has to have power (UM1974, HSE
        // clock).
        let mut begun = Begun::new(device.RCC, Source::Bypass);
        let rcc = &mut begun.rcc;
        let gpioa = device.GPIOA.split(rcc);
        let gpiob = device.GPIOB.split(rcc);
        let gpioc = device.GPIOC.split(rcc);
        let gpioe = device.GPIOE.split(rcc);
        let gpiof = device.GPIOF.split(rcc);
        let gpiog = device.GPIOG.split(rcc);

        // The amplifier before anything else: off, then zero torque.
        let enable = chip::amplifier_off(gpiof.pf13);
        let drive = Drive::new(chip::converters!(device, gpioa, gpioe, rcc), enable);

        let tilt = Inclinometer::new(InclinometerPin::new(device.ADC1, gpioc.pc0.into_analog(), rcc));
        let drive_lines = DriveLines::new(
            [Line::new(gpiof.pf14), Line::new(gpiof.pf15), Line::new(gpiof.pf12)],
            Self::ENABLE,
            (device.ADC2, gpioc.pc2.into_analog()),
            rcc,
        );
        // PA15 and PB3 are the debugger's JTDI and JTDO out of reset (RM0090 8.3.2); from here on
        // they are the timer's.
        let tracks = (gpioa.pa15.into_pull_up_input(), gpiob.pb3.into_pull_up_input());
        let encoder = chip::encoder(device.TIM2, tracks, gpioe.pe7, rcc);
        gpiog.pg9.into_push_pull_output();
        gpiog.pg6.into_push_pull_output().set_low();
        let lamps = Lamps::new(gpiob.pb0, gpiob.pb7, gpiob.pb14);

        let wired = Wired { encoder, drive, drive_lines, tilt, lamps };
        Parts::new(begun, core, chip::own!(device, gpioa), wired)
    }
}
