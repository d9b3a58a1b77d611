//! A serial device, over a pseudo-terminal pair: the virtual device's bytes behind the far end,
//! unplugged and plugged in again.

mod board;
mod crashed;
mod pipe;

use crate::common::{figure, folder, host_sim, text};
use board::Board;
use device_sim::device::virtual_device::VirtualDevice;
use device_sim::device::{Port, Wire};
use device_sim::driver::Driver;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use link::frames::DeviceFrame;
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A plugged-in board: the far end of a pseudo-terminal with a wire to a device. Dropped, it is
/// unplugged.
struct Plugged {
    path: PathBuf,
    unplug: Arc<AtomicBool>,
    pump: Option<JoinHandle<()>>,
}

impl Plugged {
    fn new(path: &Path, mut wire: Box<dyn Wire>) -> Self {
        // Closed on exec: a program under test must not hold its own board's end open.
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let board = openpt(flags).expect("there are pseudo-terminals");
        grantpt(&board).and_then(|()| unlockpt(&board)).expect("it is ours");
        let name = ptsname(&board, Vec::new()).expect("it has a name").into_string().expect("text");
        // Held open, so that the pair outlives programs that come and go.
        let held = File::open(&name).expect("it is there");
        let mut raw = tcgetattr(&held).expect("it is a terminal");
        raw.make_raw();
        tcsetattr(&held, OptionalActions::Now, &raw).expect("it is a terminal");
        std::os::unix::fs::symlink(name, path).expect("the folder can be written");
        fcntl_setfl(&board, OFlags::NONBLOCK).expect("it is a file");
        let mut board = File::from(board);
        let unplug = Arc::new(AtomicBool::new(false));
        let end = unplug.clone();
        let pump = std::thread::spawn(move || {
            let _held = held;
            let mut bytes = [0; 4096];
            let mut outgoing = Vec::new();
            while !end.load(Ordering::Relaxed) {
                if let Ok(count) = board.read(&mut bytes)
                    && wire.write(&bytes[..count]).is_err()
                {
                    return;
                }
                if outgoing.is_empty() {
                    let Ok(count) = wire.read(&mut bytes, Duration::from_millis(1)) else { return };
                    outgoing.extend(&bytes[..count]);
                }
                // What the terminal's buffer does not take yet waits here, as in a board's
                // endpoint.
                match board.write(&outgoing) {
                    Ok(written) => drop(outgoing.drain(..written)),
                    Err(_) => std::thread::sleep(Duration::from_millis(1)),
                }
            }
        });
        Self { path: path.to_owned(), unplug, pump: Some(pump) }
    }
}

impl Drop for Plugged {
    fn drop(&mut self) {
        std::fs::remove_file(&self.path).expect("it was there");
        self.unplug.store(true, Ordering::Relaxed);
        self.pump.take().expect("once").join().expect("the pump ends");
    }
}

fn device() -> VirtualDevice {
    let profile = Profile::find("adult").expect("it is built in");
    let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
    VirtualDevice::new(&profile, procedure)
}

#[test]
fn the_same_bytes_over_a_terminal_lose_nothing() {
    let dir = folder("serial");
    let path = dir.join("ttyBoard");
    let mut board = Board::start(device());
    let _plugged = Plugged::new(&path, board.plug_in());
    let output = host_sim(&["run", "--headless", "--seconds", "6", "--device", text(&path)]).output();
    let output = output.expect("the program starts");
    let stdout = String::from_utf8(output.stdout).expect("text");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!((figure(&stdout, "samples"), figure(&stdout, "lost")), (60_000.0, 0.0), "{stdout}");
    assert_eq!((figure(&stdout, "punctures"), figure(&stdout, "lost_samples")), (2.0, 0.0), "{stdout}");
}

#[test]
fn with_a_page_the_torque_waits_for_a_person() {
    let dir = folder("page");
    let path = dir.join("ttyBoard");
    let mut board = Board::start(device());
    let _plugged = Plugged::new(&path, board.plug_in());
    let stdout = crate::common::run_well(&["run", "--port", "0", "--seconds", "4", "--device", text(&path)]);
    assert!(stdout.contains("press Start"), "{stdout}");
    assert_eq!((figure(&stdout, "samples"), figure(&stdout, "punctures")), (40_000.0, 0.0), "{stdout}");
    assert_eq!(figure(&stdout, "peak_force_n"), 0.0, "{stdout}");
}

