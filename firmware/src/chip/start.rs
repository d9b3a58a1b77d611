//! Start-up, in parts: the clocks, then the board's pins, the amplifier first ([`Parts`]). After
//! that nothing runs by itself, and nothing has been written. The image starts all of it
//! ([`Chip::start`]), the board's own test what it uses. The image masks interrupts meanwhile.

use super::brownout;
use super::clock::{self, Source};
use super::encoder::{Encoder, EncoderLines};
use super::flash::Sectors;
use super::lamps::Lamps;
use super::monitors::DriveLines;
use super::supply::{self, Supply, SupplyLevel};
use super::tick_timer::TickTimer;
use super::watchdog::Watchdog;
use super::{Stm32F4, Wiring, usb};
use crate::last_words::LAST_WORDS;
use control_core::ceilings::Ceilings;
use control_core::event::Fault;
use control_core::{Device, Patient, Plan};
use cortex_m::peripheral::SYST;
use firmware::drive::Converters;
use firmware::port::Board;
use firmware::reset::{Crash, ResetFlags, Said, cause};
use firmware::store::{Nor, Store, Stored};
use firmware::tasks::tick::BoardDrive;
use firmware::timing;
use link::build::Build;
use link::device::Identity;
use stm32f4xx_hal::gpio::{PA11, PA12};
use stm32f4xx_hal::pac;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::signature::Uid;

/// Memory that must outlive start-up.
pub(crate) type Statics = usb::Statics;

/// The first part is done: the clocks run.
pub(crate) struct Begun {
    /// For what the board switches on.
    pub(crate) rcc: Rcc,
    flags: ResetFlags,
}

impl Begun {
    /// Waits for the board's clock.
    pub(crate) fn new(rcc: pac::RCC, source: Source) -> Self {
        let flags = clock::reset_flags(&rcc);
        Self { rcc: clock::start(rcc, source), flags }
    }
}

/// The peripherals that no board uses for anything else.
pub(crate) struct Own {
    pub(crate) flash: pac::FLASH,
    pub(crate) power: pac::PWR,
    pub(crate) external: pac::EXTI,
    pub(crate) usb: (pac::OTG_FS_GLOBAL, pac::OTG_FS_DEVICE, pac::OTG_FS_PWRCLK),
    pub(crate) usb_pins: (PA11, PA12),
    pub(crate) tick_timer: pac::TIM4,
    pub(crate) watchdog: pac::IWDG,
    pub(crate) debug: pac::DBGMCU,
}

/// [`Own`] of the peripherals and of the port that has the pins of USB.
macro_rules! own {
    ($device:ident, $gpioa:ident) => {
        $crate::chip::Own {
            flash: $device.FLASH,
            power: $device.PWR,
            external: $device.EXTI,
            usb: ($device.OTG_FS_GLOBAL, $device.OTG_FS_DEVICE, $device.OTG_FS_PWRCLK),
            usb_pins: ($gpioa.pa11, $gpioa.pa12),
            tick_timer: $device.TIM4,
            watchdog: $device.IWDG,
            debug: $device.DBGMCU,
        }
    };
}
pub(crate) use own;

/// The pins as the board has set them up.
pub(crate) struct Wired<W: Wiring> {
    pub(crate) encoder: (Encoder, EncoderLines),
    pub(crate) drive: BoardDrive<Stm32F4<W>>,
    pub(crate) drive_lines: DriveLines,
    pub(crate) tilt: W::Tilt,
    pub(crate) lamps: Lamps,
}

/// The parts of a board on which nothing runs yet but its clocks.
pub(crate) struct Parts<W: Wiring> {
    pub(crate) wired: Wired<W>,
    pub(crate) supply: Supply,
    pub(crate) supply_level: SupplyLevel,
    pub(crate) chip: Chip,
}

/// The peripherals that the microcontroller works with by itself, once they are started.
pub(crate) struct Chip {
    pub(crate) flash: Sectors,
    pub(crate) usb: usb::Core,
    pub(crate) tick_timer: pac::TIM4,
    pub(crate) watchdog: (pac::IWDG, pac::DBGMCU),
    pub(crate) rcc: Rcc,
    systick: SYST,
    flags: ResetFlags,
}

/// The parts that run from now on.
pub(crate) struct Started {
    pub(crate) tick_timer: TickTimer,
    pub(crate) serial: usb::Port,
    pub(crate) watchdog: Watchdog,
    pub(crate) store: Store<Nor<Sectors>>,
    pub(crate) plan: Plan,
    pub(crate) heat: Option<u32>,
    pub(crate) identity: Identity,
    pub(crate) reset_cause: Option<Fault>,
    pub(crate) crash: Option<Crash>,
}

