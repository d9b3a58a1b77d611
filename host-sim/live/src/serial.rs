//! A device behind a serial port: USB CDC, where the baud rate means nothing, or anything else that
//! carries bytes.

use device_sim::device::{Port, Wire};
use device_sim::error::Error;
use std::io;
use std::time::Duration;

/// Written into the port's settings; USB CDC ignores it.
const BAUD: u32 = 115_200;
/// A device that takes no bytes for this long is as good as unplugged.
const WRITE_PATIENCE: Duration = Duration::from_millis(200);

/// A serial port by its path; it may come and go.
pub struct SerialPort {
    path: String,
}

struct SerialWire(Box<dyn serialport::SerialPort>);

impl SerialPort {
    /// Checks that there is such a port now.
    pub fn find(path: &str) -> Result<Self, Error> {
        let port = Self { path: path.to_owned() };
        match port.connect() {
            Ok(_) => Ok(port),
            Err(cause) => Err(Error::input(format_args!(
                "{path}: the serial port cannot be opened ({cause}); plug the device in, check the path and your rights, or use --device virtual"
            ))),
        }
    }

    fn connect(&self) -> io::Result<SerialWire> {
        let opened = serialport::new(&self.path, BAUD).timeout(WRITE_PATIENCE).open()?;
        Ok(SerialWire(opened))
    }
}

impl Port for SerialPort {
    fn open(&mut self) -> io::Result<Box<dyn Wire>> {
        self.connect().map(|wire| Box::new(wire) as Box<dyn Wire>)
    }
}

impl Wire for SerialWire {
    fn read(&mut self, into: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.0.set_timeout(patience)?;
        match io::Read::read(&mut self.0, into) {
            // A port that is ready to read and has nothing has hung up.
            Ok(0) => Err(io::ErrorKind::BrokenPipe.into()),
            Ok(count) => Ok(count),
            Err(cause) if matches!(cause.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted) => {
                Ok(0)
            }
            Err(cause) => Err(cause),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.set_timeout(WRITE_PATIENCE)?;
        io::Write::write_all(&mut self.0, bytes)
    }
}
