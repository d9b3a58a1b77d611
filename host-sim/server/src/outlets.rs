//! Everybody who wants what arrives from a device: the pages, the recording, the totals.

use crate::live_gains::LiveGains;
use device_sim::driver::Driver;
use device_sim::error::Error;
use device_sim::session::{LinkStatus, ProbeView, Publisher, RecordingStatus, TaskDone};
use link::frames::{self, DeviceFrame};
use recording::messages::{Hello, Setup};
use recording::run_stats::RunStats;
use recording::write::Recorder;
use std::time::Duration;

/// The notice for a page while there is no device.
const WAITING: &str = "no answer from the device; waiting for it";

/// Everybody who wants what arrives.
pub struct Outlets {
    /// The pages.
    pub publisher: Publisher,
    /// The recording.
    pub recorder: Option<Recorder>,
    /// The totals.
    pub stats: RunStats,
    pub(crate) gains: LiveGains,
    pub(crate) error: Option<Error>,
    /// The device's last hello, for a recording that begins later.
    hello: Option<frames::Hello>,
    /// The file of the last recording that was ended.
    recorded: Option<String>,
    /// Why there is no recording, where a person has asked for one in vain.
    complaint: Option<String>,
    /// The name of the person at the device, as a page says it.
    pub(crate) trainee: Option<String>,
    /// Tick after the newest sample.
    tick: u64,
}

impl Outlets {
    /// Nothing has arrived yet.
    pub fn new(publisher: Publisher, recorder: Option<Recorder>, stats: RunStats) -> Self {
        Self {
            publisher,
            recorder,
            stats,
            gains: LiveGains::default(),
            error: None,
            hello: None,
            recorded: None,
            complaint: None,
            trainee: None,
            tick: 0,
        }
    }

    pub(crate) fn frame(&mut self, frame: &DeviceFrame) {
        if self.stats.is_full() {
            return;
        }
        if let Err(error) = self.deliver(frame) {
            // The rest of the run must not write on: the file ends where the disk did.
            self.recorder = None;
            self.error = Some(error);
        }
    }

    fn deliver(&mut self, frame: &DeviceFrame) -> Result<(), Error> {
        match frame {
            DeviceFrame::Hello(hello) => {
                self.stats.hello(Hello::from(hello));
                self.hello = Some(hello.clone());
                self.publisher.frame(frame);
                self.recorder.as_mut().map_or(Ok(()), |r| r.hello(hello))
            }
            DeviceFrame::Samples(block) => {
                let taken = self.stats.samples(&block.samples);
                self.tick = block.first_tick + taken.len() as u64;
                self.publisher.samples(block.first_tick, taken);
                self.recorder.as_mut().map_or(Ok(()), |r| r.samples(block.first_tick, taken))
            }
            DeviceFrame::Pose(pose) => {
                self.publisher.frame(frame);
                self.recorder.as_mut().map_or(Ok(()), |r| r.pose(pose))
            }
            DeviceFrame::Event(event) => {
                self.stats.event(event);
                self.publisher.frame(frame);
                self.recorder.as_mut().map_or(Ok(()), |r| r.event(event))
            }
            DeviceFrame::Timing(_) | DeviceFrame::Ack(_) => {
                self.publisher.frame(frame);
                Ok(())
            }
            DeviceFrame::Device(record) => {
                self.gains.learn(&record.device);
                Ok(())
            }
            DeviceFrame::Crash(crash) => {
                eprintln!("host-sim: {crash}");
                self.complaint = Some(crash.to_string());
                Ok(())
            }
        }
    }

    /// Records from now on in a new file; one that is going on goes on.
    pub(crate) fn record(&mut self, name: &str, setup: Option<&Setup>) {
        let Some(setup) = setup.filter(|_| self.recorder.is_none()) else { return };
        let begun = Recorder::create_new(name, setup).and_then(|mut recorder| {
            self.hello.as_ref().map_or(Ok(()), |hello| recorder.hello(hello))?;
            Ok(recorder)
        });
        self.complaint = begun.as_ref().err().map(ToString::to_string);
        self.recorder = begun.ok();
    }

    /// Tells where the probe is, and writes it if a recording is going on.
    pub(crate) fn probe(&mut self, view: ProbeView) {
        self.publisher.probe(view);
        let written = self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.probe(view));
        self.written(written);
    }

    /// Tells pages and recording that a task of the procedure has been done.
    pub(crate) fn task(&mut self, name: String) {
        let task = TaskDone { tick: self.tick, name };
        self.publisher.task(&task);
        let written = self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.task(&task));
        self.written(written);
    }

    fn written(&mut self, written: Result<(), Error>) {
        if let Err(error) = written {
            self.recorder = None;
            self.error = Some(error);
        }
    }

    /// Closes the recording, which may be read from then on.
    pub(crate) fn end_recording(&mut self, driver: &Driver) {
        if let Some(recorder) = self.recorder.take() {
            let file = recorder.file().to_owned();
            self.complaint = recorder.finish(driver.counts().into()).err().map(|error| error.to_string());
            self.recorded = self.complaint.is_none().then_some(file);
        }
    }

    pub(crate) fn status(&self, driver: &Driver, now: Duration) {
        let counts = driver.counts();
        let recording =
            self.recorder.as_ref().map(|r| RecordingStatus { file: r.file().to_owned(), bytes: r.bytes() });
        let connected = driver.is_ready(now);
        let notice = driver.notice().or((!connected).then_some(WAITING)).or(self.complaint.as_deref());
        let notice = notice.map(str::to_owned);
        self.publisher.link(|status| {
            *status = LinkStatus {
                connected,
                frames: counts.frames,
                lost_frames: counts.lost_frames,
                samples: counts.samples,
                lost_samples: counts.lost_samples,
                garbage: counts.garbage,
                fault: driver.fault().map(|fault| fault.to_string()),
                recording,
                recorded: self.recorded.clone(),
                notice,
                replay: None,
                compensation: self.gains.share(),
                trainee: self.trainee.clone(),
                // Each subscription fills in its own.
                skipped_samples: 0,
            };
        });
    }
}
