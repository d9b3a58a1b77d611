//! The cable: enumeration, both byte streams, sleep, and the plug pulled and put back, against the
//! flash image.

use emulator::board::{MILLISECOND, Wiring, plant};
use emulator::usb_host::Port;
use link::Command;
use link::frames::EventKind;
use tests::pc::Pc;
use tests::rig::Rig;
use tests::scenario::board;

#[test]
fn a_pc_finds_a_serial_port_with_the_devices_name() {
    let mut board = board(plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    let (identity, misuse, stray) = board.at_stop(|stopped| {
        let port = stopped.usb();
        (port.host.identity().clone(), port.core.misuse(), stopped.stray_accesses())
    });
    // pid.codes' test identity; V-USB's 16C0:27DD asks for a domain at the beginning of the serial
    // number.
    assert_eq!((identity.vendor, identity.product), (0x1209, 0x0001));
    assert!(identity.strings.iter().all(Option::is_some), "{identity:?}");
    assert_eq!(misuse, (0, 0), "packet memory");
    assert!(stray.is_empty(), "accesses that nothing answers: {stray:?}");
    let hello = pc.heard.hello.expect("a hello");
    assert_eq!((hello.tick_hz, hello.fault), (10_000, None));
}

#[test]
fn nothing_is_sent_to_a_port_that_nobody_opened() {
    let mut board = board(plant::held());
    board.at_stop(|stopped| stopped.usb().host.plug());
    board.run_ms(1_000);
    let (port, counts) = board.at_stop(|stopped| (stopped.usb().host.port(), stopped.usb().host.counts()));
    assert_eq!(port, Port::Configured);
    assert_eq!(counts.bytes_in, 0);
}

#[test]
fn a_plug_pulled_and_put_back_again_and_again() {
    let mut board = board(plant::held());
    let mut pc = Pc::new();
    for round in 1..=5 {
        pc.connect(&mut board);
        pc.run_ms(&mut board, 100);
        let counts = pc.counts();
        assert!(counts.samples > 900, "round {round}: {counts:?}");
        assert_eq!((counts.lost_frames, counts.lost_samples, counts.garbage), (0, 0, 0), "round {round}");
        board.at_stop(|stopped| stopped.usb().host.unplug());
        // From a bounce of the plug to a walk to another room.
        board.run_until(board.now() + [1, 2, 5, 50, 800][round - 1] * MILLISECOND);
    }
    let enumerations = board.at_stop(|stopped| stopped.usb().host.counts().enumerations);
    assert_eq!(enumerations, 5);
    assert!(board.at_stop(|stopped| stopped.resets()).is_empty());
}

#[test]
fn a_bus_that_sleeps_and_wakes_carries_on() {
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant::held());
    pc.run_ms(&mut board, 50);
    board.at_stop(|stopped| stopped.usb().host.suspend());
    board.run_ms(2_000);
    board.at_stop(|stopped| stopped.usb().host.resume());
    board.run_ms(100);
    pc.hello(&mut board);
    pc.run_ms(&mut board, 100);
    assert!(pc.counts().samples > 900, "{:?}", pc.counts());
    assert_eq!(pc.counts().lost_samples, 0);
}

#[test]
fn garbage_costs_the_frame_it_is_in_and_no_other() {
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant::held());
    let mut bits = 12_345_u32;
    for _ in 0..20 {
        let noise: Vec<u8> = (0..1_500)
            .map(|_| {
                bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (bits >> 24) as u8
            })
            .collect();
        pc.send_bytes(&mut board, &noise);
        pc.send_bytes(&mut board, &[0]);
        pc.must(&mut board, Command::Heartbeat);
    }
    pc.run_ms(&mut board, 1_100);
    let timing = pc.heard.timing.expect("timing");
    assert!(timing.garbage_frames >= 20, "{timing:?}");
    assert!(!pc.heard_event(|kind| matches!(kind, EventKind::Started | EventKind::Fault { .. })));
    assert_eq!(pc.counts().lost_samples, 0);
}

#[test]
fn a_command_repeated_is_answered_again_and_done_once() {
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant::held());
    pc.must(&mut board, Command::Start);
    pc.run_ms(&mut board, 20);
    let started = |pc: &Pc| pc.heard.events.iter().filter(|event| event.kind == EventKind::Started).count();
    assert_eq!(started(&pc), 1);
    pc.must(&mut board, Command::Start);
    pc.run_ms(&mut board, 20);
    assert_eq!(started(&pc), 1, "it is running already");
}
