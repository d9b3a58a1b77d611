//! The tasks on a board made of memory: each by itself, at the edges of what it is for.

use super::queues::{Packet, Queues, SmallOrder, TelemetryEnds, TickEnds, Ticked, UsbEnds};
use super::shared::{LINK_CONFIGURED, LINK_READY, Shared};
use super::supervisor::Watch;
use super::telemetry::Telemetry;
use super::tick::Tick;
use super::tilt::Tilt;
use super::usb::Port;
use crate::drive::{Drive, MotorDac};
use crate::lines::{Pull, PulledLines};
use crate::monitor::Readings;
use crate::port::{self, Board, WouldBlock};
use crate::reset::LastWords;
use crate::store::{CELL_WORDS, ConfigFlash, Slot, Store, StoreError};
use crate::supervision::Task;
use crate::tilt::{Reading, TiltSource, TiltTrouble};
use crate::timing;
use control_core::config::DacWidth;
use control_core::controller::TickInput;
use control_core::event::{Fault, State};
use control_core::interlock::Interlock;
use control_core::units::{Counts, DacCode, Milliradians};
use control_core::{Controller, Device, Patient, Plan};
use core::cell::{Cell, RefCell};
use core::convert::Infallible;
use core::sync::atomic::Ordering::Relaxed;
use embedded_hal::digital::{ErrorType, OutputPin};
use link::Command;
use link::codec::MAX_FRAME;
use link::device::{Identity, Waiting};
use link::frames::{DeviceFrame, EventKind, PROTOCOL_VERSION, Rejection, SaveFailure};
use link::host::{Commands, Reception};
use std::boxed::Box;
use std::collections::VecDeque;
use std::thread_local;
use std::vec::Vec;

/// What a test sets and sees of the board; each test has a thread, and so a board, of its own.
#[derive(Default)]
struct World {
    cycles: Cell<u32>,
    since_edge: Cell<u32>,
    edge_waits: Cell<bool>,
    count: Cell<i32>,
    codes: RefCell<Vec<u16>>,
    enabled: Cell<bool>,
    readings: Cell<Readings>,
    supply_low: Cell<bool>,
    wire_off: Cell<bool>,
    fed: Cell<u32>,
    stops_on_debug: Cell<bool>,
    tilt: Cell<Option<Reading>>,
    woken: Cell<[u32; 3]>,
    usb_allowed: Cell<bool>,
    configured: Cell<bool>,
    open: Cell<bool>,
    incoming: RefCell<VecDeque<Vec<u8>>>,
    outgoing: RefCell<Vec<Vec<u8>>>,
    room: Cell<usize>,
    flash_fails: Cell<bool>,
}

thread_local! {
    static WORLD: &'static World = Box::leak(Box::default());
}

fn world() -> &'static World {
    WORLD.with(|world| *world)
}

struct Fake;
struct Part;

impl Board for Fake {
    type Timer = Part;
    type Encoder = Part;
    type Dac12 = Part;
    type Dac8 = Eight;
    type Enable = Part;
    type EncoderLines = Lines;
    type DriveLines = Part;
    type Supply = Part;
    type Watchdog = Part;
    type Tilt = Part;
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
    const WIDTH: DacWidth = DacWidth::Bits12;

    fn put(&mut self, code: DacCode) {
        world().codes.borrow_mut().push(code.0);
    }
}

struct Eight;

impl MotorDac for Eight {
    const WIDTH: DacWidth = DacWidth::Bits8;

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

struct Lines(Pull);

impl PulledLines for Lines {
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

struct Words([Vec<u32>; 2]);

impl ConfigFlash for Words {
    const CELLS: usize = 8;

    fn word(&self, slot: Slot, index: usize) -> u32 {
        self.0[slot as usize][index]
    }

    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
        if world().flash_fails.get() {
            return Err(StoreError::Flash);
        }
        self.0[slot as usize][index] &= word;
        Ok(())
    }

