//! `settle` on the flash image: the emulated board plays the excitations on a mechanism that the
//! diagnosis did not write (`tests::mechanism`: a law and an integrator of its own), and the
//! diagnosis names what is concealed in it.

use std::io;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use device_sim::device::{Port, Wire};
use lab::settle::{Inputs, Settings, Subject, settle};
use tests::board::{Board, MILLISECOND, Nanos};
use tests::mechanism::{Mechanism, SharedMechanism};
use tests::pc::open_port;
use tests::scenario::board;

/// The rotor's angle at the beginning and the board's tilt, rad.
const ROTOR: f64 = 1.234;
const TILT: f64 = std::f64::consts::FRAC_PI_6;
/// The most that the board moves on between two readings, so that a slow computer makes a slow
/// device and not a silent one.
const BURST_MS: u64 = 5;

/// The board at the end of its cable. It moves on only while the cable is read, and no faster than
/// a clock.
struct Plugged(Arc<Mutex<Board>>);

struct Cable {
    board: Arc<Mutex<Board>>,
    begun: Nanos,
    since: Instant,
}

impl Port for Plugged {
    fn open(&mut self) -> io::Result<Box<dyn Wire>> {
        let begun = self.0.lock().unwrap_or_else(PoisonError::into_inner).now();
        Ok(Box::new(Cable { board: self.0.clone(), begun, since: Instant::now() }))
    }
}

impl Wire for Cable {
    fn read(&mut self, into: &mut [u8], patience: Duration) -> io::Result<usize> {
        let mut board = self.board.lock().unwrap_or_else(PoisonError::into_inner);
        let due_ms = (self.since.elapsed().as_millis() as u64)
            .saturating_sub((board.now() - self.begun) / MILLISECOND);
        if due_ms == 0 {
            std::thread::sleep(patience);
            return Ok(0);
        }
        board.run_ms(due_ms.min(BURST_MS));
        let room = into.len();
        let bytes = board.at_stop(move |stopped| stopped.usb().host.read());
        assert!(bytes.len() <= room, "{} bytes came at once", bytes.len());
        into[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let bytes = bytes.to_vec();
        let mut board = self.board.lock().unwrap_or_else(PoisonError::into_inner);
        board.at_stop(move |stopped| stopped.usb().host.write(&bytes));
        Ok(())
    }
}

#[test]
#[ignore = "nightly: half a minute of the board, recorded at 10 kHz, and its diagnosis, 40 s"]
fn cogging_is_settled_on_the_flash_image() {
    let mechanism = SharedMechanism::new(Mechanism::new(ROTOR, TILT));
    let mut board = board(mechanism.plant());
    open_port(&mut board);
    let mut port = Plugged(Arc::new(Mutex::new(board)));
    let stop = AtomicBool::new(false);
    let mut subject = Subject::Real { port: &mut port, stop: &stop };
    let rig = subject.data_sheet_rig().expect("the board tells its scale");
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("settled");
    let settings = Settings {
        inputs: Inputs::Designed,
        rounds: 2,
        motion_s: 60.0,
        seed: 1,
        compensate: false,
        device: "board".into(),
        out,
    };
    let settled = settle(&mut subject, &rig, &settings, |_| Ok(())).expect("it is settled");
    println!("{}", settled.conclusion);
    let named: Vec<(&str, f64)> =
        settled.names.iter().map(|name| (name.name.as_str(), name.confidence)).collect();
    println!("{named:?} after {:.0} s of motion", settled.motion_s());
    // The mechanism has a weight, too, which the data sheet does not tell.
    let names: Vec<&str> = named.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["cogging", "tilt_gravity"], "{}", settled.conclusion);
}
