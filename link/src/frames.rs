//! The messages of both sides. Additions go to the end of an enum; anything else raises
//! [`PROTOCOL_VERSION`].

use crate::build::Build;
use crate::crash::Crash;
pub use crate::guard::GuardRefusal;
use crate::record::Record;
use control_core::NeedleLine;
use control_core::compensation::Gains;
use control_core::config::{DacWidth, Device, Patient};
use control_core::controller::Sample;
use control_core::event::{Fault, Limits};
use control_core::excitation::{Excitation, SequenceRefusal};
use control_core::interlock::Interlock;
use control_core::plan::{Field, Refusal};
use control_core::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians, Newtons};
use fixed::types::I2F30;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Version of what follows; a PC refuses another.
pub const PROTOCOL_VERSION: u16 = 12;
/// Samples in a full block: 3.2 ms.
pub const BLOCK_SAMPLES: usize = 32;
/// Pose frames a second.
pub(crate) const POSE_HZ: u16 = 1_000;
/// Stages whose time is reported.
pub const STAGES: usize = 8;

/// Device to PC: a frame with its number, one more than the last, from 0 at a hello.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Numbered {
    /// Wraps.
    pub sequence: u32,
    /// The message.
    pub frame: DeviceFrame,
}

/// Device to PC.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum DeviceFrame {
    /// The device's identity and the scale in which it speaks; the answer to a hello and to a new
    /// configuration.
    Hello(Hello),
    /// Samples at 10 kHz.
    Samples(SampleBlock),
    /// The needle's pose, at 1 kHz.
    Pose(Pose),
    /// Something happened.
    Event(Event),
    /// Times of the stages, once a second.
    Timing(Timing),
    /// The answer to a command.
    Ack(Ack),
    /// The device's part of the configuration in force; the answer to [`Command::ReportDevice`].
    Device(Record),
    /// The crash that ended the device's last run, after the hello of each session until a person
    /// clears the fault.
    Crash(Crash),
}

/// The device's identity and the scale in which it speaks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL_VERSION`] of the device.
    pub version: u16,
    /// The microcontroller's unique number, or all zeros on the virtual device.
    pub identity: [u8; 12],
    /// Version of the firmware.
    pub firmware: [u8; 3],
    /// The commit that the firmware was built from.
    pub build: Build,
    /// CRC-32 of the configuration in force, both parts.
    pub config_hash: u32,
    /// CRC-32 of its device's part.
    pub device_hash: u32,
    /// Samples a second.
    pub tick_hz: u32,
    /// Poses a second.
    pub pose_hz: u16,
    /// Length of one count along the needle in mm.
    pub mm_per_count: I2F30,
    /// Radius of the roller.
    pub roller_radius: Millimetres,
    /// Torque at full scale of the converter.
    pub full_scale_torque: MillinewtonMetres,
    /// The converter.
    pub dac: DacWidth,
    /// The fault that has latched, or the cause of the last reset where it was one, until a person
    /// clears it.
    pub fault: Option<Fault>,
}

/// Consecutive samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SampleBlock {
    /// Tick of the first one; the others follow without a gap.
    pub first_tick: u64,
    /// The samples.
    pub samples: Vec<Sample, BLOCK_SAMPLES>,
}

/// The needle's pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Its tick.
    pub tick: u64,
    /// Depth of the tip past the zero, along the needle.
    pub depth: Millimetres,
    /// Its speed.
    pub speed: MillimetresPerSecond,
    /// The force that the law computed, before limits.
    pub force: Newtons,
    /// Inclination below the horizontal.
    pub tilt: Milliradians,
    /// [`control_core::event::State`] as a number.
    pub state: u8,
    /// The limits that hold torque back.
    pub limits: Limits,
    /// The angle to the skin that the layers are met at, smoothed.
    pub angle: Milliradians,
    /// [`control_core::event::VesselState`] as a number.
    pub vessel: u8,
    /// The force across the needle that would hold its direction; this device cannot give it.
    pub lateral: Newtons,
}

/// Something happened.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Its tick.
    pub tick: u64,
    /// Its kind.
    pub kind: EventKind,
}

