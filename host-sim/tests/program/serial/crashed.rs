//! A board whose last run ended with a crash: every program that talks to it says so.

use super::board::Board;
use super::{Plugged, device};
use crate::common::{folder, host_sim, text};
use device_sim::device::Wire;
use link::codec::{self, MAX_FRAME};
use link::crash::Crash;
use link::frames::{DeviceFrame, Numbered};
use std::io::{self, BufRead, BufReader};
use std::process::Stdio;
use std::time::Duration;

/// A wire on which a record of a crash comes with the answer to the PC's first bytes.
struct AfterCrash {
    record: Vec<u8>,
    is_greeted: bool,
    wire: Box<dyn Wire>,
}

impl AfterCrash {
    fn new(crash: &Crash, wire: Box<dyn Wire>) -> Self {
        let mut frame = [0; MAX_FRAME];
        let numbered = Numbered { sequence: 0, frame: DeviceFrame::Crash(crash.clone()) };
        let length = codec::encode(&numbered, &mut frame).expect("it fits");
        Self { record: frame[..length].to_vec(), is_greeted: false, wire }
    }
}

impl Wire for AfterCrash {
    fn read(&mut self, into: &mut [u8], patience: Duration) -> io::Result<usize> {
        if self.record.is_empty() || !self.is_greeted {
            return self.wire.read(into, patience);
        }
        let record = std::mem::take(&mut self.record);
        into[..record.len()].copy_from_slice(&record);
        Ok(record.len())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.is_greeted |= !bytes.is_empty();
        self.wire.write(bytes)
    }
}

/// True if the program says the crash on standard error before it ends, or before it is ended here.
fn says(arguments: &[&str], name: &str) -> bool {
    let crash = Crash::panic("firmware/src/app.rs", 77);
    let path = folder(name).join("ttyBoard");
    let mut board = Board::start(device());
    let _plugged = Plugged::new(&path, Box::new(AfterCrash::new(&crash, board.plug_in())));
    let mut child = host_sim(arguments)
        .args(["--device", text(&path)])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let lines = BufReader::new(child.stderr.take().expect("piped")).lines();
    let sentence = format!("host-sim: {crash}");
    let is_said = lines.map_while(Result::ok).any(|line| line == sentence);
    // It waits for a hand or plays for minutes; it may also have ended by itself.
    let _ = child.kill();
    child.wait().expect("it ends");
    is_said
}

#[test]
fn commissioning_says_how_the_last_run_ended() {
    assert!(says(&["commission", "--yes"], "crashed-commission"));
}

#[test]
fn characterisation_says_how_the_last_run_ended() {
    let out = folder("crashed-characterise-out");
    assert!(says(&["characterise", "--yes", "--out", text(&out)], "crashed-characterise"));
}
