//! A board that nobody has commissioned gives no torque but two millinewton metres, and says why;
//! one that has been switched on does not start before it knows its depth. `host-sim commission` on
//! the flash image; no command does it instead.

use std::f64::consts::TAU;
use std::time::Duration;

use control_core::Device;
use control_core::config::{SafetyConfig, Sensors};
use control_core::event::State;
use control_core::excitation::{Excitation, GENTLE_TORQUE, Servo, Signal};
use control_core::interlock::Interlock;
use control_core::plan::Field;
use control_core::units::{Damping, Millimetres, MillinewtonMetres, Stiffness};
use device_sim::error::Error;
use emulator::board::flash::{FACTORY_OPTIONS, GUARDED_OPTIONS};
use emulator::board::wires::{Wire, Wires};
use emulator::board::{Board, MILLISECOND, Nanos, Wiring, plant};
use fixed::types::I16F16;
use lab::commission::bench::{Act, Line};
use lab::commission::{CommissioningOutcome, CommissioningStep, WeighWish, Wish, commission, weigh};
use link::Command;
use link::commissioning::Record;
use link::frames::CommandRefusal;
use tests::needle::Needle;
use tests::pc::{Pc, open_port};
use tests::rig::{Rig, ZERO_TORQUE};
use tests::scenario::board_wired;

const NOT_COMMISSIONED: CommandRefusal = CommandRefusal::Interlocked(Interlock::NotCommissioned);

fn ramps(torque: MillinewtonMetres, stiffness: f64) -> Command {
    Command::Excite(Excitation {
        signal: Signal::BreakawayRamps { torque, ramp_ms: 100 },
        duration_ms: 400,
        servo: Servo { stiffness: Stiffness(I16F16::from_num(stiffness)), damping: Damping::default() },
        travel: Millimetres(I16F16::from_num(200)),
        compensated: false,
    })
}

#[test]
fn a_board_without_a_record_starts_only_once_it_is_commissioned() {
    let unknown = Wiring { commissioned: false, ..Wiring::default() };
    let needle = Needle::held_at(0.0);
    needle.change(|state| state.hand = None);
    let mut board = board_wired(unknown, needle.plant());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Zero);
    assert_eq!(pc.must_not(&mut board, Command::Start), NOT_COMMISSIONED);
    let strong = MillinewtonMetres(GENTLE_TORQUE.0 + I16F16::ONE / 8);
    assert_eq!(pc.must_not(&mut board, ramps(strong, 0.0)), NOT_COMMISSIONED);
    assert_eq!(pc.must_not(&mut board, ramps(GENTLE_TORQUE, 0.1)), NOT_COMMISSIONED, "a servo");

    assert_eq!(
        pc.must_not(&mut board, Command::Commission),
        CommandRefusal::NotShown,
        "it has not seen itself move"
    );

    board.at_stop(|stopped| stopped.log().written.clear());
    pc.must(&mut board, ramps(GENTLE_TORQUE, 0.0));
    pc.run_ms(&mut board, 600);
    let played =
        pc.heard.samples.iter().filter(|(_, sample)| sample.state == State::Excitation as u8).count();
    assert_eq!(played, 4_000, "the pulses are played");
    let furthest = board.at_stop(|stopped| {
        let written = stopped.log().written.iter();
        written.map(|output| output.code.abs_diff(ZERO_TORQUE)).max()
    });
    // 2 mN·m of 28.8 on 2,047 codes.
    assert!(furthest.is_some_and(|codes| (100..=143).contains(&codes)), "{furthest:?} codes");

    let turned = Device { encoder_reversed: true, ..Device::commissioned_virtual() };
    for device in [turned, Device::commissioned_virtual()] {
        let refused = pc.must_not(&mut board, Command::ConfigureDevice(device));
        assert_eq!(refused, CommandRefusal::NotShown, "a command does not commission it");
    }
    let record = pc.record_of(turned);
    pc.must(&mut board, record);
    let record = pc.record_of(Device::commissioned_virtual());
    pc.must(&mut board, record);
    assert_eq!(
        pc.must_not(&mut board, Command::Start),
        CommandRefusal::Interlocked(Interlock::NotZeroed),
        "counts that ran the other way are another depth"
    );
    pc.must(&mut board, Command::Zero);
    pc.must(&mut board, Command::Start);
    pc.must(&mut board, Command::Stop);
    pc.run_ms(&mut board, 20);

    // The record is the device's own and outlives a reset; the depth does not.
    board.at_stop(|stopped| stopped.reset_by_pin());
    board.run_ms(20);
    pc.connect(&mut board);
    assert_eq!(pc.must_not(&mut board, Command::Start), CommandRefusal::Interlocked(Interlock::NotZeroed));
    pc.must(&mut board, Command::Zero);
    pc.must(&mut board, Command::Start);
}

