//! Telemetry.

use super::super::planner::Planner;
use super::super::queues::{Ends, Packet, Queued, TickEnds, Ticked, UsbEnds};
use super::super::shared::{LINK_CONFIGURED, LINK_READY, Shared};
use super::super::telemetry::Telemetry;
use super::fake::{Fake, Part, Words, ends, plan, shared, world};
use crate::store::{CELL_WORDS, ConfigFlash, Store};
use crate::timing;
use control_core::controller::TickInput;
use control_core::event::{Fault, State};
use control_core::interlock::Interlock;
use control_core::{Controller, Device, LargeOrder, Order, Patient};
use core::sync::atomic::Ordering::Relaxed;
use link::Command;
use link::codec::MAX_FRAME;
use link::device::Identity;
use link::frames::{CommandRefusal, DeviceFrame, EventKind, GuardRefusal, PROTOCOL_VERSION, SaveError};
use link::host::{Commands, Reception};
use std::vec::Vec;

/// Telemetry with a PC at the far ends of its queues.
struct Desk {
    telemetry: Telemetry<Fake>,
    planner: Planner<Fake>,
    shared: &'static Shared,
    tick: TickEnds,
    usb: UsbEnds,
    commands: Commands,
    reception: Reception,
}

impl Desk {
    fn new() -> Self {
        let shared = shared();
        let Ends { tick: (tick, _), usb, planner, telemetry: telemetry_ends } = ends();
        let identity = Identity { firmware: [1, 2, 3], ..Identity::VIRTUAL };
        let blank = || std::vec![u32::MAX; Words::CELLS * CELL_WORDS];
        let (store, ..) = Store::open(Words([blank(), blank()]));
        let telemetry =
            Telemetry::new(shared, (identity, &plan(), None, None, true), store, telemetry_ends, Part);
        shared.link.store(LINK_CONFIGURED | LINK_READY, Relaxed);
        let (planner, commands, reception) =
            (Planner::new(planner), Commands::default(), Reception::default());
        Self { telemetry, planner, shared, tick, usb, commands, reception }
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

    /// One run of the task, a millisecond after the last, another one where there was something to
    /// plan, and what it said.
    fn turn(&mut self) -> Vec<DeviceFrame> {
        let mut frames = self.turn_without_plan();
        let woken = world().woken.get();
        self.planner.run();
        if world().woken.get() != woken {
            // Not before the PC has been silent for a while.
            self.shared.supervised_ms.fetch_add(timing::QUIET_MS, Relaxed);
            frames.extend(self.turn_without_plan());
        }
        frames
    }

    fn turn_without_plan(&mut self) -> Vec<DeviceFrame> {
        self.shared.supervised_ms.fetch_add(1, Relaxed);
        self.telemetry.run();
        let packets: Vec<Packet> = core::iter::from_fn(|| self.usb.to_pc.dequeue()).collect();
        packets.iter().flatten().filter_map(|&byte| self.reception.push(byte)).collect()
    }

    fn answer(&mut self, command: Command) -> Result<(), CommandRefusal> {
        let id = self.say(command);
        let mut acks = self.turn().into_iter().filter_map(|frame| match frame {
            DeviceFrame::Ack(ack) if ack.id == id => Some(ack.result),
            _ => None,
        });
        acks.next_back().unwrap()
    }
}

#[test]
fn a_start_reaches_the_tick_with_its_number() {
    let mut desk = Desk::new();
    assert_eq!(desk.answer(Command::Start), Err(CommandRefusal::NoSession));
    let mut desk = Desk::in_session();
    assert_eq!(desk.answer(Command::Stop), Ok(()));
    assert!(desk.shared.trips.take_stop());
    let unknown = Err(CommandRefusal::Interlocked(Interlock::NotZeroed));
    assert_eq!(desk.answer(Command::Start), unknown, "nobody has said where depth 0 is");
    assert_eq!(desk.answer(Command::Zero), Ok(()));
    assert!(matches!(desk.tick.orders.dequeue(), Some(Queued { order: Some(Order::Zero), .. })));
    assert_eq!(desk.answer(Command::Start), Ok(()));
    assert!(matches!(desk.tick.orders.dequeue(), Some(Queued { stops: 1, order: Some(Order::Start) })));
    desk.shared.conditions.set(Interlock::AmplifierNotReady, true);
    let refused = Err(CommandRefusal::Interlocked(Interlock::AmplifierNotReady));
    assert_eq!(desk.answer(Command::Start), refused);
    assert!(world().usb_allowed.get(), "there is room again");
}

#[test]
fn what_was_under_way_when_the_pc_went_is_thrown_away() {
    for gone in [0, LINK_CONFIGURED] {
        let mut desk = Desk::in_session();
        desk.shared.powered.store(true, Relaxed);
        desk.say(Command::Zero);
        desk.say(Command::Start);
        desk.shared.link.store(gone, Relaxed);
        assert!(desk.turn().is_empty(), "nobody listens");
        assert!(desk.tick.orders.dequeue().is_none(), "the start is gone");
        assert_eq!(desk.shared.stops.load(Relaxed), 1);
        assert!(desk.shared.trips.take_stop());
        assert_eq!(desk.shared.trips.take(), Some(Fault::LinkLost));
        assert!(desk.shared.discard.load(Relaxed));
    }
}

#[test]
fn a_configuration_is_saved_without_torque_or_reported_failed() {
    let mut config = Device::commissioned_virtual();
    config.limits.fade_in_ms = 444;
    let mut desk = Desk::in_session();
    // The tick has not stopped yet: no sample says so, the tick does.
    desk.shared.powered.store(true, Relaxed);
    let refused = Err(CommandRefusal::Powered);
    assert_eq!(desk.answer(Command::ConfigureDevice(config)), refused, "it does not wait");
    assert!(desk.tick.orders.dequeue().is_none());
    desk.shared.powered.store(false, Relaxed);
    assert_eq!(desk.answer(Command::ConfigureDevice(config)), Ok(()));
    // Not before the PC has been silent for a while.
    (0..timing::QUIET_MS).for_each(|_| drop(desk.turn()));
    assert!(matches!(desk.tick.orders.dequeue(), Some(Queued { order: None, .. })));
    assert!(desk.tick.large_orders.dequeue().is_some());
    assert!(!desk.shared.conditions.get().contains(Interlock::Saving));
    world().flash_fails.set(true);
    config.limits.fade_in_ms = 445;
    desk.say(Command::ConfigureDevice(config));
    let frames: Vec<DeviceFrame> = (0..=timing::QUIET_MS).flat_map(|_| desk.turn()).collect();
    let wanted = EventKind::NotSaved { cause: SaveError::Flash };
    assert!(
        frames.iter().any(|frame| matches!(frame, DeviceFrame::Event(event) if event.kind == wanted)),
        "{frames:?}"
    );
    assert!(desk.tick.large_orders.dequeue().is_some(), "it is in force all the same");
}

/// The flash takes its time; what was ordered after a configuration waits behind it, and of a PC
/// that has gone its start alone is forgotten.
#[test]
fn a_save_takes_many_turns_and_outlives_its_pc() {
    let mut config = Device::commissioned_virtual();
    config.limits.fade_in_ms = 444;
    for is_gone in [false, true] {
        let mut desk = Desk::in_session();
        assert_eq!(desk.answer(Command::Zero), Ok(()));
        while desk.tick.orders.dequeue().is_some() {}
        world().program_cycles.set(timing::SAVE_CYCLES / 3);
        assert_eq!(desk.answer(Command::ConfigureDevice(config)), Ok(()));
        assert_eq!(desk.answer(Command::ConfigurePatient(Patient::nobody())), Ok(()));
        assert_eq!(desk.answer(Command::Start), Ok(()), "it waits");
        desk.shared.link.store(if is_gone { 0 } else { LINK_CONFIGURED | LINK_READY }, Relaxed);
        let (mut turns, mut orders, mut plans) = (0, Vec::new(), Vec::new());
        for _ in 0..200 {
            turns += u32::from(desk.shared.conditions.get().contains(Interlock::Saving));
            desk.turn();
            orders.extend(core::iter::from_fn(|| desk.tick.orders.dequeue()).map(|queued| queued.order));
            plans.extend(core::iter::from_fn(|| desk.tick.large_orders.dequeue()));
        }
        assert!((8..200).contains(&turns), "{turns} turns of three words each");
        let has_started = orders.iter().any(|order| matches!(order, Some(Order::Start)));
        assert_eq!((has_started, orders.len()), (!is_gone, if is_gone { 2 } else { 3 }));
        let Some(LargeOrder::Configure(plan)) = plans.last() else { panic!("a plan") };
        assert_eq!((plan.device(), plan.patient()), (&config, &Patient::nobody()));
    }
}

fn acks(frames: &[DeviceFrame]) -> Vec<(u32, Result<(), CommandRefusal>)> {
    let acks = frames.iter().filter_map(|frame| match frame {
        DeviceFrame::Ack(ack) => Some((ack.id, ack.result)),
        _ => None,
    });
    acks.collect()
}

/// While a plan is made a stop is answered at once and a start is to be sent again. The
/// configuration is answered when its plan is there, unless its PC has started anew.
#[test]
fn a_stop_does_not_wait_for_a_plan() {
    for is_new in [false, true] {
        let mut desk = Desk::in_session();
        let configure = desk.say(Command::ConfigurePatient(Patient::nobody()));
        assert!(acks(&desk.turn_without_plan()).is_empty());
        let (start, stop) = (desk.say(Command::Start), desk.say(Command::Stop));
        let answers = acks(&desk.turn_without_plan());
        assert_eq!(answers, [(start, Err(CommandRefusal::Full)), (stop, Ok(()))]);
        assert!(desk.shared.trips.take_stop());
        if is_new {
            let hello = desk.say(Command::Hello { version: PROTOCOL_VERSION });
            assert_eq!(acks(&desk.turn_without_plan()), [(hello, Ok(()))]);
        }
        let answers = acks(&desk.turn());
        assert_eq!(answers, if is_new { std::vec![] } else { std::vec![(configure, Ok(()))] });
        let plan = (0..99).find_map(|_| {
            desk.turn();
            desk.tick.large_orders.dequeue()
        });
        assert_eq!(plan.is_some(), !is_new);
        // The device is free for the next one either way.
        assert_eq!(desk.answer(Command::ConfigurePatient(Patient::default())), Ok(()));
    }
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

#[test]
fn a_start_on_its_way_refuses_a_configuration() {
    let mut config = Device::commissioned_virtual();
    config.limits.fade_in_ms = 444;
    let mut desk = Desk::in_session();
    desk.answer(Command::Zero).unwrap();
    desk.answer(Command::Start).unwrap();
    // A sample from before the start.
    let output = Controller::new(plan()).tick(TickInput::default());
    assert!(desk.tick.outputs.enqueue(Ticked { tick: 0, output }).is_ok());
    desk.turn();
    assert_eq!(desk.answer(Command::ConfigureDevice(config)), Err(CommandRefusal::Powered));
    assert_eq!(desk.answer(Command::Stop), Ok(()), "which makes the start void");
    assert_eq!(desk.answer(Command::ConfigureDevice(config)), Ok(()));
}

#[test]
fn the_brown_out_reset_is_set_with_torque_off_only() {
    let mut desk = Desk::in_session();
    for (set, said) in [(false, GuardRefusal::Off), (true, GuardRefusal::Restart)] {
        let answer = desk.answer(Command::GuardSupply { set });
        assert_eq!(answer, Err(CommandRefusal::Guard(said)));
    }
    assert_eq!(world().guarded.get(), 2);
    // The tick has powered up; the link's last sample was of a tick without torque.
    desk.shared.powered.store(true, Relaxed);
    assert_eq!(desk.answer(Command::GuardSupply { set: true }), Err(CommandRefusal::Powered));
    assert_eq!(world().guarded.get(), 2, "nothing has stopped the processor");
    assert!(!desk.shared.conditions.get().contains(Interlock::Saving));
}
