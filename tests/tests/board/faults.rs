//! Faults take torque away in time, are reported, and stay until a person starts again.

use control_core::event::{Fault, Limits};
use control_core::interlock::Interlock;
use control_core::units::MillinewtonMetres;
use control_core::{Config, Device};
use emulator::board::tilt::{Health, Model};
use emulator::board::{Board, Effect, MILLISECOND, Nanos, Stopped, Wiring, firmware_path, plant, record};
use fixed::types::I16F16;
use link::Command;
use link::frames::{CommandRefusal, EventKind};
use tests::pc::Pc;
use tests::rig::{PRESSED, Rig, ZERO_TORQUE, task};

const TICK: Nanos = 100_000;
/// A fault that a tick can see ends within two ticks; looking at the pins adds 10 µs.
const TWO_TICKS: Nanos = 2 * TICK + 10_000;
const HUNG: Nanos = 20 * MILLISECOND;

fn report(what: &str, time: Nanos) {
    println!("| {what} | {:.2} ms |", time as f64 / 1e6);
}

#[test]
fn an_encoder_that_jumps() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.set_plant(Box::new(|_: Nanos, _| PRESSED + 400)));
    // The shaft's edges take a tick to arrive.
    let time = rig.time_to_safe(TICK + TWO_TICKS);
    report("encoder jump", time);
    let hand = plant::by_hand(plant::path(vec![(0, PRESSED)]));
    rig.board.at_stop(|stopped| stopped.set_plant(Box::new(hand)));
    rig.comes_back_after(Fault::EncoderJump);
}

#[test]
fn an_encoder_that_does_not_turn_under_torque() {
    let mut rig = Rig::pressed();
    // Whatever the motor does, the count stays: not even a hand's tremor is left.
    rig.board.at_stop(|stopped| stopped.set_plant(Box::new(plant::path(vec![(0, PRESSED)]))));
    let time = rig.time_to_safe(5_000 * MILLISECOND);
    report("frozen encoder under torque", time);
    let hand = plant::by_hand(plant::path(vec![(0, PRESSED)]));
    rig.board.at_stop(|stopped| stopped.set_plant(Box::new(hand)));
    rig.comes_back_after(Fault::EncoderFrozen);
}

fn tilt_fault(model: Model, health: Health, limit: Nanos) {
    let mut rig = Rig::pressed_on(Wiring { tilt: Some(model), ..Wiring::default() });
    rig.board.at_stop(move |stopped| stopped.tilt().expect("an accelerometer").health = health);
    let time = rig.time_to_safe(limit);
    report(&format!("{model:?} {health:?}"), time);
    rig.board.at_stop(|stopped| stopped.tilt().expect("an accelerometer").health = Health::Good);
    rig.comes_back_after(Fault::Tilt);
}

#[test]
fn an_accelerometer_that_goes_absent() {
    tilt_fault(Model::Lis302dl, Health::Absent, 60 * MILLISECOND);
    tilt_fault(Model::Lis3dsh, Health::Absent, 60 * MILLISECOND);
}

#[test]
fn an_accelerometer_that_answers_nonsense() {
    tilt_fault(Model::Lis302dl, Health::Nonsense, 60 * MILLISECOND);
    tilt_fault(Model::Lis3dsh, Health::Nonsense, 60 * MILLISECOND);
}

#[test]
fn an_accelerometer_that_is_stuck() {
    tilt_fault(Model::Lis302dl, Health::Stuck, 120 * MILLISECOND);
    tilt_fault(Model::Lis3dsh, Health::Stuck, 120 * MILLISECOND);
    tilt_fault(Model::Lis3dsh, Health::Frozen, 600 * MILLISECOND);
}

