//! Plays one programme on whatever device answers: asks for a part of it, waits until it has been
//! played, asks for the next, and keeps every sample. The steps of a part play without a rest, as
//! one sequence that the device has taken before it begins. A fault, a refusal or a lost sample
//! ends it: a recording with a hole is no recording.

use super::following::Following;
use super::programme::{Programme, ProgrammeStep};
use super::writer::Track;
use control_core::controller::Sample;
use control_core::event::{Fault, State};
use control_core::{Config, TICK_HZ};
use device_sim::driver::Driver;
use device_sim::error::Error;
use link::frames::{DeviceFrame, EventKind, SampleBlock};
use recording::messages::Hello;
use std::time::Duration;

/// A step that has been asked for begins within this.
const TO_BEGIN: Duration = Duration::from_secs(2);
/// A device that is there answers within this.
const TO_ANSWER: Duration = Duration::from_secs(5);

/// The phase of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Waiting until the device has taken its configuration.
    Greeting { since: Duration },
    /// Part `index` has been asked for.
    Asked { index: usize, since: Duration },
    /// Part `index` is played.
    Playing { index: usize, since: Duration },
    /// All parts are done.
    Over,
}

/// Plays one programme.
pub struct Sequencer<'a> {
    driver: Driver,
    file: &'static str,
    /// Steps that play without a rest, in order.
    parts: Vec<&'a [ProgrammeStep]>,
    phase: Phase,
    now: Duration,
    hello: Option<Hello>,
    mm_per_count: f64,
    samples: Vec<Sample>,
    reference: Vec<f64>,
    following: Option<Following<'a>>,
    next_tick: Option<u64>,
    error: Option<Error>,
}

impl<'a> Sequencer<'a> {
    /// Nothing is connected yet.
    ///
    /// # Errors
    /// A sentence if `config` is unsound.
    pub fn new(config: Config, programme: &'a Programme) -> Result<Self, Error> {
        let plan = config.plan().map_err(Error::failed)?;
        let mut steps = programme.steps.as_slice();
        let parts = programme.parts(&plan).into_iter().map(|count| {
            let (part, rest) = steps.split_at(count);
            steps = rest;
            part
        });
        Ok(Self {
            parts: parts.collect(),
            driver: Driver::new(config.patient),
            file: programme.file,
            phase: Phase::Greeting { since: Duration::ZERO },
            now: Duration::ZERO,
            hello: None,
            mm_per_count: f64::NAN,
            samples: Vec::new(),
            reference: Vec::new(),
            following: None,
            next_tick: None,
            error: None,
        })
    }

    /// A connection is open.
    pub fn connected(&mut self, now: Duration) {
        self.now = now;
        self.phase = Phase::Greeting { since: now };
        self.driver.connected(now);
    }

    /// Returns the bytes to send now; calls `begins` for every step that is requested.
    pub fn transmit(&mut self, now: Duration, mut begins: impl FnMut(&ProgrammeStep)) -> &[u8] {
        self.now = now;
        match self.phase {
            Phase::Greeting { .. } if self.driver.is_ready(now) && self.hello.is_some() => {
                self.ask(0, &mut begins);
            }
            Phase::Greeting { since } if now.saturating_sub(since) > TO_ANSWER => {
                self.fail("the device did not answer; check that it runs this project's firmware");
            }
            Phase::Asked { index, since } if now.saturating_sub(since) > TO_BEGIN => {
                let step: usize = self.parts[..index].iter().map(|part| part.len()).sum();
                self.fail(format_args!("the device did not begin step {}; restart it", step + 1));
            }
            _ => {}
        }
        if let Some(refused) = self.driver.refused().map(str::to_owned) {
            self.fail(refused);
        }
        if let Phase::Playing { index, .. } = self.phase
            && self.samples.last().is_some_and(|s| s.state == State::Idle as u8)
        {
            if index + 1 < self.parts.len() {
                self.ask(index + 1, &mut begins);
            } else {
                self.phase = Phase::Over;
            }
        }
        self.driver.transmit(now)
    }

