//! The messages of one device to its class, from its session's batches. Pure: no clock, no network.

use super::message::{About, ClassScore, Kind, Poses};
use device_sim::page::condense::Condenser;
use device_sim::page::messages::{self, Event};
use device_sim::session::{Batch, Scene};
use link::frames::EventKind;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::time::Duration;
use training::practice::Attempt;

/// Between two [`About`]s.
const ABOUT_PERIOD: Duration = Duration::from_secs(1);
/// Events that an [`About`] repeats.
const EVENTS: usize = 8;
/// A tip that stays this close to one place does not move, mm.
const STILL_MM: f64 = 1.0;

/// A message to publish: JSON.
pub type Message = (Kind, Vec<u8>);

/// Remembers between batches what the next messages need.
#[derive(Debug, Default)]
pub struct ClassPublisher {
    condenser: Condenser,
    score: ClassScore,
    scene: Option<Scene>,
    fault: Option<String>,
    events: VecDeque<Event>,
    stillness: Stillness,
    /// The time at which the last [`About`] was sent.
    told: Option<Duration>,
}

impl ClassPublisher {
    /// The messages for what has arrived since the last call; every pose of it is in them. `now` is
    /// any clock that goes on.
    pub fn take(&mut self, batch: Batch, now: Duration) -> Vec<Message> {
        let mut told = Vec::new();
        if let Some(scene) = batch.scene.clone() {
            (self.scene, self.told) = (Some(scene), None);
        }
        // What the scripted hand does counts as nobody's.
        let attempts = batch.attempts.iter().filter_map(|json| Attempt::deserialize(json).ok());
        for attempt in attempts.filter(|attempt| attempt.by_person) {
            self.score.count(attempt.figures);
            push(&mut told, Kind::Score, &self.score);
        }
        let status = batch.link.clone();
        for happening in &batch.events {
            match happening.event.kind {
                EventKind::Fault { cause } => self.fault = Some(cause.to_string()),
                EventKind::Cleared => self.fault = None,
                _ => {}
            }
        }
        let poses = batch.poses.clone();
        let (_, frame) = self.condenser.take(batch);
        for event in frame.events {
            push(&mut told, Kind::Event, &event);
            self.events.push_back(event);
            self.events.drain(..self.events.len().saturating_sub(EVENTS));
        }
        for pose in &poses {
            self.stillness.take(pose.tick, pose.depth.0.to_num());
        }
        if let Some(newest) = frame.pose {
            let row = |pose: messages::Pose| [pose.t_s, pose.depth_mm, pose.speed_mm_s, pose.force_n];
            let poses = poses.iter().map(|pose| row(self.condenser.pose(pose))).collect();
            push(&mut told, Kind::Pose, &Poses { newest: (&newest).into(), poses });
        }
        let is_due = self.told.is_none_or(|told| now >= told + ABOUT_PERIOD);
        if is_due && let Some(scene) = &self.scene {
            let about = About {
                scene: scene.clone(),
                connected: status.connected,
                recording: status.recording.is_some(),
                trainee: status.trainee.clone(),
                fault: self.fault.clone(),
                still_s: self.stillness.seconds(),
                score: self.score.clone(),
                events: self.events.iter().cloned().collect(),
            };
            push(&mut told, Kind::About, &about);
            self.told = Some(now);
        }
        told
    }
}

fn push(messages: &mut Vec<Message>, kind: Kind, what: &impl Serialize) {
    // Only a map with keys that are not strings cannot be written, and no message has one.
    messages.extend(serde_json::to_vec(what).ok().map(|bytes| (kind, bytes)));
}

/// For how long a tip in the body has stayed where it is.
#[derive(Debug, Default)]
struct Stillness {
    /// Depth in mm and tick at which it was last somewhere else.
    since: Option<(f64, u64)>,
    now: u64,
}

impl Stillness {
    fn take(&mut self, tick: u64, depth_mm: f64) {
        self.now = tick;
        let stays = self.since.is_some_and(|(at, since)| (depth_mm - at).abs() < STILL_MM && tick >= since);
        if depth_mm <= 0.0 {
            self.since = None;
        } else if !stays {
            self.since = Some((depth_mm, tick));
        }
    }

