//! The board, STM32F4DISCOVERY (MB997, STM32F407VG): which pin does what, and the clocks. No other file names a pin.
//!
//! | pin | does | remark |
//! | --- | --- | --- |
//! | PA15, PA1 | encoder A, B (TIM2, 32 bit) | both free on the board; PA0 has the button, PA5 the accelerometer |
//! | PA4 | motor set value, 12 bit (DAC 1) | shared with the audio codec, which is held in reset |
//! | PD4 | codec reset | low for good |
//! | PE8–PE15 | motor set value, 8 bit (DAC0800), PE8 the lowest bit | for a configuration that says so |
//! | PD7 | amplifier enable, high is on | needs an external pull-down of 10 kΩ; read back |
//! | PE4 | emergency stop: to ground while it may run | pulled up inside: a jumper where there is no stop |
//! | PE5 | amplifier ready: low while it is | pulled up inside: a jumper where it has no such output |
//! | PC2, PE6 | motor current, scaled as PA4 (ADC 2, channel 12); PE6 to ground where it is fitted | read at start-up |
//! | PA5, PA6, PA7, PE3 | accelerometer: SCK, MISO, MOSI, select | on the board |
//! | PB1 | to 3 V: an analogue inclinometer is fitted | pulled down inside; read at start-up |
//! | PC1 | analogue inclinometer (ADC 1, channel 11) | free on the board |
//! | PA11, PA12 | USB | the micro-USB connector CN5 |
//! | PD12 | green LED: running | on the board |

pub(crate) mod crash;
mod encoder;
mod flash;
mod monitors;
mod outputs;
pub(crate) mod usb;

use control_core::ceilings::Ceilings;
use control_core::event::Fault;
use control_core::{Device, Patient, Plan};
use cortex_m::peripheral::DWT;
use crash::LAST_WORDS;
use encoder::{Encoder, EncoderLines};
use firmware::drive::{Drive, ParallelDac};
use firmware::port;
use firmware::reset::{ResetFlags, Said, cause};
use firmware::store::{Store, Stored};
use firmware::tasks::tick::BoardDrive;
use firmware::tilt::{Accelerometer, Inclinometer, Reading, TiltSource};
use firmware::timing;
use link::device::Identity;
use monitors::DriveLines;
use outputs::{InclinometerPin, Lines, OnChipDac};
use stm32f4xx_hal::gpio::{Output, PD7, PE3};
use stm32f4xx_hal::otg_fs::USB;
use stm32f4xx_hal::pac::{self, Interrupt};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{self, Enable, Rcc, Reset};
use stm32f4xx_hal::signature::Uid;
use stm32f4xx_hal::spi::{Mode, Phase, Polarity, Spi};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// What nobody configures this board for: 10 N at a roller of 10 mm, the most that seed 002 asks for, and 0.6 m/s, half as fast
/// again as the overspeed trip of a usual encoder. Another motor is another image.
const CEILINGS: Ceilings = Ceilings::new(100, 600);

/// This board.
pub(crate) struct Discovery;

impl port::Board for Discovery {
    type Timer = TickTimer;
    type Encoder = Encoder;
    type Dac12 = OnChipDac;
    type Dac8 = ParallelDac<Lines>;
    type Enable = PD7<Output>;
    type EncoderLines = EncoderLines;
    type DriveLines = DriveLines;
    type Supply = SupplyLevel;
    type Watchdog = Watchdog;
    type Tilt = BoardTilt;
    type Serial = usb::Port;
    type Flash = flash::Sectors;

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
}

/// Memory that must outlive start-up.
pub(crate) struct Statics {
    usb: usb::Statics,
}

impl Statics {
    /// Empty.
    pub(crate) const fn new() -> Self {
        Self { usb: usb::Statics::new() }
    }
}

