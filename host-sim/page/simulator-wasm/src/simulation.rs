//! The virtual device, the PC's side of its link and what the page is told, in one thread and
//! without a clock.

use device_sim::device::virtual_device::VirtualDevice;
use device_sim::driver::Driver;
use device_sim::error::Error;
use device_sim::lockstep;
use device_sim::needle::LineSender;
use device_sim::page::condense::Condenser;
use device_sim::page::messages::ToPage;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use device_sim::session::{self, Control, Hand, Publisher, Session, Source, Subscription};
use std::time::Duration;

/// The procedure that the scripted hand follows.
const PROCEDURE: &str = "venepuncture";

/// A device, and everything up to the page.
pub struct Simulation {
    device: VirtualDevice,
    driver: Driver,
    needle: LineSender,
    session: Session,
    publisher: Publisher,
    subscription: Subscription,
    condenser: Condenser,
    said_scene: bool,
    person: bool,
    person_starts: bool,
    digest: Digest,
}

impl Simulation {
    /// With a built-in profile.
    pub fn new(profile: &str) -> Result<Self, Error> {
        let profile = Profile::find(profile)?;
        let procedure = Procedure::find(PROCEDURE, &profile)?;
        let scene = profile.scene(Source::Virtual, Some(PROCEDURE.to_owned()));
        let (session, publisher) = session::open(scene);
        let mut driver = Driver::new(profile.config.patient.clone());
        driver.connected(Duration::ZERO);
        Ok(Self {
            device: VirtualDevice::new(&profile, procedure),
            driver,
            needle: LineSender::new(&profile),
            subscription: session.subscribe(),
            session,
            publisher,
            condenser: Condenser::default(),
            said_scene: false,
            person: false,
            person_starts: false,
            digest: Digest::default(),
        })
    }

    /// Moves time on, as host-sim's run loop does it with a virtual device.
    pub fn advance(&mut self, ticks: u64) {
        let end = self.device.ticks() + ticks;
        while self.device.ticks() < end {
            let now = lockstep::time(self.device.ticks());
            while let Some(control) = self.publisher.next_control() {
                self.control(control);
            }
            let may_start = self.driver.is_ready(now) && !self.person_starts;
            if may_start && !self.driver.has_started() && !self.driver.is_starting() {
                self.driver.start();
            }
            let Self { device, driver, publisher, digest, needle, .. } = self;
            lockstep::exchange(
                device,
                driver,
                Some(needle),
                |bytes| digest.take(bytes),
                |frame| publisher.frame(frame),
            );
            publisher.needle(needle.track().origin_mm());
        }
        self.status();
    }

    fn control(&mut self, control: Control) {
        match control {
            Control::Start => self.driver.start(),
            Control::Stop => {
                // Stopped once, only a person starts it again.
                self.person_starts = true;
                self.driver.stop();
            }
            Control::Clear => self.driver.clear(),
            Control::Zero => self.driver.zero(),
            other => self.device.control(other),
        }
    }

    fn status(&self) {
        let now = lockstep::time(self.device.ticks());
        let counts = self.driver.counts();
        self.publisher.link(|status| {
            status.connected = self.driver.is_ready(now);
            status.frames = counts.frames;
            status.lost_frames = counts.lost_frames;
            status.samples = counts.samples;
            status.lost_samples = counts.lost_samples;
            status.garbage = counts.garbage;
            status.fault = self.driver.fault().map(|fault| fault.to_string());
            status.notice = self.driver.notice().map(str::to_owned);
        });
    }

    /// Does what the page asks for, if a device alone can; what is wrong with it where it asked for
    /// nonsense.
    pub fn receive(&mut self, text: &str) -> Result<(), String> {
        let control = Control::parse(text)?;
        if let Some(hand) = control.hand() {
            self.person = hand == Hand::Person;
        }
        self.session.control(control);
        Ok(())
    }

    /// Returns the messages for the page, one JSON text a line.
    pub fn tell(&mut self) -> String {
        let mut lines = String::new();
        let mut say = |message: &ToPage| {
            // Only a map with keys that are no strings cannot be written, and there is none.
            if let Ok(text) = serde_json::to_string(message) {
                lines.push_str(&text);
                lines.push('\n');
            }
        };
        if !std::mem::replace(&mut self.said_scene, true) {
            say(&ToPage::Scene(self.session.scene()));
        }
        let (device, mut frame) = self.condenser.take(self.subscription.drain());
        if let Some(device) = device {
            say(&ToPage::Device(device));
        }
        frame.hand = if self.person { Hand::Person } else { Hand::Demo };
        say(&ToPage::Frame(frame));
        lines
    }

    /// A hash of every byte that the device has sent.
    pub fn digest(&self) -> u64 {
        self.digest.0
    }
}

/// FNV-1a, 64 bits.
struct Digest(u64);

impl Default for Digest {
    fn default() -> Self {
        Self(0xCBF2_9CE4_8422_2325)
    }
}

impl Digest {
    fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_receives_scene_and_device_and_moves_the_needle() {
        let mut simulation = Simulation::new("adult").expect("it is built in");
        simulation.advance(30_000);
        let told = simulation.tell();
        assert!(told.starts_with(r#"{"type":"scene""#), "{}", &told[..60]);
        assert!(told.contains(r#""type":"device""#) && told.contains(r#""kind":"puncture""#));
        simulation.receive(r#"{"do":"drag","depth_mm":-4.0}"#).expect("it is a message");
        simulation.advance(20_000);
        let told = simulation.tell();
        let depth =
            told.split(r#""depth_mm":"#).nth(1).and_then(|rest| rest.split(',').next()).expect("a pose");
        assert!((depth.parse::<f64>().expect("a number") + 4.0).abs() < 0.3, "{depth}");
        assert!(told.contains(r#""hand":"person""#));
        assert!(simulation.receive("{}").is_err());
    }

    #[test]
    fn an_unknown_profile_is_refused() {
        assert!(Simulation::new("giant").is_err());
    }
}
