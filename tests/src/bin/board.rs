//! Runs the flash image on the emulated board by hand.
//!
//! The device's serial port appears as a pseudo-terminal; `host-sim run --device PATH` talks to it
//! as to a real one.

use std::io::{ErrorKind, Read, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};
use tests::board::{Board, Drive, Nanos, Wiring, firmware_path};
use tests::usb_host::Port;

const HELP: &str = "\
Runs the flash image on an emulated STM32F4DISCOVERY and puts its serial port on a pseudo-terminal.

Usage: board [--seconds S] [--fast] [--held] [IMAGE]

  IMAGE        the ELF file to run; default: what `cargo xtask firmware` builds, or FIRMWARE_ELF
  --seconds S  ends after S seconds of device time; default: never
  --fast       as fast as it goes, instead of in step with the clock on the wall
  --held       holds the shaft, instead of letting a hand push the needle to and fro

Example: cargo run --release -p tests --ignore-rust-version --bin board
         cargo run --release -- run --device PATH     (the path that the first one prints)";

struct Options {
    image: PathBuf,
    seconds: Option<u64>,
    fast: bool,
    held: bool,
}

fn options() -> Result<Option<Options>, String> {
    let mut options = Options { image: firmware_path(), seconds: None, fast: false, held: false };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--help" | "-h" => return Ok(None),
            "--fast" => options.fast = true,
            "--held" => options.held = true,
            "--seconds" => {
                let value = arguments.next().unwrap_or_default();
                let seconds = value.parse();
                options.seconds =
                    Some(seconds.map_err(|_| format!("--seconds takes a whole number, not `{value}`"))?);
            }
            other if other.starts_with('-') => return Err(format!("`{other}` is no option; see --help")),
            image => options.image = image.into(),
        }
    }
    Ok(Some(options))
}

/// A hand that pushes the needle 8 mm in and draws it back, every eight seconds, and gives way to
/// what the motor asks for by up to a millimetre.
fn hand() -> impl FnMut(Nanos, Drive) -> i64 + Send {
    const PERIOD: f64 = 8.0;
    const COUNTS_PER_MM: f64 = 63.66;
    let mut yielded = 0.0;
    move |at: Nanos, drive: Drive| {
        let phase = (at as f64 / 1e9 % PERIOD) / PERIOD;
        let depth = -1.0 + 9.0 * (0.5 - 0.5 * (2.0 * std::f64::consts::PI * phase).cos());
        let torque = match drive {
            Drive { code: Some(code), enabled: true } => (f64::from(code) - 2048.0) / 2047.0,
            _ => 0.0,
        };
        yielded += (torque - yielded) * 0.001;
        ((depth + yielded) * COUNTS_PER_MM) as i64
    }
}

fn run(options: Options) -> Result<(), String> {
    let wiring = Wiring::default();
    let board = if options.held {
        Board::on(&options.image, wiring, tests::board::plant::held())
    } else {
        Board::on(&options.image, wiring, hand())
    };
    let mut board = board.map_err(|why| why.to_string())?;
    // The far end stays open here, so that programs may come and go.
    let (mut terminal, far_end) =
        TTYPort::pair().map_err(|error| format!("no pseudo-terminal: {error}; is /dev/ptmx there?"))?;
    let path = far_end.name().unwrap_or_default();
    let nothing = |error| format!("the pseudo-terminal {path}: {error}");
    terminal.set_timeout(Duration::ZERO).map_err(nothing)?;
    println!("the device's serial port: {path}");

    board.at_stop(|stopped| stopped.usb().host.plug());
    let (mut port, mut enabled) = (Port::Absent, false);
    let (mut started, mut paced_from) = (Instant::now(), board.now());
    let mut waiting = Vec::new();
    loop {
        board.run_ms(1);
        let mut bytes = [0; 4096];
        let from_pc = match terminal.read(&mut bytes) {
            Ok(length) => bytes[..length].to_vec(),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => Vec::new(),
            Err(error) => return Err(format!("the pseudo-terminal {path}: {error}")),
        };
        let (now_port, drive, from_device, log) = board.at_stop(move |stopped| {
            let host = &mut stopped.usb().host;
            if host.port() == Port::Configured && !host.is_open() {
                host.open();
            }
            host.write(&from_pc);
            let (port, bytes) = (host.port(), host.read());
            let drive = stopped.drive();
            (port, drive, bytes, std::mem::take(stopped.log()))
        });
        drop(log);
        waiting.extend(from_device);
        match terminal.write(&waiting) {
            Ok(length) => drop(waiting.drain(..length)),
            // Nobody reads: a terminal keeps little.
            Err(_) if waiting.len() > 65_536 => waiting.clear(),
            Err(_) => {}
        }
        if now_port != port {
            eprintln!("{:>8.3} s  USB: {now_port:?}", board.now() as f64 / 1e9);
            port = now_port;
        }
        if drive.enabled != enabled {
            enabled = drive.enabled;
            let word = if enabled { "on" } else { "off" };
            eprintln!("{:>8.3} s  amplifier {word}", board.now() as f64 / 1e9);
        }
        if options.seconds.is_some_and(|seconds| board.now() >= seconds * 1_000_000_000) {
            return Ok(());
        }
        if !options.fast {
            let device = Duration::from_nanos(board.now() - paced_from);
            match device.checked_sub(started.elapsed()) {
                Some(ahead) => std::thread::sleep(ahead),
                // Time that was lost is not made up for: the device would find its PC too slow.
                None => (started, paced_from) = (Instant::now(), board.now()),
            }
        }
    }
}

fn main() -> ExitCode {
    match options() {
        Ok(None) => {
            println!("{HELP}");
            ExitCode::SUCCESS
        }
        Ok(Some(options)) => match run(options) {
            Ok(()) => ExitCode::SUCCESS,
            Err(why) => {
                eprintln!("error: {why}");
                ExitCode::FAILURE
            }
        },
        Err(why) => {
            eprintln!("error: {why}");
            ExitCode::from(2)
        }
    }
}
