//! A recording in the visualizer, at the pace at which it happened, and from any place of it that a
//! person chooses.

use control_core::TICK_HZ;
use device_sim::needle::NeedleTrack;
use device_sim::session::{Control, Publisher, ReplayStatus};
use recording::messages::{Message, Setup};
use recording::read::Recording;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The sleep between looks at the clock.
const NAP: Duration = Duration::from_millis(5);
/// A gap in the ticks that is longer than this is skipped: 1 s.
const LONGEST_GAP: u64 = TICK_HZ as u64;
/// After a jump a viewer receives this much of what came before: the length of the plots, 10 s.
const TOLD_TICKS: u64 = 10 * TICK_HZ as u64;
/// Events of longer ago are in nobody's list.
const TOLD_EVENTS: usize = 80;

/// Plays a recording to whoever looks.
pub struct Replay<'a> {
    recording: &'a Recording,
    publisher: &'a Publisher,
    /// Set from outside (Ctrl-C) to end.
    stop: &'a AtomicBool,
    paused: bool,
    next: usize,
    /// Ticks that have been played since `begun`, which pauses push on.
    begun: Instant,
    zero_tick: u64,
    last_tick: Option<u64>,
    samples: u64,
    frames: u64,
    /// Time of every message into the recording, in ticks, gaps and new beginnings left out; and
    /// all of it.
    times: Vec<u64>,
    length: u64,
    /// The needle in the patient of the recording, if that is known.
    track: Option<NeedleTrack>,
}

impl<'a> Replay<'a> {
    /// At the beginning.
    pub fn new(recording: &'a Recording, publisher: &'a Publisher, stop: &'a AtomicBool) -> Self {
        let (times, length) = times(&recording.messages);
        Self {
            recording,
            publisher,
            stop,
            paused: false,
            next: 0,
            begun: Instant::now(),
            zero_tick: 0,
            last_tick: None,
            samples: 0,
            frames: 0,
            times,
            length,
            track: track(recording, &recording.setup),
        }
    }

    /// Plays until the end, or for ever where `repeat`; a person stops, starts and moves it in the
    /// page. Samples played.
    pub fn run(mut self, repeat: bool) -> u64 {
        while !self.stop.load(Ordering::Relaxed) {
            while let Some(control) = self.publisher.next_control() {
                self.control(control);
            }
            if self.next >= self.recording.messages.len() && !self.paused {
                if !repeat {
                    break;
                }
                self.rewind();
            }
            if !self.paused {
                self.play_due();
            }
            let replay = ReplayStatus {
                at_s: seconds(self.times.get(self.next).copied().unwrap_or(self.length)),
                length_s: seconds(self.length),
                playing: !self.paused,
                jumps: 0,
            };
            self.publisher.link(|status| {
                status.connected = true;
                status.samples = self.samples;
                status.frames = self.frames;
                status.replay = Some(replay);
            });
            std::thread::sleep(NAP);
        }
        self.samples
    }

    fn control(&mut self, control: Control) {
        match control {
            Control::Stop if !self.paused => self.paused = true,
            Control::Start if self.paused => {
                self.paused = false;
                // Time stood still meanwhile.
                if let Some(tick) = self.last_tick {
                    self.rebase(tick);
                }
            }
            Control::Seek { at_s } if at_s.is_finite() => self.seek(at_s),
            _ => {}
        }
    }

    fn rewind(&mut self) {
        self.next = 0;
        self.track = track(self.recording, &self.recording.setup);
        self.last_tick = None;
    }

    fn rebase(&mut self, tick: u64) {
        self.begun = Instant::now();
        self.zero_tick = tick;
    }

    /// Goes on from `at_s` into the recording; a viewer forgets what was shown and receives what
    /// came before.
    fn seek(&mut self, at_s: f64) {
        let wanted = (at_s.max(0.0) * f64::from(TICK_HZ)) as u64;
        self.next = self.times.partition_point(|time| *time < wanted);
        self.last_tick = None;
        let first = self.times.partition_point(|time| time + TOLD_TICKS < wanted);
        let (mut samples, mut poses, mut hello) = (Vec::new(), Vec::new(), None);
        for message in &self.recording.messages[first..self.next] {
            match message {
                Message::Samples(block) => samples.extend(block.rows()),
                Message::Pose(pose) => poses.push(pose.to_frame()),
                Message::Event(_)
                | Message::Link(_)
                | Message::Setup(_)
                | Message::Hello(_)
                | Message::Probe(_)
                | Message::Task(_) => {}
            }
        }
        let mut events = Vec::new();
        self.track = track(self.recording, &self.recording.setup);
        for message in &self.recording.messages[..self.next] {
            self.follow(message);
            match message {
                Message::Hello(said) => hello = Some(said),
                Message::Event(event) => events.push(*event),
                _ => {}
            }
        }
        let latest = events.len().saturating_sub(TOLD_EVENTS);
        hello.iter().for_each(|hello| self.publisher.hello(&hello.to_frame()));
        self.publisher.jump(&samples, &poses, &events[latest..]);
    }

    fn play_due(&mut self) {
        while let Some(message) = self.recording.messages.get(self.next) {
            if let Some(tick) = message.tick() {
                if self.last_tick.is_none_or(|last| is_jump(last, tick)) {
                    self.rebase(tick);
                }
                let due = Duration::from_micros(tick.saturating_sub(self.zero_tick) * 100);
                if self.begun.elapsed() < due {
                    return;
                }
                self.last_tick = Some(tick);
            }
            self.next += 1;
            self.publish(message);
        }
    }

