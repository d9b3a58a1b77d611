//! Everything that server and page say to each other: JSON texts over the WebSocket at `/live`, one message a text.
//!
//! After connecting the page gets a `scene`, a `patient` where it may be changed, a `device` as soon as the device has said who it is, and then a `frame`
//! every 8 ms, every 250 ms while nothing arrives from the device, less often where the page is slow. The page sends a [`FromPage`] when a
//! person does something. Times are seconds of the device's own clock, lengths are along the needle.

use crate::session::{Control, LinkStatus, PatientStatus, PatientWish, ProbeView, Scene};
use serde::{Deserialize, Serialize};

/// Server to page; `type` names the variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToPage {
    /// The scene; at the beginning, and again with each other patient. Its fields are those of [`Scene`].
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
    pub link: Link,
    /// The one who moves the needle.
    pub hand: Hand,
    /// Times of the device's stages, once a second.
    pub timing: Option<Timing>,
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
    /// The motor's force at the needle after all limits, from the converter's code; in N, with the same sign.
    pub motor_n: f64,
    /// The motor's torque in mN·m, positive in the insertion direction.
    pub torque_mnm: f64,
    /// Inclination below the horizontal in rad.
    pub tilt_rad: f64,
    /// Angle to the skin that the layers are met at, smoothed, in rad.
    pub angle_rad: f64,
    /// The tip's place relative to the vessel: `outside`, `touching`, `in_lumen`, `through`, `beside` or `unknown`.
    pub vessel: &'static str,
    /// The force across the needle that would hold its direction, in N; no motor gives it.
    pub lateral_n: f64,
    /// `idle`, `approach`, `elastic`, `puncture`, `friction`, `withdrawal`, `excitation`, `fault` or `unknown`.
    pub state: &'static str,
    /// Limits in force, a bit each: 1 torque, 2 slew, 4 fade-in, 8 thermal, 16 passivity, 32 estimated.
    pub limits: u8,
}

/// All samples and poses of 5 ms: `[t_s, [depth low, high], [law low, high], [motor low, high]]` in s, mm and N, `t_s` being
/// where the 5 ms begin.
/// Null where nothing was known. Extremes are kept, so that no spike is lost on the way to the plot.
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
    /// `contact`, `puncture`, `vessel`, `exit`, `fault`, `limits`, `started`, `stopped`, `flashback`, `far_wall`, `barrier` or `other`.
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
}

/// The state of the link, in totals since the session began.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Link {
    /// The session's own status.
    #[serde(flatten)]
    pub status: LinkStatus,
    /// Samples that this page was too slow for; they are in the recording all the same.
    pub skipped_samples: u64,
}

/// The one who moves the needle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Hand {
    /// The scripted hand, or whoever holds the real needle.
    #[default]
    Demo,
    /// A person, in a page.
    Person,
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

/// Page to server; `do` names the variant, e.g. `{"do":"drag","depth_mm":3.2}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum FromPage {
    /// Power up.
    Start,
    /// Torque off.
    Stop,
    /// The needle is at depth 0 now.
    Zero,
    /// The hand wants the tip here.
    Drag {
        /// Depth in mm, −200 to 500.
        depth_mm: f64,
    },
    /// The pointer was lifted; the hand stays where it is.
    Release,
    /// The scripted hand takes over again.
    Demo,
    /// The hand turns the needle.
    Tilt {
        /// Inclination below the horizontal in rad, 0 to π/2.
        rad: f64,
    },
    /// A patient that comes with the program.
    Choose {
        /// Its name.
        patient: String,
    },
    /// The patient as a person has edited it.
    Edit {
        /// Key by key as in a profile's file.
        profile: serde_json::Value,
    },
    /// The patient as a person has edited it, to be kept under a name. An older one is never replaced: `anna` becomes `anna-2` where
    /// there is one.
    SavePatient {
        /// Name of the file without folder and ending, as that of a recording.
        name: String,
        /// Key by key as in a profile's file.
        profile: serde_json::Value,
    },
    /// So much of the device's compensation is to be in force.
    Compensate {
        /// Share of what the device has stored, 0 to 1.
        share: f64,
    },
    /// Record from now on. An older file is never replaced: `monday` becomes `monday-2` where there is one.
    Record {
        /// Name of the file without folder and ending: 1 to 60 letters, digits, blanks or `._-`.
        name: String,
    },
    /// End the recording.
    EndRecording,
    /// The probe has been moved, or its image shows another part of the needle; at most ten times a second.
    Probe(ProbeView),
    /// A task of the procedure has been done.
    Task {
        /// Its name: 1 to 40 lower-case letters, digits or `_`.
        name: String,
    },
    /// A recording is to go on from here.
    Seek {
        /// Time into the recording in s, 0 or more.
        at_s: f64,
    },
}

