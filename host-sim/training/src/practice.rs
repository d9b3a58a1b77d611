//! Practice: each insertion of a run is judged as soon as the needle has left the skin, by the code
//! that judges recordings, against what its patient is for. What was judged goes to the pages.

use crate::live_score::LiveScore;
use crate::score::Insertion;
use crate::score::gesture::Gesture;
use crate::score::target::TargetOutcome;
use control_core::config::Tissue;
use device_sim::procedure::task::Task;
use device_sim::profile::Profile;
use device_sim::session::{Publisher, Subscription};
use serde::Serialize;

/// The tip has to rest in the vein for so long: blood is drawn, or a cannula put in.
const IN_LUMEN_S: f64 = 0.5;
/// An angle further off than this, root mean square along the way, is not the patient's any more,
/// °.
const ANGLE_WITHIN_DEG: f64 = 5.0;
/// Places a second of the way that a page draws.
const PATH_HZ: f64 = 25.0;

/// The goal of an insertion into a patient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Goal {
    /// Into the vein and not through it.
    Vein,
    /// Into this structure, which the patient names as the target, and not through it.
    Structure(Tissue),
    /// Into the skin: the patient has nothing else.
    Skin,
}

impl Goal {
    /// Returns the goal of insertions into this patient.
    pub(crate) fn of(profile: &Profile) -> Self {
        let layers = &profile.config.patient.layers;
        if layers.iter().any(|layer| layer.tissue == Tissue::Vessel) {
            return Goal::Vein;
        }
        let target = profile.goal().and_then(|goal| layers.get(usize::from(goal.layer)));
        target.map_or(Goal::Skin, |layer| Goal::Structure(layer.tissue))
    }

    /// Returns the goal as a sentence without its full stop.
    pub(crate) fn in_words(self) -> String {
        match self {
            Goal::Vein => format!("Enter the vein, rest in it for {IN_LUMEN_S} s, and do not go through it"),
            Goal::Structure(tissue) => {
                format!(
                    "Reach the {} and touch nothing that is to be spared",
                    device_sim::session::tissue_name(tissue)
                )
            }
            Goal::Skin => "Pierce the skin".into(),
        }
    }

    /// Returns the numeric limits of an attempt that reaches the goal, by the names of the figures.
    fn targets(self) -> serde_json::Value {
        let mut targets = serde_json::json!({
            "angle_rms_error_deg": { "at_most": ANGLE_WITHIN_DEG },
            "spared_hits": { "at_most": 0 },
        });
        if self == Goal::Vein {
            targets["in_lumen_s"] = serde_json::json!({ "at_least": IN_LUMEN_S });
        }
        targets
    }

    /// Returns what an insertion lacks, in words; nothing where it has reached the goal.
    pub(crate) fn missing(self, figures: &Insertion) -> Vec<String> {
        let mut missing = Vec::new();
        match self {
            Goal::Vein if figures.through_far_wall => missing.push("it went through the far wall".into()),
            Goal::Vein if !figures.vessel => missing.push("the vein was not entered".into()),
            Goal::Vein if figures.in_lumen_s < IN_LUMEN_S => {
                missing.push(format!("it rested in the vein for {:.1} s only", figures.in_lumen_s));
            }
            Goal::Structure(tissue) => {
                let tissue = device_sim::session::tissue_name(tissue);
                match figures.target.as_ref().map(|target| target.outcome) {
                    Some(TargetOutcome::Reached) => {}
                    Some(TargetOutcome::Beyond) => missing.push(format!("it went through the {tissue}")),
                    Some(TargetOutcome::Missed) | None => {
                        missing.push(format!("the {tissue} was not reached"))
                    }
                }
            }
            Goal::Skin if figures.punctures == 0 => missing.push("the skin was not pierced".into()),
            _ => {}
        }
        let mistakes = figures.tasks.iter().flat_map(|tasks| &tasks.list).filter(|task| task.is_critical);
        missing.extend(mistakes.map(|task| task.in_words()));
        if figures.spared_hits > 0 {
            missing.push("something that is to be spared was touched".into());
        }
        if figures.angle_rms_error_deg.is_some_and(|error| error > ANGLE_WITHIN_DEG) {
            missing.push(format!("the angle was off by more than {ANGLE_WITHIN_DEG}°"));
        }
        missing
    }
}

