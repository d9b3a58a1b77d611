//! `settle`, on the virtual device and over a port: the rounds, the use of what was settled, and a
//! person who ends it.

use crate::common::{folder, refused, run};
use device_sim::device::{Port, Wire};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use lab::characterise::mechanism::BareDevice;
use lab::commission::bench::WireLine;
use lab::compensate::{self, CompensationStep, Wish};
use lab::settle::{Inputs, Plant, Progress, Settings, Subject, settle};
use link::codec::MAX_FRAME;
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

fn hidden() -> Rig {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/hidden.toml");
    Rig::read(&path).expect("a rig")
}

/// One round of recordings that last `motion_s` together.
fn settings(out: &Path, motion_s: f64, compensate: bool) -> Settings {
    let inputs = if compensate { Inputs::Designed } else { Inputs::Characterise };
    Settings { inputs, rounds: 1, motion_s, seed: 1, compensate, device: "virtual".into(), out: out.into() }
}

#[test]
fn what_was_settled_is_fed_forward_and_the_hand_feels_less() {
    let out = folder("settle-feel");
    let mut subject = Subject::Virtual(Box::new(Plant { rig: hidden(), file: "hidden.toml".into() }));
    let rig = subject.data_sheet_rig().expect("the virtual device has a data sheet");
    let mut steps = 0;
    let settled = settle(&mut subject, &rig, &settings(&out, 40.0, true), |progress| {
        steps += usize::from(matches!(progress, Progress::Feeds(_)));
        Ok(())
    })
    .expect("it is settled");
    assert!(!settled.names.is_empty(), "{}", settled.conclusion);
    let feel = settled.feel.expect("it was asked for").expect("something is fed forward");
    let (before, after) = (feel.before.all(), feel.after.all());
    assert!(after < 0.6 * before, "{after} N after {before} N");
    assert!(steps >= 3, "each step is announced: {steps}");
    // The device's part reads back, and the page shows what the file says.
    let json = std::fs::read_to_string(out.join("settle.json")).expect("it was written");
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let hold = json["feel"]["after_mn_rms"]["hold"].as_f64().expect("a number");
    assert!((hold - 1e3 * feel.after.hold).abs() < 1e-9);
    // The turns each way and 6 s of holding, before and after.
    assert!((30.0..120.0).contains(&feel.motion_s), "{} s", feel.motion_s);
    for file in ["device.toml", "compensation.html", "settle.html"] {
        assert!(out.join(file).is_file(), "{file}");
    }
    let patched = Rig::read(&out.join("patched-rig.toml")).expect("it was written");
    let has = |name: &str| patched.effects.iter().any(|effect| effect.name.as_str() == name);
    assert!(settled.names.iter().all(|name| has(&name.class[0])), "{:?}", patched.effects);
}

/// A lag of 0.2 ms, which the first round does not distinguish from a delay.
const LATE: &str = r#"format = 1
kind = "rotary"
model = { inertia = 1.4e-6, viscous = 1.2e-6, coulomb = 4.0e-4 }
actuator = { gain = 1.4069371300321356e-5, command_unit = "dac", limit = 2047.0 }
encoder = { counts_per_unit = 636.6197772990716, turn = 6.283185307179586 }
[[effect]]
name = "electrical_lag"
shape = { time_constant = 0.0002 }
"#;

/// The virtual device with that lag, and the rig of its data sheet.
fn late() -> (Subject<'static>, Rig) {
    let rig = Rig::parse(LATE, "lag.toml").expect("a rig");
    let mut subject = Subject::Virtual(Box::new(Plant { rig, file: "lag.toml".into() }));
    let rig = subject.data_sheet_rig().expect("the virtual device has a data sheet");
    (subject, rig)
}

/// Fewer would not show a round that is designed against the one before.
#[test]
#[ignore = "nightly: 38 s of motion at 10 kHz and two diagnoses, 15 s"]
fn a_class_is_asked_again_within_the_motion_allowed() {
    let out = folder("settle-designed");
    let (mut subject, rig) = late();
    let settings = Settings { rounds: 5, motion_s: 38.0, compensate: false, ..settings(&out, 0.0, true) };
    let mut asked = Vec::new();
    let settled = settle(&mut subject, &rig, &settings, |progress| {
        if let Progress::Asked(_, words, _) = progress {
            asked.push(words.to_owned());
        }
        Ok(())
    })
    .expect("it is settled");
    let class = ["command_delay", "electrical_lag"];
    assert!(
        settled.rounds[0].names.iter().any(|name| name.class.iter().all(|one| class.contains(&one.as_str())))
    );
    assert_eq!((asked.len(), settled.rounds.len()), (2, 2), "{}", settled.conclusion);
    assert!(settled.motion_s() <= 38.0, "{} s", settled.motion_s());
    // The second was designed, and predicts what each rival would do.
    let design =
        std::fs::read_to_string(out.join("round-2/experiment/experiment.json")).expect("it was designed");
    let design: serde_json::Value = serde_json::from_str(&design).expect("JSON");
    assert!(class.iter().all(|name| design.to_string().contains(name)), "{design}");
    assert!(settled.conclusion.contains("38 s are allowed"), "{}", settled.conclusion);
}

