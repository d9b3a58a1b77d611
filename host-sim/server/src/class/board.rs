//! The instructor's board: the newest state of every device, who is stuck, who is gone. Pure: the
//! caller passes the time and the messages. Each message is checked for its size and form and
//! passed on to the page unchanged.

use super::Name;
use super::message::{ClassScore, Kind};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The most devices; messages of further ones are dropped.
const MOST_MEMBERS: usize = 200;
/// Events that are kept of each device.
const MOST_EVENTS: usize = 8;
/// A device that says nothing for so long is gone.
const SILENCE: Duration = Duration::from_secs(2);
/// A tip that does not move in the body for longer than this is stuck, s.
const STUCK_S: f64 = 20.0;
/// So many insertions in a row that did not pass are stuck.
const STUCK_INSERTIONS: u32 = 3;

/// Everything known of a class; shared between the network's threads and the page's.
#[derive(Debug, Default)]
pub struct Board {
    members: Mutex<Members>,
}

#[derive(Debug, Default)]
struct Members {
    by_name: BTreeMap<Name, Member>,
    /// Messages that could not be understood or were too many.
    refused: u64,
}

/// One device.
#[derive(Debug)]
struct Member {
    heard: Instant,
    /// The newest poses as they came: what is in them is read only when somebody looks.
    poses: Vec<u8>,
    heard_poses: u64,
    scene: Value,
    /// Counts the scenes, so that a page is sent each once.
    scene_number: u64,
    about: Option<About>,
    events: Vec<Value>,
}

/// [`super::message::Poses`], as much of them as is wanted.
#[derive(Debug, Deserialize)]
struct Poses<N, P> {
    newest: N,
    poses: P,
}

/// The part of [`super::message::About`] that the board needs.
#[derive(Debug, Deserialize)]
struct About {
    scene: Value,
    connected: bool,
    recording: bool,
    trainee: Option<String>,
    fault: Option<String>,
    still_s: f64,
    score: ClassScore,
    events: Vec<Value>,
}

/// One device as the page shows it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MemberView {
    /// Its name.
    pub name: String,
    /// True if no message has arrived for 2 s.
    pub gone: bool,
    /// Since when nothing has been heard of it, s.
    pub silent_s: f64,
    /// True if its computer receives data from the device.
    pub connected: bool,
    /// True if it records.
    pub recording: bool,
    /// The name or pseudonym of its trainee, where one has been given.
    pub trainee: Option<String>,
    /// The reason why its trainee seems to need help, in words.
    pub stuck: Option<String>,
    /// The newest pose, a [`crate::streams::NeedlePose`].
    pub pose: Option<Value>,
    /// Poses that have come in all.
    pub poses: u64,
    /// Its insertions so far.
    pub score: ClassScore,
    /// Its last events, oldest first.
    pub events: Vec<Value>,
    /// The scene; only if the page does not have it yet.
    pub scene: Option<Value>,
}

/// Server to page.
#[derive(Serialize)]
struct ToClassPage<'a> {
    #[serde(rename = "type")]
    kind: &'static str,
    name: &'a str,
    address: SocketAddr,
    members: Vec<MemberView>,
}

/// The scenes that a page has, so that each is sent once.
#[derive(Debug, Default)]
pub struct Sent {
    scenes: BTreeMap<Name, u64>,
}

impl Board {
    /// A message under `device/kind`, the end of its key. Returns whether it was understood.
    pub fn hear(&self, device: &str, kind: &str, bytes: &[u8], now: Instant) -> bool {
        let mut members = self.lock();
        let heard = members.hear(device, kind, bytes, now).is_some();
        members.refused += u64::from(!heard);
        heard
    }

    /// Everybody, by name, for a page that has been `sent` so much.
    pub fn view(&self, now: Instant, sent: &mut Sent) -> Vec<MemberView> {
        let members = self.lock();
        members.by_name.iter().map(|(name, member)| member.view(name, now, sent)).collect()
    }

    /// Returns the message for a page, as JSON: the class with all its members.
    pub fn text(&self, class: &Name, address: SocketAddr, now: Instant, sent: &mut Sent) -> Option<String> {
        let members = self.view(now, sent);
        let class = ToClassPage { kind: "class", name: class.as_str(), address, members };
        serde_json::to_string(&class).ok()
    }

    /// Messages that could not be understood, or came from too many devices.
    pub fn refused(&self) -> u64 {
        self.lock().refused
    }

