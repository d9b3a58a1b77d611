//! A conversation with a device that is being commissioned, one thing after the other: play this,
//! watch that, take this part.

use crate::pause::pause;
use control_core::controller::Sample;
use control_core::event::{Fault, State};
use control_core::excitation::Excitation;
use control_core::{Device, Patient, TICK_HZ};
use device_sim::driver::Driver;
use device_sim::error::Error;
use link::commissioning::Record;
use link::crash::Crash;
use link::frames::{DeviceFrame, EventKind, GuardRefusal};
use std::time::Duration;

/// A device that is there answers within this.
const TO_ANSWER: Duration = Duration::from_secs(5);

/// The actions of a hand on the roller or the device, for a line with a virtual hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Act {
    /// Nothing; nobody touches the roller.
    HandsOff,
    /// Turns the roller so many times in the direction of insertion.
    Turn(u32),
    /// Draws something through under the roller, in the direction of insertion, so many mm.
    Pull(f64),
    /// Tilts the needle to so many rad below the horizontal.
    Tilt(f64),
    /// Hangs so many g on the needle and lets them go gently within three seconds; 0 takes them
    /// off.
    Hang(f64),
}

/// A way to a device.
pub trait Line {
    /// Sends `out`, adds what has come to `into`, and says how long the line has been open.
    fn exchange(&mut self, out: &[u8], into: &mut Vec<u8>) -> Result<Duration, Error>;

    /// Makes the virtual hand act. If a person is the hand, a prompt has asked already.
    fn act(&mut self, act: Act);

    /// The newest sample of what has come.
    fn saw(&mut self, _newest: &Sample) {}

    /// Announces that the torque is taken off and the device given back what it had: that is done
    /// even after a person has stopped.
    fn restores(&mut self) {}

    /// The crash that ended the device's last run.
    fn crashed(&mut self, _crash: &Crash) {}
}

/// The conversation.
pub struct DeviceDialogue<'a> {
    line: &'a mut dyn Line,
    driver: Driver,
    now: Duration,
    bytes: Vec<u8>,
    samples: Vec<Sample>,
    record: Option<Record>,
    fault: Option<Fault>,
    not_saved: Option<String>,
    played_ticks: usize,
}

impl<'a> DeviceDialogue<'a> {
    /// Says hello and waits until the device listens.
    pub async fn open(line: &'a mut dyn Line) -> Result<Self, Error> {
        let mut driver = Driver::new(Patient::nobody());
        driver.connected(Duration::ZERO);
        let mut bench = Self {
            line,
            driver,
            now: Duration::ZERO,
            bytes: Vec::new(),
            samples: Vec::new(),
            record: None,
            fault: None,
            not_saved: None,
            played_ticks: 0,
        };
        bench.settle().await?;
        Ok(bench)
    }

    /// Waits until the device listens: while a person was asked something, the line may have fallen
    /// silent.
    pub async fn settle(&mut self) -> Result<(), Error> {
        self.exchange().await?;
        self.until("the device did not answer; check that it runs this project's firmware", |bench| {
            bench.driver.is_ready(bench.now)
        })
        .await
    }

    /// Has the device check that a brown-out reset guards its supply, and set one that is off if
    /// `set` is true.
    pub(crate) async fn guard_supply(&mut self, set: bool) -> Result<Result<(), GuardRefusal>, Error> {
        const SILENT: &str =
            "the device did not answer whether its supply is guarded; flash this program's firmware";
        self.driver.guard_supply(set);
        let end = self.now + TO_ANSWER;
        loop {
            self.exchange().await?;
            match (self.driver.take_guard(), self.driver.notice()) {
                (Some(answer), _) => return Ok(answer),
                (None, Some(why)) => return Err(Error::failed(why)),
                (None, None) if self.now > end => return Err(Error::failed(SILENT)),
                (None, None) => {}
            }
        }
    }

    /// The device's part of the configuration.
    pub async fn device(&mut self) -> Result<Device, Error> {
        Ok(self.record().await?.device)
    }

    /// The same under the device's seal.
    pub async fn record(&mut self) -> Result<Record, Error> {
        const SILENT: &str = "the device did not report its configuration; restart it";
        self.record = None;
        self.driver.report_device();
        self.until(SILENT, |bench| bench.record.is_some()).await?;
        self.record.ok_or_else(|| Error::failed(SILENT))
    }

    /// Gives the device its part and sees that it has taken and kept it.
    pub async fn configure(&mut self, device: &Device) -> Result<(), Error> {
        self.driver.configure_device(*device);
        self.becomes(device).await.map(drop)
    }

    /// Takes the torque off and gives the device its part back, even after a person has stopped.
    pub(crate) async fn restore(&mut self, device: &Device) -> Result<(), Error> {
        self.line.restores();
        self.samples.clear();
        self.driver.stop();
        let end = self.now + TO_ANSWER;
        let is_off = |sample: &Sample| [State::Idle as u8, State::Fault as u8].contains(&sample.state);
        // Once Stop is answered, the reason why an earlier command was refused is forgotten.
        while self.driver.notice().is_some() || !self.samples.last().is_some_and(is_off) {
            self.exchange().await?;
            if self.now > end {
                return Err(Error::failed("the device did not take its torque off; switch it off"));
            }
        }
        self.configure(device).await
    }

