//! What whoever looks at a device is told of it while it runs, and what a person may ask. Data alone: nothing here waits or sends.

use super::Scene;
use control_core::controller::Sample;
use link::frames::{Event, Hello, Pose, Timing};
use serde::Serialize;

/// An older pose says nothing of where the needle was at an event: 100 ms.
const NEAR_TICKS: u64 = control_core::TICK_HZ as u64 / 10;

/// Something that happened, and where the needle was just before: after a puncture the force has already dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Happening {
    /// What happened.
    pub event: Event,
    /// The last pose before its tick, where there was one lately.
    pub before: Option<Pose>,
}

impl Happening {
    /// Takes a pose that is nearer before it than the one it has.
    pub(super) fn learn(&mut self, pose: &Pose) {
        let is_near = pose.tick < self.event.tick && self.event.tick - pose.tick <= NEAR_TICKS;
        if is_near && self.before.is_none_or(|known| known.tick < pose.tick) {
            self.before = Some(*pose);
        }
    }
}

/// Whom the needle goes into, as a page shows and edits it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PatientStatus {
    /// Patients that come with the program.
    pub names: Vec<String>,
    /// The profile that counts, key by key as in its file.
    pub profile: serde_json::Value,
    /// What became of the last wish.
    pub answer: Option<PatientAnswer>,
}

/// What became of a wish for another patient.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PatientAnswer {
    /// Whether the device has taken it, whole.
    pub taken: bool,
    /// Why not, in one sentence.
    pub reason: String,
}

/// How the link is doing, in totals since the session began.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LinkStatus {
    /// Whether the device has answered lately.
    pub connected: bool,
    /// Frames that arrived whole.
    pub frames: u64,
    /// Frames whose number is missing.
    pub lost_frames: u64,
    /// Samples that arrived.
    pub samples: u64,
    /// Samples that did not.
    pub lost_samples: u64,
    /// Pieces between frames that were none.
    pub garbage: u64,
    /// The recording in progress.
    pub recording: Option<RecordingStatus>,
    /// What a person should know: why there is no connection, why a command was refused, why recording ended.
    pub notice: Option<String>,
    /// Where a recording that is played stands.
    pub replay: Option<ReplayStatus>,
    /// The share of the device's compensation in force, 0 to 1; none where it compensates nothing.
    pub compensation: Option<f64>,
}

/// Where a recording that is played stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ReplayStatus {
    /// Time into the recording, s.
    pub at_s: f64,
    /// How long it is, s.
    pub length_s: f64,
    /// Whether it goes on by itself.
    pub playing: bool,
    /// How often it has jumped: what a page has drawn of another place is no longer true.
    pub jumps: u64,
}

/// A recording in progress.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingStatus {
    /// The file.
    pub file: String,
    /// Bytes written so far.
    pub bytes: u64,
}

/// All that arrived since the last drain.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// What is simulated, where that has changed (a subscriber's first batch says it too).
    pub scene: Option<Scene>,
    /// The patient, where anything about it has changed.
    pub patient: Option<PatientStatus>,
    /// The goal that insertions are judged by, where it has changed.
    pub practice: Option<serde_json::Value>,
    /// Insertions that have ended, each with its verdict (a subscriber's first batch repeats all).
    pub attempts: Vec<serde_json::Value>,
    /// The latest hello, where there was one (a subscriber's first batch repeats it).
    pub hello: Option<Hello>,
    /// Samples with their tick, 10 kHz.
    pub samples: Vec<(u64, Sample)>,
    /// Poses, 1 kHz.
    pub poses: Vec<Pose>,
    /// Events (a subscriber's first batch repeats the last 256).
    pub events: Vec<Happening>,
    /// The latest times of the stages, where there were any.
    pub timing: Option<Timing>,
    /// How the link is doing now.
    pub link: LinkStatus,
    /// Samples that this subscriber was too slow for.
    pub skipped_samples: u64,
}

/// Another patient.
#[derive(Clone, Debug, PartialEq)]
pub enum PatientWish {
    /// One that comes with the program.
    Named(String),
    /// An edited profile, key by key as in a profile's file.
    Edited(serde_json::Value),
}

/// What a person may ask.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// Power up; torque fades in, a latched fault is cleared.
    Start,
    /// Torque off.
    Stop,
    /// The needle is at depth 0 now; only while torque is off.
    Zero,
    /// The simulated hand goes to this depth in mm; the force decides how far the needle follows.
    Drag {
        /// Depth past the zero in mm.
        depth_mm: f64,
    },
    /// The simulated hand stays where it is.
    Release,
    /// The simulated hand follows its procedure again, from the beginning.
    Script,
    /// Inclination of the simulated device below the horizontal.
    Tilt {
        /// In rad.
        rad: f64,
    },
    /// The needle goes into somebody else from now on; torque is off meanwhile.
    Patient(PatientWish),
    /// So much of the device's compensation is in force from now on, torque on or off.
    Compensate {
        /// Share of the stored gains, 0 to 1.
        share: f64,
    },
    /// What happens is recorded from now on, in a new file of this name.
    Record {
        /// Name without folder and ending.
        name: String,
    },
    /// The recording ends.
    EndRecording,
    /// A recording goes on from here, or stays here where it is paused.
    Seek {
        /// Time into the recording, s.
        at_s: f64,
    },
}