impl From<FromPage> for Control {
    fn from(message: FromPage) -> Self {
        match message {
            FromPage::Start => Self::Start,
            FromPage::Stop => Self::Stop,
            FromPage::Zero => Self::Zero,
            FromPage::Drag { depth_mm } => Self::Drag { depth_mm },
            FromPage::Release => Self::Release,
            FromPage::Demo => Self::Script,
            FromPage::Tilt { rad } => Self::Tilt { rad },
            FromPage::Choose { patient } => Self::Patient(PatientWish::Named(patient)),
            FromPage::Edit { profile } => Self::Patient(PatientWish::Edited(profile)),
            FromPage::SavePatient { name, profile } => Self::Patient(PatientWish::Saved { name, profile }),
            FromPage::Compensate { share } => Self::Compensate { share },
            FromPage::Record { name } => Self::Record { name },
            FromPage::EndRecording => Self::EndRecording,
            FromPage::Probe(view) => Self::Probe(view),
            FromPage::Task { name } => Self::Task { name },
            FromPage::Seek { at_s } => Self::Seek { at_s },
        }
    }
}

impl FromPage {
    /// Returns who moves the needle from this message on; `None` if it does not change that.
    pub fn hand(&self) -> Option<Hand> {
        match self {
            Self::Drag { .. } => Some(Hand::Person),
            Self::Demo => Some(Hand::Demo),
            _ => None,
        }
    }

    /// Reads a message; what is wrong with it, in one line, where it cannot be.
    pub fn parse(text: &str) -> Result<Self, String> {
        let message: Self = serde_json::from_str(text).map_err(|e| format!("message not understood: {e}"))?;
        match message {
            Self::Drag { depth_mm } if !(-200.0..=500.0).contains(&depth_mm) => {
                Err(format!("depth {depth_mm} mm is not within -200 to 500 mm"))
            }
            Self::Tilt { rad } if !(0.0..=std::f64::consts::FRAC_PI_2).contains(&rad) => {
                Err(format!("tilt {rad} rad is not within 0 to pi/2"))
            }
            Self::Compensate { share } if !(0.0..=1.0).contains(&share) => {
                Err(format!("share {share} is not within 0 to 1"))
            }
            Self::Record { name } if !is_file_name(&name) => Err(
                "a recording's name has 1 to 60 letters, digits, blanks or ._- and begins with a letter or a digit"
                    .into(),
            ),
            Self::SavePatient { name, .. } if !is_file_name(&name) => Err(
                "a patient's name has 1 to 60 letters, digits, blanks or ._- and begins with a letter or a digit".into(),
            ),
            Self::Probe(view) if !view.is_plausible() => Err("the probe is not on the limb".into()),
            Self::Task { name } if !crate::procedure::task::is_name(&name) => Err(
                "a task's name has 1 to 40 lower-case letters, digits or _; use a name of the procedure's file".into(),
            ),
            Self::Seek { at_s } if !(0.0..=1e9).contains(&at_s) => {
                Err(format!("time {at_s} s is not within 0 to 1e9 s"))
            }
            message => Ok(message),
        }
    }
}

/// Returns true for a plain name that leads to no other folder.
pub fn is_file_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_alphanumeric() || " ._-".contains(c);
    (1..=60).contains(&name.chars().count())
        && name.chars().all(is_plain)
        && name.starts_with(|c: char| c.is_alphanumeric())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_a_page_are_read_and_nonsense_is_refused() {
        assert_eq!(
            FromPage::parse(r#"{"do":"drag","depth_mm":3.25}"#),
            Ok(FromPage::Drag { depth_mm: 3.25 })
        );
        assert_eq!(FromPage::parse(r#"{"do":"stop"}"#), Ok(FromPage::Stop));
        for bad in [
            "",
            "{}",
            r#"{"do":"fly"}"#,
            r#"{"do":"drag"}"#,
            r#"{"do":"drag","depth_mm":1e9}"#,
            r#"{"do":"drag","depth_mm":null}"#,
            r#"{"do":"tilt","rad":2}"#,
            r#"{"do":"task","name":""}"#,
            r#"{"do":"task","name":"<b>"}"#,
            r#"{"do":"seek","at_s":-1}"#,
            r#"{"do":"record","name":"../monday"}"#,
            r#"{"do":"record","name":""}"#,
            r#"{"do":"save_patient","name":"../anna","profile":{}}"#,
            r#"{"do":"save_patient","name":"anna"}"#,
            r#"{"do":"compensate","share":1.01}"#,
            r#"{"do":"probe","along_mm":13}"#,
            r#"{"do":"probe","along_mm":13,"across_mm":0,"azimuth_rad":9,"lean_rad":0,"share_in_plane":1,"tip_seen":true}"#,
        ] {
            let error = FromPage::parse(bad).unwrap_err();
            assert!(!error.contains('\n'), "{error}");
        }
    }

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
