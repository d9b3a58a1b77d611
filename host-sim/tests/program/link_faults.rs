//! The torque when the link fails: silence, a pulled cable, lost and damaged bytes, a PC that comes
//! back.

use device_sim::device::virtual_device::VirtualDevice;
use device_sim::driver::Driver;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use link::codec::MAX_FRAME;
use link::frames::{DeviceFrame, EventKind};
use std::time::Duration;

/// A device and a PC with a cable between them that a test may spoil.
struct SpoiltLink {
    device: VirtualDevice,
    driver: Driver,
    frames: Vec<DeviceFrame>,
}

impl SpoiltLink {
    fn new() -> Self {
        let profile = Profile::find("adult").expect("it is built in");
        let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
        let mut driver = Driver::new(profile.config.patient.clone());
        driver.connected(Duration::ZERO);
        Self { device: VirtualDevice::new(&profile, procedure), driver, frames: Vec::new() }
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.device.ticks() * 100)
    }

    /// Runs for `ms`; `spoil` sees all bytes of a millisecond, to the device and from it.
    fn run(&mut self, ms: u32, mut spoil: impl FnMut(&mut Vec<u8>)) {
        for _ in 0..ms {
            let now = self.now();
            let mut down = self.driver.transmit(now).to_vec();
            spoil(&mut down);
            self.device.receive(&down);
            self.tick_alone(1);
            let mut up = Vec::new();
            let mut frame = [0; MAX_FRAME];
            loop {
                match self.device.transmit(&mut frame) {
                    0 => break,
                    count => up.extend(&frame[..count]),
                }
            }
            spoil(&mut up);
            let frames = &mut self.frames;
            self.driver.receive(now, &up, |frame| frames.push(frame.clone()));
        }
    }

    fn tick_alone(&mut self, ms: u32) {
        for _ in 0..ms * 10 {
            self.device.tick();
        }
    }

    fn start(&mut self) {
        self.run(100, |_| {});
        assert!(self.driver.is_ready(self.now()));
        self.driver.start();
        self.run(100, |_| {});
        assert!(self.device.is_enabled());
    }

    /// Faults that were reported.
    fn faults(&self) -> usize {
        let is_fault = |f: &&DeviceFrame| matches!(f, DeviceFrame::Event(e) if matches!(e.kind, EventKind::Fault { .. }));
        self.frames.iter().filter(is_fault).count()
    }
}

#[test]
fn a_device_stays_off_until_started_and_on_with_heartbeats() {
    let mut bench = SpoiltLink::new();
    bench.run(1_000, |_| {});
    assert!(bench.driver.is_ready(bench.now()) && !bench.device.is_enabled());
    bench.driver.start();
    bench.run(5_000, |_| {});
    assert!(bench.device.is_enabled());
    assert_eq!(bench.faults(), 0);
    bench.driver.stop();
    bench.run(10, |_| {});
    assert!(!bench.device.is_enabled());
}

#[test]
fn torque_ends_with_the_pc_and_does_not_return_with_it() {
    let mut bench = SpoiltLink::new();
    bench.start();
    // Into the skin, so that there is torque to lose.
    bench.run(2_100, |_| {});
    assert!(bench.device.set_value() < -0.05, "{}", bench.device.set_value());
    let mut on_for = 0;
    while bench.device.is_enabled() && on_for < 1_000 {
        bench.tick_alone(1);
        on_for += 1;
    }
    assert!((140..=201).contains(&on_for), "torque stayed for {on_for} ms of silence");
    assert_eq!(bench.device.set_value(), 0.0);

    // The same PC again, which had asked for a start in its earlier life.
    bench.driver.disconnected();
    bench.device.disconnect();
    let now = bench.now();
    bench.driver.connected(now);
    bench.run(2_000, |_| {});
    assert!(bench.driver.is_ready(bench.now()));
    assert!(!bench.device.is_enabled(), "no set value of an earlier connection");
    bench.driver.start();
    bench.run(100, |_| {});
    assert!(!bench.device.is_enabled(), "nobody has cleared the fault");
    bench.driver.clear();
    bench.driver.start();
    bench.run(100, |_| {});
    assert!(bench.device.is_enabled());
}

#[test]
fn a_pulled_cable_takes_the_torque_at_once() {
    let mut bench = SpoiltLink::new();
    bench.start();
    bench.device.disconnect();
    bench.tick_alone(1);
    assert!(!bench.device.is_enabled());
    assert_eq!(bench.device.set_value(), 0.0);
}

#[test]
fn a_pc_that_restarts_while_torque_is_on_stops_the_device_first() {
    let mut bench = SpoiltLink::new();
    bench.start();
    let profile = Profile::find("thin-elderly").expect("it is built in");
    bench.driver = Driver::new(profile.config.patient.clone());
    let now = bench.now();
    bench.driver.connected(now);
    bench.run(200, |_| {});
    assert!(!bench.device.is_enabled(), "a new PC begins with torque off");
    assert!(bench.driver.is_ready(bench.now()), "and its configuration is in force");
    let hash = link::codec::hash(&profile.config);
    let hello =
        bench.frames.iter().rev().find_map(|f| if let DeviceFrame::Hello(h) = f { Some(h) } else { None });
    assert_eq!(hello.expect("it said hello").config_hash, hash);
}

#[test]
fn commands_get_through_a_bad_cable_and_every_loss_is_counted() {
    let mut bench = SpoiltLink::new();
    let mut random = 1_u64;
    let mut spoiled = 0;
    let mut spoil = |bytes: &mut Vec<u8>| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // One millisecond in eight loses a byte or gains one.
        if random >> 61 == 0 && !bytes.is_empty() {
            let place = (random >> 33) as usize % bytes.len();
            if random & (1 << 20) == 0 {
                bytes.remove(place);
            } else {
                bytes.insert(place, (random >> 25) as u8);
            }
            spoiled += 1;
        }
    };
    bench.run(3_000, &mut spoil);
    bench.driver.start();
    bench.run(1_000, &mut spoil);
    assert!(bench.device.is_enabled(), "the start got through");
    bench.run(20, |_| {});
    assert!(spoiled > 100);
    let counts = bench.driver.counts();
    assert!(counts.garbage > 50 && counts.lost_frames > 50, "{counts:?}");
    let sent = bench.device.ticks();
    assert!(counts.samples + counts.lost_samples <= sent);
    // All but what was said before the first hello got through and after the last block.
    assert!(counts.samples + counts.lost_samples > sent - 4_000, "{counts:?} of {sent}");
}

#[test]
fn a_device_that_loses_power_is_greeted_anew_and_stays_off() {
    let mut bench = SpoiltLink::new();
    bench.start();
    let fresh = SpoiltLink::new();
    let ticks = bench.device.ticks();
    bench.device = fresh.device;
    // The clock of the bench is the device's: bring it to where it was.
    while bench.device.ticks() < ticks {
        bench.device.tick();
    }
    bench.run(3_000, |_| {});
    assert!(bench.driver.is_ready(bench.now()), "after a second of silence the PC says hello again");
    assert!(!bench.device.is_enabled());
}
