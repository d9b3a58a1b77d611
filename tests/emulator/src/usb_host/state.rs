//! The port as a program on the PC sees it.

use serde::{Deserialize, Serialize};

/// The state of the port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Port {
    /// No cable, or a device that doesn't show itself.
    Absent,
    /// Debounce, reset or enumeration.
    Enumerating,
    /// The serial port is there.
    Configured,
    /// The serial port is there and the bus sleeps.
    Suspended,
    /// The device answered wrongly, and why.
    Failed(String),
}

/// The counts of the host since it was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// The number of times that the serial port appeared.
    pub enumerations: u32,
    /// The number of times that it disappeared without the cable being pulled: the device
    /// restarted.
    pub disconnects: u32,
    /// Transactions that the device did not answer after it was configured.
    pub silences: u64,
    /// Halted bulk endpoints.
    pub stalls: u64,
    /// IN packets with the wrong data toggle, which a host throws away.
    pub toggle_errors: u64,
    /// Bytes given to the application, and taken from it.
    pub bytes_in: u64,
    /// Bytes the device acknowledged.
    pub bytes_out: u64,
}
