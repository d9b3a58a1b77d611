//! Joins the two ends: a driver that talks to the device, and everybody who wants what arrives
//! (pages, the recording, the totals). In step with a simulated device, or in real time over a wire
//! that may be pulled and come back.

use crate::outlets::Outlets;
use crate::patient_manager::PatientManager;
use crate::realtime_clock::RealtimeClock;
use control_core::Patient;
use device_sim::device::virtual_device::VirtualDevice;
use device_sim::device::{Port, Wire};
use device_sim::driver::Driver;
use device_sim::error::Error;
use device_sim::lockstep;
use device_sim::needle::LineSender;
use device_sim::profile::Profile;
use device_sim::session::{Control, PatientAnswer, Subscription};
use link::frames::DeviceFrame;
use recording::run_stats::RunStats;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use training::practice::Practice;

/// A port that could not be opened is tried again after this.
const RETRY: Duration = Duration::from_millis(300);
/// The longest single wait for the device: short enough for heartbeats and a quick answer to a
/// person.
const PATIENCE: Duration = Duration::from_millis(2);
/// A device that has never become ready after this is not one.
const FIRST_ANSWER: Duration = Duration::from_secs(5);
/// The extra time for a run with gaps in it.
const GRACE: Duration = Duration::from_secs(3);

/// A run in progress.
pub struct RunLoop<'a> {
    driver: Driver,
    outlets: Outlets,
    /// Set from outside (Ctrl-C) to end the run in good order.
    stop: &'a AtomicBool,
    was_ready: bool,
    /// True if this device has been asked for its configuration since it was connected.
    has_asked: bool,
    /// Only a person starts the device, in the page: asked for, or because a person has stopped it.
    person_starts: bool,
    /// The tip is at depth 0 when it is started for the first time.
    zeroes_first: bool,
    /// The person who started the program has seen the fault that the device reports.
    clears_first: bool,
    /// The patient, if it may be changed.
    patients: Option<PatientManager>,
    /// The practice that judges insertions while somebody looks.
    practice: Option<Practice>,
    /// The needle in its patient, if that is known.
    needle: Option<LineSender>,
}

/// The totals of a run.
pub struct RunOutcome {
    /// Totals of the link.
    pub link: link::host::Counts,
    /// Totals of what happened.
    pub stats: RunStats,
    /// Size of the recording, where there was one.
    pub recorded_bytes: Option<u64>,
}

impl<'a> RunLoop<'a> {
    /// Not connected yet.
    pub fn new(driver: Driver, outlets: Outlets, stop: &'a AtomicBool) -> Self {
        Self {
            driver,
            outlets,
            stop,
            was_ready: false,
            has_asked: false,
            person_starts: false,
            zeroes_first: false,
            clears_first: false,
            patients: None,
            practice: None,
            needle: None,
        }
    }

    /// The torque stays off until a person asks for it in the page.
    pub fn wait_for_a_person(mut self) -> Self {
        self.person_starts = true;
        self
    }

    /// Depth 0 is where the needle is when the device is started for the first time.
    pub fn zeroing_first(mut self) -> Self {
        self.zeroes_first = true;
        self
    }

    /// The person who asks for the run has seen the fault that the device reports.
    pub fn clearing_first(mut self) -> Self {
        self.clears_first = true;
        self
    }

    /// A person may change the patient in the page.
    pub fn with_patients(self, patients: PatientManager) -> Self {
        let mut following = self.following(patients.profile());
        following.outlets.publisher.patient(&patients.status(None));
        following.patients = Some(patients);
        following
    }

    /// The device is told where a needle that turns in this patient meets its layers.
    pub fn following(mut self, profile: &Profile) -> Self {
        self.needle = Some(LineSender::new(profile));
        self
    }

    /// Insertions are judged while somebody looks. A person holds the needle of a real device.
    pub fn with_practice(mut self, subscription: Subscription, is_real: bool) -> Self {
        self.practice = self.patients.as_ref().map(|patients| {
            let purpose = patients.setup().purpose;
            Practice::new(subscription, patients.profile(), purpose, is_real)
        });
        self
    }