/// A board whose sensor came off would go on without the protection that it was commissioned with.
#[test]
fn a_sensor_that_came_off_since_commissioning_prevents_a_start() {
    const ALL: Sensors = Sensors { encoder_supply: true, current: true };
    let needle = Needle::held_at(0.0);
    needle.change(|state| state.hand = None);
    let wiring =
        Wiring { commissioned: false, supply_sense: true, current_monitor: true, ..Wiring::default() };
    let mut board = board_wired(wiring, needle.plant());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, ramps(GENTLE_TORQUE, 0.0));
    pc.run_ms(&mut board, 600);
    pc.must(&mut board, Command::Commission);
    // It is saved in pieces.
    pc.run_ms(&mut board, 100);
    let start_with = |board: &mut Board, pc: &mut Pc, fitted, command: Option<Command>| {
        board.at_stop(move |stopped| {
            stopped.set_fitted(fitted);
            stopped.reset_by_pin();
        });
        board.run_ms(20);
        pc.connect(board);
        pc.run_ms(board, 200);
        pc.must(board, Command::Zero);
        command.into_iter().for_each(|command| pc.must(board, command));
        let answer = pc.command(board, Command::Start).result;
        pc.must(board, Command::Stop);
        pc.run_ms(board, 50);
        answer
    };
    let refused = |interlock| Err(CommandRefusal::Interlocked(interlock));
    for (fitted, wanted) in [
        (Sensors { current: false, ..ALL }, refused(Interlock::CurrentUnmeasured)),
        (ALL, Ok(())),
        (Sensors { encoder_supply: false, ..ALL }, refused(Interlock::EncoderSupplyUnsensed)),
    ] {
        assert_eq!(start_with(&mut board, &mut pc, fitted, None), wanted, "{fitted:?}");
    }
    pc.must(&mut board, Command::ReportDevice);
    pc.run_ms(&mut board, 50);
    let record = pc.heard.record.expect("the device's record");
    assert_eq!(record.device.sensors, ALL, "it is in the record");
    // A command does not make it forget one; a record of its own of before does.
    let old = Device { sensors: Sensors::default(), ..record.device };
    let sealed = Record::of(&old, pc.heard.hello.as_ref().expect("a hello").identity);
    let claimed = pc.must_not(&mut board, Command::ConfigureDevice(old));
    assert_eq!(claimed, CommandRefusal::Commissioned(Field::Sensors));
    let restored = Some(Command::RestoreDevice(sealed));
    assert_eq!(start_with(&mut board, &mut pc, Sensors::default(), restored), Ok(()));
}

#[test]
fn a_patient_does_not_commission_a_device() {
    let mut board = board_wired(Wiring { commissioned: false, ..Wiring::default() }, plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::ConfigurePatient(control_core::Patient::default()));
    pc.must(&mut board, Command::Zero);
    assert_eq!(pc.must_not(&mut board, Command::Start), NOT_COMMISSIONED);
}

#[test]
fn a_zero_outlives_a_cable_that_is_pulled() {
    let Rig { mut board, mut pc } = Rig::zeroed(Wiring::default());
    board.at_stop(|stopped| stopped.usb().host.unplug());
    board.run_ms(50);
    pc.connect(&mut board);
    assert_eq!(pc.command(&mut board, Command::Start).result, Ok(()));
}

/// The board was built for so much, whatever a record says; and what has been commissioned is
/// lowered, not raised.
#[test]
fn no_command_raises_a_ceiling() {
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant::held());
    let with = |change: fn(&mut Device)| {
        let mut device = Device::commissioned_virtual();
        change(&mut device);
        device
    };
    let strong = with(|device| {
        device.full_scale_torque.0 = I16F16::from_num(200);
        device.limits.torque.0 = I16F16::from_num(101);
    });
    let fast = with(|device| device.limits.max_counts_per_tick = 24);
    for device in [strong, fast] {
        let unknown = Device { commissioned: false, ..device };
        for command in [pc.record_of(device), Command::ConfigureDevice(unknown)] {
            let refused = pc.must_not(&mut board, command);
            assert!(matches!(refused, CommandRefusal::Config(_)), "{refused:?}");
        }
    }
    let weak = with(|device| device.limits.torque.0 = I16F16::from_num(20));
    pc.must(&mut board, Command::ConfigureDevice(weak));
    for (device, field) in [
        (Device::commissioned_virtual(), Field::TorqueLimit),
        (
            Device { limits: SafetyConfig { max_counts_per_tick: 17, ..weak.limits }, ..weak },
            Field::MaxCountsPerTick,
        ),
        (Device { motor_reversed: true, ..weak }, Field::MotorSign),
    ] {
        let refused = pc.must_not(&mut board, Command::ConfigureDevice(device));
        assert_eq!(refused, CommandRefusal::Commissioned(field));
    }
    // It is in flash as well.
    pc.run_ms(&mut board, 50);
    board.at_stop(|stopped| stopped.reset_by_pin());
    board.run_ms(20);
    pc.connect(&mut board);
    let hash = pc.heard.hello.as_ref().map(|hello| hello.device_hash);
    assert_eq!(hash, Some(link::codec::hash(&weak)));
}

