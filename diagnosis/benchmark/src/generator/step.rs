//! The integrator: position Verlet (second order, symplectic) with impulse-level dry friction
//! (Moreau's time stepping), at steps of 10 µs or less. A step that would reverse the motion under
//! friction ends at rest, so stick and slip are events and no speed threshold decides them.

use super::foreign::{ForeignState, Moment};
use super::plant::{Plant, Presliding, Train, harmonic_sum, sign};

/// The state of a plant.
pub(super) struct State {
    pub(super) q: f64,
    pub(super) v: f64,
    load_q: f64,
    load_v: f64,
    current: f64,
    bristle: f64,
    elements: Vec<f64>,
    foreign: ForeignState,
}

impl State {
    /// A plant at rest at `start`. `phase` is that of the oscillations that a foreign force begins
    /// with, in rad.
    pub(super) fn new(plant: &Plant, start: f64, phase: f64) -> Self {
        let elements = match &plant.dry.presliding {
            Some(Presliding::MaxwellSlip { elements }) => elements.len(),
            _ => 0,
        };
        Self {
            q: start,
            v: 0.0,
            load_q: start,
            load_v: 0.0,
            current: 0.0,
            bristle: 0.0,
            elements: vec![0.0; elements],
            foreign: ForeignState::new(start, phase),
        }
    }
}

/// One step in time, and what acts on the plant in its middle.
pub(super) struct Instant {
    /// Time of the middle, s.
    pub(super) t: f64,
    /// Length of the step, s.
    pub(super) h: f64,
    /// Time since the machine was switched on, s.
    pub(super) warm: f64,
    /// Time at which the run ends, s.
    pub(super) end: f64,
    /// The command that arrives, after its delay.
    pub(super) command: f64,
    pub(super) tilt: f64,
    /// External load on q, positive in the insertion direction.
    pub(super) external: f64,
    /// Offset of this recording beyond the plant's, as a force.
    pub(super) offset: f64,
    /// Noise and wander of the force.
    pub(super) disturbance: f64,
}

/// The motion in one step.
pub(super) struct PlantStep {
    pub(super) mean_speed: f64,
    pub(super) speed_change: f64,
    pub(super) at_rest: bool,
}

/// The forces of a step on the motor and on the load, without friction, and the inertia that they
/// move.
struct Forces {
    /// The drive's own, which dry friction may depend on; it is part of `motor`.
    drive: f64,
    motor: f64,
    load: f64,
    inertia: f64,
}

/// Makes one step.
pub(super) fn advance(plant: &Plant, s: &mut State, at: &Instant) -> PlantStep {
    let before = s.v;
    s.q += 0.5 * at.h * s.v;
    s.load_q += 0.5 * at.h * s.load_v;
    let forces = s.forces(plant, at);
    let at_rest = match plant.train {
        Train::Rigid => s.move_rigid(plant, at, &forces),
        Train::Spring { load_share, friction_share, .. }
        | Train::Gap { load_share, friction_share, .. }
        | Train::Slip { load_share, friction_share, .. } => {
            s.move_coupled(plant, at, &forces, load_share, friction_share)
        }
    };
    PlantStep { mean_speed: 0.5 * (before + s.v), speed_change: s.v - before, at_rest }
}

impl State {
    fn forces(&mut self, plant: &Plant, at: &Instant) -> Forces {
        let shaped = plant.shaped_command(at.command);
        if plant.lag > 0.0 {
            self.current += (shaped - self.current) * (1.0 - (-at.h / plant.lag).exp());
        } else {
            self.current = shaped;
        }
        let drive = plant.force_constant(self.q, at.warm) * self.current;
        let motor = drive + harmonic_sum(&plant.cogging, plant.angle(self.q));
        let rigid = matches!(plant.train, Train::Rigid);
        let (q, v) = if rigid { (self.q, self.v) } else { (self.load_q, self.load_v) };
        let mut load = plant.offset + at.offset + plant.weight * at.tilt.sin() + at.external + at.disturbance;
        let mut inertia = plant.inertia;
        if let Some((amplitude, phase)) = plant.imbalance {
            load += amplitude * (plant.angle(q) + phase + at.tilt).sin();
        }
        if let Some((stiffness, rest, cubic)) = plant.spring {
            let x = q - rest;
            load -= stiffness * x * (1.0 + cubic * x * x);
        }
        if let Some((span, shape)) = plant.damping_profile {
            load -= span * shape.at(q) * v;
        }
        load -= plant.drag * v * v.abs();
        let moment = Moment { q, v, t: at.t, h: at.h, end: at.end };
        for foreign in &plant.foreign {
            load += self.foreign.force(foreign, &moment, &mut inertia);
        }
        Forces { drive, motor, load, inertia }
    }

