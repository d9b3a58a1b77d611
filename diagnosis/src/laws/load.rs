//! Two-mass model: a load behind backlash or a slipping grip, seen only by its force on the motor.
//!
//! With J = Jm + Jl, p = Jl/J and r = Jl/Jm, a rigid machine accelerates by d − f, where d = D/J
//! and f = F/J against the motion. A load that brakes itself by a, reached through a force T, adds
//! r·(d − y − (f − a) − e/r), where y = T/(p·J) and e = E/J of the forces E that act on the load.
//! The motor's lead w over its load follows w″ = (1 + r)·(d − y − (f − a) − e/r) while both go the
//! same way, and the load's friction turns with the load. Through a gap T is a stiff, damped
//! contact; through a grip T rises with the creep w′ up to a ceiling. Both are driven by the
//! command, so that little noise of the measured motion enters, and bounded, so that nothing
//! drifts.

use super::joint_terms::Gap;
use super::shape::shape;
use super::{Effect, State};
use std::f64::consts::TAU;

shape! {
    /// The machine that a joint divides: accelerations of the whole, with its load's part.
    struct Machine {
        /// Acceleration per unit of command.
        per_command: 1.0,
        /// Deceleration by dry friction.
        dry: 0.0,
        /// Deceleration by viscous friction per unit of speed, 1/s.
        viscous: 0.0,
        /// Acceleration per unit of the measured load.
        per_force: 0.0,
        /// Acceleration by the weight on an axis that is upright.
        weight: 0.0,
        /// Deceleration of the load by its own dry friction.
        coast: needed,
        /// Load inertia over motor inertia.
        ratio: needed,
    }
}

/// Values of the whole machine that the law of a joint uses, all per inertia: per unit of command
/// and of the measured load, by dry and viscous friction, and by the weight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WholeMachine {
    pub(crate) per_command: f64,
    pub(crate) dry: f64,
    pub(crate) viscous: f64,
    pub(crate) per_force: f64,
    pub(crate) weight: f64,
}

impl WholeMachine {
    /// The values of a shape.
    pub(crate) fn shape(&self) -> [(&'static str, f64); 5] {
        let Self { per_command, dry, viscous, per_force, weight } = *self;
        [
            ("per_command", per_command),
            ("dry", dry),
            ("viscous", viscous),
            ("per_force", per_force),
            ("weight", weight),
        ]
    }
}

impl Effect {
    /// True if its law is built on the rest of the machine.
    pub(crate) fn is_joint(&self) -> bool {
        self.name.formula().is_none() && self.shape.contains_key("per_command")
    }

    /// Builds the law of a joint on another machine. The force at which a grip lets go stays as it
    /// is.
    pub(crate) fn put_on(&mut self, machine: &WholeMachine) {
        let scale = self.shape["per_command"] / machine.per_command;
        if let Some(limit) = self.shape.get_mut("limit") {
            *limit *= scale;
        }
        self.shape.extend(machine.shape().map(|(key, value)| (key.to_owned(), value)));
    }
}

/// The load's motion against the motor's.
#[derive(Debug, Clone)]
pub(crate) struct Load {
    /// Half the gap, rad or m.
    half: f64,
    /// Natural frequency of the contact, rad/s.
    contact: f64,
    /// Load inertia over motor inertia.
    ratio: f64,
    /// Acceleration of the whole machine per unit of command, and its deceleration by dry and
    /// viscous friction.
    per_command: f64,
    dry: f64,
    viscous: f64,
    /// Acceleration of the whole machine per unit of the measured load, and by its weight.
    per_force: f64,
    weight: f64,
    /// The last tilt, rad, and its sine.
    tilt: (f64, f64),
    /// Deceleration of the load by its own dry friction, and its friction over that of the whole
    /// machine, per inertia.
    coast: f64,
    share: f64,
    /// Command that the grip carries at its ceiling, in the command's unit.
    limit: f64,
    /// Half the creep at which the grip slips, rad/s or m/s.
    creep: f64,
    /// Lead over the load and its rate; none before the first command.
    lead: Option<(f64, f64)>,
}

/// Accelerations by friction and by forces on the load.
struct Held {
    /// To the motor's lead, against it.
    apart: f64,
    /// To the motor of a rigid machine and not to one that carries its load by a joint.
    missed: f64,
}

/// Inertia of a load over its motor's.
pub(super) const RATIOS: (f64, f64) = (0.2, 5.0);
/// Part of the machine's friction that the load's may be: the rig may have the machine's too small.
pub(super) const MOST_OF_DRY: f64 = 1.2;

/// The load's own dry friction over the whole inertia.
pub(super) fn own_friction(effect: &Effect) -> f64 {
    let Machine { coast, ratio, .. } = Machine::of(effect);
    coast * ratio / (1.0 + ratio)
}

/// A gap in the terms of a joint of this inertia.
pub(super) fn gap_of(effect: &Effect, width: f64, contact_hz: f64, inertia: f64) -> Gap {
    let Load { ratio, coast, share, viscous, .. } = Load::of(Machine::of(effect));
    let load = inertia * ratio / (1.0 + ratio);
    let (load_dry, load_damping) = (load * coast, load * share * viscous);
    Gap { width, ratio, load_dry, load_damping, contact_hz, damping: DAMPING }
}

/// Damping of the contact: it bounces once or twice.
const DAMPING: f64 = 0.3;
/// Time in which friction stops what it holds, s.
const HOLDING: f64 = 1e-3;
/// Longest step against the contact's frequency, rad, and of a grip, s.
const STEP: f64 = 0.35;
const GRIP_STEP_S: f64 = 1.2e-3;

impl Load {
    /// A load behind a gap, rad or m, whose contact has a natural frequency, Hz.
    pub(super) fn behind_gap(effect: &Effect, gap: f64, contact_hz: f64) -> Self {
        Self { half: 0.5 * gap, contact: TAU * contact_hz, ..Self::of(Machine::of(effect)) }
    }