    /// Follows the needle.
    fn follow(&mut self, message: &Message) {
        match (message, &mut self.track) {
            (Message::Setup(setup), _) => self.track = track(self.recording, setup),
            (Message::Pose(pose), Some(track)) => {
                let pose = pose.to_frame();
                track.move_to(pose.depth.0.to_num(), f64::from(pose.angle.0) * 1e-3);
            }
            (Message::Event(event), Some(track)) => track.happen(&event.kind),
            _ => {}
        }
    }

    fn publish(&mut self, message: &Message) {
        self.frames += 1;
        self.follow(message);
        self.track.iter().for_each(|track| self.publisher.needle(track.origin_mm()));
        match message {
            Message::Hello(hello) => self.publisher.hello(&hello.to_frame()),
            Message::Samples(block) => {
                let samples: Vec<_> = block.rows().map(|row| row.1).collect();
                self.samples += samples.len() as u64;
                self.publisher.samples(block.first_tick, &samples);
            }
            Message::Pose(pose) => self.publisher.pose(pose.to_frame()),
            Message::Event(event) => self.publisher.event(*event),
            Message::Link(link) => self.publisher.link(|status| {
                status.lost_frames = link.lost_frames;
                status.lost_samples = link.lost_samples;
                status.garbage = link.garbage;
            }),
            Message::Task(task) => self.publisher.task(task),
            Message::Setup(_) | Message::Probe(_) => {}
        }
    }
}

/// Returns a needle outside the patient of `setup`.
fn track(recording: &Recording, setup: &Setup) -> Option<NeedleTrack> {
    recording.profile_of(setup).ok().map(|profile| NeedleTrack::new(&profile))
}

/// True if the device restarted, or was silent for too long to wait for.
fn is_jump(last: u64, tick: u64) -> bool {
    tick + LONGEST_GAP < last || tick > last + LONGEST_GAP
}

fn seconds(ticks: u64) -> f64 {
    ticks as f64 / f64::from(TICK_HZ)
}

/// Returns the tick from the beginning at which each message is played, never falling, and the
/// whole length.
fn times(messages: &[Message]) -> (Vec<u64>, u64) {
    let (mut now, mut last) = (0, None);
    let times = messages
        .iter()
        .map(|message| {
            if let Some(tick) = message.tick() {
                now += match last {
                    Some(last) if !is_jump(last, tick) => tick.saturating_sub(last),
                    _ => 0,
                };
                last = Some(last.filter(|last| !is_jump(*last, tick)).map_or(tick, |last| tick.max(last)));
            }
            now
        })
        .collect();
    (times, now)
}

#[cfg(test)]
mod tests {
    use super::*;
    use device_sim::session;
    use link::frames::{Event, EventKind};
    use recording::messages::{Pose, Samples, Setup};
    use serde_json::json;

    fn from_json<T: serde::de::DeserializeOwned>(json: serde_json::Value) -> T {
        serde_json::from_value(json).expect("recordings hold it like this")
    }

    /// A second of poses and blocks from tick 5,000 on with an event in the middle; then the device
    /// begins anew.
    fn recording() -> Recording {
        let setup: Setup = from_json(json!({
            "program": "", "source": "virtual", "profile_toml": "", "profile_origin": "", "procedure": null
        }));
        let second = |from: u64| {
            (0..1_000_u64).flat_map(move |ms| {
                let tick = from + ms * 10;
                let pose: Pose = from_json(json!({
                    "tick": tick, "depth_mm": ms as f64 * 0.01, "speed_mm_s": 10.0, "force_n": 0.0, "tilt_mrad": 500,
                    "state": 1, "limits": 0
                }));
                let block = Samples {
                    first_tick: tick,
                    count: vec![ms as i32; 10],
                    dac: vec![2048; 10],
                    state: vec![1; 10],
                    tilt_mrad: vec![500; 10],
                };
                let event = Event { tick, kind: EventKind::Puncture { layer: 0 } };
                let told = (ms == 500).then_some(Message::Event(event));
                [Message::Pose(pose), Message::Samples(block)].into_iter().chain(told)
            })
        };
        let messages = second(5_000).chain(second(0)).collect();
        Recording { file: "a.mcap".into(), setup, messages, cut: None, begun_ns: 0 }
    }

    #[test]
    fn time_runs_on_over_a_device_that_begins_anew() {
        let (times, length) = times(&recording().messages);
        assert!(times.is_sorted());
        assert_eq!(length, 2 * 9_990, "two seconds but for the last millisecond of each");
    }

    #[test]
    fn a_jump_shows_only_that_place_and_what_came_before() {
        let recording = recording();
        let (session, publisher) = session::open(crate::visualizer::test_scene());
        let mut looker = session.subscribe();
        let stop = AtomicBool::new(false);
        let mut replay = Replay::new(&recording, &publisher, &stop);
        replay.paused = true;
        replay.seek(0.7);
        let batch = looker.drain();
        assert!((batch.poses.last().expect("poses").depth.0.to_num::<f64>() - 7.0).abs() < 0.03);
        assert_eq!(batch.samples.len(), 7_000, "as much as there was before, at 10 kHz");
        assert_eq!(batch.link.skipped_samples, 0);
        assert_eq!(batch.events.len(), 1);
        assert!(batch.events[0].before.is_some(), "with the pose before the drop");
        // Back before the event: it has not happened.
        replay.seek(0.2);
        let batch = looker.drain();
        assert!(batch.events.is_empty() && batch.samples.len() == 2_000);
        assert!(session.subscribe().drain().events.is_empty(), "for a new looker neither");
        // Beyond the end: the end.
        replay.seek(1e6);
        assert_eq!(replay.next, recording.messages.len());
    }
}