impl<W: Wiring> Parts<W> {
    /// After the board's pins: the cycle counter and the supply's detector.
    pub(crate) fn new(begun: Begun, mut core: cortex_m::Peripherals, own: Own, wired: Wired<W>) -> Self {
        let Begun { mut rcc, flags } = begun;
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        // Keeps the core's clock up in sleep: a debugger can read the log then, and the cycle
        // counter counts on. What it costs: `sleep`.
        own.debug.cr().modify(|_, w| w.dbg_sleep().set_bit());
        brownout::note_loaded(&own.flash);
        let (supply, supply_level) = supply::warning(own.power, own.external, &mut rcc);
        let chip = Chip {
            flash: Sectors::new(own.flash),
            usb: usb::Core::new(own.usb, own.usb_pins, &rcc),
            tick_timer: own.tick_timer,
            watchdog: (own.watchdog, own.debug),
            rcc,
            systick: core.SYST,
            flags,
        };
        Self { wired, supply, supply_level, chip }
    }
}

impl Chip {
    /// Reads the configuration, which may erase a slot; then the watchdog before whatever could
    /// hang, USB, and the clocks of the supervisor and of the tick.
    pub(crate) fn start<W: Wiring>(mut self, statics: &'static mut Statics) -> Started {
        let Said { crash, torque, heat } = LAST_WORDS.take();
        let (store, device_part, patient_part) = Store::open(Nor(self.flash));
        let ceilings = W::CEILINGS.with_converters(<Stm32F4<W> as Board>::Converters::WIDTHS);
        let (plan, damage) = plan(&ceilings, device_part, patient_part);
        let reset_cause = cause(self.flags, crash.as_ref(), torque).or(damage);
        match &crash {
            Some(crash) => say(crash),
            None => defmt::info!("started; torque is off"),
        }

        let (timer, debug) = self.watchdog;
        let watchdog = Watchdog::start(timer, debug, W::ALIVE);
        let serial = usb::init(self.usb, serial_number(), statics);
        let mut systick = self.systick;
        systick.set_clock_source(cortex_m::peripheral::syst::SystClkSource::Core);
        systick.set_reload(timing::CORE_HZ / timing::SUPERVISOR_HZ - 1);
        systick.clear_current();
        systick.enable_counter();
        systick.enable_interrupt();
        Started {
            tick_timer: TickTimer::start(self.tick_timer, &mut self.rcc),
            serial,
            watchdog,
            store,
            plan,
            heat,
            identity: Identity {
                serial: serial_number(),
                firmware: version(),
                build: Build::parse(env!("NEEDLE_BUILD")),
                ceilings,
            },
            reset_cause,
            crash,
        }
    }
}

/// Logs the crash that ended the last run.
fn say(crash: &Crash) {
    let Crash { kind, detail, pc, lr, fault_status, bus_address, file } = crash;
    defmt::warn!(
        "last run ended: kind {=u8}, detail {=u32:#x}, PC {=u32:#x}, LR {=u32:#x}, CFSR {=u32:#x}, BFAR {=u32:#x}, file {=str}",
        *kind as u8,
        *detail,
        *pc,
        *lr,
        *fault_status,
        *bus_address,
        file.as_str()
    );
}

/// The stored parts where they may run, else the default of the part that may not, and what is to
/// be said of it.
fn plan(ceilings: &Ceilings, device: Stored<Device>, patient: Stored<Patient>) -> (Plan, Option<Fault>) {
    // The widest converter that there is: none is left of a record.
    let unknown = Device { dac: ceilings.converters[1], ..Device::default() };
    let (device, lost_device) = device.or(unknown);
    let is_too_much = ceilings.check(&device).is_err();
    let device = if is_too_much { unknown } else { device };
    let (patient, lost_patient) = patient.or(Patient::default());
    let fault = (lost_device || lost_patient || is_too_much).then_some(Fault::StoredConfig);
    // A patient for another device leaves, and a device that may not be leaves the default.
    let fitting = Plan::new(&device, &patient).map(|plan| (plan, fault));
    let parts = [(device, Patient::nobody()), (unknown, Patient::default())];
    let plan = fitting.or_else(|_| {
        let plan = parts.iter().find_map(|(device, patient)| Plan::new(device, patient).ok());
        plan.map(|plan| (plan, Some(Fault::StoredConfig))).ok_or(())
    });
    match plan {
        Ok(plan) => plan,
        Err(()) => panic!("the default configuration is refused"),
    }
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
pub(crate) fn serial_number() -> [u8; 12] {
    let uid = Uid::get();
    let mut serial = [0; 12];
    serial[0..2].copy_from_slice(&uid.x().to_le_bytes());
    serial[2..4].copy_from_slice(&uid.y().to_le_bytes());
    serial[4] = uid.waf_num();
    let lot = uid.lot_num().as_bytes();
    serial[5..].iter_mut().zip(lot).for_each(|(place, &byte)| *place = byte);
    serial
}