    /// A thread that panicked must not take the class with it: the data is still whole.
    fn lock(&self) -> MutexGuard<'_, Members> {
        self.members.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Members {
    fn hear(&mut self, device: &str, kind: &str, bytes: &[u8], now: Instant) -> Option<()> {
        let name: Name = device.parse().ok()?;
        let kind = Kind::from_name(kind)?;
        if bytes.len() > kind.longest() {
            return None;
        }
        let is_known = self.by_name.contains_key(&name);
        if !is_known && self.by_name.len() >= MOST_MEMBERS {
            return None;
        }
        let mut member = Member::new(now);
        let member = self.by_name.get_mut(&name).unwrap_or(&mut member);
        member.take(kind, bytes)?;
        member.heard = now;
        if !is_known {
            let new = std::mem::replace(member, Member::new(now));
            self.by_name.insert(name, new);
        }
        Some(())
    }
}

impl Member {
    fn new(now: Instant) -> Self {
        let (poses, events) = (Vec::new(), Vec::new());
        Self { heard: now, poses, heard_poses: 0, scene: Value::Null, scene_number: 0, about: None, events }
    }

    fn take(&mut self, kind: Kind, bytes: &[u8]) -> Option<()> {
        match kind {
            Kind::Pose => {
                let told: Poses<IgnoredAny, Vec<IgnoredAny>> = serde_json::from_slice(bytes).ok()?;
                self.heard_poses += told.poses.len() as u64;
                self.poses.clear();
                self.poses.extend_from_slice(bytes);
            }
            Kind::Event => {
                let event: Value = serde_json::from_slice(bytes).ok()?;
                event.get("kind")?.as_str()?;
                self.events.push(event);
                self.events.drain(..self.events.len().saturating_sub(MOST_EVENTS));
            }
            Kind::Score => {
                let score = serde_json::from_slice(bytes).ok()?;
                self.about.as_mut()?.score = score;
            }
            Kind::About => {
                let mut about: About = serde_json::from_slice(bytes).ok()?;
                about.scene.get("layers")?.as_array()?;
                let scene = about.scene.take();
                if scene != self.scene {
                    self.scene = scene;
                    self.scene_number += 1;
                }
                let from = about.events.len().saturating_sub(MOST_EVENTS);
                self.events = about.events.split_off(from);
                self.about = Some(about);
            }
        }
        Some(())
    }