/// `host-sim commission` at the end of the emulated cable, with a hand that does what a person is
/// asked.
struct CommissionedBoard {
    board: Board,
    needle: Needle,
    /// The position at which the hand stops, in m.
    end: Option<f64>,
    /// The weight on the needle, N, and the instant at which the hand begins to let it go.
    hung: (f64, Nanos),
}

/// The needle's roller in mm, and how fast a hand turns it, in m/s.
const ROLLER_MM: f64 = 10.0;
const HAND_SPEED: f64 = 0.06;

impl CommissionedBoard {
    fn new(reversed: bool, wires: Wires) -> Self {
        Self::on(Wiring { commissioned: false, ..Wiring::default() }, reversed, wires)
    }

    fn on(wiring: Wiring, reversed: bool, wires: Wires) -> Self {
        let needle = Needle::held_at(0.0);
        needle.change(|state| (state.hand, state.reversed) = (None, reversed));
        let mut board = board_wired(wiring, needle.plant());
        board.at_stop(move |stopped| stopped.set_wires(wires));
        open_port(&mut board);
        Self { board, needle, end: None, hung: (0.0, 0) }
    }

    fn commission(&mut self) -> (Result<CommissioningOutcome, Error>, bool) {
        let wish = Wish { turns: 1, pull_mm: 40.0, counts_per_turn: None };
        let mut has_moved = false;
        let outcome = commission(self, &wish, |step| {
            has_moved |= step.moves();
            Ok(())
        });
        (outcome, has_moved)
    }
}

impl Line for CommissionedBoard {
    fn exchange(&mut self, out: &[u8], into: &mut Vec<u8>) -> Result<Duration, Error> {
        let out = out.to_vec();
        self.board.at_stop(move |stopped| stopped.usb().host.write(&out));
        self.board.run_ms(1);
        let (weight, since) = self.hung;
        let let_go = ((self.board.now() - since) as f64 / (3_000 * MILLISECOND) as f64).min(1.0);
        self.needle.change(|state| state.pull = weight * let_go);
        let end = self.end;
        self.needle.change(|state| {
            if let (Some(at), Some(end)) = (state.hand, end)
                && at >= end
            {
                (state.hand, state.hand_speed) = (Some(end), 0.0);
            }
        });
        into.extend(self.board.at_stop(|stopped| stopped.usb().host.read()));
        Ok(Duration::from_nanos(self.board.now()))
    }

    fn act(&mut self, act: Act) {
        let from = self.needle.state().depth;
        let way = match act {
            Act::Hang(grams) => {
                self.hung = (9.81e-3 * grams, self.board.now());
                None
            }
            Act::HandsOff => None,
            Act::Turn(turns) => Some(TAU * f64::from(turns) * ROLLER_MM * 1e-3),
            Act::Pull(mm) => Some(mm * 1e-3),
            Act::Tilt(rad) => {
                let axes = [-rad.sin(), 0.0, rad.cos()].map(|share| (1e3 * share).round() as i32);
                self.board.at_stop(move |stopped| {
                    stopped.tilt().expect("an accelerometer").set_milligravities(axes);
                });
                None
            }
        };
        self.end = way.map(|way| from + way);
        self.needle.change(|state| {
            (state.hand, state.hand_speed) =
                (way.map(|_| from), if way.is_some() { HAND_SPEED } else { 0.0 });
        });
    }
}

/// Takes more than 5 s: a person's whole dialogue, 25 s of the board, with the leads either way
/// round.
#[test]
fn a_device_is_commissioned_over_its_cable_and_keeps_its_record() {
    for reversed in [false, true] {
        let mut bench = CommissionedBoard::new(reversed, Wires::default());
        let (outcome, _) = bench.commission();
        let outcome = outcome.unwrap_or_else(|why| panic!("leads reversed {reversed}: {why}"));
        assert_eq!(outcome.leads_reversed, reversed);
        let lines = outcome.lines().join("\n");
        let said = if reversed { "motor leads reversed: driven the other way" } else { "motor leads right" };
        assert!(lines.contains(said), "{lines}");
        let device = outcome.record.device;
        assert!(device.commissioned && device.counts_per_turn == 4_000, "{lines}");
        assert_eq!((device.motor_reversed, device.encoder_reversed), (reversed, false));
        assert!((outcome.radius_mm / ROLLER_MM - 1.0).abs() < 0.01, "{lines}");
        // 30 g on 10 mm.
        assert!((outcome.mechanism.inertia / 3e-6 - 1.0).abs() < 0.15, "{lines}");
        assert!((outcome.mechanism.dry / 6e-4 - 1.0).abs() < 0.15, "{lines}");

        let mut pc = Pc::new();
        bench.board.at_stop(|stopped| stopped.reset_by_pin());
        bench.board.run_ms(20);
        pc.connect(&mut bench.board);
        let hash = pc.heard.hello.as_ref().map(|hello| hello.device_hash);
        assert_eq!(hash, Some(link::codec::hash(&device)), "it outlives a reset");
        pc.must(&mut bench.board, Command::Zero);
        pc.must(&mut bench.board, Command::Start);
        // Given back to the same board.
        pc.must(&mut bench.board, Command::Stop);
        pc.run_ms(&mut bench.board, 20);
        pc.must(&mut bench.board, Command::RestoreDevice(outcome.record));
    }
}

