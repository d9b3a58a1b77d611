//! The requests of a person to a running device, as the page sends them. Data only: nothing here
//! waits or sends.

use super::messages::ProbeView;
use crate::named_files::is_file_name;
use crate::procedure::purpose::is_task_name;
use serde::{Deserialize, Serialize};

/// A request of a person; `do` names the variant in the JSON that a page sends, e.g.
/// `{"do":"drag","depth_mm":3.2}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Control {
    /// Power up.
    Start,
    /// Torque off.
    Stop,
    /// The person has seen the fault.
    Clear,
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
    /// The patient as a person has edited it, to be kept under a name. An older one is never
    /// replaced: `anna` becomes `anna-2` where there is one.
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
    /// Record from now on. An older file is never replaced: `monday` becomes `monday-2` where there
    /// is one.
    Record {
        /// Name of the file without folder and ending: 1 to 60 letters, digits, blanks or `._-`.
        name: String,
    },
    /// End the recording.
    EndRecording,
    /// The probe has been moved, or its image shows another part of the needle; at most ten times a
    /// second.
    Probe(ProbeView),
    /// A task of the procedure has been done.
    Task {
        /// Its name: 1 to 40 lower-case letters, digits or `_`.
        name: String,
    },
    /// The person at the device has this name or pseudonym, which the device's class is told.
    Trainee {
        /// The name, at most 60 characters on a line; none where it is empty.
        name: String,
    },
    /// A recording is to go on from here.
    Seek {
        /// Time into the recording in s, 0 or more.
        at_s: f64,
    },
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

impl Control {
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
            Self::Task { name } if !is_task_name(&name) => Err(
                "a task's name has 1 to 40 lower-case letters, digits or _; use a name of the procedure's file".into(),
            ),
            Self::Trainee { name } if name.chars().count() > 60 || name.contains(char::is_control) => {
                Err("a trainee's name has at most 60 characters on one line".into())
            }
            Self::Seek { at_s } if !(0.0..=1e9).contains(&at_s) => {
                Err(format!("time {at_s} s is not within 0 to 1e9 s"))
            }
            message => Ok(message),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_a_page_are_read_and_nonsense_is_refused() {
        assert_eq!(Control::parse(r#"{"do":"drag","depth_mm":3.25}"#), Ok(Control::Drag { depth_mm: 3.25 }));
        assert_eq!(Control::parse(r#"{"do":"stop"}"#), Ok(Control::Stop));
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
            r#"{"do":"trainee","name":"a\nb"}"#,
            r#"{"do":"trainee"}"#,
            r#"{"do":"seek","at_s":-1}"#,
            r#"{"do":"record","name":"../monday"}"#,
            r#"{"do":"record","name":""}"#,
            r#"{"do":"save_patient","name":"../anna","profile":{}}"#,
            r#"{"do":"save_patient","name":"anna"}"#,
            r#"{"do":"compensate","share":1.01}"#,
            r#"{"do":"probe","along_mm":13}"#,
            r#"{"do":"probe","along_mm":13,"across_mm":0,"azimuth_rad":9,"lean_rad":0,"share_in_plane":1,"tip_seen":true}"#,
        ] {
            let error = Control::parse(bad).unwrap_err();
            assert!(!error.contains('\n'), "{error}");
        }
    }
}
