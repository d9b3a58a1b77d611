//! The emulated board: a flash image, unmodified, on an STM32F4 with a plant on its pins, a tilt
//! sensor and a USB host on its cable. Which board: [`pins`].
//!
//! Everything that knows the emulator stays in this module; a test sees pins, a shaft, a cable and
//! virtual time. The clock is one instruction a cycle at 168 MHz: it proves order, rates and
//! instruction counts, not cycles. The same image, plant and orders give the same run.

mod amplifier;
mod asked;
mod bus;
pub mod cache;
mod clock;
mod dac;
pub mod elf;
mod exti;
pub mod flash;
mod image_file;
pub mod log;
mod machine;
mod monostable;
pub mod otg;
pub mod pins;
pub mod plant;
mod probe;
pub mod processor;
pub mod record;
mod rtt;
mod run;
pub mod semihosting;
mod snapshot;
mod stopped;
pub mod tilt;
mod tracks;
mod usb_port;
mod usb_power;
mod warm_core;
mod watch;
pub mod wires;
mod world;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use control_core::Device;
use rigless::emulator::{self, Start};
use rigless::session::Session;
use rigless::time::VirtualNanos;

pub use amplifier::Amplifier;
pub use bus::INSTRUCTIONS_PER_SECOND;
pub use monostable::Monostable;
pub use plant::{Drive, Nanos, PlantSide};
pub use probe::{Counted, Effect, HandlerRun, Probe, ToCode};
pub use snapshot::Saved;
pub use stopped::Stopped;
pub use usb_port::UsbPort;
pub use world::{EncoderRead, Log, Output};

use image_file::ImageFile;
use machine::Machine;
use pins::Pins;
use run::{Done, Order, Run};
use world::{PAINT, World};

/// A millisecond of virtual time.
pub const MILLISECOND: Nanos = 1_000_000;

/// One of the part's timers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Timer {
    /// TIM2, TIM3, TIM4 or TIM5: 0 to 3.
    General(usize),
    /// TIM1 or TIM8: 0 or 1.
    Advanced(usize),
}

impl Timer {
    /// The address of its counter.
    #[must_use]
    pub fn count_address(self) -> u64 {
        self.base() + 0x24
    }

    /// The alternate function that leads from a pin to it (data sheet, alternate function mapping).
    fn function(self) -> u64 {
        match self {
            Self::General(0) | Self::Advanced(0) => 1,
            Self::General(_) => 2,
            Self::Advanced(_) => 3,
        }
    }

    /// The address of its first register.
    fn base(self) -> u64 {
        match self {
            Self::General(n) => 0x4000_0000 + 0x400 * n as u64,
            Self::Advanced(n) => 0x4001_0000 + 0x400 * n as u64,
        }
    }
}

/// The source of the amplifier's set value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SetValue {
    /// The part's own converter, 12 bits.
    OnChip,
    /// A converter on PE8 to PE15, 8 bits.
    Lines,
}

/// The connections of the part. The default is the Discovery, with its parts.
#[derive(Debug, Clone, Copy)]
pub struct Wiring {
    /// The timer the encoder's tracks go to.
    pub encoder: Timer,
    /// The timer whose update is the tick, with the rate it counts at in hertz; without one no
    /// latency is measured.
    pub tick: Option<(Timer, u64)>,
    /// The pins in use.
    pub pins: Pins,
    /// The source of the motor's set value.
    pub set_value: SetValue,
    /// The accelerometer, if any.
    pub tilt: Option<tilt::Model>,
    /// True if an analogue inclinometer and its strap are fitted, level until
    /// [`Stopped::set_analogue`] changes it.
    pub inclinometer: bool,
    /// True if the encoder's supply is sensed.
    pub supply_sense: bool,
    /// True if the motor's current is measured.
    pub current_monitor: bool,
    /// True if the converter's output is wired to the current monitor's input, as the board's own
    /// test asks for it.
    pub loopback: bool,
    /// True if the amplifier's enable path goes through a [`Monostable`].
    pub monostable: bool,
    /// The part's supply when it is switched on, in millivolts.
    pub supply: u32,
    /// The period of the plant, in nanoseconds.
    pub plant_period: Nanos,
    /// True if the flash holds the record of a commissioned device, the default one.
    pub commissioned: bool,
}

