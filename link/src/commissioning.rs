//! The rules by which a device becomes commissioned and stays so. No command makes it so: the
//! device plays gentle pulses, sees in its own counts that the motor drives them the way it is
//! asked to (`Proof`), and only then takes [`crate::Command::Commission`]. From then on a command
//! may lower its ceilings and not raise them ([`control_core::ceilings`]). A record that the device
//! has sent carries its seal ([`Record`]) and is taken back.

use crate::frames::CommandRefusal;
use control_core::Device;
use control_core::ceilings;
use control_core::controller::Sample;
use control_core::event::State;

pub use crate::record::Record;

/// The least way of the roller that shows anything, in counts.
const LEAST_COUNTS: u32 = 20;
/// The factor by which the most work must exceed the size of the least, and the work that remains
/// at the end.
const CLEARLY: i64 = 4;

/// Checks that a command may replace `before` by `after`.
pub(crate) fn may_become(before: &Device, after: &Device) -> Result<(), CommandRefusal> {
    if !after.commissioned {
        return Ok(());
    }
    if !before.commissioned {
        return Err(CommandRefusal::NotShown);
    }
    ceilings::changed(before, after).map_or(Ok(()), |field| Err(CommandRefusal::Commissioned(field)))
}

/// The evidence that the device has gathered about itself while it played.
///
/// From rest, the work that the torque has done is the roller's energy and what friction took:
/// never negative where the motor drives the way that the encoder counts, never positive where it
/// does not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Proof {
    /// Nothing.
    #[default]
    None,
    /// Gentle pulses have been ordered.
    Ordered,
    /// They are being played.
    Playing(Pulses),
    /// They were played to their end, and motor and encoder go together.
    Shown,
}

/// Pulses so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pulses {
    count: i32,
    /// Least and largest count.
    span: (i32, i32),
    /// Torque in codes times counts, since it began.
    work: i64,
    /// The least and the most of it.
    bounds: (i64, i64),
    /// Torque was asked for outwards and inwards.
    driven: (bool, bool),
}

impl Pulses {
    fn new(count: i32) -> Self {
        Self { count, span: (count, count), work: 0, bounds: (0, 0), driven: (false, false) }
    }

    fn see(&mut self, count: i32, torque: i32) {
        let moved = count.wrapping_sub(self.count);
        self.count = count;
        self.span = (self.span.0.min(count), self.span.1.max(count));
        self.work = self.work.saturating_add(i64::from(moved) * i64::from(torque));
        self.bounds = (self.bounds.0.min(self.work), self.bounds.1.max(self.work));
        self.driven = (self.driven.0 | (torque < 0), self.driven.1 | (torque > 0));
    }

    fn show(&self) -> bool {
        let has_moved = self.span.1.abs_diff(self.span.0) >= LEAST_COUNTS;
        let (least, most) = self.bounds;
        // The rest at the end has gone into friction: a roller that runs on by itself leaves
        // nothing.
        has_moved && self.driven == (true, true) && most > -least * CLEARLY && self.work * CLEARLY > most
    }
}

impl Proof {
    /// Sees a tick, of a converter whose zero torque is at `middle`.
    pub(crate) fn see(&mut self, sample: &Sample, middle: u16, has_tripped: bool) {
        let is_playing = sample.state == State::Excitation as u8;
        *self = match *self {
            Self::Ordered | Self::Playing(_) if has_tripped => Self::None,
            Self::Ordered if is_playing => Self::Playing(Pulses::new(sample.count)),
            Self::Playing(mut pulses) => {
                pulses.see(sample.count, i32::from(sample.dac) - i32::from(middle));
                match (is_playing, pulses.show()) {
                    (true, _) => Self::Playing(pulses),
                    (false, true) => Self::Shown,
                    (false, false) => Self::None,
                }
            }
            other => other,
        };
    }

    /// True if motor and encoder go together.
    pub(crate) fn is_shown(self) -> bool {
        self == Self::Shown
    }

    /// The pulses do not come to their end.
    pub(crate) fn interrupt(&mut self) {
        if !self.is_shown() {
            *self = Self::None;
        }
    }

    /// Another configuration is another device, but for what the pulses give: the converter's zero,
    /// what moves, and the stiffness that it bears, which may be less.
    pub(crate) fn keep(&mut self, before: &Device, after: &Device) {
        let mut same = Device { dac_zero: after.dac_zero, mechanism: after.mechanism, ..*before };
        same.limits.stiffness = before.limits.stiffness.min(after.limits.stiffness);
        if same != *after {
            *self = Self::None;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    const MIDDLE: u16 = 2_048;

    /// Pulses of 100 codes both ways on a roller of which `drive` makes counts.
    fn played(drive: impl Fn(i32) -> i32, trips: bool) -> Proof {
        let mut proof = Proof::Ordered;
        let mut sample = Sample { count: 7, dac: MIDDLE, state: State::Idle as u8, tilt_mrad: 0 };
        proof.see(&sample, MIDDLE, false);
        assert_eq!(proof, Proof::Ordered);
        sample.state = State::Excitation as u8;
        for tick in 0..400 {
            let torque = if tick % 200 < 100 { 100 } else { -100 };
            sample.dac = (i32::from(MIDDLE) + torque) as u16;
            sample.count += drive(torque);
            proof.see(&sample, MIDDLE, trips && tick == 300);
        }
        sample.state = State::Idle as u8;
        proof.see(&sample, MIDDLE, false);
        proof
    }

    #[test]
    fn only_a_motor_that_drives_as_the_encoder_counts_is_shown() {
        assert_eq!(played(i32::signum, false), Proof::Shown);
        assert_eq!(played(|torque| -torque.signum(), false), Proof::None, "the leads are reversed");
        assert_eq!(played(|_| 0, false), Proof::None, "nothing moves");
        assert_eq!(played(|_| 1, false), Proof::None, "it runs on, whatever is asked of it");
        assert_eq!(played(i32::signum, true), Proof::None, "a fault ended it");
        let flickering = std::cell::Cell::new(1);
        let flicker = |_| {
            flickering.set(-flickering.get());
            flickering.get()
        };
        assert_eq!(played(flicker, false), Proof::None, "a dead channel");
    }
}