    /// A load held by a grip that carries `limit`, in the command's unit, and slips at twice the
    /// creep `creep`, rad/s or m/s.
    pub(super) fn in_grip(effect: &Effect, limit: f64, creep: f64) -> Self {
        Self { limit, creep, ..Self::of(Machine::of(effect)) }
    }

    fn of(machine: Machine) -> Self {
        let Machine { per_command, dry, viscous, per_force, weight, coast, ratio } = machine;
        Self {
            half: 0.0,
            contact: 0.0,
            ratio,
            per_command,
            dry,
            viscous,
            per_force,
            weight,
            tilt: (0.0, 0.0),
            coast,
            share: if dry > 0.0 { coast / dry } else { 1.0 },
            limit: f64::INFINITY,
            creep: 0.0,
            lead: None,
        }
    }

    /// Command that drives the motor alone, beyond what the flanks of the gap carry, mean over the
    /// step.
    pub(crate) fn through_gap(&mut self, s: &State) -> f64 {
        let drive = s.command * self.per_command;
        // The first command finds the flank that pushes.
        let (mut lead, mut rate) = self.lead.unwrap_or((drive.signum() * self.half, 0.0));
        let steps = (s.dt * self.contact / STEP).ceil().clamp(1.0, 400.0);
        let h = s.dt / steps;
        let whole = 1.0 + self.ratio;
        let Held { apart, missed } = self.held(s);
        let mut sum = 0.0;
        for _ in 0..steps as usize {
            let over = lead - lead.clamp(-self.half, self.half);
            let push = self.contact * (self.contact * over + 2.0 * DAMPING * rate) / whole;
            // A flank pushes and never pulls.
            let carried = if over * push > 0.0 { push } else { 0.0 };
            let brake = self.brake(s.velocity - rate);
            rate += (whole * (drive - carried) - apart + brake) * h;
            lead += rate * h;
            sum += drive - carried;
        }
        self.lead = Some((lead, rate));
        (sum / steps - missed) / self.per_command
    }

    /// Command that drives the motor alone, beyond what the grip carries: little while it creeps,
    /// much while it slips.
    pub(crate) fn by_grip(&mut self, s: &State) -> f64 {
        let drive = s.command * self.per_command;
        let most = self.limit * self.per_command;
        let (_, mut rate) = self.lead.unwrap_or((0.0, 0.0));
        let steps = (s.dt / GRIP_STEP_S).ceil().clamp(1.0, 50.0);
        let h = s.dt / steps;
        let whole = 1.0 + self.ratio;
        let Held { apart, missed } = self.held(s);
        let mut sum = 0.0;
        for _ in 0..steps as usize {
            let brake = self.brake(s.velocity - rate);
            let pushed = rate + (whole * drive - apart + brake) * h;
            // What the grip carries at the end of the step: it follows faster than a step is long.
            let creep = after_grip(pushed / self.creep, whole * most.abs() * h / self.creep);
            rate = creep * self.creep;
            sum += drive - most.abs() * carried(creep);
        }
        self.lead = Some((0.0, rate));
        (sum / steps - missed) / self.per_command
    }