/// A sensor that does not measure gives no torque, not even for the milliseconds of a fault.
#[test]
fn a_start_with_a_dead_tilt_sensor_is_refused() {
    for health in [Health::Absent, Health::Nonsense, Health::Stuck, Health::Frozen] {
        let mut rig = Rig::zeroed(Wiring::default());
        let becomes = |rig: &mut Rig, health| {
            rig.board.at_stop(move |stopped| stopped.tilt().expect("an accelerometer").health = health);
            rig.pc.run_ms(&mut rig.board, 700);
        };
        becomes(&mut rig, health);
        let since = rig.board.now();
        let answer = rig.pc.command(&mut rig.board, Command::Start).result;
        rig.pc.run_ms(&mut rig.board, 50);
        let on = rig.enabled_since(since);
        assert!(on.is_empty(), "{health:?}: answered {answer:?}, the amplifier on at {on:?}");
        assert_eq!(answer, Err(CommandRefusal::Interlocked(Interlock::TiltSensor)), "{health:?}");
        becomes(&mut rig, Health::Good);
        rig.pc.must(&mut rig.board, Command::Start);
    }
}

/// It answers as before, and is in power-down: it needs its configuration again, and the device
/// goes on.
#[test]
fn an_accelerometer_that_loses_its_power_alone_is_set_up_again() {
    for model in [Model::Lis302dl, Model::Lis3dsh] {
        let mut rig = Rig::pressed_on(Wiring { tilt: Some(model), ..Wiring::default() });
        let (since, before) = (rig.board.now(), rig.pc.heard.samples.len());
        rig.board.at_stop(|stopped| {
            let chip = stopped.tilt().expect("an accelerometer");
            chip.lose_power();
            // Level from now on, which only a sensor that measures can report.
            chip.set_milligravities([0, 0, 1_000]);
        });
        rig.pc.run_ms(&mut rig.board, 1_000);
        let reads = |tilt: i16| tilt.abs() < 20;
        let newest = rig.pc.heard.samples.last().map(|(_, sample)| sample.tilt_mrad);
        assert!(newest.is_some_and(reads), "{model:?}: {newest:?} mrad");
        let found = rig.pc.heard.samples[before..].iter().position(|(_, sample)| reads(sample.tilt_mrad));
        report(
            &format!("{model:?} without its power, level again"),
            found.map_or(0, |ticks| ticks as Nanos * TICK),
        );
        let off = rig
            .board
            .at_stop(move |stopped| stopped.log().enable.iter().any(|&(at, is_on)| at >= since && !is_on));
        assert!(!off, "{model:?}: the torque stays");
    }
}

#[test]
fn a_host_that_goes_in_the_middle_of_an_insertion() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.usb().host.unplug());
    let time = rig.time_to_safe(HUNG);
    report("plug pulled", time);
    rig.pc.run_ms(&mut rig.board, 500);
    rig.comes_back_after(Fault::LinkLost);
}

#[test]
fn a_bus_that_is_suspended() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.usb().host.suspend());
    let time = rig.time_to_safe(HUNG);
    report("bus suspended", time);
    rig.board.run_ms(500);
    rig.comes_back_after(Fault::LinkLost);
}

#[test]
fn a_program_that_closes_the_port() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.usb().host.close());
    let time = rig.time_to_safe(HUNG);
    report("port closed", time);
    rig.board.at_stop(|stopped| stopped.usb().host.open());
    rig.comes_back_after(Fault::LinkLost);
}

#[test]
fn half_a_frame_and_then_silence() {
    let mut rig = Rig::pressed();
    rig.pc.set_silent(true);
    rig.pc.send_bytes(&mut rig.board, &[0x07, 0x02, 0x03, 0x11, 0x22]);
    let time = rig.time_to_safe(201 * MILLISECOND);
    report("half a frame, then silence", time);
    rig.comes_back_after(Fault::HostSilent);
}

#[test]
fn a_heartbeat_that_stops_while_the_port_stays_open() {
    let mut rig = Rig::pressed();
    rig.pc.set_silent(true);
    let time = rig.time_to_safe(201 * MILLISECOND);
    assert!(time > 100 * MILLISECOND, "not before its time: {time} ns");
    report("heartbeat stops", time);
    rig.comes_back_after(Fault::HostSilent);
}

