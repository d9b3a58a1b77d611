//! The torque of a tick: the law or the excitation asks for a torque, the feedforward is added, and
//! the limits reduce the sum.

use super::{Core, Mode};
use crate::compensation::feedforward::RotorState;
use crate::event::Limits;
use crate::excitation::Segments;
use crate::math::{saturating_multiply, truncating_product};
use crate::passivity::Elements;
use crate::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians};
use core::borrow::BorrowMut;
use fixed::types::I16F16;

impl Core {
    /// Motor torque that the law or the excitation asks for; none where torque is off. N times mm
    /// is mN·m.
    pub(super) fn wanted_torque(
        &mut self,
        segments: &mut dyn BorrowMut<Segments>,
        mut force: Elements,
        (depth, speed): (Millimetres, MillimetresPerSecond),
        has_given_way: bool,
    ) -> Option<(MillinewtonMetres, Limits)> {
        let radius = self.plan.config.device.roller_radius;
        match self.mode {
            Mode::Running => {
                let damping = truncating_product(speed.0.to_bits(), self.plan.damping.to_bits(), 30);
                force.friction.0 = force.friction.0.saturating_add(I16F16::from_bits(damping));
                let (given, damped) =
                    self.observer.tick(self.plan.bounce_damping, depth, force, has_given_way);
                let limits = if damped { Limits::PASSIVITY } else { Limits::default() };
                // Each wall and friction stay below the 125 N of the strongest motor, damping below
                // 17 N: with 25 mm that fits. Were it ever more, it would be too much, and not the
                // other way.
                let torque = I16F16::ZERO.saturating_sub(saturating_multiply(given.0, self.plan.lever));
                let before = self.limiter.given().0.saturating_sub(self.feedforward.fed());
                Some((MillinewtonMetres(self.runaway.steady(torque, before)), limits))
            }
            Mode::Exciting => {
                let segments = segments.borrow_mut();
                let torque = self.player.tick(segments, radius, depth, speed);
                if torque.is_none() {
                    self.mode = Mode::Idle;
                    segments.forget();
                }
                torque.map(|torque| (torque, Limits::default()))
            }
            Mode::Idle | Mode::Faulted => None,
        }
    }

    /// Returns `wanted` and `limits` with the feedforward added to the law or the excitation.
    #[inline(always)]
    pub(super) fn compensated(
        &mut self,
        MillinewtonMetres(wanted): MillinewtonMetres,
        limits: Limits,
        speed: MillimetresPerSecond,
        tilt: Milliradians,
    ) -> (MillinewtonMetres, Limits) {
        let count = self.previous.unwrap_or_default().0;
        let rotor = RotorState { count, speed };
        let found = &self.plan.config.device.compensation;
        let (torque, is_held) =
            self.feedforward.tick(found, &self.plan.compensation, rotor, (self.turn, tilt), wanted);
        (MillinewtonMetres(torque), if is_held { limits.with(Limits::PASSIVITY) } else { limits })
    }

    /// Returns the part of the torque `held` that is given while the encoder is asked whether it
    /// counts.
    #[cold]
    #[inline(never)]
    fn left_while_asking(&mut self, held: I16F16) -> I16F16 {
        self.asked = held;
        self.still.left_of(held)
    }

    pub(super) fn limit(&mut self, wanted: MillinewtonMetres, limits: Limits) -> (MillinewtonMetres, Limits) {
        let most = self.plan.torque_limits.torque;
        let allowed = self.winding.allowed();
        let held = wanted.0.min(allowed).max(-allowed);
        let mut limits = limits;
        if held != wanted.0 {
            let thermal = if allowed < most { Limits::THERMAL } else { Limits::default() };
            let torque = if wanted.0.unsigned_abs() > most.unsigned_abs() {
                Limits::TORQUE
            } else {
                Limits::default()
            };
            limits = limits.with(thermal).with(torque);
        }
        let given = if self.still.is_asking() { self.left_while_asking(held) } else { held };
        let (torque, in_force) = self.limiter.tick(&self.plan.torque_limits, MillinewtonMetres(given));
        let missing = torque.0.saturating_sub(wanted.0);
        if missing != I16F16::ZERO {
            self.observer.held_back(saturating_multiply(missing, self.plan.per_lever));
        }
        (torque, in_force.with(limits))
    }
}
