//! A recording in the visualizer, at the pace at which it happened.

use crate::recording::messages::Message;
use crate::recording::read::Recording;
use crate::session::{Control, Publisher};
use control_core::TICK_HZ;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long to sleep between looks at the clock.
const NAP: Duration = Duration::from_millis(5);
/// A gap in the ticks that is longer than this is skipped: 1 s.
const LONGEST_GAP: u64 = TICK_HZ as u64;

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
}

impl<'a> Replay<'a> {
    /// At the beginning.
    pub fn new(recording: &'a Recording, publisher: &'a Publisher, stop: &'a AtomicBool) -> Self {
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
        }
    }

    /// Plays until the end, or for ever where `repeat`; a person stops and starts it in the page. Samples played.
    pub fn run(mut self, repeat: bool) -> u64 {
        while !self.stop.load(Ordering::Relaxed) {
            while let Some(control) = self.publisher.next_control() {
                self.control(control);
            }
            if self.next >= self.recording.messages.len() {
                if !repeat {
                    break;
                }
                self.rewind();
            }
            if !self.paused {
                self.play_due();
            }
            self.publisher.link(|status| {
                status.connected = !self.paused;
                status.samples = self.samples;
                status.frames = self.frames;
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
            _ => {}
        }
    }

    fn rewind(&mut self) {
        self.next = 0;
        self.last_tick = None;
    }

    fn rebase(&mut self, tick: u64) {
        self.begun = Instant::now();
        self.zero_tick = tick;
    }

    fn play_due(&mut self) {
        while let Some(message) = self.recording.messages.get(self.next) {
            if let Some(tick) = message.tick() {
                let jumped =
                    self.last_tick.is_none_or(|last| tick + LONGEST_GAP < last || tick > last + LONGEST_GAP);
                if jumped {
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

    fn publish(&mut self, message: &Message) {
        self.frames += 1;
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
            Message::Setup(_) => {}
        }
    }
}
