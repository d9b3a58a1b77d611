//! The goal of an attempt: a list of steps that follows from the patient and the purpose of the
//! procedure, never from the needle's line. Page, score, debrief, xAPI and class take words and
//! judgement from here; what is not on the list is no error.

use control_core::config::Tissue;
use device_sim::procedure::purpose::Purpose;
use device_sim::profile::Profile;
use device_sim::session::tissue_name;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// Angle to the skin at which a vein is entered, °. Teaching texts say 10–30; in whole degrees, as
/// a person reads them.
pub const ENTRY_DEG: RangeInclusive<f64> = 10.0..=30.0;
/// The needle is lowered by so much after the flashback, °: as it is taught, 8–12, and some more.
pub const LOWERED_DEG: RangeInclusive<f64> = 5.0..=15.0;
/// And then advanced by so much before the catheter, mm: so that the catheter's end is in the vein
/// too. As it is taught, 3–4, and some more.
pub const ADVANCED_MM: RangeInclusive<f64> = 2.0..=5.0;
/// Blood is drawn for at least so long, s: an assumption.
pub const DRAWN_S: f64 = 0.5;

/// A step of a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// The tourniquet is put on before the skin is touched.
    TourniquetOn,
    /// The vein is anchored before the skin is pierced.
    Anchor,
    /// The skin is pierced at an angle within [`ENTRY_DEG`].
    Angle,
    /// The vein is entered through one hole in the skin, and nothing else is.
    Enter,
    /// Blood shows.
    Flashback,
    /// The needle is lowered by [`LOWERED_DEG`].
    Lower,
    /// It is advanced by [`ADVANCED_MM`].
    Advance,
    /// The catheter is slid in.
    Catheter,
    /// Blood is drawn for [`DRAWN_S`].
    Draw,
    /// The tourniquet is taken off while the needle is in.
    TourniquetOff,
    /// The skin is pierced.
    Pierce,
    /// The target is reached.
    Reach,
    /// It is aspirated in the target.
    Aspirate,
    /// And then injected.
    Inject,
    /// The needle is drawn out.
    NeedleOut,
}

/// A goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Its steps, in their order.
    pub steps: &'static [Step],
    /// The name of the tissue that is to be reached; none where only the skin is.
    pub target: Option<&'static str>,
}

const CANNULATION: &[Step] = &[
    Step::TourniquetOn,
    Step::Anchor,
    Step::Angle,
    Step::Enter,
    Step::Flashback,
    Step::Lower,
    Step::Advance,
    Step::Catheter,
    Step::TourniquetOff,
    Step::NeedleOut,
];
const BLOOD_DRAW: &[Step] =
    &[Step::TourniquetOn, Step::Enter, Step::Draw, Step::TourniquetOff, Step::NeedleOut];
const VEIN: &[Step] = &[Step::Enter, Step::Draw, Step::NeedleOut];
const INJECTION: &[Step] = &[Step::Reach, Step::Aspirate, Step::Inject, Step::NeedleOut];
const REACH: &[Step] = &[Step::Reach, Step::NeedleOut];
const SKIN: &[Step] = &[Step::Pierce, Step::NeedleOut];

impl Goal {
    /// Returns the goal of insertions into this patient for this purpose. A purpose that makes no
    /// sense in it leaves the patient's own goal.
    pub fn of(profile: &Profile, purpose: Option<Purpose>) -> Self {
        let steps = match (profile.aim(), purpose) {
            (Some(Tissue::Vessel), Some(Purpose::Cannulation)) => CANNULATION,
            (Some(Tissue::Vessel), Some(Purpose::BloodDraw)) => BLOOD_DRAW,
            (Some(Tissue::Vessel), _) => VEIN,
            (Some(_), Some(Purpose::Injection)) => INJECTION,
            (Some(_), _) => REACH,
            (None, _) => SKIN,
        };
        let target =
            profile.aim().map(|tissue| if tissue == Tissue::Vessel { "vein" } else { tissue_name(tissue) });
        Self { steps, target }
    }

    /// Returns the goal as a sentence without its full stop.
    pub fn in_words(&self) -> String {
        match (self.steps, self.target) {
            (CANNULATION, _) => "Put a catheter into the vein".into(),
            (BLOOD_DRAW, _) => "Draw blood from the vein".into(),
            (INJECTION, Some(tissue)) => format!("Inject into the {tissue}"),
            (_, Some(tissue)) => format!("Reach the {tissue}"),
            (_, None) => "Pierce the skin".into(),
        }
    }