/// What the tasks get.
pub(crate) struct Parts {
    pub(crate) tick_timer: TickTimer,
    pub(crate) encoder: Encoder,
    pub(crate) encoder_lines: EncoderLines,
    pub(crate) drive_lines: DriveLines,
    pub(crate) drive: BoardDrive<Discovery>,
    pub(crate) tilt: BoardTilt,
    pub(crate) serial: usb::Port,
    pub(crate) watchdog: Watchdog,
    pub(crate) supply: Supply,
    pub(crate) supply_level: SupplyLevel,
    pub(crate) store: Store<flash::Sectors>,
    pub(crate) plan: Plan,
    pub(crate) heat: u32,
    pub(crate) identity: Identity,
    pub(crate) reset_cause: Option<Fault>,
}

/// Sets everything up, the amplifier first, and starts the clocks of the tick, the supervisor and the watchdog. Interrupts are
/// masked meanwhile.
pub(crate) fn init(
    mut core: cortex_m::Peripherals,
    device: pac::Peripherals,
    statics: &'static mut Statics,
) -> Parts {
    let flags = reset_flags(&device.RCC);
    crash::wait_for_crystal(&device.RCC);
    let mut rcc = device.RCC.freeze(
        rcc::Config::hse(timing::CRYSTAL_HZ.Hz())
            .sysclk(timing::CORE_HZ.Hz())
            .hclk(timing::CORE_HZ.Hz())
            .pclk1(timing::APB1_HZ.Hz())
            .pclk2(timing::APB2_HZ.Hz())
            .require_pll48clk(),
    );
    let gpioa = device.GPIOA.split(&mut rcc);
    let gpiob = device.GPIOB.split(&mut rcc);
    let gpioc = device.GPIOC.split(&mut rcc);
    let gpiod = device.GPIOD.split(&mut rcc);
    let gpioe = device.GPIOE.split(&mut rcc);

    // The amplifier before anything else: off, then zero torque.
    let mut enable = gpiod.pd7.into_push_pull_output();
    enable.set_low();
    gpiod.pd4.into_push_pull_output().set_low();
    let lines = Lines::new((
        gpioe.pe8, gpioe.pe9, gpioe.pe10, gpioe.pe11, gpioe.pe12, gpioe.pe13, gpioe.pe14, gpioe.pe15,
    ));
    let dac = OnChipDac::new(device.DAC.constrain(gpioa.pa4.into_analog(), &mut rcc));
    let drive = Drive::new(dac, ParallelDac(lines), enable);

    let strap = gpiob.pb1.into_pull_down_input();
    // Whatever charge the pin had, its pull has taken away by then.
    cortex_m::asm::delay(timing::PULL_SETTLE_CYCLES);
    let is_analogue = strap.is_high();
    let tilt = if is_analogue {
        BoardTilt::Analogue(Inclinometer::new(InclinometerPin::new(
            device.ADC1,
            gpioc.pc1.into_analog(),
            &mut rcc,
        )))
    } else {
        let mode = Mode { polarity: Polarity::IdleHigh, phase: Phase::CaptureOnSecondTransition };
        let pins = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
        let bus = device.SPI1.spi(pins, mode, timing::TILT_SPI_HZ.Hz(), &mut rcc);
        BoardTilt::OnBoard(Accelerometer::new(bus, gpioe.pe3.into_push_pull_output()))
    };

    let drive_lines =
        DriveLines::new((gpioe.pe4, gpioe.pe5, gpioe.pe6), (device.ADC2, gpioc.pc2.into_analog()), &mut rcc);
    let (encoder, encoder_lines) = encoder::init(device.TIM2, gpioa.pa15, gpioa.pa1, &mut rcc);

    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    // Keeps the core's clock up in sleep: a debugger can read the log then, and the cycle counter counts on.
    device.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
    gpiod.pd12.into_push_pull_output().set_high();

    let Said { crash, torque, heat } = LAST_WORDS.take();
    let (store, device_part, patient_part) = Store::open(flash::Sectors::new(device.FLASH));
    let (plan, damage) = plan(device_part, patient_part);
    let reset_cause = cause(flags, crash, torque).or(damage);
    match crash {
        Some(crash) => {
            defmt::warn!("last run ended: kind {}, detail {=u32:#x}", crash.kind as u8, crash.detail)
        }
        None => defmt::info!("started; torque is off"),
    }

    let serial = usb::init(
        USB::new(
            (device.OTG_FS_GLOBAL, device.OTG_FS_DEVICE, device.OTG_FS_PWRCLK),
            (gpioa.pa11, gpioa.pa12),
            &rcc.clocks,
        ),
        serial_number(),
        &mut statics.usb,
    );

    let (supply, supply_level) = supply_warning(device.PWR, device.EXTI, &mut rcc);
    let mut systick = core.SYST;
    systick.set_clock_source(cortex_m::peripheral::syst::SystClkSource::Core);
    systick.set_reload(timing::CORE_HZ / timing::SUPERVISOR_HZ - 1);
    systick.clear_current();
    systick.enable_counter();
    systick.enable_interrupt();

    let mut watchdog = IndependentWatchdog::new(device.IWDG);
    watchdog.stop_on_debug(&device.DBGMCU, true);
    watchdog.start(timing::WATCHDOG_MS.millis());
    watchdog.feed();
    Parts {
        tick_timer: TickTimer::start(device.TIM4, &mut rcc),
        encoder,
        encoder_lines,
        drive_lines,
        drive,
        tilt,
        serial,
        watchdog: Watchdog { watchdog, debug: device.DBGMCU },
        supply,
        supply_level,
        store,
        plan,
        heat,
        identity: Identity { serial: serial_number(), firmware: version(), ceilings: CEILINGS },
        reset_cause,
    }
}