    /// Torque off now; what to send for it.
    pub fn stop(&mut self, now: Duration) -> &[u8] {
        self.driver.stop();
        self.driver.transmit(now)
    }

    /// Takes bytes.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        let mut frames = Vec::new();
        self.driver.receive(now, bytes, |frame| frames.push(frame.clone()));
        for frame in frames {
            self.frame(&frame);
        }
    }

    /// The first step of the part that is played, and since when.
    pub fn playing(&self) -> Option<(&ProgrammeStep, Duration)> {
        match self.phase {
            Phase::Playing { index, since } => Some((self.parts[index].first()?, since)),
            _ => None,
        }
    }

    /// Seconds recorded.
    pub(crate) fn played_s(&self) -> f64 {
        self.samples.len() as f64 / f64::from(TICK_HZ)
    }

    /// True if there is nothing left to do.
    pub fn is_over(&self) -> bool {
        self.phase == Phase::Over || self.error.is_some()
    }

    /// Returns the recording, or the error that prevented it.
    pub fn finish(self) -> Result<Track, Error> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let Some(hello) = self.hello else {
            return Err(Error::failed("the device did not identify itself; restart it"));
        };
        Ok(Track { file: self.file, hello, samples: self.samples, reference: self.reference })
    }

    fn ask(&mut self, index: usize, begins: &mut impl FnMut(&ProgrammeStep)) {
        let part = self.parts[index];
        part.iter().for_each(begins);
        match part {
            [step] => self.driver.excite(step.excitation.clone()),
            _ => self.driver.play(part.iter().map(|step| step.excitation.clone()).collect()),
        }
        self.phase = Phase::Asked { index, since: self.now };
    }

    fn fail(&mut self, why: impl std::fmt::Display) {
        self.error.get_or_insert_with(|| Error::failed(why));
    }

    fn frame(&mut self, frame: &DeviceFrame) {
        match frame {
            DeviceFrame::Hello(hello) => {
                self.mm_per_count = hello.mm_per_count.to_num();
                self.hello = Some(Hello::from(hello));
            }
            DeviceFrame::Samples(block) => self.block(block),
            DeviceFrame::Crash(crash) => eprintln!("host-sim: {crash}"),
            DeviceFrame::Event(event) => {
                if let EventKind::Fault { cause } = event.kind {
                    self.fault(cause);
                }
            }
            _ => {}
        }
    }

    fn fault(&mut self, cause: Fault) {
        self.fail(format_args!("{cause}; see that nothing holds the roller and characterise again"));
    }

    fn block(&mut self, block: &SampleBlock) {
        let recording = matches!(self.phase, Phase::Asked { .. } | Phase::Playing { .. });
        if recording && self.next_tick.is_some_and(|next| next != block.first_tick) {
            self.fail("samples were lost on the way; close other programs and characterise again");
        }
        self.next_tick = Some(block.first_tick + block.samples.len() as u64);
        for sample in &block.samples {
            self.sample(sample);
        }
    }

    fn sample(&mut self, sample: &Sample) {
        let is_played = sample.state == State::Excitation as u8;
        if let (true, Phase::Asked { index, .. }) = (is_played, self.phase) {
            self.phase = Phase::Playing { index, since: self.now };
            // It begins where the motor was one tick earlier.
            let begin = self.samples.last().map_or(sample.count, |last| last.count);
            self.following = Following::new(self.parts[index], f64::from(begin), self.mm_per_count);
        }
        if !is_played {
            self.following = None;
        }
        if self.phase == Phase::Over || (self.samples.is_empty() && !is_played) {
            return;
        }
        let reference = match &mut self.following {
            Some(following) => following.tick(sample.count),
            // Between two parts torque is off and nothing is followed.
            None => self.reference.last().copied().unwrap_or(f64::from(sample.count)),
        };
        self.samples.push(*sample);
        self.reference.push(reference);
    }
}
