//! A needle of 30 g on the roller, with or without a hand on it: what moves as physics has it, and
//! not along a path.

use std::sync::{Arc, Mutex, PoisonError};

use emulator::board::plant::{Drive, Nanos, PlantSide};

/// Needle, roller and rotor in kg; dry friction in N; viscous in N·s/m.
const MASS: f64 = 0.03;
const DRY: f64 = 0.06;
const VISCOUS: f64 = 0.02;
/// The motor's torque at full scale, in mN·m, over the roller's radius in mm, is N.
const FULL_SCALE: f64 = 28.8 / 10.0;
/// A light grip: N/m and N·s/m.
const GRIP: (f64, f64) = (1_500.0, 5.0);
const COUNTS_PER_M: f64 = 63_662.0;

/// The state that a test reads and changes.
#[derive(Debug, Clone, Copy)]
pub struct State {
    /// Depth in m, and speed in m/s.
    pub depth: f64,
    /// Speed in m/s.
    pub speed: f64,
    /// The position at which the hand holds it, in m; `None` if it has let go.
    pub hand: Option<f64>,
    /// Speed of the hand in m/s, while it holds.
    pub hand_speed: f64,
    /// True if the motor's leads are reversed.
    pub reversed: bool,
    /// The torque that the motor gives for each that it is asked for.
    pub gain: f64,
    /// The force that pulls it in, in N.
    pub pull: f64,
}

/// The needle, shared between the test and the emulator's thread, and the instant to which it has
/// moved.
#[derive(Debug, Clone)]
pub struct Needle(Arc<Mutex<(State, Nanos)>>);

impl Needle {
    /// At rest, held at `depth` in m.
    #[must_use]
    pub fn held_at(depth: f64) -> Self {
        let state = State {
            depth,
            speed: 0.0,
            hand: Some(depth),
            hand_speed: 0.0,
            reversed: false,
            gain: 1.0,
            pull: 0.0,
        };
        Self(Arc::new(Mutex::new((state, 0))))
    }

    /// Another needle that is where this one is.
    #[must_use]
    pub fn apart(&self) -> Self {
        Self(Arc::new(Mutex::new(*self.0.lock().unwrap_or_else(PoisonError::into_inner))))
    }

    /// Returns its state.
    #[must_use]
    pub fn state(&self) -> State {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).0
    }

    /// Changes it.
    pub fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner).0);
    }

    /// As a plant, which goes on from where it is.
    #[must_use]
    pub fn plant(&self) -> impl PlantSide + use<> {
        let shared = self.0.clone();
        move |at: Nanos, drive: Drive| {
            let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
            let (state, last) = &mut *shared;
            let dt = at.saturating_sub(*last) as f64 / 1e9;
            *last = at;
            state.step(dt, drive);
            (state.depth * COUNTS_PER_M).floor() as i64
        }
    }
}

impl State {
    fn step(&mut self, dt: f64, drive: Drive) {
        let set = match drive {
            Drive { code: Some(code), enabled: true } => (f64::from(code) - 2_048.0) / 2_047.0,
            _ => 0.0,
        };
        let motor = FULL_SCALE * self.gain * set * if self.reversed { -1.0 } else { 1.0 };
        let hand =
            self.hand.map_or(0.0, |at| GRIP.0 * (at - self.depth) + GRIP.1 * (self.hand_speed - self.speed));
        let force = motor + self.pull + hand - VISCOUS * self.speed;
        if self.speed == 0.0 && force.abs() <= DRY {
            // It sticks.
        } else {
            let against = if self.speed == 0.0 { force.signum() } else { self.speed.signum() };
            let speed = self.speed + (force - DRY * against) / MASS * dt;
            self.speed = if speed * self.speed < 0.0 { 0.0 } else { speed };
        }
        self.depth += self.speed * dt;
        self.hand = self.hand.map(|at| at + self.hand_speed * dt);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_released_needle_is_driven_out_and_a_reversed_one_in() {
        for (reversed, sign) in [(false, -1.0), (true, 1.0)] {
            let needle = Needle::held_at(0.0025);
            needle.change(|state| (state.hand, state.reversed) = (None, reversed));
            let mut plant = needle.plant();
            // 1 N outwards.
            let drive = Drive { code: Some(2_048 - 711), enabled: true };
            (0..=500).for_each(|step| {
                let _ = plant.step(step * 20_000, drive);
            });
            let moved = needle.state().depth - 0.0025;
            // (1 − 0.06) N on 30 g for 10 ms.
            assert!((sign * moved - 0.001_56).abs() < 5e-5, "{moved} m");
        }
    }

    #[test]
    fn a_hand_holds_it() {
        let needle = Needle::held_at(0.0);
        let mut plant = needle.plant();
        needle.change(|state| state.hand_speed = 0.02);
        let drive = Drive { code: Some(2_048), enabled: true };
        (0..=50_000).for_each(|step| {
            let _ = plant.step(step * 20_000, drive);
        });
        assert!((needle.state().depth - 0.02).abs() < 2e-4, "{:?}", needle.state());
    }
}
