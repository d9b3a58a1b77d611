//! The messages of a device to its class: JSON under the Zenoh key `needle/CLASS/DEVICE/KIND`.
//! Units are in the names.

use crate::streams::NeedlePose;
use device_sim::page::messages::Event;
use device_sim::session::Scene;
use serde::{Deserialize, Serialize};
use training::score::Insertion;

/// The part of a key that says what a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// [`Poses`], 25 times a second.
    Pose,
    /// One [`Event`].
    Event,
    /// A [`ClassScore`], at the end of each insertion.
    Score,
    /// An [`About`], once a second and whenever another patient is chosen: whoever comes later
    /// learns all from it.
    About,
}

impl Kind {
    const ALL: [(Self, &str); 4] =
        [(Self::Pose, "pose"), (Self::Event, "event"), (Self::Score, "score"), (Self::About, "about")];

    /// As a key holds it.
    pub fn as_str(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }

    /// Longest message in bytes that the instructor takes, several times what a device sends. Poses
    /// that had to wait for a second come in one message.
    pub(super) const fn longest(self) -> usize {
        match self {
            Self::Pose => 64 * 1024,
            Self::Event => 1024,
            Self::Score => 16 * 1024,
            Self::About => 32 * 1024,
        }
    }

    /// From a key's last part.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, known)| *known == name).map(|(kind, _)| *kind)
    }
}

/// The needle's pose, and its path since the last message.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Poses {
    /// The newest pose, in full.
    pub newest: NeedlePose,
    /// Every pose of 1 kHz since the last message, oldest first and the newest among them.
    pub poses: Vec<PoseRow>,
}

/// A pose in short: time in s, depth in mm, speed in mm/s, the force that the control core asked
/// for in N.
pub type PoseRow = [f64; 4];

/// A trainee's insertions so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClassScore {
    /// A person's insertions that have ended.
    pub insertions: u32,
    /// Those of them that passed.
    pub passed: u32,
    /// Insertions since the last one that passed.
    pub without_success: u32,
    /// The last one; none before the first.
    pub last: Option<Insertion>,
}

impl ClassScore {
    /// One more has ended.
    pub fn count(&mut self, insertion: Insertion) {
        self.insertions += 1;
        let passed = insertion.verdict.passed;
        self.passed += u32::from(passed);
        self.without_success = if passed { 0 } else { self.without_success + 1 };
        self.last = Some(insertion);
    }
}

/// All that stays true for longer than a pose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct About {
    /// The scene, as on the trainee's own page.
    pub scene: Scene,
    /// True if the trainee's computer receives data from its device.
    pub connected: bool,
    /// True if it records.
    pub recording: bool,
    /// The trainee's name or pseudonym, where one has been given.
    pub trainee: Option<String>,
    /// The fault that has latched, in words.
    pub fault: Option<String>,
    /// The time for which the tip has been in the body and within 1 mm of one place, s; 0 outside.
    pub still_s: f64,
    /// Insertions so far.
    pub score: ClassScore,
    /// The last events, oldest first.
    pub events: Vec<Event>,
}