/// A device with a mechanism behind a port. It moves on only while its wire is read, and no faster
/// than a clock.
struct Behind(Arc<Mutex<BareDevice>>);

impl Port for Behind {
    fn open(&mut self) -> io::Result<Box<dyn Wire>> {
        let begun = self.0.lock().expect("nobody panicked").ticks();
        let (device, waiting) = (self.0.clone(), VecDeque::new());
        Ok(Box::new(Cable { device, waiting, begun, since: Instant::now() }))
    }
}

struct Cable {
    device: Arc<Mutex<BareDevice>>,
    waiting: VecDeque<u8>,
    begun: u64,
    since: Instant,
}

/// Ticks between two readings at most, so that a slow computer makes a slow device and not a silent
/// one.
const BURST: u64 = 50;

impl Wire for Cable {
    fn read(&mut self, into: &mut [u8], patience: Duration) -> io::Result<usize> {
        let mut device = self.device.lock().expect("nobody panicked");
        let due = self.begun + (self.since.elapsed().as_micros() / 100) as u64;
        let ticks = due.saturating_sub(device.ticks());
        if ticks == 0 && self.waiting.is_empty() {
            std::thread::sleep(patience);
        }
        for _ in 0..ticks.min(BURST) {
            device.tick(0.0);
        }
        let mut frame = [0; MAX_FRAME];
        loop {
            match device.transmit(&mut frame) {
                0 => break,
                count => self.waiting.extend(&frame[..count]),
            }
        }
        let count = into.len().min(self.waiting.len());
        for (place, byte) in into.iter_mut().zip(self.waiting.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.device.lock().expect("nobody panicked").receive(bytes);
        Ok(())
    }
}

fn behind() -> Behind {
    Behind(Arc::new(Mutex::new(BareDevice::new(&hidden(), "hidden.toml").expect("a device"))))
}

/// Takes 9 s: the device is a real one to the program, and plays in real time.
#[test]
fn a_device_behind_a_port_is_recorded_and_diagnosed() {
    let (out, stop) = (folder("settle-port"), AtomicBool::new(false));
    let mut port = behind();
    let mut subject = Subject::Real { port: &mut port, stop: &stop };
    let rig = subject.data_sheet_rig().expect("the device tells its scale");
    let settled = settle(&mut subject, &rig, &settings(&out, 9.0, false), |_| Ok(())).expect("it is settled");
    assert_eq!(settled.rounds.len(), 1);
    assert!(settled.feel.is_none(), "it was not asked for");
    let rows = std::fs::read_to_string(out.join("round-1/fit.csv")).expect("a recording").lines().count();
    assert!(rows > 20_000, "{rows} rows at 10 kHz");
}

#[test]
fn a_person_ends_it_and_the_torque_goes() {
    let (out, stop) = (folder("settle-stop"), AtomicBool::new(false));
    let mut port = behind();
    let device = port.0.clone();
    let mut subject = Subject::Real { port: &mut port, stop: &stop };
    let rig = subject.data_sheet_rig().expect("the device tells its scale");
    let ended = settle(&mut subject, &rig, &settings(&out, 9.0, false), |progress| {
        if matches!(progress, Progress::Played { seconds, .. } if seconds > 0.5) {
            stop.store(true, Ordering::Relaxed);
        }
        Ok(())
    });
    let said = ended.expect_err("it was stopped").to_string();
    assert!(said.contains("stopped"), "{said}");
    let mut device = device.lock().expect("nobody panicked");
    // What the program sent last reaches the device: torque fades and stays away.
    for _ in 0..2_000 {
        device.tick(0.0);
    }
    let begin = device.position();
    for _ in 0..2_000 {
        device.tick(0.0);
    }
    assert!((device.position() - begin).abs() < 0.01, "the roller still turns");
    assert!(!out.join("round-1").join("fit.csv").exists(), "half a recording was written");
}

#[test]
fn a_person_refuses_the_first_movement() {
    let out = folder("settle-refused");
    let mut subject = Subject::Virtual(Box::new(Plant { rig: hidden(), file: "hidden.toml".into() }));
    let rig = subject.data_sheet_rig().expect("the virtual device has a data sheet");
    let refused = settle(&mut subject, &rig, &settings(&out, 9.0, false), |progress| match progress {
        Progress::Asked(..) => Err(Error::failed("not now")),
        _ => Ok(()),
    });
    assert_eq!(refused.expect_err("it was refused").to_string(), "not now");
    assert!(!out.join("round-1").exists(), "nothing was played");
}

/// A person presses Stop while the roller shows what would be fed forward: the device gets back
/// what it had, although nothing else is sent after a stop. Takes 25 s, in real time.
#[test]
fn a_stop_while_feeding_forward_gives_back_what_the_device_had() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/hidden-found.toml");
    let found = Rig::read(&path).expect("a rig");
    let stop = Arc::new(AtomicBool::new(false));
    let mut port = behind();
    let device = port.0.clone();
    let before = *device.lock().expect("nobody panicked").plan().device();
    let presses = {
        let (device, stop) = (device.clone(), stop.clone());
        move || {
            std::thread::sleep(Duration::from_secs(4));
            let feeds = *device.lock().expect("nobody panicked").plan().device() != before;
            stop.store(true, Ordering::Relaxed);
            feeds
        }
    };
    let mut pressed = None;
    let mut line = WireLine::new(port.open().expect("it is there"), &stop);
    let mut steps = Vec::new();
    let ended = compensate::compensate(&mut line, &found, Wish::default(), |step| {
        steps.push(step.to_string());
        if step == CompensationStep::After {
            pressed = Some(std::thread::spawn(presses.clone()));
        }
        Ok(())
    });
    let feeds = pressed.expect("it was tried").join().expect("nobody panicked");
    assert!(feeds, "what is to be taken back was never in the device");
    let said = ended.expect_err("it was stopped").to_string();
    assert!(said.contains("stopped") && !said.contains("may still feed forward"), "{said}");
    assert!(steps.len() >= 3, "{steps:?}");
    assert_eq!(*device.lock().expect("nobody panicked").plan().device(), before);
}

