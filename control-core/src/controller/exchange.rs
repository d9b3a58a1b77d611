//! The inputs and outputs of a tick, and the orders between ticks.

use crate::compensation::Gains;
use crate::event::{Fault, Limits, Transitions, VesselState};
use crate::excitation::{Excitation, Prepared};
use crate::plan::Plan;
use crate::units::{Counts, DacCode, Millimetres, MillimetresPerSecond, Milliradians, Newtons};
use serde::{Deserialize, Serialize};

/// The inputs of a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct TickInput {
    /// The encoder's absolute count; it may wrap.
    pub count: Counts,
    /// The latest inclination.
    pub tilt: Milliradians,
}

/// The outputs of a tick.
#[derive(Clone, Copy, Debug)]
pub struct TickOutput {
    /// The code to write to the converter.
    pub dac: DacCode,
    /// True if the amplifier may be on.
    pub enable: bool,
    /// The sample to stream.
    pub sample: Sample,
    /// The changes in the tissue.
    pub transitions: Transitions,
    /// The limits in force, which hold torque back.
    pub limits: Limits,
    /// The fault that latched in this tick.
    pub tripped: Option<Fault>,
    /// Depth past the zero.
    pub depth: Millimetres,
    /// Estimated speed.
    pub speed: MillimetresPerSecond,
    /// The force that the law asked for, before limits.
    pub force: Newtons,
    /// The angle to the skin that the layers were met at.
    pub angle: Milliradians,
    /// The tip's place as seen from the vessel.
    pub vessel: VesselState,
    /// The force across the needle that would hold its direction; this device cannot give it.
    pub lateral: Newtons,
}

/// One tick as it is streamed and recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sample {
    /// Counts past the zero.
    pub count: i32,
    /// The torque as the code of a converter of the same width whose zero is mid-scale, on a motor
    /// whose sign is right: without the commissioned zero and sign, so that a recording needs no
    /// device to be read.
    pub dac: u16,
    /// [`crate::event::State`] as a number.
    pub state: u8,
    /// Inclination in mrad.
    pub tilt_mrad: i16,
}

/// An order of a person or the supervisor to the control law, between ticks, in a few bytes.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Power up and fade in. Only on a device that has been commissioned and has no latched fault.
    Start,
    /// Zero torque, amplifier off.
    Stop,
    /// The needle is at depth 0 now; only while torque is off.
    Zero,
    /// The PC is alive.
    Heartbeat,
    /// A person has seen the latched fault: it no longer keeps the device from being started.
    Clear,
    /// Something outside the tick went wrong: torque off, latched.
    Trip(Fault),
    /// The gains of the compensation from now on, until the next [`LargeOrder::Configure`]; they
    /// have passed [`crate::compensation::check::check`].
    Compensate(Gains),
}

/// An order that takes more memory. Each is rare, and only for a device whose torque is off.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "nothing allocates here, and a plan is rare")]
pub enum LargeOrder {
    /// Another plan.
    Configure(Plan),
    /// Play an excitation from where the motor is; on a device that has not been commissioned only
    /// where [`Excitation::is_gentle`]. It has passed [`Excitation::check`].
    Excite(Excitation),
    /// Play the segments of a sequence one after the other, without a rest between them; only on a
    /// device that has been commissioned.
    Play(Prepared),
    /// The rotor's angle, from which waves are counted, is zero at this many counts past the zero;
    /// `None`: it is not known.
    Index(Option<Counts>),
}

/// An order of either size, as it waits for the tick.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "nothing allocates here, and few wait")]
pub enum AnyOrder {
    /// One of a few bytes.
    Small(Order),
    /// One that takes more memory.
    Large(LargeOrder),
}

impl AnyOrder {
    /// True if it turns the amplifier on.
    pub fn gives_torque(&self) -> bool {
        matches!(self, Self::Small(Order::Start) | Self::Large(LargeOrder::Excite(_) | LargeOrder::Play(_)))
    }
}

impl From<Order> for AnyOrder {
    #[inline]
    fn from(order: Order) -> Self {
        Self::Small(order)
    }
}

impl From<LargeOrder> for AnyOrder {
    #[inline]
    fn from(order: LargeOrder) -> Self {
        Self::Large(order)
    }
}