/// The stored parts where they may run, else the default of the part that may not, and what is to be said of it.
fn plan(device: Stored<Device>, patient: Stored<Patient>) -> (Plan, Option<Fault>) {
    let (device, lost_device) = device.or(Device::unknown());
    let is_too_much = CEILINGS.check(&device).is_err();
    let device = if is_too_much { Device::unknown() } else { device };
    let (patient, lost_patient) = patient.or(Patient::default());
    let fault = (lost_device || lost_patient || is_too_much).then_some(Fault::StoredConfig);
    // A patient for another device leaves, and a device that may not be leaves the default.
    let fitting = Plan::new(&device, &patient).map(|plan| (plan, fault));
    let parts = [(device, Patient::nobody()), (Device::unknown(), Patient::default())];
    let plan = fitting.or_else(|_| {
        let plan = parts.iter().find_map(|(device, patient)| Plan::new(device, patient).ok());
        plan.map(|plan| (plan, Some(Fault::StoredConfig))).ok_or(())
    });
    match plan {
        Ok(plan) => plan,
        Err(()) => panic!("the default configuration is refused"),
    }
}

/// Why the microcontroller was reset; forgets it.
fn reset_flags(rcc: &pac::RCC) -> ResetFlags {
    let csr = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    ResetFlags {
        watchdog: csr.wdgrstf().bit() || csr.wwdgrstf().bit(),
        software: csr.sftrstf().bit(),
        power_on: csr.porrstf().bit(),
        brownout: csr.borrstf().bit(),
    }
}

/// An interrupt when the supply falls below 2.66 V. This board's rail is a diode below 3.3 V, 2.9 V where people have
/// measured it: the thresholds above this one would never see it healthy.
fn supply_warning(pwr: pac::PWR, exti: pac::EXTI, rcc: &mut Rcc) -> (Supply, SupplyLevel) {
    const FALLING_2V66: u8 = 4;
    pac::PWR::enable(rcc);
    const { assert!(PVD_LINE == 16) };
    exti.rtsr().modify(|_, w| w.tr16().set_bit());
    exti.imr().modify(|_, w| w.mr16().set_bit());
    // Three bits: any value is one.
    pwr.cr().modify(|_, w| w.pls().set(FALLING_2V66).pvde().set_bit());
    (Supply(exti), SupplyLevel(pwr))
}

/// Version of this crate.
fn version() -> [u8; 3] {
    let number = |text: &str| text.parse().unwrap_or(u8::MAX);
    [
        number(env!("CARGO_PKG_VERSION_MAJOR")),
        number(env!("CARGO_PKG_VERSION_MINOR")),
        number(env!("CARGO_PKG_VERSION_PATCH")),
    ]
}

