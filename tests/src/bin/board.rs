//! Runs the flash image on the emulated board by hand.
//!
//! The device's serial port appears as a pseudo-terminal; `host-sim run --device PATH` talks to it
//! as to a real one.

use std::io::{ErrorKind, Read, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use emulator::board::{Board, Drive, Nanos, Wiring, firmware_path};
use emulator::usb_host::Port;
use serialport::{SerialPort, TTYPort};

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
        Board::on(&options.image, wiring, emulator::board::plant::held())
    } else {
        Board::on(&options.image, wiring, hand())
    };
    let mut board = board.map_err(|why| why.to_string())?;
    // The far end stays open here, so that programs may come and go.
    let (mut terminal, _far_end) = Terminal::open()?;
    println!("the device's serial port: {}", terminal.path);

    board.at_stop(|stopped| stopped.usb().host.plug());
    let mut shown = Shown { port: Port::Absent, enabled: false };
    let mut clock = WallClock { started: Instant::now(), from: board.now() };
    loop {
        board.run_ms(1);
        let from_pc = terminal.read()?;
        let (port, drive, from_device, log) = board.at_stop(move |stopped| {
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
        terminal.write(from_device);
        shown.update(board.now(), port, drive.enabled);
        if options.seconds.is_some_and(|seconds| board.now() >= seconds * 1_000_000_000) {
            return Ok(());
        }
        if !options.fast {
            clock.wait(board.now());
        }
    }
}

/// The pseudo-terminal on which the device's serial port is.
struct Terminal {
    near: TTYPort,
    path: String,
    /// Bytes that nobody has read yet.
    waiting: Vec<u8>,
}

impl Terminal {
    /// Opens a terminal; the second is its far end, which a program opens by its path.
    fn open() -> Result<(Self, TTYPort), String> {
        let (mut near, far) =
            TTYPort::pair().map_err(|error| format!("no pseudo-terminal: {error}; is /dev/ptmx there?"))?;
        let path = far.name().unwrap_or_default();
        near.set_timeout(Duration::ZERO).map_err(|error| format!("the pseudo-terminal {path}: {error}"))?;
        Ok((Self { near, path, waiting: Vec::new() }, far))
    }

    /// Returns the bytes from the PC that are there.
    fn read(&mut self) -> Result<Vec<u8>, String> {
        let mut bytes = [0; 4096];
        match self.near.read(&mut bytes) {
            Ok(length) => Ok(bytes[..length].to_vec()),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                Ok(Vec::new())
            }
            Err(error) => Err(format!("the pseudo-terminal {}: {error}", self.path)),
        }
    }

    fn write(&mut self, from_device: Vec<u8>) {
        self.waiting.extend(from_device);
        match self.near.write(&self.waiting) {
            Ok(length) => drop(self.waiting.drain(..length)),
            // Nobody reads: a terminal keeps little.
            Err(_) if self.waiting.len() > 65_536 => self.waiting.clear(),
            Err(_) => {}
        }
    }
}

/// The states of cable and amplifier, as they were last shown.
struct Shown {
    port: Port,
    enabled: bool,
}

impl Shown {
    fn update(&mut self, now: Nanos, port: Port, enabled: bool) {
        let seconds = now as f64 / 1e9;
        if port != self.port {
            eprintln!("{seconds:>8.3} s  USB: {port:?}");
            self.port = port;
        }
        if enabled != self.enabled {
            let word = if enabled { "on" } else { "off" };
            eprintln!("{seconds:>8.3} s  amplifier {word}");
            self.enabled = enabled;
        }
    }
}

/// The clock on the wall, and the device's time at its start.
struct WallClock {
    started: Instant,
    from: Nanos,
}

impl WallClock {
    /// Waits until as much time has passed on the wall as for the device, whose time is `now`.
    fn wait(&mut self, now: Nanos) {
        match Duration::from_nanos(now - self.from).checked_sub(self.started.elapsed()) {
            Some(ahead) => std::thread::sleep(ahead),
            // Time that was lost is not made up for: the device would find its PC too slow.
            None => *self = Self { started: Instant::now(), from: now },
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
