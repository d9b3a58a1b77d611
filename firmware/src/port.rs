//! The interface of a board: a port is one folder that implements [`Board`] for it, and names its
//! pins in no other place. `embedded-hal` has the trait for the amplifier's enable line; the traits
//! that it lacks are here.

use crate::drive::Converters;
use crate::monitor::Readings;
use crate::store::ConfigFlash;
use crate::tilt::TiltSource;
use crate::wire_check::PulledLines;
use control_core::units::Counts;
use embedded_hal::digital::OutputPin;
use link::frames::GuardRefusal;

/// A board: its parts, and what reaches its processor as a whole.
pub trait Board: 'static {
    /// The tick's timer.
    type Timer: TickTimer;
    /// The encoder.
    type Encoder: Encoder;
    /// The converters.
    type Converters: Converters;
    /// The amplifier's enable line.
    type Enable: OutputPin;
    /// The encoder's lines.
    type EncoderLines: PulledLines;
    /// The signals from amplifier and emergency stop.
    type DriveLines: ReadDrive;
    /// The supply.
    type Supply: SupplyLevel;
    /// The watchdog.
    type Watchdog: Watchdog;
    /// The tilt sensor.
    type Tilt: TiltSource;
    /// The lamps.
    type Lamps: Lamps;
    /// The port to the PC.
    type Serial: SerialPort;
    /// The configuration's flash.
    type Flash: ConfigFlash;

    /// The core's cycles, which wrap.
    fn cycles() -> u32;
    /// Sets the USB task off.
    fn wake_usb();
    /// Sets the telemetry task off.
    fn wake_telemetry();
    /// Sets the tilt task off.
    fn wake_tilt();
    /// True if the port's own interrupt may set the USB task off.
    fn allow_usb(allowed: bool);
    /// Checks that a brown-out reset guards the supply; where it is off, sets it if `set` asks for
    /// it, which stops the processor for up to a second and counts after the next reset.
    fn guard_supply(set: bool) -> Result<(), GuardRefusal>;
}

/// The timer whose edges are the ticks.
pub trait TickTimer {
    /// Clears the edge that brought us here.
    fn acknowledge(&self);
    /// True if the next edge has come already.
    fn edge_waits(&self) -> bool;
    /// Core cycles since the edge.
    fn cycles_since_edge(&self) -> u32;
}

/// The encoder's counter.
pub trait Encoder {
    /// The count, which wraps.
    fn count(&self) -> Counts;
}

/// The lines on which the drive speaks back.
pub trait ReadDrive {
    /// Returns their signals now.
    fn read(&self) -> Readings;
}

/// The supply's detector.
pub trait SupplyLevel {
    /// True if the supply is below the level at which the core surely runs, or nothing would end a
    /// core that it no longer carries.
    fn is_low(&self) -> bool;
}

/// The watchdog, which runs.
pub trait Watchdog {
    /// Starts its countdown again.
    fn feed(&mut self);
    /// Stops it while a debugger halts the core, if `stop` is true.
    fn stop_on_debug(&mut self, stop: bool);
}

/// The lamps by which a person sees the device's state without a PC.
pub trait Lamps {
    /// Lights the one that says that the tasks run, the one for torque, and the one for a fault
    /// that has latched or has ended the last run.
    fn show(&mut self, powered: bool, fault: bool);
}

/// The error of a serial port that would have to wait: there is nothing to read, or no room to
/// write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WouldBlock;

/// A serial port on USB.
pub trait SerialPort {
    /// Looks at the core, once.
    fn poll(&mut self);
    /// Enumerated, configured and not suspended.
    fn is_configured(&self) -> bool;
    /// A program has it open.
    fn is_open(&self) -> bool;
    /// Takes a packet, with its length.
    fn read(&mut self, packet: &mut [u8]) -> Result<usize, WouldBlock>;
    /// Gives a packet; an empty one ends a transfer.
    fn write(&mut self, packet: &[u8]) -> Result<(), WouldBlock>;
}