    /// True if an attempt begins with a task, so that a second hole in the skin belongs to it.
    pub(crate) fn begins_with_task(&self) -> bool {
        self.steps.first() == Some(&Step::TourniquetOn)
    }

    /// Returns a step as a person reads it.
    pub fn step_in_words(&self, step: Step) -> String {
        let target = self.target.unwrap_or("skin");
        match step {
            Step::TourniquetOn => "Tourniquet on".into(),
            Step::Anchor => "Anchor the vein".into(),
            Step::Angle => format!("{}–{}° to the skin", ENTRY_DEG.start(), ENTRY_DEG.end()),
            Step::Enter => format!("Enter the {target}"),
            Step::Flashback => "See the blood".into(),
            Step::Lower => format!("Lower by {}–{}°", LOWERED_DEG.start(), LOWERED_DEG.end()),
            Step::Advance => format!("Advance by {}–{} mm", ADVANCED_MM.start(), ADVANCED_MM.end()),
            Step::Catheter => "Catheter in".into(),
            Step::Draw => format!("Draw blood for {DRAWN_S} s"),
            Step::TourniquetOff => "Tourniquet off".into(),
            Step::Pierce => "Pierce the skin".into(),
            Step::Reach => format!("Reach the {target}"),
            Step::Aspirate => "Aspirate".into(),
            Step::Inject => "Inject".into(),
            Step::NeedleOut => "Needle out".into(),
        }
    }
}

impl Step {
    /// Returns the range that it asks for, in the unit of its words; none where it asks for no
    /// number.
    pub fn range(self) -> Option<[f64; 2]> {
        let range = match self {
            Step::Angle => ENTRY_DEG,
            Step::Lower => LOWERED_DEG,
            Step::Advance => ADVANCED_MM,
            _ => return None,
        };
        Some([*range.start(), *range.end()])
    }

    /// Returns the name of the task that a person reports for it; none where the needle tells.
    pub fn task(self) -> Option<&'static str> {
        match self {
            Step::TourniquetOn => Some("tourniquet_on"),
            Step::Anchor => Some("anchor"),
            Step::Catheter => Some("catheter"),
            Step::TourniquetOff => Some("tourniquet_off"),
            Step::Aspirate => Some("aspirate"),
            Step::Inject => Some("inject"),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use device_sim::profile::Entry;

    #[test]
    fn the_goal_follows_from_the_patient_and_not_from_the_line() {
        let find = |name: &str| Profile::find(name).expect("it is built in");
        let over_the_vein = Entry {
            angle_deg: Some(85.0),
            along_mm: Some(30.0),
            around_deg: Some(39.2),
            turn_deg: Some(-39.2),
            azimuth_deg: None,
        };
        let beside_the_vein = Entry { around_deg: Some(15.0), ..Entry::default() };
        let shoulder = find("shoulder-joint").entered(&over_the_vein).expect("it goes in");
        let forearm = find("forearm").entered(&beside_the_vein).expect("it goes in");
        for (profile, purpose, words, steps) in [
            (find("adult"), Some(Purpose::Cannulation), "Put a catheter into the vein", 10),
            (find("dorsal-hand"), Some(Purpose::BloodDraw), "Draw blood from the vein", 5),
            (forearm, None, "Reach the vein", 3),
            (shoulder, Some(Purpose::BloodDraw), "Reach the bursa", 2),
            (find("shoulder"), Some(Purpose::Injection), "Inject into the bursa", 4),
        ] {
            let goal = Goal::of(&profile, purpose);
            assert_eq!((goal.in_words().as_str(), goal.steps.len()), (words, steps), "{}", profile.name);
        }
    }

    #[test]
    fn each_task_of_a_purpose_is_a_step() {
        let adult = Profile::find("adult").expect("it is built in");
        let shoulder = Profile::find("shoulder").expect("it is built in");
        for (purpose, profile) in
            [(Purpose::Cannulation, &adult), (Purpose::BloodDraw, &adult), (Purpose::Injection, &shoulder)]
        {
            let goal = Goal::of(profile, Some(purpose));
            let tasks: Vec<&str> = goal.steps.iter().filter_map(|step| step.task()).collect();
            assert_eq!(tasks, purpose.tasks());
        }
    }
}