/// The kinds of events. Layers count from 0, the outermost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "each field is the layer or the cause that the variant names")]
pub enum EventKind {
    /// The tip has touched a layer.
    Contact { layer: u8 },
    /// A layer has given way.
    Puncture { layer: u8 },
    /// A vessel's wall has given way: the aim.
    Vessel { layer: u8 },
    /// The tip has left a layer.
    Exit { layer: u8 },
    /// Torque was taken away, latched.
    Fault { cause: Fault },
    /// Other limits are in force than before.
    Limits { in_force: Limits },
    /// Powered; torque fades in.
    Started,
    /// Torque off at a person's wish.
    Stopped,
    /// The configuration is in force, but will be lost at the next reset.
    NotSaved { cause: SaveError },
    /// The tip has come into the lumen of a vessel, through its near wall or drawn back through its
    /// far one: blood shows.
    Flashback { layer: u8 },
    /// A vessel's far wall has given way: the needle has gone through.
    FarWall { layer: u8 },
    /// The needle has been turned further from its direction of entry than the tissue around it
    /// lets it.
    Barrier,
    /// The tip has come into a layer that had given way before: it is in the needle's own track,
    /// where the layer is open.
    InTrack {
        /// Which layer.
        layer: u8,
    },
    /// A person has cleared the latched fault: the device may be started again.
    Cleared,
    /// The motor's heat is unknown since the power came: after a hello, until it must have cooled.
    HeatUnknown {
        /// Torque is held to the continuous one for so many seconds from this event on.
        seconds: u16,
    },
}

/// The reason why a configuration was not saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SaveError {
    /// The flash did not take what it was given, or did not keep it.
    Flash,
    /// No room was left, and none could be made.
    Full,
    /// It is longer than what the flash holds of one.
    TooLong,
}

impl core::fmt::Display for SaveError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            SaveError::Flash => {
                "the configuration was not saved because the flash did not keep it: send it again, or replace the board"
            }
            SaveError::Full => {
                "the configuration was not saved because there is no room: restart the device and send it again"
            }
            SaveError::TooLong => "the configuration was not saved because it is too long: use fewer layers",
        })
    }
}

/// Times of the stages, in cycles of the device's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Clock of the device in Hz; 0 on the virtual device, whose times are in ns.
    pub clock_hz: u32,
    /// By [`Stage`].
    pub stages: [StageTime; STAGES],
    /// Ticks that came late or not at all.
    pub missed_ticks: u32,
    /// Codes that were written after the instant at which the converter takes one: they reach the
    /// motor a tick later.
    pub late_codes: u32,
    /// Samples that the device had to drop because the PC did not take them.
    pub dropped_samples: u32,
    /// Frames from the PC that could not be read.
    pub garbage_frames: u32,
}

/// Last and longest time of a stage since the hello.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// The last time.
    pub last: u32,
    /// The longest.
    pub longest: u32,
}

/// Place of a stage in [`Timing::stages`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stage {
    /// The whole tick.
    Tick = 0,
    /// From the timer's edge to the write of the converter.
    TickToDac = 1,
    /// Reading the tilt sensor.
    Tilt = 2,
    /// Packing and sending.
    Telemetry = 3,
    /// Serving USB.
    Usb = 4,
    /// The supervisor.
    Supervisor = 5,
}

/// The answer to a command.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ack {
    /// The command's.
    pub id: u32,
    /// Done, or why not.
    pub result: Result<(), CommandRefusal>,
}

/// The reason why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum CommandRefusal {
    /// The configuration or the excitation may not run.
    Config(Refusal),
    /// Not while torque is on: stop first.
    Powered,
    /// The PC speaks another version.
    Version,
    /// The device has no room for another command; send it again.
    Full,
    /// Nobody has said hello on this line: torque is given only to a PC that listens.
    NoSession,
    /// Something keeps the device from being started.
    Interlocked(Interlock),
    /// A value that commissioning found, or a ceiling, would change or rise.
    Commissioned(Field),
    /// The device has not seen by pulses of its own that its motor and its encoder go together.
    NotShown,
    /// A sequence, or one of its segments, is not taken; what was uploaded is forgotten.
    Sequence(SequenceRefusal),
    /// A fault has latched, or has ended the last run: a person has to clear it first.
    Faulted(Fault),
    /// A fault is cleared only after a stop.
    NotStopped,
    /// A stop with a later number has overtaken it: it gives no torque any more.
    Overtaken,
    /// No brown-out reset guards the supply yet.
    Guard(GuardRefusal),
}

