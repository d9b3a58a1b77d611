//! A board made of memory, and the tasks' ends on it.

use super::super::queues::{Ends, Queued, Queues, TelemetryEnds};
use super::super::shared::Shared;
use super::super::tick::Tick;
use crate::drive::{Drive, MotorDac, Two};
use crate::monitor::Readings;
use crate::port::{self, Board, WouldBlock};
use crate::reset::LastWords;
use crate::store::{ConfigFlash, Slot, StoreError};
use crate::tilt::{Reading, TiltSource};
use crate::timing;
use crate::wire_check::{Pull, PulledLines};
use control_core::config::DacWidth;
use control_core::units::{Counts, DacCode};
use control_core::{Device, Order, Patient, Plan};
use core::cell::{Cell, RefCell};
use core::convert::Infallible;
use core::sync::atomic::Ordering::Relaxed;
use embedded_hal::digital::{ErrorType, OutputPin};
use link::frames::GuardRefusal;
use std::boxed::Box;
use std::collections::VecDeque;
use std::thread_local;
use std::vec::Vec;

/// The state of the board that a test sets and sees; each test has a thread, and so a board, of its
/// own.
#[derive(Default)]
pub(super) struct World {
    pub(super) cycles: Cell<u32>,
    pub(super) since_edge: Cell<u32>,
    pub(super) edge_waits: Cell<bool>,
    pub(super) count: Cell<i32>,
    pub(super) codes: RefCell<Vec<u16>>,
    pub(super) enabled: Cell<bool>,
    pub(super) readings: Cell<Readings>,
    pub(super) supply_low: Cell<bool>,
    pub(super) wire_off: Cell<bool>,
    pub(super) fed: Cell<u32>,
    pub(super) stops_on_debug: Cell<bool>,
    pub(super) tilt: Cell<Option<Reading>>,
    pub(super) woken: Cell<[u32; 3]>,
    pub(super) usb_allowed: Cell<bool>,
    pub(super) configured: Cell<bool>,
    pub(super) open: Cell<bool>,
    pub(super) incoming: RefCell<VecDeque<Vec<u8>>>,
    pub(super) outgoing: RefCell<Vec<Vec<u8>>>,
    pub(super) room: Cell<usize>,
    pub(super) flash_fails: Cell<bool>,
    pub(super) program_cycles: Cell<u32>,
    pub(super) lamps: Cell<(bool, bool)>,
    pub(super) guarded: Cell<u32>,
}

thread_local! {
    static WORLD: &'static World = Box::leak(Box::default());
}

pub(super) fn world() -> &'static World {
    WORLD.with(|world| *world)
}

pub(super) struct Fake;
pub(super) struct Part;

impl Board for Fake {
    type Timer = Part;
    type Encoder = Part;
    type Converters = Two<Part, Eight>;
    type Enable = Part;
    type EncoderLines = Lines;
    type DriveLines = Part;
    type Supply = Part;
    type Watchdog = Part;
    type Tilt = Part;
    type Lamps = Part;
    type Serial = Part;
    type Flash = Words;

    fn cycles() -> u32 {
        world().cycles.get()
    }

    fn wake_usb() {
        wake(0);
    }

    fn wake_telemetry() {
        wake(1);
    }

    fn wake_tilt() {
        wake(2);
    }

    fn allow_usb(allowed: bool) {
        world().usb_allowed.set(allowed);
    }

    fn guard_supply(set: bool) -> Result<(), GuardRefusal> {
        world().guarded.set(world().guarded.get() + 1);
        if set { Err(GuardRefusal::Restart) } else { Err(GuardRefusal::Off) }
    }
}

fn wake(task: usize) {
    let mut woken = world().woken.get();
    woken[task] += 1;
    world().woken.set(woken);
}

impl port::TickTimer for Part {
    fn acknowledge(&self) {
        world().edge_waits.set(false);
    }

    fn edge_waits(&self) -> bool {
        world().edge_waits.get()
    }

    fn cycles_since_edge(&self) -> u32 {
        world().since_edge.get()
    }
}

impl port::Encoder for Part {
    fn count(&self) -> Counts {
        Counts(world().count.get())
    }
}

impl MotorDac for Part {
    const WIDTH: DacWidth = DacWidth::BITS_12;

    fn put(&mut self, code: DacCode) {
        world().codes.borrow_mut().push(code.0);
    }
}

pub(super) struct Eight;

impl MotorDac for Eight {
    const WIDTH: DacWidth = DacWidth::BITS_8;