#[test]
fn a_program_that_stops_reading_keeps_its_device() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.usb().host.set_reading(false));
    rig.pc.run_ms(&mut rig.board, 1_000);
    assert!(rig.board.at_stop(|stopped| stopped.drive().enabled), "the heartbeat is there");
    rig.board.at_stop(|stopped| stopped.usb().host.set_reading(true));
    rig.pc.run_ms(&mut rig.board, 1_500);
    let timing = rig.pc.heard.timing.expect("timing");
    assert_eq!(timing.missed_ticks, 0);
    assert!(timing.dropped_samples > 0, "what the PC did not take is dropped and counted: {timing:?}");
    let counts = rig.pc.counts();
    assert!(counts.lost_samples > 0 && counts.garbage == 0, "and the PC sees it: {counts:?}");
}

#[test]
fn a_storm_of_valid_commands_changes_nothing() {
    let mut rig = Rig::pressed();
    let since = rig.board.now();
    for _ in 0..1_000 {
        let patient = control_core::Patient::default();
        for command in [Command::Start, Command::Zero, Command::Heartbeat, Command::ConfigurePatient(patient)]
        {
            if rig.board.at_stop(|stopped| stopped.usb().host.unsent()) < 4_096 {
                rig.pc.send(&mut rig.board, command);
            }
        }
        rig.pc.run_ms(&mut rig.board, 1);
    }
    let switched =
        rig.board.at_stop(move |stopped| stopped.log().enable.iter().filter(|&&(at, _)| at >= since).count());
    assert_eq!(switched, 0, "the amplifier stays on");
    assert!(!rig.pc.heard_event(|kind| matches!(kind, EventKind::Fault { .. })));
    let timing = rig.pc.heard.timing.expect("timing");
    assert_eq!((timing.missed_ticks, timing.garbage_frames), (0, 0));
}

fn hung(what: &str, exception: u32) {
    let mut rig = Rig::pressed();
    let effect = rig.hang();
    rig.upset(exception, effect);
    let time = rig.time_to_safe(HUNG);
    report(what, time);
    rig.board.run_ms(50);
    assert_eq!(rig.board.at_stop(|stopped| stopped.resets().len()), 1, "the watchdog ends it");
    rig.wait_for_port();
    rig.comes_back_after(Fault::Watchdog);
}

#[test]
fn a_tilt_task_that_hangs() {
    hung("tilt task hangs", task::TILT);
}

#[test]
fn a_telemetry_task_that_hangs() {
    hung("telemetry task hangs", task::TELEMETRY);
}

#[test]
fn a_usb_stack_that_hangs() {
    hung("USB task hangs", task::USB);
}

#[test]
fn a_supervisor_that_hangs() {
    hung("supervisor hangs", task::SUPERVISOR);
}

/// A core that has come into an endless loop of its own, which feeds the watchdog in it, is never
/// reset, and its enable line stays high: the monostable takes the torque away.
#[test]
fn a_wrong_program_that_feeds_its_watchdog() {
    // `ldr r0, [pc, #4]`, `ldr r1, [pc, #8]`, `str r1, [r0]`, `b` back to it, the watchdog's key
    // register and its key (RM0090 21.4.1).
    const PROGRAM: [u32; 4] = [0x4902_4801, 0xE7FD_6001, 0x4000_3000, 0xAAAA];
    const AT: u32 = 0x2002_0000;
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| {
        for (at, word) in (AT..).step_by(4).zip(PROGRAM) {
            assert!(stopped.set_word(at.into(), word), "memory for a program");
        }
    });
    rig.upset(task::TICK, Effect::Jump(AT));
    let begin = rig.board.now();
    // Its converter keeps the code: only the amplifier is off.
    let is_off = |stopped: &mut Stopped<'_>| !stopped.drive().enabled;
    assert!(rig.board.run_until_seen(begin + 6 * MILLISECOND, TICK / 10, is_off), "the motor is driven");
    report("wrong program that feeds its watchdog", rig.board.now() - begin);
    rig.board.run_ms(100);
    let (resets, line) = rig.board.at_stop(|stopped| (stopped.resets().len(), stopped.enable_line()));
    assert!(resets == 0 && line, "{resets} resets, the enable line high: {line}");
}