impl Default for Wiring {
    fn default() -> Self {
        Self {
            encoder: Timer::General(0),
            tick: Some((Timer::General(2), 84_000_000)),
            pins: pins::DISCOVERY,
            set_value: SetValue::OnChip,
            tilt: Some(tilt::Model::Lis3dsh),
            inclinometer: false,
            supply_sense: false,
            current_monitor: false,
            loopback: false,
            monostable: true,
            supply: machine::RAIL_MILLIVOLTS,
            plant_period: 20_000,
            commissioned: true,
        }
    }
}

impl Wiring {
    /// The NUCLEO-F429ZI, with the inclinometer that it needs.
    #[must_use]
    pub fn nucleo_f429zi() -> Self {
        Self { pins: pins::NUCLEO_F429ZI, tilt: None, inclinometer: true, ..Self::default() }
    }
}

/// The reason why a board could not be switched on.
#[derive(Debug)]
pub struct Refused(String);

impl std::fmt::Display for Refused {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for Refused {}

/// Returns the path of the flash image: `FIRMWARE_ELF`, or where `cargo xtask firmware` leaves it.
#[must_use]
pub fn firmware_path() -> PathBuf {
    const DEFAULT: &str = "target/thumbv7em-none-eabihf/firmware/firmware";
    std::env::var_os("FIRMWARE_ELF")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(DEFAULT), PathBuf::from)
}

/// Returns the path of a board's image: in the folder of the default board's.
#[must_use]
pub fn image_for(pins: &Pins) -> PathBuf {
    let default = firmware_path();
    if *pins == pins::DISCOVERY { default } else { default.with_file_name(pins.image) }
}

/// True if two addresses are in one memory of the part, the second as an end.
fn same_memory(low: u64, top: u64) -> bool {
    low < top && low >> 28 == (top - 1) >> 28
}

/// A board that is switched on.
#[derive(Debug)]
pub struct Board {
    orders: Sender<Order>,
    done: Receiver<Done>,
    thread: Option<JoinHandle<Result<(), String>>>,
    probe: Probe,
    flash: flash::Flash,
    image: PathBuf,
    wiring: Wiring,
    file: Arc<ImageFile>,
    stack: Option<(u64, u64)>,
    now: Nanos,
}

impl Board {
    /// Switches on a board with the image at `path`, wired as `wiring`, with `plant` on its shaft.
    /// The core has run nothing yet.
    pub fn on(path: &Path, wiring: Wiring, plant: impl PlantSide + 'static) -> Result<Self, Refused> {
        Self::start(path, wiring, Box::new(plant), None)
    }

    /// Switches on a board, or goes on from where `saved` stood.
    fn start(
        path: &Path,
        wiring: Wiring,
        plant: Box<dyn PlantSide>,
        saved: Option<&Saved>,
    ) -> Result<Self, Refused> {
        let refuse = |why: String| Refused(format!("{}: {why}", path.display()));
        let file = ImageFile::read(path)?;
        let key = file.key;
        let (probe, flash) = (Probe::default(), flash::Flash::default());
        flash.array().supply = wiring.supply;
        if wiring.commissioned {
            record::save(&mut flash.array(), &Device::commissioned_virtual());
        }
        let machine = Machine::new(&wiring, key, probe.clone(), flash.clone())
            .map_err(|error| refuse(error.to_string()))?;
        let mut session =
            Session::new(Box::new(machine), 0, VirtualNanos(0)).map_err(|error| refuse(error.to_string()))?;
        let find = |name: &str| file.places.get(name).ok();
        let stack = find("_stack_start").map(|top| {
            // The stack ends where the image says, or at the foot of the memory its top is in.
            let low =
                ["_stack_end", "__euninit"].into_iter().filter_map(find).find(|low| same_memory(*low, top));
            (low.unwrap_or((top - 1) & !0xFFFF), top)
        });
        let known = world::Symbols { rtt: find("_SEGGER_RTT"), stack };
        let (orders, taken) = channel();
        let (answer, done) = channel();
        let mut world = World::new(wiring, known, plant);
        let resume = saved
            .map(|saved| saved.snapshot.restore(&mut session, &key.digest(), &mut world))
            .transpose()
            .map_err(|error| refuse(error.to_string()))?;
        let run = Run::new(world, key, resume.is_some(), (taken, answer));
        let placed = file.clone();
        let thread = std::thread::spawn(move || {
            let mut start = Start::new(&placed.images);
            start.resume = resume.as_ref();
            let finished = emulator::run(session, &start, run);
            finished.map(drop).map_err(|error| error.to_string())
        });
        let (image, now) = (path.to_path_buf(), saved.map_or(0, |saved| saved.now));
        Ok(Self { orders, done, thread: Some(thread), probe, flash, image, wiring, file, stack, now })
    }