#[test]
fn a_port_where_nobody_answers_is_one_line_and_status_one() {
    let dir = folder("mute");
    let path = dir.join("ttyMute");
    let (near, _far) = pipe::cable();
    let _plugged = Plugged::new(&path, Box::new(near));
    let output =
        host_sim(&["run", "--headless", "--device", text(&path)]).output().expect("the program starts");
    crate::common::refused(&output, 1, &["did not answer"]);
}

#[test]
fn unplugged_and_plugged_in_again_it_goes_on_with_torque_off() {
    let dir = folder("replug");
    let (path, mcap) = (dir.join("ttyBoard"), dir.join("a.mcap"));
    let mut board = Board::start(device());
    let plugged = Plugged::new(&path, board.plug_in());
    let child =
        host_sim(&["run", "--headless", "--seconds", "5", "--device", text(&path), "--record", text(&mcap)])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
    std::thread::sleep(Duration::from_millis(2_000));
    drop(plugged);
    std::thread::sleep(Duration::from_millis(700));
    let _again = Plugged::new(&path, board.plug_in());
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success());
    let stdout = String::from_utf8(output.stdout).expect("text");
    assert_eq!(figure(&stdout, "samples"), 50_000.0, "both stretches together: {stdout}");

    let out = dir.join("out");
    crate::common::run_well(&["export", text(&mcap), "--out", text(&out)]);
    let rows = |name: &str| {
        let csv = std::fs::read_to_string(out.join(name)).expect("a stretch each");
        csv.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    let (before, after) = (rows("recording-1.csv"), rows("recording-2.csv"));
    assert!(before.len() > 10_000 && after.len() > 10_000, "{} and {} rows", before.len(), after.len());
    assert!(before.iter().any(|row| !row.ends_with(",0")), "it had been started");
    let off = |row: &String| row.contains(",0,") && (row.ends_with(",0") || row.ends_with(",7"));
    assert!(after.iter().all(off), "no torque until a person starts it again");
}

#[test]
fn a_killed_program_leaves_a_device_without_torque() {
    let dir = folder("killed-host");
    let path = dir.join("ttyBoard");
    let mut board = Board::start(device());
    let _plugged = Plugged::new(&path, board.plug_in());
    let mut child = host_sim(&["run", "--headless", "--device", text(&path)])
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    std::thread::sleep(Duration::from_millis(2_000));
    child.kill().expect("it runs");
    child.wait().expect("it ends");
    std::thread::sleep(Duration::from_millis(500));

    // The next program that connects receives the reason.
    let mut port = live::serial::SerialPort::find(text(&path)).expect("it is there");
    let mut wire = port.open().expect("it opens");
    let mut driver = Driver::new(Profile::find("adult").expect("it is built in").config.patient);
    let begin = Instant::now();
    driver.connected(Duration::ZERO);
    let (mut fault, mut powered, mut samples) = (None, 0, 0);
    let mut bytes = [0; 4096];
    while begin.elapsed() < Duration::from_secs(2) && samples < 1_000 {
        wire.write(driver.transmit(begin.elapsed())).expect("it takes bytes");
        let count = wire.read(&mut bytes, Duration::from_millis(2)).expect("it gives bytes");
        driver.receive(begin.elapsed(), &bytes[..count], |frame| match frame {
            DeviceFrame::Hello(hello) => fault = fault.or(hello.fault),
            DeviceFrame::Samples(block) if fault.is_some() => {
                samples += block.samples.len();
                powered += block.samples.iter().filter(|s| s.dac != 2048).count();
            }
            _ => {}
        });
    }
    assert_eq!(fault, Some(control_core::event::Fault::HostSilent));
    assert!(samples >= 1_000 && powered == 0, "{powered} of {samples} samples with torque");
}
