//! Ways to a device: the same bytes whether it is simulated in this process or hangs on a serial
//! port.

pub mod compensated;
mod deformed;
pub mod device_config;
pub mod grip;
pub mod virtual_device;
pub mod winding;

use std::io;
use std::time::Duration;

/// An open connection that carries bytes both ways.
pub trait Wire: Send {
    /// Reads what is there, waiting for at most `patience`; 0 bytes where nothing came. An error
    /// means that the connection is permanently gone.
    fn read(&mut self, into: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// Writes all of `bytes`, or fails: then the connection is permanently gone.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;
}

/// Something that can be connected to, again and again.
pub trait Port: Send {
    /// A new connection.
    fn open(&mut self) -> io::Result<Box<dyn Wire>>;
}