#[test]
fn a_dead_channel_is_named_before_the_motor_moves() {
    let wires = Wires { b: Wire::Stuck(false), ..Wires::default() };
    let mut bench = CommissionedBoard::new(false, wires);
    let (outcome, has_moved) = bench.commission();
    let said = outcome.map(|outcome| outcome.lines()).expect_err("it does not pass").to_string();
    assert!(
        said.contains("one of the encoder's channels is dead") && said.contains("check the wires"),
        "{said}"
    );
    assert!(!has_moved);
    let mut pc = Pc::new();
    pc.hello(&mut bench.board);
    pc.must(&mut bench.board, Command::Zero);
    assert_eq!(pc.must_not(&mut bench.board, Command::Start), NOT_COMMISSIONED);
}

/// Takes more than 5 s: 25 s of the board each, on a motor that gives half and twice of what it is
/// asked for, and on one that was commissioned with insertion taken for withdrawal.
#[test]
fn a_weight_on_the_needle_corrects_a_wrong_torque_constant() {
    let wish = WeighWish { grams: 100.0, correct: true };
    for gain in [0.5, 2.0] {
        let mut bench = CommissionedBoard::on(Wiring::default(), false, Wires::default());
        bench.needle.change(|state| state.gain = gain);
        let outcome = weigh(&mut bench, &wish, |_| Ok(())).unwrap_or_else(|why| panic!("{gain}: {why}"));
        let device = outcome.record.device;
        let found = device.full_scale_torque.0.to_num::<f64>();
        let within = f64::from(device.torque_uncertainty) * 1e-3;
        println!("| a motor of {gain} times its torque | {found:.2} mN·m within {:.1} % |", 1e2 * within);
        let off = (found / (28.8 * gain) - 1.0).abs();
        assert!(outcome.is_corrected && off <= within && within < 0.1, "{gain}: {found}, {within}");
        assert!(device.commissioned && device.limits.torque <= device.full_scale_torque);
        let mass = device.mechanism.mass.0.to_num::<f64>();
        assert!((mass / 30.0 - 1.0).abs() < 0.15, "{gain}: {mass} g of 30");
    }
    let swapped = Wires { swapped: true, ..Wires::default() };
    let mut bench = CommissionedBoard::on(Wiring::default(), true, swapped);
    let why = weigh(&mut bench, &wish, |_| Ok(())).expect_err("the other way round").to_string();
    assert!(why.contains("outwards") && why.contains("commission again"), "{why}");
}

/// A part from the factory: the step that sets its brown-out reset comes first, and what it has set
/// counts after a restart.
#[test]
fn commissioning_sets_the_brown_out_reset_first() {
    const LEFT: &str = "left";
    let mut bench = CommissionedBoard::new(false, Wires::default());
    bench.board.flash().array().options = FACTORY_OPTIONS;
    let steps_of = |bench: &mut CommissionedBoard| {
        bench.board.at_stop(|stopped| stopped.reset_by_pin());
        bench.board.run_ms(50);
        open_port(&mut bench.board);
        let mut steps = Vec::new();
        let wish = Wish { turns: 1, pull_mm: 40.0, counts_per_turn: None };
        let ended = commission(bench, &wish, |step| {
            steps.push(step);
            if matches!(step, CommissioningStep::Turn(_)) { Err(Error::failed(LEFT)) } else { Ok(()) }
        });
        (steps, ended.map(|outcome| outcome.lines()).expect_err("it was left").to_string())
    };
    let (steps, said) = steps_of(&mut bench);
    assert_eq!(steps, [CommissioningStep::GuardSupply]);
    assert!(said.contains("has been set") && said.contains("switch the board off and on"), "{said}");
    assert_eq!(bench.board.flash().array().options, GUARDED_OPTIONS);
    let (steps, said) = steps_of(&mut bench);
    assert_eq!((steps, said.as_str()), (vec![CommissioningStep::Turn(1)], LEFT));
}
