//! A running device (virtual, serial or a replayed recording) as whoever looks at it sees it: what
//! arrives, in batches, and the few things a person may ask. Nothing here touches bytes, the plant
//! or the disk.

mod control;
mod messages;
mod scene;
#[cfg(test)]
mod tests;

pub use control::{Control, Hand};
pub use messages::{
    Batch, Happening, LinkStatus, PatientAnswer, PatientStatus, ProbeView, RecordingStatus, ReplayStatus,
    TaskDone,
};
pub(crate) use scene::vessel_name;
pub use scene::{
    Scene, SceneBeside, SceneBody, SceneLayer, SceneNeedle, SceneOutline, SceneVessel, Source, state_name,
    tissue_name,
};

use control_core::controller::Sample;
use link::frames::{DeviceFrame, Event, Hello, Pose, Timing};
use serde_json::Value;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak, mpsc};

/// Samples that wait for a slow subscriber: 2 s.
const WAITING_SAMPLES: usize = 20_000;
/// Poses that wait for a slow subscriber: 2 s.
const WAITING_POSES: usize = 2_000;
/// The number of events that are kept for a slow subscriber, and that a new one receives.
const WAITING_EVENTS: usize = 256;

/// A running device as the visualizer sees it. Cheap to clone.
#[derive(Clone)]
pub struct Session {
    hub: Arc<Hub>,
}

/// One looker's place in the stream; dropped, it is forgotten.
pub struct Subscription {
    buffer: Arc<Mutex<Buffer>>,
    hub: Arc<Hub>,
}

/// The other end: whoever runs the device publishes and takes controls here.
pub struct Publisher {
    hub: Arc<Hub>,
    controls: mpsc::Receiver<Control>,
}

struct Hub {
    scene: Mutex<Scene>,
    state: Mutex<HubState>,
    controls: mpsc::Sender<Control>,
}

#[derive(Default)]
struct HubState {
    subscribers: Vec<Weak<Mutex<Buffer>>>,
    hello: Option<Hello>,
    probe: Option<ProbeView>,
    needle: Option<[f64; 2]>,
    timing: Option<Timing>,
    last_pose: Option<Pose>,
    events: VecDeque<Happening>,
    tasks: VecDeque<TaskDone>,
    link: LinkStatus,
    jumps: u64,
    patient: Option<PatientStatus>,
    practice: Option<Value>,
    attempts: Vec<Value>,
}

#[derive(Default)]
struct Buffer {
    scene: Option<Scene>,
    patient: Option<PatientStatus>,
    practice: Option<Value>,
    attempts: Vec<Value>,
    hello: Option<Hello>,
    samples: VecDeque<(u64, Sample)>,
    poses: VecDeque<Pose>,
    events: VecDeque<Happening>,
    tasks: VecDeque<TaskDone>,
    probe: Option<ProbeView>,
    needle: Option<[f64; 2]>,
    timing: Option<Timing>,
    skipped_samples: u64,
    jumps: u64,
}

/// A session and the end that feeds it.
pub fn open(scene: Scene) -> (Session, Publisher) {
    let (sender, receiver) = mpsc::channel();
    let hub = Arc::new(Hub { scene: Mutex::new(scene), state: Mutex::default(), controls: sender });
    (Session { hub: hub.clone() }, Publisher { hub, controls: receiver })
}

/// A looker that panicked must not take the device with it: its data is still whole.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Appends, dropping the oldest beyond `limit`; returns how many were dropped. A jump may have left
/// more than `limit` waiting, which then stays that long until it is read.
fn append<T: Clone>(queue: &mut VecDeque<T>, new: &[T], limit: usize) -> u64 {
    let limit = limit.max(queue.len());
    queue.extend(new.iter().cloned());
    let excess = queue.len().saturating_sub(limit);
    queue.drain(..excess);
    excess as u64
}

/// Tells the events after `pose` of it.
fn teach(events: &mut VecDeque<Happening>, pose: &Pose) {
    events.iter_mut().rev().take_while(|h| h.event.tick > pose.tick).for_each(|h| h.learn(pose));
}

