//! The cable: enumeration, both byte streams, sleep, and the plug pulled and put back, against the
//! flash image.

use control_core::event::{Fault, State};
use link::Command;
use link::frames::EventKind;
use tests::board::{Board, Wiring, firmware_path, plant};
use tests::pc::Pc;
use tests::usb_host::Port;

fn board() -> Board {
    Board::on(&firmware_path(), Wiring::default(), plant::held()).unwrap_or_else(|why| panic!("{why}"))
}

#[test]
fn smoke() {
    let mut board = board();
    let mut pc = Pc::new();
    pc.connect(&mut board);
    println!("{:?} {:?}", board.now(), pc.heard.hello);
    println!(
        "{:?}",
        board.at_stop(|s| (
            s.usb().host.identity().clone(),
            s.usb().core.misuse(),
            s.stray_accesses(),
            s.resets()
        ))
    );
    pc.run_ms(&mut board, 1000);
    println!("{:?}", pc.counts());
    println!("{:?} {:?}", pc.heard.timing, pc.heard.events);
    println!("{:?}", board.stack_use());
    pc.must(&mut board, Command::Start);
    pc.run_ms(&mut board, 500);
    println!("{:?}", pc.heard.events);
    println!("{:?}", board.at_stop(|s| s.log().put_out.iter().take(5).copied().collect::<Vec<_>>()));
    println!("{:?}", board.at_stop(|s| s.log().written.iter().take(5).copied().collect::<Vec<_>>()));
    println!("{:?}", board.at_stop(|s| s.drive()));
    println!("{:?}", board.at_stop(|s| s.log().rtt.len()));
    let _ = (Fault::Tilt, State::Idle, Port::Absent, EventKind::Started);
}