    /// Runs a simulated device in step with it, `clock` saying how fast: the clock of both ends is
    /// the device's, so that a busy computer slows both and neither finds the other silent.
    /// `progress` sees the samples so far, now and then.
    pub fn run_in_step(
        mut self,
        mut device: VirtualDevice,
        mut clock: RealtimeClock,
        mut progress: impl FnMut(u64),
    ) -> Result<RunOutcome, Error> {
        self.driver.connected(Duration::ZERO);
        while !self.is_over() {
            let now = lockstep::time(device.ticks());
            while let Some(control) = self.outlets.publisher.next_control() {
                self.control(control, |c| device.control(c));
            }
            self.start_once(now);
            let Self { driver, outlets, needle, .. } = &mut self;
            let see = |frame: &DeviceFrame| outlets.frame(frame);
            lockstep::exchange(&mut device, driver, needle.as_mut(), |_| {}, see);
            self.publish_needle();
            device.take_done().into_iter().for_each(|name| self.outlets.task(name.to_owned()));
            if let Some(taken) = self.patient_answer() {
                let procedure = self.patients.as_ref().filter(|_| taken).and_then(PatientManager::procedure);
                procedure.into_iter().for_each(|procedure| device.follow(procedure));
                // The layers of a body are those of a line: the needle points along it.
                let on_line =
                    self.patients.as_ref().filter(|patients| taken && patients.profile().body.is_some());
                on_line.into_iter().for_each(|patients| {
                    device.control(Control::Tilt { rad: patients.profile().tilt_rad() });
                });
                // Nobody's hand is on a simulated needle: it goes on as it did, unless a person has
                // stopped it.
                if !self.person_starts {
                    self.driver.start();
                }
            }
            if device.ticks().is_multiple_of(1_000) {
                self.report(now);
                progress(self.outlets.stats.samples);
            }
            if clock.wait(lockstep::time(device.ticks())).is_err() {
                device.note_late();
            }
        }
        self.finish()
    }

    /// Runs the device behind `port` in real time, for at most `seconds`, however often it comes
    /// and goes.
    pub fn run_in_real_time(
        mut self,
        port: &mut dyn Port,
        seconds: Option<f64>,
        mut progress: impl FnMut(u64),
    ) -> Result<RunOutcome, Error> {
        let begin = Instant::now();
        let mut wire: Option<Box<dyn Wire>> = None;
        let mut next_try = Duration::ZERO;
        let mut bytes = vec![0; 1 << 14];
        while !self.is_over() {
            let now = begin.elapsed();
            if seconds.is_some_and(|s| now > Duration::from_secs_f64(s) + GRACE) {
                break;
            }
            if let Some(open) = &mut wire {
                if self.exchange(open.as_mut(), &mut bytes, now, begin).is_err() {
                    wire = None;
                    self.driver.disconnected();
                }
            } else if now >= next_try {
                next_try = now + RETRY;
                wire = port.open().ok();
                if wire.is_some() {
                    self.driver.connected(now);
                }
            } else {
                std::thread::sleep(PATIENCE);
            }
            if !self.was_ready && now > FIRST_ANSWER {
                return Err(self.never_ready());
            }
            while let Some(control) = self.outlets.publisher.next_control() {
                // The hand on a real needle is nobody's to move.
                self.control(control, |_| {});
            }
            self.patient_answer();
            self.start_once(now);
            if let Some(why) =
                self.driver.notice().filter(|_| !self.person_starts && !self.driver.has_started())
            {
                // Nobody would see it in a page.
                return Err(Error::failed(why));
            }
            self.report(now);
            progress(self.outlets.stats.samples);
        }
        if let Some(mut open) = wire {
            self.leave(open.as_mut(), begin);
        }
        self.finish()
    }

    fn exchange(
        &mut self,
        wire: &mut dyn Wire,
        bytes: &mut [u8],
        now: Duration,
        begin: Instant,
    ) -> std::io::Result<()> {
        let out = self.driver.transmit(now);
        if !out.is_empty() {
            wire.write(out)?;
        }
        let count = wire.read(bytes, PATIENCE)?;
        let Self { driver, outlets, needle, .. } = self;
        driver.receive(begin.elapsed(), &bytes[..count], |frame| {
            outlets.frame(frame);
            needle.iter_mut().for_each(|needle| needle.frame(frame));
        });
        needle.iter_mut().for_each(|needle| driver.follow(begin.elapsed(), needle));
        self.publish_needle();
        Ok(())
    }

    /// Tells the pages where the needle's line is.
    fn publish_needle(&self) {
        if let Some(needle) = &self.needle {
            self.outlets.publisher.needle(needle.track().origin_mm());
        }
    }

    /// Takes the torque off before the cable is let go; the heartbeat's silence would do it 200 ms
    /// later.
    fn leave(&mut self, wire: &mut dyn Wire, begin: Instant) {
        self.driver.stop();
        for _ in 0..3 {
            if wire.write(self.driver.transmit(begin.elapsed())).is_err() {
                return;
            }
            std::thread::sleep(PATIENCE);
        }
    }

    /// The person who started the program asked for a start: once, and not again after a stop or a
    /// reconnection.
    fn start_once(&mut self, now: Duration) {
        if !self.driver.is_ready(now) {
            self.has_asked = false;
            self.outlets.gains.forget();
            return;
        }
        self.was_ready = true;
        if !std::mem::replace(&mut self.has_asked, true) {
            self.driver.report_device();
        }
        if !self.person_starts && !self.driver.has_started() && !self.driver.is_starting() {
            if std::mem::take(&mut self.clears_first) {
                self.driver.clear();
            }
            if std::mem::take(&mut self.zeroes_first) {
                self.driver.zero();
            }
            self.driver.start();
        }
    }