    fn erase(&mut self, slot: Slot) -> Result<(), StoreError> {
        self.0[slot as usize].fill(u32::MAX);
        Ok(())
    }
}

fn plan() -> Plan {
    Plan::new(&Device::default(), &Patient::default()).unwrap()
}

fn shared() -> &'static Shared {
    let words: &'static LastWords = Box::leak(Box::new(LastWords::new()));
    Box::leak(Box::new(Shared::new(words)))
}

/// The ends of queues that live as long as the test's process.
fn ends() -> (TickEnds, UsbEnds, (TelemetryEnds, &'static mut Waiting)) {
    let queues: &'static mut Queues = Box::leak(Box::new(Queues::new()));
    let ends = queues.split();
    (ends.tick, ends.usb, ends.telemetry)
}

/// A tick with its far ends; nothing has run yet.
fn tick() -> (Tick<Fake>, &'static Shared, TelemetryEnds) {
    let shared = shared();
    let (tick_ends, _, (telemetry, _)) = ends();
    let drive = Drive::new(Part, Eight, Part);
    (Tick::new(shared, (Part, Part, drive), &plan(), 0, tick_ends), shared, telemetry)
}

/// Runs `tick` as often, with the clock and a supervisor that is alive.
fn run(tick: &mut Tick<Fake>, shared: &Shared, ticks: u32) {
    for _ in 0..ticks {
        world().cycles.set(world().cycles.get().wrapping_add(timing::TICK_CYCLES));
        shared.supervised_ms.fetch_add(1, Relaxed);
        tick.run();
    }
}

fn order(telemetry: &mut TelemetryEnds, order: SmallOrder) {
    assert!(telemetry.orders.enqueue(order).is_ok());
}

#[test]
fn the_tick_starts_for_the_session_that_is_there_and_for_no_other() {
    let (mut tick, shared, mut telemetry) = tick();
    shared.session.store(7, Relaxed);
    order(&mut telemetry, SmallOrder::Start(6));
    run(&mut tick, shared, 3);
    assert!(!world().enabled.get() && !shared.is_powered(), "of a PC that is gone");
    order(&mut telemetry, SmallOrder::Start(7));
    run(&mut tick, shared, 2);
    assert!(world().enabled.get() && shared.is_powered());
    order(&mut telemetry, SmallOrder::Stop);
    run(&mut tick, shared, 2);
    assert!(!world().enabled.get() && !shared.is_powered());
    assert_eq!(world().codes.borrow().last(), Some(&2048));
}

#[test]
fn the_tick_does_not_start_under_an_interlock_and_says_why() {
    let (mut tick, shared, mut telemetry) = tick();
    shared.conditions.set(Interlock::EmergencyStop, true);
    order(&mut telemetry, SmallOrder::Start(0));
    run(&mut tick, shared, 2);
    assert!(!world().enabled.get());
    let tripped = core::iter::from_fn(|| telemetry.outputs.dequeue()).find_map(|t: Ticked| t.output.tripped);
    assert_eq!(tripped, Some(Fault::EmergencyStop));
}

#[test]
fn the_tick_takes_a_trip_at_once_and_a_plan_only_without_torque() {
    let (mut tick, shared, mut telemetry) = tick();
    let eight = Device { dac: DacWidth::Bits8, ..Device::default() };
    let eight = Plan::new(&eight, &Patient::default()).unwrap();
    let configure = |telemetry: &mut TelemetryEnds| {
        assert!(telemetry.large_orders.enqueue(control_core::Order::Configure(eight.clone())).is_ok());
        order(telemetry, SmallOrder::Large(0));
    };
    order(&mut telemetry, SmallOrder::Start(0));
    run(&mut tick, shared, 2);
    configure(&mut telemetry);
    run(&mut tick, shared, 2);
    assert_eq!(tick.width(), DacWidth::Bits12, "torque is on");
    shared.trips.raise(Fault::Tilt);
    run(&mut tick, shared, 1);
    assert!(!world().enabled.get());
    configure(&mut telemetry);
    run(&mut tick, shared, 2);
    assert_eq!(tick.width(), DacWidth::Bits8);
}

#[test]
fn the_tick_misses_its_supervisor() {
    let (mut tick, shared, mut telemetry) = tick();
    order(&mut telemetry, SmallOrder::Start(0));
    run(&mut tick, shared, 2);
    for silent in 1..=timing::SUPERVISOR_SILENCE_TICKS {
        assert!(world().enabled.get(), "after {silent} ticks");
        world().cycles.set(world().cycles.get().wrapping_add(timing::TICK_CYCLES));
        tick.run();
    }
    run(&mut tick, shared, 1);
    assert!(!world().enabled.get());
}

#[test]
fn a_tick_that_comes_late_is_counted_and_takes_torque_away() {
    let (mut tick, shared, mut telemetry) = tick();
    run(&mut tick, shared, 3);
    assert_eq!(shared.missed_ticks.load(Relaxed), 0, "the first has none before it");
    // Three periods later: two are missing.
    world().cycles.set(world().cycles.get() + 2 * timing::TICK_CYCLES);
    run(&mut tick, shared, 1);
    assert_eq!((shared.missed_ticks.load(Relaxed), shared.trips.is_empty()), (2, true), "torque is off");
    order(&mut telemetry, SmallOrder::Start(0));
    run(&mut tick, shared, 2);
    world().cycles.set(world().cycles.get() + timing::TICK_CYCLES);
    run(&mut tick, shared, 1);
    assert_eq!((shared.missed_ticks.load(Relaxed), shared.trips.take()), (3, Some(Fault::Overrun)));
    shared.conditions.set(Interlock::Saving, true);
    world().cycles.set(world().cycles.get() + 10 * timing::TICK_CYCLES);
    run(&mut tick, shared, 1);
    assert_eq!(shared.missed_ticks.load(Relaxed), 3, "an erasure stops the processor");
}

/// After 119 hours the number of ticks begins again; a tick that is missed then is missed.
#[test]
fn the_number_of_ticks_wraps_without_a_word() {
    let (mut tick, shared, mut telemetry) = tick();
    tick.set_number(u32::MAX - 1);
    run(&mut tick, shared, 2);
    world().cycles.set(world().cycles.get().wrapping_add(timing::TICK_CYCLES));
    run(&mut tick, shared, 1);
    assert_eq!(shared.missed_ticks.load(Relaxed), 1);
    let numbers: Vec<u32> = core::iter::from_fn(|| telemetry.outputs.dequeue()).map(|t| t.tick).collect();
    assert_eq!(numbers, [u32::MAX - 1, u32::MAX, 0]);
}

#[test]
fn the_tick_leaves_word_of_its_torque_and_of_the_motors_heat() {
    let (mut tick, shared, mut telemetry) = tick();
    // A needle 2 mm deep, that a wall pushes out.
    world().count.set(127);
    order(&mut telemetry, SmallOrder::Start(0));
    for second in 0..20_000 {
        world().count.set(127 + [0, 1, 2, 1][second / 250 % 4]);
        order(&mut telemetry, SmallOrder::Heartbeat);
        run(&mut tick, shared, 1);
        let _ = telemetry.outputs.dequeue();
    }
    let said = shared.last_words.take();
    assert!(said.torque && said.heat > 0, "{said:?}");
    assert!(shared.given().0 < 2048 - 100, "{:?}", shared.given());
}

/// A supervisor whose drive says that all is well.
fn supervisor() -> (Watch<Fake>, &'static Shared) {
    world().readings.set(Readings { ready: true, ..Readings::default() });
    let shared = shared();
    (Watch::new(shared, Part, Part, Lines(Pull::Up), Part), shared)
}

fn supervise(watch: &mut Watch<Fake>, shared: &Shared, ms: u32) {
    for _ in 0..ms {
        Task::ALL.into_iter().for_each(|task| shared.reports.alive(task));
        watch.run();
    }
}

#[test]
fn the_supervisor_feeds_while_all_report_and_wakes_everybody() {
    let (mut watch, shared) = supervisor();
    supervise(&mut watch, shared, 10);
    assert_eq!((world().fed.get(), world().woken.get()), (10, [10, 10, 2]));
    assert_eq!(shared.supervised_ms.load(Relaxed), 10);
    assert!(world().stops_on_debug.get() && shared.trips.is_empty());
    shared.powered.store(true, Relaxed);
    world().readings.set(Readings { ready: true, enable_line: true, ..Readings::default() });
    supervise(&mut watch, shared, 1);
    assert!(!world().stops_on_debug.get(), "a halt with torque on is ended by the watchdog");
    for _ in 0..20 {
        shared.reports.alive(Task::Tick);
        watch.run();
    }
    assert!(world().fed.get() < 20);
    assert_eq!(shared.trips.take(), Some(Fault::Watchdog));
    assert!(shared.last_words.take().crash.is_some());
}

#[test]
fn what_the_supervisor_sees_is_an_interlock_and_under_torque_a_fault() {
    type Break = fn();
    let all: [(Break, Interlock); 4] = [
        (|| world().supply_low.set(true), Interlock::Supply),
        (|| world().wire_off.set(true), Interlock::EncoderWire),
        (
            || world().readings.set(Readings { stop_open: true, ..world().readings.get() }),
            Interlock::EmergencyStop,
        ),
        (
            || world().readings.set(Readings { ready: false, ..world().readings.get() }),
            Interlock::AmplifierNotReady,
        ),
    ];
    for powered in [false, true] {
        for (breaks, interlock) in all {
            world().supply_low.set(false);
            world().wire_off.set(false);
            let (mut watch, shared) = supervisor();
            shared.powered.store(powered, Relaxed);
            world().readings.set(Readings { enable_line: powered, ..world().readings.get() });
            supervise(&mut watch, shared, 10);
            assert_eq!((shared.conditions.get().first(), shared.trips.is_empty()), (None, true));
            breaks();
            supervise(&mut watch, shared, 2);
            assert_eq!(shared.conditions.get().first(), Some(interlock));
            assert_eq!(shared.trips.take(), powered.then_some(interlock.fault()), "{interlock:?}");
        }
    }
}

#[test]
fn an_enable_line_that_does_not_rise_is_a_fault_under_torque_only() {
    let (mut watch, shared) = supervisor();
    supervise(&mut watch, shared, 5);
    assert!(shared.trips.is_empty());
    shared.powered.store(true, Relaxed);
    supervise(&mut watch, shared, 2);
    assert_eq!(shared.trips.take(), Some(Fault::AmplifierNotReady));
}

#[test]
fn the_tilt_task_gives_what_it_measures_and_trips_under_torque() {
    let shared = shared();
    let mut tilt: Tilt<Fake> = Tilt::new(shared, Part);
    world().tilt.set(Some(Reading::New(Milliradians(-321))));
    tilt.run();
    assert_eq!(shared.tilt(), Milliradians(-321));
    world().tilt.set(Some(Reading::Failed(TiltTrouble::Absent)));
    (0..100).for_each(|_| tilt.run());
    assert!(shared.trips.is_empty(), "torque is off");
    shared.powered.store(true, Relaxed);
    tilt.run();
    assert_eq!(shared.trips.take(), Some(Fault::Tilt));
}

#[test]
fn the_port_passes_packets_on_both_ways_and_ends_a_full_one() {
    let shared = shared();
    let (_, usb, (mut telemetry, _)) = ends();
    let mut port: Port<Fake> = Port::new(shared, Part, usb);
    let packet = |bytes: &[u8]| Packet::from_slice(bytes).unwrap();
    world().incoming.borrow_mut().push_back([1, 2, 3].into());
    world().room.set(10);
    assert!(telemetry.to_pc.enqueue(packet(&[9; 64])).is_ok());
    port.run();
    assert_eq!(telemetry.from_pc.dequeue(), Some(packet(&[1, 2, 3])));
    assert_eq!(shared.link.load(Relaxed), 0);
    assert!(
        world().outgoing.borrow().is_empty() && telemetry.to_pc.is_empty(),
        "nobody is there: thrown away"
    );
    world().configured.set(true);
    world().open.set(true);
    assert!(telemetry.to_pc.enqueue(packet(&[9; 64])).is_ok());
    world().room.set(1);
    port.run();
    assert_eq!(shared.link.load(Relaxed), LINK_CONFIGURED | LINK_READY);
    assert_eq!(world().outgoing.borrow().len(), 1);
    world().room.set(1);
    port.run();
    assert_eq!(world().outgoing.borrow().last().map(Vec::len), Some(0), "the host waits for a shorter one");
    assert!(telemetry.to_pc.enqueue(packet(&[9; 64])).is_ok());
    shared.discard.store(true, Relaxed);
    world().room.set(10);
    port.run();
    assert_eq!(world().outgoing.borrow().len(), 2, "for a PC that is gone");
}

#[test]
fn a_port_without_room_keeps_its_interrupt_away() {
    let shared = shared();
    let (_, usb, (mut telemetry, _)) = ends();
    let mut port: Port<Fake> = Port::new(shared, Part, usb);
    world().usb_allowed.set(true);
    for _ in 0..40 {
        world().incoming.borrow_mut().push_back([7].into());
    }
    (0..40).for_each(|_| port.run());
    assert!(!world().usb_allowed.get());
    let taken = core::iter::from_fn(|| telemetry.from_pc.dequeue()).count();
    assert_eq!((taken, world().incoming.borrow().len()), (15, 25), "what there is no room for stays");
}

/// Telemetry with a PC at the far ends of its queues.
struct Desk {
    telemetry: Telemetry<Fake>,
    shared: &'static Shared,
    tick: TickEnds,
    usb: UsbEnds,
    commands: Commands,
    reception: Reception,
}

impl Desk {
    fn new() -> Self {
        let shared = shared();
        let (tick, usb, telemetry_ends) = ends();
        let identity = Identity { firmware: [1, 2, 3], ..Identity::VIRTUAL };
        let blank = || std::vec![u32::MAX; Words::CELLS * CELL_WORDS];
        let (store, ..) = Store::open(Words([blank(), blank()]));
        let telemetry = Telemetry::new(shared, (identity, &plan(), None), store, telemetry_ends);
        shared.link.store(LINK_CONFIGURED | LINK_READY, Relaxed);
        Self { telemetry, shared, tick, usb, commands: Commands::default(), reception: Reception::default() }
    }

    fn in_session() -> Self {
        let mut desk = Self::new();
        desk.say(Command::Hello { version: PROTOCOL_VERSION });
        assert!(desk.turn().iter().any(|frame| matches!(frame, DeviceFrame::Hello(_))));
        while desk.tick.orders.dequeue().is_some() {}
        desk
    }

    fn say(&mut self, command: Command) -> u32 {
        let mut bytes = [0; MAX_FRAME];
        let (id, length) = self.commands.encode(command, &mut bytes).unwrap();
        for packet in bytes[..length].chunks(64) {
            assert!(self.usb.from_pc.enqueue(Packet::from_slice(packet).unwrap()).is_ok());
        }
        id
    }

    /// One run of the task, and what it said.
    fn turn(&mut self) -> Vec<DeviceFrame> {
        self.telemetry.run();
        let packets: Vec<Packet> = core::iter::from_fn(|| self.usb.to_pc.dequeue()).collect();
        packets.iter().flatten().filter_map(|&byte| self.reception.push(byte)).collect()
    }

    fn answer(&mut self, command: Command) -> Result<(), Rejection> {
        let id = self.say(command);
        let mut acks = self.turn().into_iter().filter_map(|frame| match frame {
            DeviceFrame::Ack(ack) if ack.id == id => Some(ack.result),
            _ => None,
        });
        acks.next_back().unwrap()
    }
}

#[test]
fn a_start_reaches_the_tick_with_its_session() {
    let mut desk = Desk::new();
    assert_eq!(desk.answer(Command::Start), Err(Rejection::NoSession));
    let mut desk = Desk::in_session();
    desk.shared.session.store(3, Relaxed);
    let unknown = Err(Rejection::Interlocked(Interlock::NotZeroed));
    assert_eq!(desk.answer(Command::Start), unknown, "nobody has said where depth 0 is");
    assert_eq!(desk.answer(Command::Zero), Ok(()));
    assert!(matches!(desk.tick.orders.dequeue(), Some(SmallOrder::Zero)));
    assert_eq!(desk.answer(Command::Start), Ok(()));
    assert!(matches!(desk.tick.orders.dequeue(), Some(SmallOrder::Start(3))));
    desk.shared.conditions.set(Interlock::AmplifierNotReady, true);
    let refused = Err(Rejection::Interlocked(Interlock::AmplifierNotReady));
    assert_eq!(desk.answer(Command::Start), refused);
    assert!(world().usb_allowed.get(), "there is room again");
}

#[test]
fn what_was_under_way_when_the_pc_went_is_thrown_away() {
    for gone in [0, LINK_CONFIGURED] {
        let mut desk = Desk::in_session();
        let session = desk.shared.session.load(Relaxed);
        desk.shared.powered.store(true, Relaxed);
        desk.say(Command::Zero);
        desk.say(Command::Start);
        desk.shared.link.store(gone, Relaxed);
        assert!(desk.turn().is_empty(), "nobody listens");
        assert!(matches!(desk.tick.orders.dequeue(), Some(SmallOrder::Stop)));
        assert!(desk.tick.orders.dequeue().is_none(), "the start is gone");
        assert_eq!(desk.shared.session.load(Relaxed), session.wrapping_add(1));
        assert_eq!(desk.shared.trips.take(), Some(Fault::LinkLost));
        assert!(desk.shared.discard.load(Relaxed));
    }
}

#[test]
fn a_configuration_is_saved_without_torque_and_a_failure_is_told() {
    let mut config = Device::default();
    config.limits.fade_in_ms = 444;
    let mut desk = Desk::in_session();
    // The tick has not stopped yet: the link does not know, telemetry does.
    desk.shared.powered.store(true, Relaxed);
    desk.answer(Command::ConfigureDevice(config)).unwrap();
    assert!(desk.tick.orders.dequeue().is_none(), "it waits");
    desk.shared.powered.store(false, Relaxed);
    desk.turn();
    assert!(matches!(desk.tick.orders.dequeue(), Some(SmallOrder::Large(_))));
    assert!(desk.tick.large_orders.dequeue().is_some());
    assert!(!desk.shared.conditions.get().contains(Interlock::Saving));
    world().flash_fails.set(true);
    config.limits.fade_in_ms = 445;
    desk.say(Command::ConfigureDevice(config));
    let frames: Vec<DeviceFrame> = (0..3).flat_map(|_| desk.turn()).collect();
    let wanted = EventKind::NotSaved { cause: SaveFailure::Flash };
    assert!(
        frames.iter().any(|frame| matches!(frame, DeviceFrame::Event(event) if event.kind == wanted)),
        "{frames:?}"
    );
    assert!(desk.tick.large_orders.dequeue().is_some(), "it is in force all the same");
}

#[test]
fn samples_become_blocks_and_a_gap_is_counted() {
    let mut desk = Desk::in_session();
    let mut controller = Controller::new(plan());
    let mut streamed = Vec::new();
    // Numbers 100 to 103 are missing.
    for tick in (0..200_u32).filter(|tick| !(100..104).contains(tick)) {
        let output = controller.tick(TickInput::default());
        assert!(desk.tick.outputs.enqueue(Ticked { tick, output }).is_ok());
        for frame in desk.turn() {
            if let DeviceFrame::Samples(block) = frame {
                streamed.extend((block.first_tick..).take(block.samples.len()));
                assert!(block.samples.iter().all(|sample| sample.state == State::Idle as u8));
            }
        }
    }
    assert!(streamed.windows(2).all(|pair| pair[1] == pair[0] + 1 || (pair[0], pair[1]) == (99, 104)));
    assert!(streamed.contains(&99) && streamed.contains(&104) && !streamed.contains(&101));
    assert_eq!(desk.reception.counts().lost_samples, 4);
}

#[test]
fn orders_that_the_tick_has_no_room_for_wait() {
    let mut desk = Desk::in_session();
    for _ in 0..4 {
        for _ in 0..6 {
            desk.say(Command::Heartbeat);
        }
        desk.turn();
    }
    let taken = core::iter::from_fn(|| desk.tick.orders.dequeue()).count();
    desk.turn();
    let later = core::iter::from_fn(|| desk.tick.orders.dequeue()).count();
    assert!(taken == 15 && later > 0, "{taken}, then {later}");
}
