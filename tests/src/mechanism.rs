//! A roller with forces of its own: cogging by the rotor's angle, dry and viscous friction, a
//! weight by tilt; with or without a hand on its needle. The numbers are those of
//! `fixtures/hidden.toml`, which nothing but the diagnosis has seen.

use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, PoisonError};

use emulator::board::plant::{Drive, Nanos, PlantSide};

/// Roller's radius in m, counts a turn, and the motor's torque at full scale in N·m.
const RADIUS: f64 = 0.01;
const COUNTS_PER_TURN: f64 = 4_000.0;
const FULL_SCALE: f64 = 0.0288;
/// Inertia in kg·m², friction in N·m·s/rad and N·m, weight at a tilt of 90° in N·m.
const INERTIA: f64 = 1.5e-6;
const VISCOUS: f64 = 1.6e-6;
const DRY: f64 = 6.0e-4;
const WEIGHT: f64 = 1.5e-3;
/// Cogging: order, factors of cosine and sine in N·m.
const COGGING: [(f64, f64, f64); 2] = [(7.0, 4.0e-4, 3.0e-4), (14.0, -3.0e-4, 6.0e-4)];
/// A light grip: N/m and N·s/m.
const GRIP: (f64, f64) = (1_500.0, 5.0);
/// Longest step in s.
const STEP: f64 = 2e-5;

/// A way of the hand: times in s and depths in m, joined as a hand joins them.
pub type Way = Vec<(f64, f64)>;

/// The roller's state.
#[derive(Debug, Clone)]
pub struct Mechanism {
    /// The rotor's angle where the needle's depth is 0, rad: from which cogging repeats.
    rotor: f64,
    tilt: f64,
    depth: f64,
    speed: f64,
    /// The position to which the hand leads the needle; `None` if nobody holds it.
    way: Option<Way>,
    time: f64,
    hand_force: f64,
}

impl Mechanism {
    /// At rest at depth 0, inclined by `tilt` rad, with the rotor at `rotor` rad.
    #[must_use]
    pub fn new(rotor: f64, tilt: f64) -> Self {
        Self { rotor, tilt, depth: 0.0, speed: 0.0, way: None, time: 0.0, hand_force: 0.0 }
    }

    /// A hand leads the needle along `way` from now on, whose times count from now; `None`: it lets
    /// go.
    pub fn lead(&mut self, way: Option<Way>) {
        self.way = way.map(|way| way.into_iter().map(|(at, depth)| (self.time + at, depth)).collect());
    }

    /// Depth in m.
    #[must_use]
    pub fn depth(&self) -> f64 {
        self.depth
    }

    /// Force of the hand in the direction of insertion, N.
    #[must_use]
    pub fn hand_force(&self) -> f64 {
        self.hand_force
    }

    /// Moves on by `dt` s under a share of full torque.
    pub fn run(&mut self, dt: f64, share: f64) {
        let steps = (dt / STEP).ceil().max(1.0);
        (0..steps as u32).for_each(|_| self.step(dt / steps, share));
    }

    fn step(&mut self, dt: f64, share: f64) {
        let angle = self.rotor + self.depth / RADIUS;
        let cogging: f64 =
            COGGING.iter().map(|(n, cos, sin)| cos * (n * angle).cos() + sin * (n * angle).sin()).sum();
        self.hand_force = self.way.as_ref().map_or(0.0, |way| {
            let (at, speed) = place(way, self.time);
            GRIP.0 * (at - self.depth) + GRIP.1 * (speed - self.speed)
        });
        let torque = FULL_SCALE * share + cogging + WEIGHT * self.tilt.sin() - VISCOUS * self.speed / RADIUS;
        let force = torque / RADIUS + self.hand_force;
        let mass = INERTIA / (RADIUS * RADIUS);
        // Dry friction can stop the needle and never turns it round.
        let free = self.speed + force / mass * dt;
        let stop = DRY / RADIUS / mass * dt;
        self.speed = if free.abs() <= stop { 0.0 } else { free - stop.copysign(free) };
        self.depth += self.speed * dt;
        self.time += dt;
    }

    /// Returns the encoder's count.
    #[must_use]
    pub fn count(&self) -> i64 {
        (self.depth / RADIUS * COUNTS_PER_TURN / TAU).floor() as i64
    }
}

/// Depth and speed on a way at a time.
fn place(way: &[(f64, f64)], time: f64) -> (f64, f64) {
    let after = way.partition_point(|point| point.0 <= time);
    match (after.checked_sub(1).map(|before| way[before]), way.get(after)) {
        (Some((from, start)), Some(&(to, end))) => {
            let (span, done) = (to - from, (time - from) / (to - from));
            // A tenth of the time to get going, a tenth to stop, an even speed between.
            const RAMP: f64 = 0.1;
            let top = 1.0 / (1.0 - RAMP);
            let (gone, speed) = if done < RAMP {
                (0.5 * top * done * done / RAMP, top * done / RAMP)
            } else if done > 1.0 - RAMP {
                let left = 1.0 - done;
                (1.0 - 0.5 * top * left * left / RAMP, top * left / RAMP)
            } else {
                (top * (done - 0.5 * RAMP), top)
            };
            (start + (end - start) * gone, speed * (end - start) / span)
        }
        (Some((_, end)), None) => (end, 0.0),
        (None, _) => (way.first().map_or(0.0, |point| point.1), 0.0),
    }
}

/// A mechanism that the test and the emulator's thread share.
#[derive(Debug, Clone)]
pub struct SharedMechanism(Arc<Mutex<(Mechanism, Vec<Moment>)>>);

/// The mechanism's state at a time.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Its time.
    pub at: Nanos,
    /// Depth in m.
    pub depth: f64,
    /// Force of the hand, N.
    pub hand_force: f64,
}

/// Time between two moments that are kept.
const KEPT: Nanos = 100_000;

impl SharedMechanism {
    /// To share.
    #[must_use]
    pub fn new(mechanism: Mechanism) -> Self {
        Self(Arc::new(Mutex::new((mechanism, Vec::new()))))
    }

    /// Looks at it or changes it.
    pub fn with<T>(&self, what: impl FnOnce(&mut Mechanism) -> T) -> T {
        what(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner).0)
    }

    /// Returns its states since the last call.
    #[must_use]
    pub fn take_moments(&self) -> Vec<Moment> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner).1)
    }

    /// As a plant.
    #[must_use]
    pub fn plant(&self) -> impl PlantSide + use<> {
        let shared = self.0.clone();
        let (mut last, mut kept) = (0, 0);
        move |at: Nanos, drive: Drive| {
            let mut inner = shared.lock().unwrap_or_else(PoisonError::into_inner);
            let (mechanism, moments) = &mut *inner;
            let share = match drive {
                Drive { code: Some(code), enabled: true } => (f64::from(code) - 2_048.0) / 2_047.0,
                _ => 0.0,
            };
            let dt = at.saturating_sub(last) as f64 / 1e9;
            last = at;
            if dt > 0.0 {
                mechanism.run(dt, share);
            }
            if at >= kept + KEPT {
                kept = at;
                moments.push(Moment { at, depth: mechanism.depth, hand_force: mechanism.hand_force });
            }
            mechanism.count()
        }
    }
}