/// An insertion with its verdict.
#[derive(Clone, Debug, Serialize)]
pub struct Attempt {
    /// Its number in this run, from 1.
    pub number: u32,
    /// Name of the patient.
    pub patient: String,
    /// True if a person held the needle when it ended; otherwise the scripted hand did, or nobody
    /// knows.
    pub by_person: bool,
    /// True if it has reached the goal.
    pub reached: bool,
    /// The criteria that it does not meet, each in words.
    pub missing: Vec<String>,
    /// The figures of `score`.
    pub figures: Insertion,
    /// Time since the first touch in s, and depth along the needle in mm.
    pub path: Vec<(f64, f64)>,
}

/// Judges the insertions of a run.
pub struct Practice {
    subscription: Subscription,
    live: LiveScore,
    patient: String,
    goal: Goal,
    skin_tilt_rad: f64,
    count: u32,
    by_person: bool,
}

impl Practice {
    /// Listens to a session from now on.
    pub fn new(subscription: Subscription, profile: &Profile, tasks: &[Task], publisher: &Publisher) -> Self {
        let mut practice = Self {
            subscription,
            live: LiveScore::default(),
            patient: String::new(),
            goal: Goal::Skin,
            skin_tilt_rad: 0.0,
            count: 0,
            by_person: false,
        };
        practice.patient(profile, tasks, publisher);
        practice
    }

    /// Insertions are into `profile`, with these tasks, from now on; one in progress is not judged.
    pub fn patient(&mut self, profile: &Profile, tasks: &[Task], publisher: &Publisher) {
        self.live.patient(profile.clone(), tasks);
        self.patient = profile.name.clone();
        self.goal = Goal::of(profile);
        self.skin_tilt_rad = profile.skin_tilt_rad();
        publisher.practice(&serde_json::json!({
            "goal": self.goal.in_words(),
            "patient": self.patient,
            "targets": self.goal.targets(),
            "tasks": tasks,
        }));
    }

    /// Notes who holds the needle.
    pub fn held(&mut self, by_person: bool) {
        self.by_person = by_person;
    }

    /// Judges what has ended since the last time.
    pub fn judge(&mut self, publisher: &Publisher) {
        let batch = self.subscription.drain();
        let mut ended = Vec::new();
        let (goal, skin_tilt_rad) = (self.goal, self.skin_tilt_rad);
        self.live.take_each(&batch, |span, figures| {
            let missing = goal.missing(&figures);
            ended.push((missing, path(&span.gesture(skin_tilt_rad)), figures));
        });
        for (missing, path, figures) in ended {
            self.count += 1;
            let attempt = Attempt {
                number: self.count,
                patient: self.patient.clone(),
                by_person: self.by_person,
                reached: missing.is_empty(),
                missing,
                figures,
                path,
            };
            // Numbers and texts can always be written.
            if let Ok(json) = serde_json::to_value(&attempt) {
                publisher.attempt(&json);
            }
        }
    }
}

fn path(gesture: &Gesture) -> Vec<(f64, f64)> {
    let every = (crate::score::gesture::RATE_HZ / PATH_HZ) as usize;
    let places = gesture.places.iter().enumerate().step_by(every.max(1));
    let rounded = |value: f64| (value * 1e3).round() / 1e3;
    places
        .map(|(index, place)| {
            (rounded(index as f64 / crate::score::gesture::RATE_HZ), rounded(place.depth_mm))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_goal_follows_from_the_patient() {
        let goal = |name: &str| Goal::of(&Profile::find(name).expect("it is built in"));
        assert_eq!(goal("adult"), Goal::Vein);
        assert_eq!(goal("dorsal-hand"), Goal::Vein);
        assert!(matches!(goal("shoulder"), Goal::Structure(Tissue::Bursa)), "{:?}", goal("shoulder"));
    }
}