impl Session {
    /// Adds a subscriber, which receives the last hello and the last events at once. Their number
    /// is not limited.
    pub fn subscribe(&self) -> Subscription {
        let mut state = lock(&self.hub.state);
        let buffer = Arc::new(Mutex::new(Buffer {
            scene: Some(lock(&self.hub.scene).clone()),
            patient: state.patient.clone(),
            practice: state.practice.clone(),
            attempts: state.attempts.clone(),
            hello: state.hello.clone(),
            probe: state.probe,
            needle: state.needle,
            timing: state.timing,
            events: state.events.clone(),
            tasks: state.tasks.clone(),
            jumps: state.jumps,
            ..Buffer::default()
        }));
        state.subscribers.push(Arc::downgrade(&buffer));
        Subscription { buffer, hub: self.hub.clone() }
    }

    /// Asks for something; never blocks. What the device refuses is said in [`LinkStatus::notice`].
    pub fn control(&self, control: Control) {
        // Where the device's side is gone there is nobody to ask.
        let _ = self.hub.controls.send(control);
    }

    /// Returns the scene for a picture before anything moves.
    pub fn scene(&self) -> Scene {
        lock(&self.hub.scene).clone()
    }
}

impl Subscription {
    /// All since the last drain; never blocks for long. A slow looker loses the oldest, and the
    /// loss is counted.
    pub fn drain(&mut self) -> Batch {
        let taken = {
            let mut buffer = lock(&self.buffer);
            let Buffer { jumps, skipped_samples, .. } = *buffer;
            std::mem::replace(&mut *buffer, Buffer { jumps, skipped_samples, ..Buffer::default() })
        };
        let mut link = lock(&self.hub.state).link.clone();
        // With the samples of the new place, not with the last ones of the old.
        link.replay.iter_mut().for_each(|replay| replay.jumps = taken.jumps);
        link.skipped_samples = taken.skipped_samples;
        Batch {
            scene: taken.scene,
            patient: taken.patient,
            practice: taken.practice,
            attempts: taken.attempts,
            hello: taken.hello,
            samples: taken.samples.into(),
            poses: taken.poses.into(),
            events: taken.events.into(),
            tasks: taken.tasks.into(),
            probe: taken.probe,
            needle: taken.needle,
            timing: taken.timing,
            link,
        }
    }
}

impl Publisher {
    /// The next thing that a person asked for.
    pub fn next_control(&self) -> Option<Control> {
        self.controls.try_recv().ok()
    }

    /// Publishes a frame of the device. Its answers and its configuration are not published.
    pub fn frame(&self, frame: &DeviceFrame) {
        match frame {
            DeviceFrame::Hello(hello) => self.hello(hello),
            DeviceFrame::Samples(block) => self.samples(block.first_tick, &block.samples),
            DeviceFrame::Pose(pose) => self.pose(*pose),
            DeviceFrame::Event(event) => self.event(*event),
            DeviceFrame::Timing(timing) => self.timing(*timing),
            DeviceFrame::Ack(_) | DeviceFrame::Device(_) | DeviceFrame::Crash(_) => {}
        }
    }

    /// Samples, the first of them at `first_tick`, the others following without a gap.
    pub fn samples(&self, first_tick: u64, samples: &[Sample]) {
        let numbered: Vec<_> = (first_tick..).zip(samples.iter().copied()).collect();
        self.each(|buffer| {
            buffer.skipped_samples += append(&mut buffer.samples, &numbered, WAITING_SAMPLES);
        });
    }

    /// A pose. An event overtakes the poses of its own millisecond: the last ones may still learn
    /// from it.
    pub fn pose(&self, pose: Pose) {
        {
            let mut state = lock(&self.hub.state);
            state.last_pose = Some(pose);
            teach(&mut state.events, &pose);
        }
        self.each(|buffer| {
            append(&mut buffer.poses, &[pose], WAITING_POSES);
            teach(&mut buffer.events, &pose);
        });
    }

