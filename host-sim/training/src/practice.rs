//! Practice: each insertion of a run is judged as soon as it has ended, by the code that judges
//! recordings. The steps of its goal go to the pages while it goes on, its verdict afterwards.

use crate::live_score::LiveScore;
use crate::score::Insertion;
use crate::score::gesture::Gesture;
use crate::verdict::{StepState, Verdict};
use device_sim::procedure::purpose::Purpose;
use device_sim::profile::Profile;
use device_sim::session::{Publisher, Subscription};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Places a second of the way that a page draws.
const PATH_HZ: f64 = 25.0;

/// An insertion with its verdict.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Attempt {
    /// Its number in this run, from 1.
    pub number: u32,
    /// Name of the patient.
    pub patient: String,
    /// True if a person held the needle all the while; otherwise the scripted hand did.
    pub by_person: bool,
    /// The figures of `score`, with the verdict.
    pub figures: Insertion,
    /// Time since the first touch in s, and depth along the needle in mm.
    pub path: Vec<(f64, f64)>,
}

/// Judges the insertions of a run.
pub struct Practice {
    subscription: Subscription,
    live: LiveScore,
    patient: String,
    purpose: Option<Purpose>,
    count: u32,
    by_person: bool,
    /// The scripted hand has moved the needle since the last insertion ended.
    was_scripted: bool,
    /// The verdict so far that was published last.
    so_far: Option<Verdict>,
}

impl Practice {
    /// Listens to a session from now on. `by_person` says who holds the needle until
    /// [`Self::held`] says it.
    pub fn new(
        subscription: Subscription,
        profile: &Profile,
        purpose: Option<Purpose>,
        by_person: bool,
    ) -> Self {
        let mut practice = Self {
            subscription,
            live: LiveScore::default(),
            patient: String::new(),
            purpose: None,
            count: 0,
            by_person,
            was_scripted: !by_person,
            so_far: None,
        };
        practice.patient(profile, purpose);
        practice
    }

    /// Insertions are into `profile`, for this purpose, from now on; one in progress is not judged.
    pub fn patient(&mut self, profile: &Profile, purpose: Option<Purpose>) {
        self.live.patient(profile, purpose);
        self.patient.clone_from(&profile.name);
        self.purpose = purpose;
        self.so_far = None;
    }

    /// Notes who holds the needle. What a person takes over before it has begun is the person's.
    pub fn held(&mut self, by_person: bool) {
        let is_new = by_person && !self.by_person && !self.live.is_going_on();
        self.was_scripted = !by_person || self.was_scripted && !is_new;
        self.by_person = by_person;
    }

    /// Judges what has ended since the last time, and says how the present attempt goes.
    pub fn judge(&mut self, publisher: &Publisher) {
        let batch = self.subscription.drain();
        let mut ended = Vec::new();
        self.live.take_each(&batch, |judge, span, figures| ended.push((path(&judge.gesture(span)), figures)));
        for (path, figures) in ended {
            self.count += 1;
            let attempt = Attempt {
                number: self.count,
                patient: self.patient.clone(),
                by_person: self.by_person && !self.was_scripted,
                figures,
                path,
            };
            self.was_scripted = !self.by_person;
            // Numbers and texts can always be written.
            if let Ok(json) = serde_json::to_value(&attempt) {
                publisher.attempt(&json);
            }
        }
        let so_far = self.live.so_far().or_else(|| self.live.to_come());
        if so_far.is_some() && so_far != self.so_far {
            if let Some(verdict) = &so_far {
                let next = verdict.steps.iter().position(|step| step.state == StepState::Open);
                publisher.practice(&json!({
                    "goal": verdict.goal,
                    "patient": self.patient,
                    "purpose": self.purpose,
                    "steps": verdict.steps,
                    "reasons": verdict.reasons,
                    "next": next,
                }));
            }
            self.so_far = so_far;
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
