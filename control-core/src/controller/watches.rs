//! The watches of a tick, apart from the force: the host, the way the needle moves, an encoder that
//! no longer counts, and the winding.

use super::{Core, LOOK_TURN, Mode};
use crate::anatomy;
use crate::event::Fault;
use crate::kinematics;
use crate::runaway::{LOOK_TICKS, fastest};
use crate::stillness::{self, Stillness};
use crate::thermal::WARM_TICKS;
use crate::units::{Millimetres, Milliradians};
use fixed::types::I16F16;

impl Core {
    /// The work that is slow enough for one tick of eight or sixteen, each part in another tick.
    #[inline(never)]
    pub(super) fn take_turn(&mut self, tilt: Milliradians, depth: Millimetres) {
        const { assert!(WARM_TICKS == 8 && LOOK_TICKS == 8 && LOOK_TURN == 4, "the turns below") };
        const {
            assert!(
                kinematics::LOOK_TICKS == 16 && anatomy::LOOK_TICKS == 16 && stillness::LOOK_TICKS == 8,
                "the turns below"
            )
        };
        let fault = match self.turn {
            0 | 8 => return self.winding.warm(&self.plan.thermal),
            2 => return self.winding.allow(&self.plan.thermal, self.plan.torque_limits.torque),
            10 => return self.movement.look(depth),
            3 => return self.insertion.look(&self.plan.anatomy, tilt),
            1 | 9 | 11 => return self.turn_layers(depth),
            5 | 13 => self.runaway.look(&self.plan.runaway),
            6 | 14 => return self.runaway.compare(),
            7 | 15 => self.runaway.judge(&self.plan.runaway),
            _ => return,
        };
        if let Some(fault) = fault
            && self.mode.is_powered()
        {
            self.trip_by_movement(fault);
        }
    }

    /// The next part of an angle or a line that is on its way.
    fn turn_layers(&mut self, depth: Millimetres) {
        if let Some(layer) = self.insertion.turn(&self.plan.anatomy, depth) {
            self.plan.law.place(self.insertion.depths(), layer);
        }
    }

    /// Trips because of the way the needle moves, unless an excitation asks for it.
    #[cold]
    #[inline(never)]
    fn trip_by_movement(&mut self, fault: Fault) {
        if self.mode != Mode::Exciting || !self.is_asked_for(fault) {
            self.trip(fault);
        }
    }

    /// True if an excitation moves a needle so that is wired rightly: it may be faster than a hand
    /// on purpose, up to a bound of its own; under its servo the mechanism may drive the needle
    /// against the motor for a moment; and its sines may shake the needle over one count.
    fn is_asked_for(&self, fault: Fault) -> bool {
        match fault {
            Fault::Overspeed => {
                let mm_per_count = self.plan.scale.mm_per_count;
                let hand = fastest(mm_per_count, self.plan.config.device.limits.max_counts_per_tick);
                !self.player.is_too_fast(self.runaway.speed(mm_per_count), hand)
            }
            Fault::WrongWay => self.player.has_servo() && self.runaway.is_knock(),
            Fault::EncoderChannel => self.player.shakes(),
            _ => false,
        }
    }

    /// The look for an encoder that no longer counts. A count up and down again is less than one: a
    /// live channel gives them when the other one is dead.
    pub(super) fn look_at_stillness(&mut self) {
        if self.still.is_moving() {
            return self.still.forget();
        }
        // While the encoder is asked, what would be given counts, and else what is: less while it
        // fades in.
        let torque = if self.still.is_asking() { self.asked } else { self.limiter.given().0 };
        self.still.look(torque.unsigned_abs() >= self.plan.loaded_torque);
        if self.still.is_asking() || self.still.is_doubtful(self.lines_agree) {
            self.ask_for_a_count();
        }
    }

    /// Asks a needle that is in doubt for a count; trips if its encoder is dead.
    #[cold]
    #[inline(never)]
    fn ask_for_a_count(&mut self) {
        let given = self.limiter.given().0;
        let is_dead = match self.mode {
            Mode::Running => {
                if !self.still.is_asking() {
                    self.asked = given;
                }
                self.still.ask(self.still.is_doubtful(self.lines_agree), given == I16F16::ZERO)
            }
            // Nobody's hand is on the needle, and less torque would be another signal.
            Mode::Exciting => self.still.is_doubtful(false),
            Mode::Idle | Mode::Faulted => {
                self.still = Stillness::default();
                false
            }
        };
        if is_dead {
            self.trip(Fault::EncoderFrozen);
        }
    }

    pub(super) fn watch_host(&mut self) {
        if !self.mode.is_powered() {
            return;
        }
        // It never wraps: what follows turns torque off long before.
        self.silent_ticks = self.silent_ticks.wrapping_add(1);
        if self.silent_ticks > self.plan.heartbeat_ticks {
            self.trip(Fault::HostSilent);
        }
    }
}