    /// Moves a plant in which motor and load are one. True if it ends at rest.
    fn move_rigid(&mut self, plant: &Plant, at: &Instant, forces: &Forces) -> bool {
        let (h, inertia) = (at.h, forces.inertia);
        let q = self.q;
        let level = |v: f64| plant.dry_level(v, q, at.warm, at.external, forces.drive);
        let smooth = forces.motor + forces.load
            - plant.viscous * (1.0 + plant.viscous_asymmetry * sign(self.v)) * self.v;
        let at_rest;
        if let Some(presliding) = &plant.dry.presliding {
            let friction =
                presliding_force(presliding, level(self.v), self.v, h, &mut self.bristle, &mut self.elements);
            self.v += h / inertia * (smooth - friction);
            at_rest = false;
        } else {
            (self.v, at_rest) = under_friction(inertia * self.v + h * smooth, inertia, h, self.v, level);
        }
        self.q += 0.5 * h * self.v;
        self.load_q = self.q;
        self.load_v = self.v;
        at_rest
    }

    /// Moves motor and load that a train couples; the shares are those of the load. True if the
    /// motor ends at rest.
    fn move_coupled(
        &mut self,
        plant: &Plant,
        at: &Instant,
        forces: &Forces,
        load_share: f64,
        friction_share: f64,
    ) -> bool {
        let h = at.h;
        let coupling = coupling_force(plant.train, self.q - self.load_q, self.v - self.load_v);
        let (jm, jl) = (forces.inertia * (1.0 - load_share), forces.inertia * load_share);
        let viscous =
            |v: f64, part: f64| plant.viscous * part * (1.0 + plant.viscous_asymmetry * sign(v)) * v;
        let motor_smooth = forces.motor - coupling - viscous(self.v, 1.0 - friction_share);
        let load_smooth = forces.load + coupling - viscous(self.load_v, friction_share);
        let level =
            |v: f64, q: f64, part: f64| part * plant.dry_level(v, q, at.warm, at.external, forces.drive);
        let (q, load_q) = (self.q, self.load_q);
        let (v, at_rest) = under_friction(jm * self.v + h * motor_smooth, jm, h, self.v, |v| {
            level(v, q, 1.0 - friction_share)
        });
        let (load_v, _) = under_friction(jl * self.load_v + h * load_smooth, jl, h, self.load_v, |v| {
            level(v, load_q, friction_share)
        });
        self.v = v;
        self.load_v = load_v;
        self.q += 0.5 * h * self.v;
        self.load_q += 0.5 * h * self.load_v;
        at_rest
    }
}

/// Dry friction as an impulse: it brings the momentum towards zero by at most `h · level` and never
/// past it.
fn under_friction(
    momentum: f64,
    inertia: f64,
    h: f64,
    speed: f64,
    level: impl Fn(f64) -> f64,
) -> (f64, bool) {
    // At rest the direction is the one in which the rest would be left.
    let state = if speed == 0.0 { sign(momentum) * 1e-15 } else { speed };
    let most = h * level(state);
    if momentum.abs() <= most {
        return (0.0, true);
    }
    ((momentum - most * sign(momentum)) / inertia, false)
}

fn presliding_force(
    law: &Presliding,
    level: f64,
    v: f64,
    h: f64,
    bristle: &mut f64,
    elements: &mut [f64],
) -> f64 {
    match law {
        Presliding::LuGre { stiffness, damping } => {
            // Implicit in z: stable at any speed.
            let z = (*bristle + h * v) / (1.0 + h * stiffness * v.abs() / level.max(1e-12));
            let rate = (z - *bristle) / h;
            *bristle = z;
            stiffness * z + damping * rate
        }
        Presliding::MaxwellSlip { elements: shares } => {
            let mut force = 0.0;
            for (state, &(share, stiffness)) in elements.iter_mut().zip(shares) {
                let most = share * level;
                *state = (*state + stiffness * v * h).clamp(-most, most);
                force += *state;
            }
            force
        }
    }
}

fn coupling_force(train: Train, twist: f64, rate: f64) -> f64 {
    match train {
        Train::Rigid => 0.0,
        Train::Spring { stiffness, damping, .. } => stiffness * twist + damping * rate,
        Train::Gap { gap, stiffness, damping, .. } => {
            let depth = twist.abs() - 0.5 * gap;
            if depth <= 0.0 {
                return 0.0;
            }
            // A contact pushes and never pulls.
            let side = sign(twist);
            side * (stiffness * depth + damping * rate * side).max(0.0)
        }
        Train::Slip { ceiling, creep, .. } => ceiling * (rate / creep).tanh(),
    }
}