    fn put(&mut self, _code: DacCode) {}
}

impl ErrorType for Part {
    type Error = Infallible;
}

impl OutputPin for Part {
    fn set_low(&mut self) -> Result<(), Infallible> {
        world().enabled.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        world().enabled.set(true);
        Ok(())
    }
}

pub(super) struct Lines(pub(super) Pull);

impl PulledLines for Lines {
    const ALL: u8 = 0b11;

    fn has_supply(&self) -> bool {
        false
    }

    fn high(&mut self) -> u8 {
        if world().wire_off.get() { u8::from(self.0 == Pull::Up) } else { 0 }
    }

    fn pull(&mut self, pull: Pull) {
        self.0 = pull;
    }

    fn settle(&mut self) {}
}

impl port::ReadDrive for Part {
    fn read(&self) -> Readings {
        world().readings.get()
    }
}

impl port::SupplyLevel for Part {
    fn is_low(&self) -> bool {
        world().supply_low.get()
    }
}

impl port::Watchdog for Part {
    fn feed(&mut self) {
        world().fed.set(world().fed.get() + 1);
    }

    fn stop_on_debug(&mut self, stop: bool) {
        world().stops_on_debug.set(stop);
    }
}

impl port::Lamps for Part {
    fn show(&mut self, powered: bool, fault: bool) {
        world().lamps.set((powered, fault));
    }
}

impl TiltSource for Part {
    fn read(&mut self) -> Reading {
        world().tilt.get().unwrap_or(Reading::Unchanged)
    }
}

impl port::SerialPort for Part {
    fn poll(&mut self) {}

    fn is_configured(&self) -> bool {
        world().configured.get()
    }

    fn is_open(&self) -> bool {
        world().open.get()
    }

    fn read(&mut self, packet: &mut [u8]) -> Result<usize, WouldBlock> {
        let bytes = world().incoming.borrow_mut().pop_front().ok_or(WouldBlock)?;
        packet[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn write(&mut self, packet: &[u8]) -> Result<(), WouldBlock> {
        let left = world().room.get().checked_sub(1).ok_or(WouldBlock)?;
        world().room.set(left);
        world().outgoing.borrow_mut().push(packet.into());
        Ok(())
    }
}

pub(super) struct Words(pub(super) [Vec<u32>; 2]);

impl ConfigFlash for Words {
    const CELLS: usize = 8;

    fn word(&mut self, slot: Slot, index: usize) -> u32 {
        self.0[slot as usize][index]
    }

    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
        if world().flash_fails.get() {
            return Err(StoreError::Flash);
        }
        self.0[slot as usize][index] &= word;
        world().cycles.set(world().cycles.get().wrapping_add(world().program_cycles.get()));
        Ok(())
    }

    fn erase(&mut self, slot: Slot) -> Result<(), StoreError> {
        self.0[slot as usize].fill(u32::MAX);
        Ok(())
    }
}

pub(super) fn plan() -> Plan {
    Plan::new(&Device::commissioned_virtual(), &Patient::default()).unwrap()
}

pub(super) fn shared() -> &'static Shared {
    let words: &'static LastWords = Box::leak(Box::new(LastWords::new()));
    Box::leak(Box::new(Shared::new(words)))
}

/// The ends of queues that live as long as the test's process.
pub(super) fn ends() -> Ends {
    let queues: &'static mut Queues = Box::leak(Box::new(Queues::new()));
    queues.split()
}

/// A tick with its far ends; nothing has run yet.
pub(super) fn tick() -> (Tick<Fake>, &'static Shared, TelemetryEnds) {
    let shared = shared();
    let Ends { tick: tick_ends, telemetry: (telemetry, _), .. } = ends();
    let drive = Drive::new(Two { wide: Part, narrow: Eight }, Part);
    (Tick::new(shared, (Part, Part, drive), &plan(), Some(0), tick_ends), shared, telemetry)
}

/// Runs `tick` as often, with the clock and a supervisor that is alive.
pub(super) fn run(tick: &mut Tick<Fake>, shared: &Shared, ticks: u32) {
    for _ in 0..ticks {
        world().cycles.set(world().cycles.get().wrapping_add(timing::TICK_CYCLES));
        shared.supervised_ms.fetch_add(1, Relaxed);
        tick.run();
    }
}

/// As telemetry passes on an order that has so many stops before it.
pub(super) fn order(telemetry: &mut TelemetryEnds, stops: u32, order: Order) {
    assert!(telemetry.orders.enqueue(Queued { stops, order: Some(order) }).is_ok());
}