    /// Tells whoever looks how the link does and which insertions have ended.
    fn report(&mut self, now: Duration) {
        self.outlets.status(&self.driver, now);
        if let Some(practice) = &mut self.practice {
            practice.judge(&self.outlets.publisher);
        }
    }

    fn control(&mut self, control: Control, mut hand: impl FnMut(Control)) {
        if let Some(practice) = &mut self.practice {
            match control {
                Control::Drag { .. } => practice.held(true),
                Control::Demo => practice.held(false),
                _ => {}
            }
        }
        match control {
            Control::Record { name } => {
                let setup = self.patients.as_ref().map(PatientManager::setup);
                self.outlets.record(&name, setup);
            }
            Control::EndRecording => self.outlets.end_recording(&self.driver),
            Control::Probe(view) => self.outlets.probe(view),
            Control::Task { name } => self.task(name),
            Control::Trainee { name } => self.outlets.trainee = Some(name).filter(|name| !name.is_empty()),
            Control::Start => self.driver.start(),
            Control::Stop => {
                self.person_starts = true;
                self.driver.stop();
            }
            Control::Clear => self.driver.clear(),
            Control::Zero => self.driver.zero(),
            Control::Choose { patient } => self.ask_patient(|patients| patients.choose(&patient)),
            Control::Edit { profile } => self.ask_patient(|patients| patients.edit(&profile)),
            Control::SavePatient { name, profile } => {
                self.ask_patient(|patients| patients.save(&name, &profile));
            }
            Control::Compensate { share } => {
                if let Some(gains) = self.outlets.gains.at(share) {
                    self.driver.compensate(gains);
                }
            }
            other => hand(other),
        }
    }

    /// A person has done a task; one that the procedure does not ask for is not noted.
    fn task(&mut self, name: String) {
        let purpose = self.patients.as_ref().and_then(|patients| patients.setup().purpose);
        if purpose.is_some_and(|purpose| purpose.tasks().contains(&name.as_str())) {
            self.outlets.task(name);
        }
    }

    /// Asks the device for another patient, or says why not.
    fn ask_patient(&mut self, ask: impl FnOnce(&mut PatientManager) -> Result<Patient, Error>) {
        let Some(patients) = &mut self.patients else { return };
        match ask(patients) {
            Ok(patient) => self.driver.configure_patient(patient),
            Err(why) => {
                let answer = PatientAnswer { reason: why.to_string(), ..PatientAnswer::default() };
                self.outlets.publisher.patient(&patients.status(Some(answer)));
            }
        }
    }

    /// Tells everybody what the device has said to another patient, where it has: whether it has
    /// taken it.
    fn patient_answer(&mut self) -> Option<bool> {
        let answer = self.driver.take_change()?;
        let patients = self.patients.as_mut()?;
        let taken = answer.is_ok().then(|| patients.taken()).flatten();
        if taken.is_some() {
            self.outlets.publisher.scene(&patients.scene());
            self.needle = Some(LineSender::new(patients.profile()));
            if let Some(practice) = &mut self.practice {
                practice.patient(patients.profile(), patients.setup().purpose);
            }
            let written = self.outlets.recorder.as_mut().map_or(Ok(()), |r| r.setup(patients.setup()));
            if let Err(error) = written {
                self.outlets.recorder = None;
                self.outlets.error = Some(error);
            }
        } else {
            patients.refused();
        }
        let is_taken = taken.is_some();
        let answer = taken.unwrap_or_else(|| PatientAnswer {
            reason: answer.err().unwrap_or_default(),
            ..PatientAnswer::default()
        });
        self.outlets.publisher.patient(&patients.status(Some(answer)));
        Some(is_taken)
    }

    fn is_over(&self) -> bool {
        self.outlets.stats.is_full()
            || self.outlets.error.is_some()
            || self.driver.refused().is_some()
            || self.stop.load(Ordering::Relaxed)
    }

    fn never_ready(&self) -> Error {
        Error::failed(format_args!(
            "the device did not answer within {} s; check that it runs this project's firmware and is not in use elsewhere",
            FIRST_ANSWER.as_secs()
        ))
    }

    fn finish(mut self) -> Result<RunOutcome, Error> {
        let link = self.driver.counts();
        let recorder = self.outlets.recorder.take();
        let recorded_bytes = recorder.map(|recorder| recorder.finish(link.into())).transpose();
        if let Some(error) = self.outlets.error {
            return Err(error);
        }
        if let Some(refused) = self.driver.refused() {
            return Err(Error::failed(refused));
        }
        Ok(RunOutcome { link, stats: self.outlets.stats, recorded_bytes: recorded_bytes? })
    }
}