/// Takes 10 s: a round has to be recorded and diagnosed before a person can end the run.
#[test]
fn a_run_that_is_ended_keeps_its_rounds() {
    let out = folder("settle-kept");
    let (mut subject, rig) = late();
    let settings = Settings { rounds: 5, compensate: false, ..settings(&out, 38.0, true) };
    let mut parts = Vec::new();
    let ended = settle(&mut subject, &rig, &settings, |progress| match progress {
        Progress::Said(_) => Err(Error::failed("not again")),
        Progress::Diagnoses(part) => {
            parts.push(part);
            Ok(())
        }
        _ => Ok(()),
    });
    assert_eq!(ended.expect_err("it was ended").to_string(), "not again");
    let json = std::fs::read_to_string(out.join("settle.json")).expect("it was written");
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["rounds"].as_array().map(Vec::len), Some(1));
    let conclusion = json["conclusion"].as_str().expect("a sentence");
    assert!(conclusion.contains("it ended early: not again"), "{conclusion}");
    assert!(out.join("settle.html").is_file());
    let names = json["names"].as_array().expect("names");
    assert!(!names.is_empty(), "{json}");
    let patched = Rig::read(&out.join("patched-rig.toml")).expect("what is settled is kept");
    assert_eq!(patched.effects.len(), names.len());
    assert!(parts.len() > 5 && parts.is_sorted(), "progress never falls: {parts:?}");
}

#[test]
fn rounds_motion_and_length_beyond_the_most_are_refused() {
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/fixtures/hidden.toml");
    let settle = ["settle", "--plant", plant, "--out", "unused"];
    let with = |flag: &str, value: &str| run(&[&settle[..], &[flag, value]].concat());
    refused(&with("--rounds", "6"), 2, &["--rounds must be 1 to 5"]);
    refused(&with("--motion", "181"), 2, &["--motion must be 20 to 180 s"]);
    let experiment = ["experiment", "--report", "unused", "--out", "unused", "--seconds", "31"];
    refused(&run(&experiment), 2, &["it must be from 4 to 30 seconds"]);
}
