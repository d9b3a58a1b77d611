//! The messages to those who watch a running device. Data only: nothing here waits or sends.

use super::Scene;
use crate::procedure::purpose::Purpose;
use control_core::controller::Sample;
use link::frames::{Event, Hello, Pose, Timing};
use serde::{Deserialize, Serialize};

/// An older pose says nothing of where the needle was at an event: 100 ms.
const NEAR_TICKS: u64 = control_core::TICK_HZ as u64 / 10;

/// Something that happened, and where the needle was just before: after a puncture the force has
/// already dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Happening {
    /// The event.
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
    /// Patients that can be chosen: those that come with the program, then those that were saved.
    pub names: Vec<String>,
    /// True if an edited patient can be saved.
    pub can_save: bool,
    /// The profile that counts, key by key as in its file.
    pub profile: serde_json::Value,
    /// The procedure's purpose.
    pub purpose: Option<Purpose>,
    /// The answer to the last request.
    pub answer: Option<PatientAnswer>,
}

/// The answer to a request for another patient.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PatientAnswer {
    /// True if the device has taken it, whole.
    pub taken: bool,
    /// The reason if it has not, or if it could not be saved, in one sentence.
    pub reason: String,
    /// The file that it was saved in, if that was asked for.
    pub saved: Option<String>,
}

/// The state of the link, in totals since the session began.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LinkStatus {
    /// True if the device has answered lately.
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
    /// The fault that the device reports, until a person clears it.
    pub fault: Option<String>,
    /// The recording in progress.
    pub recording: Option<RecordingStatus>,
    /// The file of the last recording that was ended in the page.
    pub recorded: Option<String>,
    /// A notice for a person: why there is no connection, why a command was refused, why recording
    /// ended.
    pub notice: Option<String>,
    /// The position in a recording that is played.
    pub replay: Option<ReplayStatus>,
    /// The share of the device's compensation in force, 0 to 1; none where it compensates nothing.
    pub compensation: Option<f64>,
    /// The name or pseudonym of the person at the device, where one has been given.
    pub trainee: Option<String>,
    /// The number of samples that were skipped because this receiver was too slow; they are still
    /// in the recording.
    pub skipped_samples: u64,
}

/// The position in a recording that is played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ReplayStatus {
    /// Time into the recording, s.
    pub at_s: f64,
    /// Its length, s.
    pub length_s: f64,
    /// True if it plays.
    pub playing: bool,
    /// The number of jumps: after one, a page's drawing of another place is no longer valid.
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
    /// The scene, if it has changed (and in a subscriber's first batch).
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
    /// Tasks that were done (a subscriber's first batch repeats the last 256).
    pub tasks: Vec<TaskDone>,
    /// The place at which the needle's line has depth 0, where it has moved: mm along the skin from
    /// the point of entry, and below it.
    pub needle: Option<[f64; 2]>,
    /// The place of the ultrasound probe, where it has moved.
    pub probe: Option<ProbeView>,
    /// The latest times of the stages, where there were any.
    pub timing: Option<Timing>,
    /// The present state of the link.
    pub link: LinkStatus,
}

/// The ultrasound probe on the skin and what its image shows of the needle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProbeView {
    /// Its middle along the skin from the point of entry, mm.
    pub along_mm: f64,
    /// Its middle across the needle's plane, mm.
    pub across_mm: f64,
    /// Its turn from the needle's plane, rad.
    pub azimuth_rad: f64,
    /// Its lean from the perpendicular, rad.
    pub lean_rad: f64,
    /// Share of the needle in tissue that is in the image's plane, 0 to 1.
    pub share_in_plane: f64,
    /// True if the image shows the tip.
    pub tip_seen: bool,
}

impl ProbeView {
    /// True if every number is one that a page sends.
    pub fn is_plausible(&self) -> bool {
        let Self { along_mm, across_mm, azimuth_rad, lean_rad, share_in_plane, .. } = self;
        [along_mm, across_mm].iter().all(|mm| (-200.0..=200.0).contains(*mm))
            && [azimuth_rad, lean_rad].iter().all(|rad| (-4.0..=4.0).contains(*rad))
            && (0.0..=1.0).contains(share_in_plane)
    }
}

/// A task of the procedure that was done: a button in a page, or the scripted hand.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TaskDone {
    /// Tick after the newest sample when it came.
    pub tick: u64,
    /// Its name.
    pub name: String,
}