    fn held(&mut self, s: &State) -> Held {
        let way = if s.velocity == 0.0 { 0.0 } else { s.velocity.signum() };
        let friction = self.dry * way + self.viscous * s.velocity;
        let pulled = (self.per_force * s.external + self.weigh(s.tilt) + s.bias) / self.ratio;
        Held {
            apart: (1.0 + self.ratio) * pulled + (1.0 + self.ratio * (1.0 - self.share)) * friction,
            missed: (1.0 - self.share) * friction + pulled,
        }
    }

    /// Acceleration by the weight; the sine is taken once for every tilt.
    fn weigh(&mut self, tilt: f64) -> f64 {
        if self.weight == 0.0 {
            return 0.0;
        }
        if self.tilt.0 != tilt {
            self.tilt = (tilt, tilt.sin());
        }
        self.weight * self.tilt.1
    }

    /// Deceleration of the load by its own friction; near rest it holds rather than brakes.
    fn brake(&self, velocity: f64) -> f64 {
        let way = (velocity / (self.coast * HOLDING).max(1e-12)).clamp(-1.0, 1.0);
        self.coast * way + self.share * self.viscous * velocity
    }
}

/// Part of its ceiling that a rolling contact carries at a creep, as a part of half the creep at
/// which it slips (Carter 1926: the zone that sticks shrinks as the creep grows).
fn carried(creep: f64) -> f64 {
    if creep.abs() < 2.0 { creep - 0.25 * creep * creep.abs() } else { creep.signum() }
}

/// The creep x at which x + most · carried(x) = pushed: one implicit step.
fn after_grip(pushed: f64, most: f64) -> f64 {
    let size = pushed.abs();
    let x = if size >= 2.0 + most {
        size - most
    } else {
        // The smaller root of ¼·most·x² − (1 + most)·x + size = 0, written so that nothing cancels.
        let b = 1.0 + most;
        2.0 * size / (b + (b * b - most * size).max(0.0).sqrt())
    };
    x * pushed.signum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{Effect, EffectName};

    const RATIO: f64 = 1.5;

    fn grip() -> Load {
        let shape =
            [("ratio", RATIO), ("per_command", 100.0), ("dry", 10.0), ("coast", 10.0), ("per_force", 20.0)];
        Load::in_grip(&Effect::shaped(EffectName::RollerSlip, &shape), 0.5, 0.05)
    }

    /// Command that drives the motor alone after a while at one speed.
    fn settled(command: f64, external: f64) -> f64 {
        let mut load = grip();
        let state = State { command, external, velocity: 5.0, dt: 1e-3, ..State::default() };
        (0..2000).map(|_| load.by_grip(&state)).last().expect("some steps")
    }

    #[test]
    fn one_step_of_the_grip_ends_at_equilibrium() {
        for most in [0.0, 0.3, 4.0, 200.0] {
            for pushed in [-300.0, -1.0, 0.0, 0.7, 2.0 + 0.9 * most, 2.0 + most, 3.0 + 2.0 * most] {
                let x = after_grip(pushed, most);
                assert!((x + most * carried(x) - pushed).abs() < 1e-9 * (1.0 + pushed.abs() + most));
            }
        }
    }

    #[test]
    fn a_grip_below_its_ceiling_drives_load_above_it_motor() {
        // At its ceiling the grip carries half a unit of command as acceleration of both together.
        assert!(settled(0.2, 0.0).abs() < 1e-3, "it holds");
        assert!((settled(2.0, 0.0) - 1.5).abs() < 0.05, "what is beyond the ceiling drives the motor alone");
    }

    #[test]
    fn what_pulls_at_the_load_goes_through_the_grip() {
        // A load that is held back by F needs F more through the grip: it lets go although the
        // command is small.
        let held_back = settled(0.35, -2.0);
        let pulled = -2.0 * 20.0 / 100.0;
        assert!((held_back - (0.35 - 0.5 - pulled / RATIO)).abs() < 0.05, "{held_back}");
    }
}