impl core::fmt::Display for CommandRefusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            CommandRefusal::Config(refusal) => refusal.fmt(f),
            CommandRefusal::Powered => f.write_str("torque is on; stop the device first"),
            CommandRefusal::Version => write!(
                f,
                "this program speaks protocol {PROTOCOL_VERSION} and the device another; flash the firmware that belongs to this program, or run the program that belongs to the firmware"
            ),
            CommandRefusal::Full => f.write_str("the device is busy with earlier commands; send it again"),
            CommandRefusal::NoSession => f.write_str("no program is connected to the device; connect first"),
            CommandRefusal::Interlocked(interlock) => interlock.fmt(f),
            CommandRefusal::Commissioned(field) => write!(
                f,
                "{field} of a commissioned device cannot be changed or raised; run host-sim commission again, or restore the file that it wrote, unchanged"
            ),
            CommandRefusal::NotShown => f.write_str(
                "the device was not commissioned with this configuration, and its own pulses have not shown that motor and encoder match; run host-sim commission",
            ),
            CommandRefusal::Sequence(refusal) => refusal.fmt(f),
            CommandRefusal::Faulted(fault) => {
                write!(f, "{fault}; look at the device, then clear the fault and start again")
            }
            CommandRefusal::NotStopped => f.write_str("a fault is cleared only after a stop; stop the device first"),
            CommandRefusal::Overtaken => f.write_str("a stop came after this start was asked for; start again"),
            CommandRefusal::Guard(refusal) => refusal.fmt(f),
        }
    }
}

/// PC to device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HostFrame {
    /// Another one for each command, each later than the one before it, from a hello on; a repeated
    /// id is answered again and not carried out again. A command that gives torque is refused where
    /// its id is not later than that of the last stop.
    pub id: u32,
    /// The command.
    pub command: Command,
}

/// The commands of the PC. Each is acknowledged and safe to repeat.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "nothing allocates here")]
pub enum Command {
    /// Begin a session: the device answers with [`Hello`] and starts to stream. Numbers begin
    /// again.
    Hello {
        /// [`PROTOCOL_VERSION`] of the PC.
        version: u16,
    },
    /// Whom the needle goes into from now on; taken whole or refused with the reason, and only
    /// while torque is off. What was found at commissioning stays as it is.
    ConfigurePatient(Patient),
    /// Power up and fade in; not while a fault is latched.
    Start,
    /// Torque off. It waits for nothing, and nothing that was asked for before it gives torque any
    /// more.
    Stop,
    /// The needle is at depth 0 now; only while torque is off.
    Zero,
    /// Still here.
    Heartbeat,
    /// Play an excitation, with no hand on the needle; only while torque is off.
    Excite(Excitation),
    /// The device's part of the configuration; taken whole or refused with the reason, and only
    /// while torque is off. One that calls itself commissioned is taken by a device that is, where
    /// it exchanges nothing that commissioning found and raises no ceiling. A patient whom it does
    /// not suit leaves: until another is sent there is nobody, and no force.
    ConfigureDevice(Device),
    /// Tell the device's part of the configuration.
    ReportDevice,
    /// The gains of the compensation from now on, torque on or off, until the device is configured
    /// or restarted; taken whole or refused with the reason.
    Compensate(Gains),
    /// The rotor's angle is zero at this many counts past the zero, until the device is restarted;
    /// `None`: it is not known. Only while torque is off.
    Index(Option<i32>),
    /// [`Command::ConfigureDevice`] with a configuration that this device reported before: taken
    /// unchanged if the seal is its own.
    RestoreDevice(Record),
    /// Marks the device's configuration as found by commissioning: accepted if its own pulses have
    /// shown that the motor and the encoder go together, and only while torque is off. Nothing else
    /// commissions a device.
    Commission,
    /// A segment of a sequence, kept by the device and not played; only while torque is off. The
    /// first begins another sequence, and each must follow the one before it. One that is refused
    /// takes those before it along.
    Segment {
        /// Its place, from 0.
        index: u8,
        /// Its excitation.
        excitation: Excitation,
    },
    /// Play the sequence that was uploaded, without a rest between its segments and with no hand on
    /// the needle; only while torque is off, and only if it is whole. It is forgotten then, as it
    /// is at a stop, a fault, a new configuration and the end of the session.
    Play {
        /// The number of its segments.
        count: u8,
        /// [`crate::codec::hash`] of the segments, as a slice.
        checksum: u32,
    },
    /// A person has seen the fault that is latched; only after a stop that came after the fault.
    Clear,
    /// Check that a brown-out reset guards the supply; where it is off, set it if `set` asks for
    /// it. Only while torque is off: it may stop the processor for a second, and is answered after
    /// that. What was set counts after the next reset.
    GuardSupply {
        /// True to set it.
        set: bool,
    },
    /// The layers along a needle that has turned in tissue, torque on or off; taken whole or
    /// refused with the reason. The latest counts, waits behind no order, and is the one that is
    /// answered. It changes the force on a needle at rest by at most 10 mN, touches no layer and
    /// lets no wall give way: what it leaves to do, the next one or the needle's own movement does.
    /// Send it 50 to 70 times a second while the needle turns. It holds until the zero, an
    /// excitation or another configuration.
    Line(NeedleLine),
}
