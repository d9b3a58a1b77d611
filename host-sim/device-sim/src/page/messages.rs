//! Everything that server and page say to each other: JSON texts over the WebSocket at `/live`, one
//! message a text.
//!
//! After connecting the page gets a `scene`, a `patient` where it may be changed, a `device` as
//! soon as the device has said who it is, and then a `frame` every 8 ms, every 250 ms while nothing
//! arrives from the device, less often where the page is slow. The page sends a
//! [`Control`](crate::session::Control) when a person does something. Times are seconds of the
//! device's own clock, lengths are along the needle.

use crate::session::{Hand, LinkStatus, PatientStatus, Scene};
use serde::Serialize;

/// Server to page; `type` names the variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToPage {
    /// The scene; at the beginning, and again with each other patient. Its fields are those of
    /// [`Scene`].
    Scene(Scene),
    /// The patient, where it may be changed; again with the answer to each wish.
    Patient(PatientStatus),
    /// The practised goal, if insertions are judged: `goal` in words; again with another patient.
    Practice(serde_json::Value),
    /// An insertion that has ended, with its verdict: the fields of `practice::Attempt`.
    Attempt(serde_json::Value),
    /// A task of the procedure that was done.
    Task {
        /// Its time, in s.
        t_s: f64,
        /// Its name.
        name: String,
    },
    /// The device; again whenever it restarts.
    Device(Device),
    /// The changes since the last frame.
    Frame(Frame),
}

/// The device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Device {
    /// Its unique number in hexadecimal; zeros on the virtual device.
    pub identity: String,
    /// Version of its firmware.
    pub firmware: String,
    /// CRC-32 of the configuration in force, in hexadecimal.
    pub config_hash: String,
    /// Samples a second.
    pub tick_hz: u32,
    /// Length of one encoder count along the needle in mm.
    pub mm_per_count: f64,
    /// Torque at the converter's full scale in mN·m.
    pub full_scale_torque_mnm: f64,
    /// Bits of the converter.
    pub dac_bits: u8,
    /// The fault that has latched, in words; null where none has.
    pub fault: Option<String>,
}

/// The changes since the last frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Frame {
    /// The newest pose; null where none has arrived since the last frame.
    pub pose: Option<Pose>,
    /// The plots' buckets, oldest first.
    pub trace: Vec<Bucket>,
    /// The events, oldest first.
    pub events: Vec<Event>,
    /// The state of the link.
    pub link: LinkStatus,
    /// The one who moves the needle.
    pub hand: Hand,
    /// Times of the device's stages, once a second.
    pub timing: Option<Timing>,
    /// The place at which the needle's line has depth 0, where it has moved: mm along the skin from
    /// the point of entry, and below it.
    pub needle: Option<[f64; 2]>,
}

/// The needle's pose and force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Pose {
    /// Its time, in s.
    pub t_s: f64,
    /// Depth of the tip past the zero in mm.
    pub depth_mm: f64,
    /// Its speed in mm/s, positive when inserting.
    pub speed_mm_s: f64,
    /// The force that the control core computed, in N, positive when it resists insertion.
    pub force_n: f64,
    /// The motor's force at the needle after all limits, from the converter's code; in N, with the
    /// same sign.
    pub motor_n: f64,
    /// The motor's torque in mN·m, positive in the insertion direction.
    pub torque_mnm: f64,
    /// Inclination below the horizontal in rad.
    pub tilt_rad: f64,
    /// Angle to the skin that the layers are met at, smoothed, in rad.
    pub angle_rad: f64,
    /// The tip's place relative to the vessel: `outside`, `touching`, `in_lumen`, `through`,
    /// `beside` or `unknown`.
    pub vessel: &'static str,
    /// The force across the needle that would hold its direction, in N; no motor gives it.
    pub lateral_n: f64,
    /// `idle`, `approach`, `elastic`, `puncture`, `friction`, `withdrawal`, `excitation`, `fault`
    /// or `unknown`.
    pub state: &'static str,
    /// Limits in force, a bit each: 1 torque, 2 slew, 4 fade-in, 8 thermal, 16 passivity, 32
    /// estimated.
    pub limits: u8,
}

/// All samples and poses of 5 ms: `[t_s, [depth low, high], [law low, high], [motor low, high]]` in
/// s, mm and N, `t_s` being where the 5 ms begin. Null where nothing was known. Extremes are kept,
/// so that no spike is lost on the way to the plot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bucket(pub f64, pub Range, pub Range, pub Range);

/// The least and the greatest of a quantity; null where there was none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Range(pub Option<f64>, pub Option<f64>);

impl Range {
    /// Takes one more value in.
    pub fn take(&mut self, value: f64) {
        self.0 = Some(self.0.map_or(value, |low| low.min(value)));
        self.1 = Some(self.1.map_or(value, |high| high.max(value)));
    }
}

/// Something happened.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Event {
    /// Its time, in s.
    pub t_s: f64,
    /// `contact`, `puncture`, `vessel`, `exit`, `fault`, `limits`, `started`, `stopped`,
    /// `flashback`, `far_wall`, `barrier`, `heat_unknown` or `other`.
    pub kind: &'static str,
    /// The layer it is about, outermost 0.
    pub layer: Option<u8>,
    /// Depth of the tip just before, in mm.
    pub depth_mm: Option<f64>,
    /// The computed force just before, in N.
    pub force_n: Option<f64>,
    /// The cause of a fault, in words.
    pub cause: Option<String>,
    /// Limits in force since then, as in [`Pose::limits`].
    pub limits: Option<u8>,
    /// Seconds from then on for which the motor's heat is unknown and its torque held to the
    /// continuous one.
    pub ends_in_s: Option<u16>,
}

/// Times of the device's stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Longest time of a whole tick in µs.
    pub longest_tick_us: f64,
    /// Ticks that came late or not at all.
    pub missed_ticks: u32,
    /// Codes that reached the motor a tick later than they should have.
    pub late_codes: u32,
    /// Samples that the device had to drop.
    pub dropped_samples: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bucket_is_a_flat_enough_array() {
        let mut range = Range::default();
        range.take(2.0);
        range.take(-1.0);
        let bucket = Bucket(0.5, range, Range::default(), range);
        let text = serde_json::to_string(&bucket).unwrap();
        assert_eq!(text, "[0.5,[-1.0,2.0],[null,null],[-1.0,2.0]]");
    }
}
