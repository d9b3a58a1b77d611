//! `settle` on the flash image: the emulated board plays the excitations on a mechanism that the
//! diagnosis did not write (`tests::mechanism`: a law and an integrator of its own), or on a plant
//! that another author concealed (`tests/independent/settle_plants.py`), and the diagnosis names
//! what is concealed in it.

use std::io;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use device_sim::device::{Port, Wire};
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use emulator::board::plant::{Drive, PlantSide};
use emulator::board::{Board, MILLISECOND, Nanos};
use lab::settle::{Inputs, Settings, Settled, Subject, settle};
use tests::mechanism::{Mechanism, SharedMechanism};
use tests::pc::open_port;
use tests::scenario::board;

/// The rotor's angle at the beginning and the board's tilt, rad.
const ROTOR: f64 = 1.234;
const TILT: f64 = std::f64::consts::FRAC_PI_6;
/// The DAC code without torque, and the longest step of a plant, s.
const MID_SCALE: f64 = 2_048.0;
const STEP_S: f64 = 2e-5;
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

/// The mechanism of a rig file on the board's shaft.
fn concealed(name: &str) -> impl PlantSide + use<> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/concealed").join(name);
    let mut plant = Plant::new(&Rig::read(&path).expect("a rig"));
    let mut last = 0;
    move |at: Nanos, drive: Drive| {
        let command = match drive {
            Drive { code: Some(code), enabled: true } => f64::from(code) - MID_SCALE,
            _ => 0.0,
        };
        let dt = at.saturating_sub(last) as f64 / 1e9;
        last = at;
        let steps = (dt / STEP_S).ceil();
        for _ in 0..steps as u32 {
            plant.step(command, Surroundings::default(), dt / steps);
        }
        plant.counts() as i64
    }
}

/// Settles what is on the shaft of the emulated board in at most `rounds`.
fn settled(plant: impl PlantSide + 'static, rounds: usize, name: &str) -> Settled {
    let mut board = board(plant);
    open_port(&mut board);
    let mut port = Plugged(Arc::new(Mutex::new(board)));
    let stop = AtomicBool::new(false);
    let mut subject = Subject::Real { port: &mut port, stop: &stop };
    let rig = subject.data_sheet_rig().expect("the board tells its scale");
    let settings = Settings {
        inputs: Inputs::Designed,
        rounds,
        motion_s: 60.0,
        seed: 1,
        compensate: false,
        device: "board".into(),
        out: Path::new(env!("CARGO_TARGET_TMPDIR")).join(name),
    };
    let settled = settle(&mut subject, &rig, &settings, |_| Ok(())).expect("it is settled");
    println!("{}", settled.conclusion);
    for name in &settled.names {
        println!("{} {:.2}", name.class.join(" or "), name.confidence);
    }
    println!("{:.0} s of motion", settled.motion_s());
    settled
}

/// The names, each alone in its class.
fn single(settled: &Settled) -> Vec<&str> {
    settled.names.iter().filter(|name| name.class.len() == 1).map(|name| name.name.as_str()).collect()
}

#[test]
#[ignore = "nightly: a minute of the board, recorded at 10 kHz, and two diagnoses"]
fn a_concealed_imbalance_is_settled_on_the_flash_image() {
    let settled = settled(concealed("mass_imbalance.toml"), 2, "settled-imbalance");
    assert_eq!(single(&settled), ["mass_imbalance"], "{}", settled.conclusion);
}

#[test]
#[ignore = "nightly: a minute of the board, recorded at 10 kHz, and two diagnoses"]
fn a_concealed_drive_spring_is_settled_on_the_flash_image() {
    let settled = settled(concealed("drive_compliance.toml"), 2, "settled-compliance");
    assert_eq!(single(&settled), ["drive_compliance"], "{}", settled.conclusion);
}

#[test]
#[ignore = "nightly: a minute of the board, recorded at 10 kHz, and two diagnoses"]
fn cogging_is_settled_on_the_flash_image() {
    let mechanism = SharedMechanism::new(Mechanism::new(ROTOR, TILT));
    let settled = settled(mechanism.plant(), 2, "settled");
    let cogging = settled.names.iter().find(|name| name.name == "cogging").expect("cogging is named");
    assert!(cogging.class.len() == 1 && cogging.confidence >= 0.9, "{cogging:?}");
    // The mechanism has a weight, too, which the data sheet does not give. At one tilt throughout
    // it is a constant force: named or not, the conclusion may not say that nothing is missing.
    let others: Vec<&str> = single(&settled).into_iter().filter(|name| *name != "cogging").collect();
    let is_told = settled.conclusion.contains("a further effect is missing");
    assert!(others == ["tilt_gravity"] || (others.is_empty() && is_told), "{}", settled.conclusion);
}