    fn view(&self, name: &Name, now: Instant, sent: &mut Sent) -> MemberView {
        let silent = now.saturating_duration_since(self.heard);
        let newest = serde_json::from_slice::<Poses<Value, IgnoredAny>>(&self.poses).ok();
        let is_new = sent.scenes.insert(name.clone(), self.scene_number) != Some(self.scene_number);
        MemberView {
            name: name.to_string(),
            gone: silent > SILENCE,
            silent_s: silent.as_secs_f64(),
            connected: self.about.as_ref().is_some_and(|about| about.connected),
            recording: self.about.as_ref().is_some_and(|about| about.recording),
            trainee: self.about.as_ref().and_then(|about| about.trainee.clone()),
            stuck: self.about.as_ref().and_then(About::stuck),
            pose: newest.map(|told| told.newest),
            poses: self.heard_poses,
            score: self.about.as_ref().map(|about| about.score.clone()).unwrap_or_default(),
            events: self.events.clone(),
            scene: (is_new && self.scene_number > 0).then(|| self.scene.clone()),
        }
    }
}

impl About {
    /// Returns the reason why the trainee seems to need help: the most serious one first.
    fn stuck(&self) -> Option<String> {
        if let Some(fault) = &self.fault {
            return Some(format!("fault: {fault}"));
        }
        if self.still_s >= STUCK_S {
            return Some(format!("the needle has stood still in the body for {:.0} s", self.still_s));
        }
        let without = self.score.without_success;
        (without >= STUCK_INSERTIONS).then(|| format!("{without} insertions in a row did not pass"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn about(score: &ClassScore, still_s: f64, fault: Option<&str>) -> Vec<u8> {
        let about = json!({ "scene": { "layers": [], "profile": "adult" }, "connected": true, "recording": true,
            "trainee": "Ann", "fault": fault, "still_s": still_s, "score": score, "events": [] });
        serde_json::to_vec(&about).unwrap()
    }

    fn view(board: &Board, now: Instant) -> MemberView {
        board.view(now, &mut Sent::default()).remove(0)
    }

    #[test]
    fn a_device_that_falls_silent_is_gone_and_comes_back() {
        let (board, begin) = (Board::default(), Instant::now());
        let after = |ms: u64| begin + Duration::from_millis(ms);
        assert!(board.hear("bed-1", "pose", br#"{"newest":{"depth_mm":2.0},"poses":[[],[]]}"#, begin));
        let seen = view(&board, after(1_000));
        assert_eq!((seen.gone, seen.pose), (false, Some(json!({ "depth_mm": 2.0 }))), "the newest");
        let seen = view(&board, after(5_000));
        assert!(seen.gone && (seen.silent_s - 5.0).abs() < 1e-9);
        assert!(board.hear("bed-1", "about", &about(&ClassScore::default(), 0.0, None), after(6_000)));
        let seen = view(&board, after(6_100));
        assert_eq!((seen.gone, seen.trainee.as_deref()), (false, Some("Ann")));
    }

    #[test]
    fn who_is_stuck_is_said_with_the_reason() {
        let (board, now) = (Board::default(), Instant::now());
        let tells = |score: &ClassScore, still_s, fault| {
            assert!(board.hear("a", "about", &about(score, still_s, fault), now));
            view(&board, now).stuck
        };
        assert_eq!(tells(&ClassScore::default(), 3.0, None), None);
        assert!(tells(&ClassScore::default(), 21.0, None).unwrap().contains("21 s"));
        assert_eq!(
            tells(&ClassScore::default(), 21.0, Some("heartbeat lost")).unwrap(),
            "fault: heartbeat lost"
        );
        let missed = ClassScore { insertions: 3, without_success: 3, ..ClassScore::default() };
        assert!(tells(&missed, 0.0, None).unwrap().contains("3 insertions"));
        let found = ClassScore { insertions: 4, passed: 1, ..ClassScore::default() };
        assert!(board.hear("a", "score", &serde_json::to_vec(&found).unwrap(), now), "at once");
        assert_eq!(view(&board, now).stuck, None);
    }

    #[test]
    fn a_scene_is_sent_once_and_again_when_it_is_another() {
        let (board, now, mut sent) = (Board::default(), Instant::now(), Sent::default());
        let mut scene_of_next_view = || board.view(now, &mut sent).remove(0).scene;
        board.hear("a", "about", &about(&ClassScore::default(), 0.0, None), now);
        assert!(scene_of_next_view().is_some());
        board.hear("a", "about", &about(&ClassScore::default(), 1.0, None), now);
        assert!(scene_of_next_view().is_none());
        let other =
            String::from_utf8(about(&ClassScore::default(), 1.0, None)).unwrap().replace("adult", "thin");
        board.hear("a", "about", other.as_bytes(), now);
        assert_eq!(scene_of_next_view().unwrap()["profile"], "thin");
    }

    #[test]
    fn nonsense_and_a_flood_of_names_are_bounded() {
        let (board, now) = (Board::default(), Instant::now());
        // In good form, but longer than any device's.
        let mut huge = br#"{"kind":"contact"}"#.to_vec();
        huge.resize(Kind::Event.longest() + 1, b' ');
        let bad: [(&str, &str, &[u8]); 7] = [
            ("a/b", "pose", b"[]"),
            ("a", "orders", b"[]"),
            ("a", "pose", b"not even JSON"),
            ("a", "event", &huge),
            ("a", "about", b"{}"),
            ("a", "event", b"7"),
            ("a", "score", b"null"),
        ];
        for (device, kind, bytes) in bad {
            assert!(!board.hear(device, kind, bytes, now), "{device} {kind}");
        }
        assert!(board.view(now, &mut Sent::default()).is_empty(), "nonsense makes no member");
        for number in 0..2 * MOST_MEMBERS {
            board.hear(&format!("d{number}"), "pose", br#"{"newest":null,"poses":[]}"#, now);
        }
        let seen = board.view(now, &mut Sent::default());
        assert!(seen[0].pose.as_ref().is_none_or(Value::is_null));
        assert_eq!((seen.len(), board.refused()), (MOST_MEMBERS, (MOST_MEMBERS + bad.len()) as u64));
        for number in 0..100 {
            board.hear("d0", "event", format!(r#"{{"kind":"{number}"}}"#).as_bytes(), now);
        }
        assert_eq!(view(&board, now).events.len(), MOST_EVENTS);
    }
}
