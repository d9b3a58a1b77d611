//! The control core of the device on the simulated mechanism, a needle in it and a hand that moves
//! or lets go.

use control_core::config::Tissue;
use control_core::controller::TickOutput;
use control_core::event::{Limits, State, VesselState};
use control_core::units::{Counts, Milliradians};
use control_core::{Controller, Order, TickInput};
use device_sim::plant::hand::Grip;
use device_sim::plant::{Plant, PlantConfig};
use device_sim::profile::Profile;

/// Above the skin, where every test begins, mm.
const START_MM: f64 = -2.0;
const STEADY_HAND: Grip =
    Grip { stiffness_n_per_m: 10_000.0, damping_n_s_per_m: 20.0, tremor_rms_m: 0.0, seed: 1 };

/// The quantities of a tick that the tests look at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// Depth along the needle, mm.
    pub(crate) depth_mm: f64,
    /// Force that the law asked for, N.
    pub(crate) force_n: f64,
    /// Force that the converter is set to, N.
    pub(crate) given_n: f64,
    /// Force across the needle that would hold its direction, N.
    pub(crate) lateral_n: f64,
    pub(crate) state: State,
    pub(crate) vessel: VesselState,
    pub(crate) limits: Limits,
}

/// Something that happened, and where along the needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Event {
    Contact(u8, f64),
    Puncture(u8, f64),
    Barrier,
    Flashback,
}

/// A started device.
pub(crate) struct StartedDevice {
    core: Controller,
    plant: Plant,
    full_scale_n: f64,
    hand_mm: f64,
    /// Every tick since it was started.
    pub(crate) seen: Vec<Seen>,
    /// The events since it was started.
    pub(crate) events: Vec<Event>,
}

impl StartedDevice {
    /// At the patient's entry angle.
    pub(crate) fn of(profile: &str) -> Self {
        let profile = Profile::find(profile).expect("it is built in");
        let angle_deg = profile.entry_rad.to_degrees();
        Self::new(&profile, angle_deg, 4.0)
    }

    /// At an angle to the skin, with rollers that hold the needle with `grip_n`; faded in, above
    /// the skin.
    pub(crate) fn new(profile: &Profile, angle_deg: f64, grip_n: f64) -> Self {
        let device = &profile.config.device;
        let radius_m = device.roller_radius.0.to_num::<f64>() * 1e-3;
        let torque_nm = device.full_scale_torque.0.to_num::<f64>() * 1e-3;
        let mechanism = PlantConfig {
            grip_force: grip_n,
            ..PlantConfig::new(radius_m, device.counts_per_turn, torque_nm)
        };
        let mut bench = Self {
            core: Controller::new(profile.plan.clone()),
            plant: Plant::new(mechanism, STEADY_HAND, START_MM * 1e-3),
            full_scale_n: torque_nm / radius_m,
            hand_mm: START_MM,
            seen: Vec::new(),
            events: Vec::new(),
        };
        bench.tilt(angle_deg);
        bench.tick(0.0);
        bench.core.order(Order::Start);
        bench.rest(0.5);
        bench
    }

    /// Turns the needle, in no time where it is outside.
    pub(crate) fn tilt(&mut self, angle_deg: f64) {
        self.plant.set_tilt(angle_deg.to_radians());
    }

    /// Turns the needle at 10°/s, and waits for the sensor's filter.
    pub(crate) fn turn(&mut self, to_deg: f64) {
        let from_deg = self.plant.tilt().to_degrees();
        let ticks = ((to_deg - from_deg).abs() * 1_000.0) as u32;
        for tick in 1..=ticks {
            self.tilt(from_deg + (to_deg - from_deg) * f64::from(tick) / f64::from(ticks));
            self.tick(0.0);
        }
        self.rest(0.3);
    }

    /// The hand holds still for so many seconds.
    pub(crate) fn rest(&mut self, seconds: f64) {
        (0..(seconds * 1e4) as u32).for_each(|_| self.tick(0.0));
    }

    /// The hand goes to a depth along the needle at a speed.
    pub(crate) fn go(&mut self, to_mm: f64, speed_mm_s: f64) {
        let step_mm = (to_mm - self.hand_mm).signum() * speed_mm_s * 1e-4;
        while (to_mm - self.hand_mm).abs() > step_mm.abs() {
            self.tick(step_mm);
        }
    }

    /// The hand has let go of the needle for so many seconds.
    pub(crate) fn let_go(&mut self, seconds: f64) {
        (0..(seconds * 1e4) as u32).for_each(|_| self.step(None));
    }

    fn tick(&mut self, step_mm: f64) {
        self.hand_mm += step_mm;
        self.step(Some((self.hand_mm * 1e-3, step_mm * 10.0)));
    }

    fn step(&mut self, hand: Option<(f64, f64)>) {
        self.core.order(Order::Heartbeat);
        let tilt = Milliradians((self.plant.tilt() * 1e3).round() as i16);
        let out = self.core.tick(TickInput { count: Counts(self.plant.count()), tilt });
        assert_eq!(out.tripped, None, "at {} mm", out.depth.0);
        let share = (f64::from(out.dac.0) - f64::from(self.core.plan().zero_torque_code().0))
            / f64::from(self.core.plan().device().dac.span());
        self.plant.tick(share, out.enable, hand);
        self.note(&out, share);
    }

    fn note(&mut self, out: &TickOutput, share: f64) {
        let depth_mm: f64 = out.depth.0.to_num();
        self.seen.push(Seen {
            depth_mm,
            force_n: out.force.0.to_num(),
            given_n: -share * self.full_scale_n,
            lateral_n: out.lateral.0.to_num(),
            state: State::from_code(out.sample.state).expect("a known state"),
            vessel: out.vessel,
            limits: out.limits,
        });
        let layers = |mask: u8| (0..8).filter(move |layer| mask >> layer & 1 == 1);
        self.events.extend(layers(out.transitions.contact).map(|layer| Event::Contact(layer, depth_mm)));
        self.events.extend(layers(out.transitions.puncture).map(|layer| Event::Puncture(layer, depth_mm)));
        self.events.extend(out.transitions.barrier.then_some(Event::Barrier));
        self.events.extend(out.transitions.flashback.then_some(Event::Flashback));
    }

    /// Place of the tip, mm: not what the encoder says where the needle has slipped.
    pub(crate) fn tip_mm(&self) -> f64 {
        self.plant.tip() * 1e3
    }

    pub(crate) fn now(&self) -> Seen {
        *self.seen.last().expect("it runs")
    }

    /// Depth along the needle of the first contact with a layer, mm.
    pub(crate) fn contact_mm(&self, wanted: u8) -> f64 {
        let found = self.events.iter().find_map(|event| match event {
            Event::Contact(layer, mm) if *layer == wanted => Some(*mm),
            _ => None,
        });
        found.unwrap_or_else(|| panic!("layer {wanted} was not met: {:?}", self.events))
    }

    /// Largest force of the law between two depths along the needle, N.
    pub(crate) fn largest_n(&self, from_mm: f64, to_mm: f64) -> f64 {
        let within = self.seen.iter().filter(|s| (from_mm..to_mm).contains(&s.depth_mm));
        within.map(|s| s.force_n).fold(0.0, f64::max)
    }
}

/// The number of a tissue's layer.
pub(crate) fn number(profile: &Profile, tissue: Tissue) -> u8 {
    let at = profile.config.patient.layers.iter().position(|layer| layer.tissue == tissue);
    at.expect("it has that tissue") as u8
}