    fn seconds(&self) -> f64 {
        let ticks = self.since.map_or(0, |(_, since)| self.now - since);
        ticks as f64 / f64::from(control_core::TICK_HZ)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::class::message::ClassScore;
    use control_core::units::Millimetres;
    use device_sim::procedure::Procedure;
    use device_sim::profile::Profile;
    use device_sim::session::{self, Publisher, Session, Source};
    use fixed::types::I16F16;
    use link::frames::Pose;
    use recording::messages::Message as Recorded;
    use recording::read::Recording;
    use training::practice::Practice;

    /// A round of the scripted venepuncture on the adult.
    fn recorded() -> (Recording, Profile) {
        let profile = Profile::find("adult").unwrap();
        let procedure = Procedure::find("venepuncture", &profile).unwrap();
        let file = std::env::temp_dir().join(format!("needle-publisher-{}.mcap", std::process::id()));
        let recording = crate::virtual_run::record(&profile, procedure, &file).unwrap();
        std::fs::remove_file(&file).unwrap();
        (recording, profile)
    }

    fn open(profile: &Profile) -> (Session, Publisher) {
        session::open(profile.scene(Source::Virtual, None))
    }

    fn read<'a>(
        messages: &'a [Message],
        wanted: Kind,
    ) -> impl DoubleEndedIterator<Item = serde_json::Value> + 'a {
        messages
            .iter()
            .filter(move |(kind, _)| *kind == wanted)
            .map(|(_, bytes)| serde_json::from_slice(bytes).unwrap())
    }

    #[test]
    fn live_score_equals_the_recordings_and_no_pose_is_lost() {
        let (recording, profile) = recorded();
        let (session, publisher) = open(&profile);
        let mut practice = Practice::new(session.subscribe(), &profile, recording.setup.purpose, true);
        let (mut subscription, mut to_class) = (session.subscribe(), ClassPublisher::default());
        let (mut messages, mut poses) = (Vec::new(), 0);
        for (number, message) in recording.messages.iter().enumerate() {
            match message {
                Recorded::Hello(hello) => publisher.hello(&hello.to_frame()),
                Recorded::Samples(block) => {
                    let samples: Vec<_> = block.rows().map(|row| row.1).collect();
                    publisher.samples(block.first_tick, &samples);
                }
                Recorded::Pose(pose) => {
                    poses += 1;
                    publisher.pose(pose.to_frame());
                }
                Recorded::Event(event) => publisher.event(*event),
                Recorded::Task(task) => publisher.task(task),
                _ => {}
            }
            // As often as in a run: every few frames.
            if number % 7 == 0 {
                practice.judge(&publisher);
                messages.extend(to_class.take(subscription.drain(), Duration::from_millis(number as u64)));
            }
        }
        practice.judge(&publisher);
        messages.extend(to_class.take(subscription.drain(), Duration::from_secs(100)));
        // Through JSON too, which costs the last digit.
        let expected =
            serde_json::to_vec(&training::score::score(&recording, None).unwrap().insertions).unwrap();
        let expected: Vec<training::score::Insertion> = serde_json::from_slice(&expected).unwrap();
        let told: Vec<ClassScore> =
            read(&messages, Kind::Score).map(|value| serde_json::from_value(value).unwrap()).collect();
        assert_eq!(told.iter().map(|score| score.last.clone().unwrap()).collect::<Vec<_>>(), expected);
        let last = told.last().unwrap();
        assert_eq!((last.insertions, last.passed, last.without_success), (1, 1, 0));
        assert_eq!(
            read(&messages, Kind::Pose).map(|told| told["poses"].as_array().unwrap().len()).sum::<usize>(),
            poses
        );
        assert!(read(&messages, Kind::Event).any(|event| event["kind"] == "puncture"));
        let about = read(&messages, Kind::About).next_back().unwrap();
        assert_eq!(about["scene"]["profile"], "adult");
        assert_eq!(about["score"]["insertions"], 1, "whoever comes later is told too");
        for (kind, bytes) in &messages {
            assert!(bytes.len() * 2 <= kind.longest(), "{} bytes of {kind:?}", bytes.len());
        }
    }

    #[test]
    fn a_needle_at_rest_in_the_body_and_a_fault_are_reported() {
        let (session, publisher) = open(&Profile::find("adult").unwrap());
        let (mut subscription, mut to_class) = (session.subscribe(), ClassPublisher::default());
        let mut about_after = |seconds: u64, depth_mm: f64| {
            let depth = Millimetres(I16F16::from_num(depth_mm));
            publisher.pose(Pose { tick: seconds * 10_000, depth, ..Pose::default() });
            let messages = to_class.take(subscription.drain(), Duration::from_secs(seconds));
            read(&messages, Kind::About).next_back().unwrap()
        };
        assert_eq!(about_after(1, -5.0)["still_s"], 0.0);
        assert_eq!(about_after(2, 5.0)["still_s"], 0.0);
        assert_eq!(about_after(32, 5.5)["still_s"], 30.0);
        assert_eq!(about_after(33, 7.0)["still_s"], 0.0, "it has moved on");
        publisher.event(link::frames::Event {
            tick: 331_000,
            kind: EventKind::Fault { cause: control_core::event::Fault::LinkLost },
        });
        let about = about_after(34, 7.0);
        assert!(about["fault"].is_string(), "{about}");
        publisher.event(link::frames::Event { tick: 341_000, kind: EventKind::Cleared });
        assert!(about_after(35, 7.0)["fault"].is_null());
    }
}