#[test]
fn a_tick_that_hangs() {
    hung("tick hangs", task::TICK);
}

fn crash(what: &str, exception: u32, effect: impl Fn(&Rig) -> Effect) {
    let mut rig = Rig::pressed();
    let effect = effect(&rig);
    rig.upset(exception, effect);
    // The task may have to wait for its turn: the slowest runs every 5 ms.
    let time = rig.time_to_safe(5 * MILLISECOND + TWO_TICKS);
    report(what, time);
    rig.board.run_ms(50);
    assert_eq!(rig.board.at_stop(|stopped| stopped.resets().len()), 1, "it resets itself");
    rig.wait_for_port();
    rig.comes_back_after(Fault::Crash);
}

#[test]
fn a_panic() {
    let panic = |rig: &Rig| {
        let panics = rig.board.symbols().iter().find(|symbol| symbol.name.ends_with("rust_begin_unwind"));
        Effect::Jump(panics.expect("a panic handler").address)
    };
    crash("panic in telemetry", task::TELEMETRY, panic);
    crash("panic in the tick", task::TICK, panic);
}

#[test]
fn a_hard_fault() {
    // Nothing answers there.
    const NOWHERE: u32 = 0x6000_0000;
    crash("hard fault in tilt", task::TILT, |_| Effect::Jump(NOWHERE));
    crash("hard fault in the tick", task::TICK, |_| Effect::Jump(NOWHERE));
}

#[test]
fn a_tick_that_overruns() {
    let mut rig = Rig::pressed();
    // A tick and a half.
    rig.upset(task::TICK, Effect::Stall(25_000));
    let time = rig.time_to_safe(2 * TICK + TWO_TICKS);
    report("tick overruns", time);
    rig.comes_back_after(Fault::Overrun);
}

#[test]
fn a_supply_that_dips_under_torque() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.reset_by_pin());
    let time = rig.time_to_safe(TWO_TICKS);
    report("supply dip, reset", time);
    rig.wait_for_port();
    rig.comes_back_after(Fault::Brownout);
}

#[test]
fn a_supply_that_falls() {
    let mut rig = Rig::pressed();
    // What the real board has on a good day.
    rig.board.at_stop(|stopped| stopped.set_supply(2_900));
    rig.board.run_ms(10);
    assert!(rig.board.at_stop(|stopped| stopped.drive().enabled), "2.9 V are enough");
    rig.board.at_stop(|stopped| stopped.set_supply(2_600));
    let time = rig.time_to_safe(TWO_TICKS);
    report("supply's early warning", time);
    rig.board.at_stop(|stopped| stopped.set_supply(3_300));
    rig.comes_back_after(Fault::Brownout);
}

#[test]
fn nothing_drives_the_motor_before_the_first_tick_after_a_reset() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.reset_by_pin());
    let since = rig.board.now();
    rig.board.run_ms(200);
    assert!(rig.enabled_since(since).is_empty());
    let codes: Vec<u16> = rig.board.at_stop(move |stopped| {
        stopped.log().put_out.iter().filter(|output| output.at > since).map(|output| output.code).collect()
    });
    assert!(codes.iter().all(|&code| code == tests::rig::ZERO_TORQUE), "{codes:?}");
}