    /// Has the device, which `device` is what was found of, take itself for commissioned: it looks
    /// at what its own pulses have shown. Its record.
    pub async fn commission(&mut self, device: &Device) -> Result<Record, Error> {
        self.driver.commission();
        // The device knows itself which sensors it has.
        let sensors = self.device().await?.sensors;
        self.becomes(&Device { commissioned: true, sensors, ..*device }).await
    }

    /// Checks that what was asked for makes the device `wanted`, and that it stays so.
    async fn becomes(&mut self, wanted: &Device) -> Result<Record, Error> {
        let record = self.record().await?;
        if record.device != *wanted {
            return Err(Error::failed("the device did not accept its new configuration; restart it"));
        }
        // An erasure of the flash takes a second or two, and what becomes of it is said afterwards.
        let until = self.now + Duration::from_millis(100);
        self.until("the device stopped answering while it saved; restart it", |bench| bench.now >= until)
            .await?;
        self.not_saved.take().map_or(Ok(record), |why| Err(Error::failed(why)))
    }

    /// Tells the device where the rotor's angle is zero, in counts past the zero.
    pub async fn index(&mut self, count: i32) -> Result<(), Error> {
        self.driver.index(count);
        let until = self.now + Duration::from_millis(100);
        self.until("the device did not accept the rotor's angle; restart it", |bench| bench.now >= until)
            .await
    }

    /// Prompts the hand, and returns samples until `is_done` says so or `longest` is over.
    pub async fn watch(
        &mut self,
        act: Act,
        longest: Duration,
        is_done: impl Fn(&[Sample]) -> bool,
    ) -> Result<&[Sample], Error> {
        self.samples.clear();
        self.line.act(act);
        let end = self.now + longest;
        while self.now < end && !is_done(&self.samples) {
            self.exchange().await?;
        }
        self.line.act(Act::HandsOff);
        Ok(&self.samples)
    }

    /// Prompts the hand for what goes on while an excitation plays.
    pub(crate) fn act(&mut self, act: Act) {
        self.line.act(act);
    }

    /// Plays an excitation to its end or to a fault: the samples during which torque was on.
    pub async fn play(&mut self, excitation: &Excitation) -> Result<(Vec<Sample>, Option<Fault>), Error> {
        self.play_within(excitation, TO_ANSWER).await
    }

    /// The same where the movement may take up to `longest`.
    pub(crate) async fn play_within(
        &mut self,
        excitation: &Excitation,
        longest: Duration,
    ) -> Result<(Vec<Sample>, Option<Fault>), Error> {
        self.samples.clear();
        // The dialogue that it ended has been told of it, and goes on before the eyes of a person.
        if self.fault.take().is_some() {
            self.driver.clear();
        }
        self.driver.excite(excitation.clone());
        let is_played = |sample: &Sample| sample.state == State::Excitation as u8;
        self.until("the device did not begin to move; restart it", |bench| {
            bench.fault.is_some() || bench.samples.iter().any(is_played)
        })
        .await?;
        self.until_within(longest, "the device did not end its movement; restart it", |bench| {
            bench.fault.is_some() || bench.samples.last().is_some_and(|sample| !is_played(sample))
        })
        .await?;
        let played: Vec<Sample> = self.samples.iter().copied().filter(is_played).collect();
        self.played_ticks += played.len();
        Ok((played, self.fault))
    }

    /// The motion that has been played since the conversation began, s.
    pub(crate) fn played_s(&self) -> f64 {
        self.played_ticks as f64 / f64::from(TICK_HZ)
    }

    async fn until(&mut self, why_not: &str, is_so: impl Fn(&Self) -> bool) -> Result<(), Error> {
        self.until_within(TO_ANSWER, why_not, is_so).await
    }

    async fn until_within(
        &mut self,
        longest: Duration,
        why_not: &str,
        is_so: impl Fn(&Self) -> bool,
    ) -> Result<(), Error> {
        let end = self.now + longest;
        while !is_so(self) {
            self.exchange().await?;
            if let Some(why) = self.driver.refused().or(self.driver.notice()) {
                return Err(Error::failed(why));
            }
            if self.now > end {
                return Err(Error::failed(why_not));
            }
        }
        Ok(())
    }

    async fn exchange(&mut self) -> Result<(), Error> {
        self.bytes.clear();
        let out = self.driver.transmit(self.now).to_vec();
        self.now = self.line.exchange(&out, &mut self.bytes)?;
        let mut frames = Vec::new();
        self.driver.receive(self.now, &self.bytes, |frame| frames.push(frame.clone()));
        for frame in frames {
            match frame {
                DeviceFrame::Samples(block) => {
                    self.samples.extend(&block.samples);
                    block.samples.last().into_iter().for_each(|newest| self.line.saw(newest));
                }
                DeviceFrame::Device(record) => self.record = Some(record),
                DeviceFrame::Crash(crash) => self.line.crashed(&crash),
                DeviceFrame::Event(event) => match event.kind {
                    EventKind::Fault { cause } => self.fault = Some(cause),
                    EventKind::NotSaved { cause } => self.not_saved = Some(cause.to_string()),
                    _ => {}
                },
                _ => {}
            }
        }
        pause().await;
        Ok(())
    }
}

/// Samples of a stretch of time.
pub fn ticks(time: Duration) -> usize {
    (time.as_secs_f64() * f64::from(TICK_HZ)) as usize
}
