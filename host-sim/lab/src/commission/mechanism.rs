//! A virtual device to be commissioned: the bare device of `characterise` with wires that may be
//! wrong, and a hand that does what it is asked.

use super::bench::{Act, Line};
use crate::characterise::mechanism::{BareDevice, Wiring};
use control_core::TICK_HZ;
use device_sim::error::Error;
use device_sim::lockstep;
use diagnosis::rig::Rig;
use std::f64::consts::TAU;
use std::time::Duration;

/// The speed at which the hand turns the roller, rad/s, and the stiffness and damping of its grip,
/// N·m/rad and N·m·s/rad.
const HAND_SPEED: f64 = 6.0;
const GRIP: (f64, f64) = (0.2, 1.0e-3);
/// A hand lets a weight go gently: s.
const LETS_GO_S: f64 = 3.0;
/// A hand tilts slowly: rad/s.
const TILT_SPEED: f64 = 0.5;

/// The device with its hand.
pub struct VirtualLine {
    device: BareDevice,
    /// The roller's true radius in mm.
    radius_mm: f64,
    act: Act,
    /// The angle at which the hand holds the roller, and the one that it moves to, rad.
    held: Option<(f64, f64)>,
    tilt: f64,
    /// The weight on the needle, N, and the tick at which the hand begins to let it go.
    hung: (f64, u64),
    /// The sensor's reading with the needle level, rad, and its sign.
    sensor: (f64, f64),
}

impl VirtualLine {
    /// The plant of `rig`, uncommissioned, wired as `wiring`, with a roller of `radius_mm`.
    pub fn new(rig: &Rig, file: &str, wiring: Wiring, radius_mm: f64) -> Result<Self, Error> {
        let line = Self::commissioned(rig, file, radius_mm)?;
        Ok(Self { device: line.device.uncommissioned(wiring)?, ..line })
    }

    /// The plant of `rig` on a device that has been commissioned.
    pub fn commissioned(rig: &Rig, file: &str, radius_mm: f64) -> Result<Self, Error> {
        let device = BareDevice::new(rig, file)?;
        Ok(Self {
            device,
            radius_mm,
            act: Act::HandsOff,
            held: None,
            tilt: 0.0,
            hung: (0.0, 0),
            sensor: (0.0, 1.0),
        })
    }

    /// The same wired as `wiring` since it was commissioned.
    pub fn wired(self, wiring: Wiring) -> Self {
        Self { device: self.device.wired(wiring), ..self }
    }

    /// A tilt sensor that reads `zero` rad with the needle level, and is mounted `sign` = ±1.
    pub fn with_tilt(self, zero: f64, sign: f64) -> Self {
        Self { sensor: (zero, sign), ..self }
    }

    /// The device behind it.
    pub fn device(&self) -> &BareDevice {
        &self.device
    }

    fn tick(&mut self) {
        let dt = 1.0 / f64::from(TICK_HZ);
        if let Act::Tilt(to) = self.act {
            self.tilt += (to - self.tilt).clamp(-TILT_SPEED * dt, TILT_SPEED * dt);
        }
        let (weight, since) = self.hung;
        let let_go = ((self.device.ticks() - since) as f64 * dt / LETS_GO_S).min(1.0);
        let pull = let_go * weight * self.tilt.sin() * self.radius_mm * 1e-3;
        let external = self.held.as_mut().map_or(0.0, |(at, end)| {
            *at = (*at + HAND_SPEED * dt).min(*end);
            GRIP.0 * (*at - self.device.position()) - GRIP.1 * self.device.velocity()
        });
        let (zero, sign) = self.sensor;
        self.device.tick_under(sign * self.tilt + zero, external + pull);
    }
}

impl Line for VirtualLine {
    fn exchange(&mut self, out: &[u8], into: &mut Vec<u8>) -> Result<Duration, Error> {
        self.device.receive(out);
        (0..lockstep::TICKS).for_each(|_| self.tick());
        lockstep::empty(|frame| self.device.transmit(frame), |bytes| into.extend(bytes));
        Ok(lockstep::time(self.device.ticks()))
    }

    fn act(&mut self, act: Act) {
        self.act = act;
        let way = match act {
            Act::Turn(turns) => Some(TAU * f64::from(turns)),
            Act::Pull(mm) => Some(mm / self.radius_mm),
            Act::HandsOff | Act::Tilt(_) | Act::Hang(_) => None,
        };
        if let Act::Hang(grams) = act {
            self.hung = (grams * 9.81e-3, self.device.ticks());
        }
        let from = self.device.position();
        self.held = way.map(|way| (from, from + way));
    }
}