    fn order(&mut self, order: Order) {
        if self.orders.send(order).is_ok() && self.done.recv().is_ok() {
            return;
        }
        let ended = self.thread.take().map(JoinHandle::join);
        panic!("the emulated board stopped at {} ns: {ended:?}", self.now);
    }

    /// Virtual time since the board was switched on.
    #[must_use]
    pub fn now(&self) -> Nanos {
        self.now
    }

    /// Runs to the instant `at`.
    pub fn run_until(&mut self, at: Nanos) {
        if at > self.now {
            self.order(Order::Until(at));
            self.now = at;
        }
    }

    /// Runs for `milliseconds` of virtual time.
    pub fn run_ms(&mut self, milliseconds: u64) {
        self.run_until(self.now + milliseconds * MILLISECOND);
    }

    /// Visits the stopped board.
    pub fn at_stop<T: Send + 'static>(
        &mut self,
        visit: impl FnOnce(&mut Stopped<'_>) -> T + Send + 'static,
    ) -> T {
        let (answer, answered) = channel();
        self.order(Order::Visit(Box::new(move |stopped| {
            let _ = answer.send(visit(stopped));
        })));
        answered.recv().expect("the visit was made")
    }

    /// Leaves word of a cold motor in the memory that no start-up clears, as after a reset: without
    /// it the firmware does not know how warm it is.
    ///
    /// # Panics
    ///
    /// When the image has no such memory.
    pub fn cool_motor(&mut self) {
        let words = self.file.symbols.iter().find(|symbol| symbol.name.contains("LAST_WORDS"));
        let end = words.map(|symbol| symbol.address + symbol.size).expect("the last words");
        let is_left = self.at_stop(move |stopped| {
            stopped.set_word((end - 8).into(), 0) && stopped.set_word((end - 4).into(), u32::MAX)
        });
        assert!(is_left, "the last words are in RAM");
    }

    /// The probe on the core: counts by interrupt, and jumps.
    #[must_use]
    pub fn probe(&self) -> Probe {
        self.probe.clone()
    }

    /// The sectors of flash that the firmware writes to.
    #[must_use]
    pub fn flash(&self) -> flash::Flash {
        self.flash.clone()
    }

    /// Every function and object of the image.
    #[must_use]
    pub fn symbols(&self) -> &[elf::Symbol] {
        &self.file.symbols
    }

    /// The function or object at `address`.
    #[must_use]
    pub fn symbol_at(&self, address: u32) -> Option<&elf::Symbol> {
        self.file
            .symbols
            .iter()
            .find(|symbol| (symbol.address..symbol.address + symbol.size).contains(&address))
    }

    /// The most stack the firmware has used, and what it has, in bytes; `None` where the image
    /// doesn't say where its stack is.
    pub fn stack_use(&mut self) -> Option<(u64, u64)> {
        let (low, high) = self.stack?;
        let untouched = self.at_stop(move |stopped| {
            (low..high).step_by(4).take_while(|&address| stopped.word(address) == Some(PAINT)).count()
        });
        Some((high - low - 4 * untouched as u64, high - low))
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.orders.send(Order::End);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