/// RAM without power has forgotten how warm the motor is: no more than its continuous torque until
/// the winding's time constant has passed, whatever was given before, and the PC is told how long.
#[test]
fn a_power_loss_limits_the_torque_until_the_motor_has_cooled() {
    let mut device = Device::commissioned_virtual();
    device.limits.continuous_torque = MillinewtonMetres(I16F16::const_from_int(3));
    device.limits.winding_time_s = 3;
    let hand = plant::by_hand(plant::path(vec![(400 * MILLISECOND, 0), (600 * MILLISECOND, PRESSED)]));
    let board = Board::on(&firmware_path(), Wiring { commissioned: false, ..Wiring::default() }, hand);
    let mut rig = Rig { board: board.expect("an image"), pc: Pc::new() };
    record::save(&mut rig.board.flash().array(), &device);
    rig.pc.connect(&mut rig.board);
    rig.pc.must(&mut rig.board, Command::Zero);
    let left = 700 - rig.board.now() / MILLISECOND;
    rig.pc.run_ms(&mut rig.board, left);
    let largest = |rig: &mut Rig| {
        rig.pc.must(&mut rig.board, Command::Start);
        let since = rig.board.now();
        rig.pc.run_ms(&mut rig.board, 500);
        rig.pc.must(&mut rig.board, Command::Stop);
        let codes = rig.board.at_stop(move |stopped| {
            let outputs = stopped.log().put_out.iter().filter(|output| output.at > since);
            outputs.map(|output| output.code.abs_diff(ZERO_TORQUE)).max()
        });
        f64::from(codes.expect("the converter was written")) * 28.8 / 2_047.0
    };
    let told = |rig: &Rig| rig.pc.heard_event(|kind| *kind == EventKind::HeatUnknown { seconds: 3 });
    let unknown = largest(&mut rig);
    println!("| torque after a power loss | {unknown:.2} mN·m of 3 |");
    assert!((2.9..=3.02).contains(&unknown), "{unknown} mN·m while nobody knows how warm it is");
    assert!(told(&rig), "the PC counts down: {:?}", rig.pc.heard.events);
    rig.pc.run_ms(&mut rig.board, 3_500);
    let cooled = largest(&mut rig);
    println!("| and once it must have cooled | {cooled:.2} mN·m |");
    assert!(cooled > 5.0, "{cooled} mN·m");
}

#[test]
fn the_motors_heat_outlives_a_reset() {
    let mut rig = Rig::pressed();
    rig.pc.must(&mut rig.board, Command::Stop);
    let mut config = Config::commissioned_virtual();
    config.device.limits.continuous_torque = MillinewtonMetres(I16F16::const_from_int(3));
    rig.pc.configure(&mut rig.board, &config);
    rig.pc.must(&mut rig.board, Command::Start);
    let is_held_down =
        |rig: &Rig| rig.pc.heard.pose.as_ref().is_some_and(|pose| pose.limits.contains(Limits::THERMAL));
    let from_cold_ms = (0..100).map(|step| 100 * step).find(|_| {
        rig.pc.run_ms(&mut rig.board, 100);
        is_held_down(&rig)
    });
    let from_cold_ms = from_cold_ms.expect("the winding warms");
    report("thermal limit from cold", from_cold_ms * MILLISECOND);
    assert!(
        from_cold_ms >= 1_500,
        "a cold motor takes longer than what follows the reset: {from_cold_ms} ms"
    );

    rig.board.at_stop(|stopped| stopped.reset_by_pin());
    rig.board.run_ms(20);
    rig.pc.connect(&mut rig.board);
    rig.pc.must(&mut rig.board, Command::Zero);
    let now = rig.board.now();
    let hand = plant::path(vec![(now, PRESSED), (now + 100 * MILLISECOND, 2 * PRESSED)]);
    rig.board.at_stop(|stopped| stopped.set_plant(Box::new(plant::by_hand(hand))));
    rig.pc.run_ms(&mut rig.board, 200);
    rig.pc.must(&mut rig.board, Command::Start);
    rig.pc.run_ms(&mut rig.board, 500);
    assert!(is_held_down(&rig), "the motor is as warm as before: {:?}", rig.pc.heard.pose);
}