/// The microcontroller's unique number.
fn serial_number() -> [u8; 12] {
    let uid = Uid::get();
    let mut serial = [0; 12];
    serial[0..2].copy_from_slice(&uid.x().to_le_bytes());
    serial[2..4].copy_from_slice(&uid.y().to_le_bytes());
    serial[4] = uid.waf_num();
    let lot = uid.lot_num().as_bytes();
    serial[5..].iter_mut().zip(lot).for_each(|(place, &byte)| *place = byte);
    serial
}

/// Line of the voltage detector in the interrupt controller.
const PVD_LINE: u32 = 16;

/// The voltage detector's interrupt.
pub(crate) struct Supply(pac::EXTI);

impl Supply {
    /// Has been served.
    pub(crate) fn clear(&mut self) {
        // Cleared by writing ones; the other lines are not used.
        self.0.pr().write(|w| w.pr16().clear_bit_by_one());
    }
}

/// The voltage detector's level.
pub(crate) struct SupplyLevel(pac::PWR);

impl port::SupplyLevel for SupplyLevel {
    fn is_low(&self) -> bool {
        self.0.csr().read().pvdo().bit()
    }
}

/// The independent watchdog, and what a debugger may stop.
pub(crate) struct Watchdog {
    watchdog: IndependentWatchdog,
    debug: pac::DBGMCU,
}

impl Watchdog {
    /// [`port::Watchdog::feed`], for a test that has no supervisor.
    #[allow(dead_code, reason = "the tests of the board call it")]
    pub(crate) fn feed_for_test(&mut self) {
        self.watchdog.feed();
    }
}

impl port::Watchdog for Watchdog {
    fn feed(&mut self) {
        self.watchdog.feed();
    }

    fn stop_on_debug(&mut self, stop: bool) {
        self.watchdog.stop_on_debug(&self.debug, stop);
    }
}

/// Core cycles of a count of the tick's timer.
const TIMER_CYCLES: u32 = timing::CORE_HZ / timing::TICK_TIMER_HZ;

/// TIM4: its update is the tick, its channel 1 the instant at which the converter takes the code.
pub(crate) struct TickTimer(pac::TIM4);

impl TickTimer {
    fn start(timer: pac::TIM4, rcc: &mut Rcc) -> Self {
        pac::TIM4::enable(rcc);
        pac::TIM4::reset(rcc);
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set((timing::TICK_TIMER_COUNTS - 1) as u16));
        // Channel 1 falls with the edge and rises when the converter is to take its code; the converter listens.
        let output_at = timing::OUTPUT_CYCLES / TIMER_CYCLES;
        timer.ccr1().write(|w| w.ccr().set(output_at as u16));
        timer.ccmr1_output().write(|w| w.oc1m().pwm_mode2());
        timer.cr2().write(|w| w.mms().compare_oc1());
        timer.egr().write(|w| w.ug().set_bit());
        timer.sr().write(|w| w.uif().clear_bit());
        timer.dier().write(|w| w.uie().set_bit());
        timer.cr1().write(|w| w.cen().set_bit());
        Self(timer)
    }
}

impl port::TickTimer for TickTimer {
    fn acknowledge(&self) {
        self.0.sr().write(|w| w.uif().clear_bit());
    }

    fn edge_waits(&self) -> bool {
        self.0.sr().read().uif().bit()
    }

    fn cycles_since_edge(&self) -> u32 {
        u32::from(self.0.cnt().read().cnt().bits()) * TIMER_CYCLES
    }
}

/// Either tilt sensor.
pub(crate) enum BoardTilt {
    OnBoard(Accelerometer<Spi<pac::SPI1>, PE3<Output>>),
    Analogue(Inclinometer<InclinometerPin>),
}

impl TiltSource for BoardTilt {
    fn read(&mut self) -> Reading {
        match self {
            BoardTilt::OnBoard(accelerometer) => accelerometer.read(),
            BoardTilt::Analogue(inclinometer) => inclinometer.read(),
        }
    }
}
