//! The part of the machine beyond a gap or a grip: a second mass that is seen only by what the motor feels of it.
//!
//! With J = Jm + Jl, p = Jl/J and r = Jl/Jm, a rigid machine accelerates by d − f, where d = D/J and f = F/J against the
//! motion. A load that brakes itself by a, reached through a force T, makes of it r·(d − y − (f − a)) more, y = T/(p·J).
//! The motor's lead w over its load follows w″ = (1 + r)·(d − y − (f − a)) while both go the same way, and the load's
//! friction turns with the load. Through a gap T is a stiff, damped contact; through a grip T rises with the creep w′ up to
//! a ceiling, friction taken as shared like the inertia. Both are driven by the command, so that little noise of the
//! measured motion enters, and bounded, so that nothing drifts.

use super::law::State;
use super::{Effect, PerStep};
use std::f64::consts::TAU;

/// The load's motion against the motor's.
#[derive(Debug, Clone)]
pub(crate) struct Load {
    /// Half the gap, rad or m.
    half: f64,
    /// Natural frequency of the contact, rad/s.
    contact: f64,
    /// Load inertia over motor inertia.
    ratio: f64,
    /// Acceleration of the whole machine per unit of command, its deceleration by dry friction, and the load's by its own.
    per_command: f64,
    dry: f64,
    coast: f64,
    /// Command that the grip carries at its ceiling, in the command's unit.
    limit: f64,
    /// Time in which the creep follows the command, s.
    creep_time: f64,
    /// What is left of a difference to the creep after a step.
    creep_left: PerStep<f64>,
    /// Lead over the load and its rate; none before the first command.
    lead: Option<(f64, f64)>,
    /// Creep as a part of that at which the grip is at its ceiling.
    creep: f64,
}

/// Damping of the contact: it bounces once or twice.
const DAMPING: f64 = 0.3;
/// Time in which friction stops what it holds, s.
const HOLDING: f64 = 1e-3;
/// Longest step against the contact's frequency, rad.
const STEP: f64 = 0.35;

impl Load {
    pub(crate) fn new(effect: &Effect) -> Self {
        let get = |key: &str, otherwise: f64| effect.shape_or(key, otherwise);
        Self {
            half: 0.5 * get("gap", 0.0),
            contact: TAU * get("contact_hz", 200.0),
            ratio: get("ratio", 1.0),
            per_command: get("per_command", 1.0),
            dry: get("dry", 0.0),
            coast: get("coast", 0.0),
            limit: get("limit", f64::INFINITY),
            creep_time: get("creep_time", 1e-3),
            creep_left: PerStep::new(),
            lead: None,
            creep: 0.0,
        }
    }

    /// Command that drives the motor alone, beyond what the flanks of the gap carry, mean over the step.
    pub(crate) fn through_gap(&mut self, s: &State) -> f64 {
        let drive = s.command * self.per_command;
        // The first command finds the flank that pushes.
        let (mut lead, mut rate) = self.lead.unwrap_or((drive.signum() * self.half, 0.0));
        let steps = (s.dt * self.contact / STEP).ceil().clamp(1.0, 400.0);
        let h = s.dt / steps;
        let whole = 1.0 + self.ratio;
        let way = if s.velocity == 0.0 { 0.0 } else { s.velocity.signum() };
        let motor_friction = (whole * self.dry - self.ratio * self.coast) * way;
        let mut sum = 0.0;
        for _ in 0..steps as usize {
            let over = lead - lead.clamp(-self.half, self.half);
            let push = self.contact * (self.contact * over + 2.0 * DAMPING * rate) / whole;
            // A flank pushes and never pulls.
            let carried = if over * push > 0.0 { push } else { 0.0 };
            // Near rest the load's friction holds rather than brakes.
            let load_way = ((s.velocity - rate) / (self.coast * HOLDING).max(1e-12)).clamp(-1.0, 1.0);
            rate += (whole * (drive - carried) - motor_friction + self.coast * load_way) * h;
            lead += rate * h;
            sum += drive - carried;
        }
        self.lead = Some((lead, rate));
        (sum / steps - (self.dry - self.coast) * way) / self.per_command
    }

    /// Command that drives the motor alone, beyond what the grip carries: little while it creeps, much while it slips.
    pub(crate) fn by_grip(&mut self, command: f64, dt: f64) -> f64 {
        let wanted = command / self.limit;
        let held = self.creep.clamp(-1.0, 1.0);
        let time = self.creep_time.max(1e-9);
        self.creep = if self.creep.abs() < 1.0 {
            wanted + (self.creep - wanted) * self.creep_left.of(dt, |dt| (-dt / time).exp())
        } else {
            self.creep + (wanted - held) * dt / time
        };
        let carried = 0.5 * (held + self.creep.clamp(-1.0, 1.0));
        command - self.limit * carried
    }
}