    /// An event.
    pub fn event(&self, event: Event) {
        let mut happening = Happening { event, before: None };
        {
            let mut state = lock(&self.hub.state);
            state.last_pose.iter().for_each(|pose| happening.learn(pose));
            append(&mut state.events, &[happening], WAITING_EVENTS);
        }
        self.each(|buffer| {
            append(&mut buffer.events, &[happening], WAITING_EVENTS);
        });
    }

    /// A hello: who speaks from now on.
    pub fn hello(&self, hello: &Hello) {
        lock(&self.hub.state).hello = Some(hello.clone());
        self.each(|buffer| buffer.hello = Some(hello.clone()));
    }

    /// Time has jumped: what waits for lookers, and what happened, is that of another place; this
    /// comes instead, however long.
    pub fn jump(&self, samples: &[(u64, Sample)], poses: &[Pose], events: &[Event]) {
        let mut happenings: VecDeque<_> =
            events.iter().map(|event| Happening { event: *event, before: None }).collect();
        poses.iter().for_each(|pose| teach(&mut happenings, pose));
        {
            let mut state = lock(&self.hub.state);
            state.events = happenings.clone();
            state.tasks.clear();
            state.last_pose = poses.last().copied();
            state.jumps += 1;
        }
        self.each(|buffer| {
            buffer.jumps += 1;
            buffer.samples = samples.iter().copied().collect();
            buffer.poses = poses.iter().copied().collect();
            buffer.events = happenings.clone();
            buffer.tasks.clear();
        });
    }

    /// Another tissue is simulated from now on: what happened to the old one is no longer shown.
    pub fn scene(&self, scene: &Scene) {
        *lock(&self.hub.scene) = scene.clone();
        {
            let mut state = lock(&self.hub.state);
            state.events.clear();
            state.tasks.clear();
        }
        self.each(|buffer| {
            buffer.scene = Some(scene.clone());
            buffer.events.clear();
            buffer.tasks.clear();
        });
    }

    /// Whom the needle goes into, and the answer to the last request.
    pub fn patient(&self, patient: &PatientStatus) {
        lock(&self.hub.state).patient = Some(patient.clone());
        self.each(|buffer| buffer.patient = Some(patient.clone()));
    }

    /// Sets the practised goal that insertions are judged by, as JSON.
    pub fn practice(&self, practice: &Value) {
        lock(&self.hub.state).practice = Some(practice.clone());
        self.each(|buffer| buffer.practice = Some(practice.clone()));
    }

    /// Publishes an insertion that has ended, with its verdict, as JSON. A new subscriber receives
    /// all of them.
    pub fn attempt(&self, attempt: &Value) {
        lock(&self.hub.state).attempts.push(attempt.clone());
        self.each(|buffer| buffer.attempts.push(attempt.clone()));
    }

    /// A task that was done.
    pub fn task(&self, task: &TaskDone) {
        append(&mut lock(&self.hub.state).tasks, std::slice::from_ref(task), WAITING_EVENTS);
        self.each(|buffer| {
            append(&mut buffer.tasks, std::slice::from_ref(task), WAITING_EVENTS);
        });
    }

    /// The place of the ultrasound probe, as a page shows it.
    pub fn probe(&self, view: ProbeView) {
        lock(&self.hub.state).probe = Some(view);
        self.each(|buffer| buffer.probe = Some(view));
    }

    /// The place at which the needle's line has depth 0, mm along the skin and below it.
    pub fn needle(&self, origin_mm: [f64; 2]) {
        if lock(&self.hub.state).needle.replace(origin_mm) != Some(origin_mm) {
            self.each(|buffer| buffer.needle = Some(origin_mm));
        }
    }

    /// Times of the stages.
    pub fn timing(&self, timing: Timing) {
        lock(&self.hub.state).timing = Some(timing);
        self.each(|buffer| buffer.timing = Some(timing));
    }

    /// Changes the state of the link.
    pub fn link(&self, change: impl FnOnce(&mut LinkStatus)) {
        change(&mut lock(&self.hub.state).link);
    }

    fn each(&self, mut act: impl FnMut(&mut Buffer)) {
        lock(&self.hub.state).subscribers.retain(|subscriber| {
            subscriber.upgrade().is_some_and(|buffer| {
                act(&mut lock(&buffer));
                true
            })
        });
    }
}
