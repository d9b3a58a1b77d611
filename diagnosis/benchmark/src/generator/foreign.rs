//! Forces outside the contract's names, and the states that they keep from step to step.

use super::plant::Foreign;

/// The states of the foreign forces.
pub(super) struct ForeignState {
    /// Place at which a creeping spring rests, u.
    creep: f64,
    /// Phase of a whirling force, rad.
    phase: f64,
    /// Phase of a hum at time zero, rad.
    hum_phase: f64,
    /// Speed of a flywheel behind a one-way clutch.
    flywheel: f64,
    /// Latches that have snapped over, one bit each.
    latched: u32,
}

/// One step of the load.
pub(super) struct Moment {
    pub(super) q: f64,
    pub(super) v: f64,
    /// Time, length of the step, and time at which the run ends, s.
    pub(super) t: f64,
    pub(super) h: f64,
    pub(super) end: f64,
}

impl ForeignState {
    pub(super) fn new(start: f64, phase: f64) -> Self {
        Self { creep: start, phase, hum_phase: phase, flywheel: 0.0, latched: 0 }
    }

    /// Returns the force in the step; some change the inertia instead, or as well.
    pub(super) fn force(&mut self, foreign: &Foreign, at: &Moment, inertia: &mut f64) -> f64 {
        let &Moment { q, v, t, h, end } = at;
        match foreign {
            Foreign::CreepSpring { stiffness, relaxation } => {
                self.creep += (q - self.creep) * (h / relaxation);
                -stiffness * (q - self.creep)
            }
            Foreign::WhirlingForce { amplitude, base_hz, per_speed_hz, power } => {
                self.phase += std::f64::consts::TAU * h * (base_hz + per_speed_hz * v.abs().powf(*power));
                amplitude * self.phase.sin()
            }
            Foreign::Hum { amplitude, hertz } => {
                amplitude * (std::f64::consts::TAU * hertz * t + self.hum_phase).sin()
            }
            Foreign::Wells { wells } => wells_force(wells, q),
            Foreign::PayloadChange { share, at } => {
                if t > at * end {
                    *inertia *= 1.0 + share;
                }
                0.0
            }
            Foreign::Flywheel { share } => {
                self.turn_flywheel(*share, v, h, inertia);
                0.0
            }
            Foreign::Latch { force, places, side } => self.latch_force(*force, places, *side, q),
            Foreign::Shuttle { amplitude, centre, scale } => {
                let x = (q - centre) * v / scale;
                amplitude * 2.0 * x / (1.0 + x * x)
            }
            Foreign::Linkage { share, centre, width } => {
                let x = (q - centre) / width;
                let bump = (-0.5 * x * x).exp();
                let slope = -x / width * bump * share * *inertia;
                *inertia *= 1.0 + share * bump;
                -0.5 * slope * v * v
            }
        }
    }

    /// A one-way clutch: the flywheel is pushed along and never holds back.
    fn turn_flywheel(&mut self, share: f64, v: f64, h: f64, inertia: &mut f64) {
        if v >= self.flywheel - 1e-12 {
            *inertia *= 1.0 + share;
            self.flywheel = v;
        } else {
            self.flywheel *= 1.0 - h / 0.5;
        }
    }

    /// Latches that snap over above the first of their places and back below the second.
    fn latch_force(&mut self, force: f64, places: &[(f64, f64)], side: f64, q: f64) -> f64 {
        for (i, &(up, down)) in places.iter().enumerate() {
            if q > up {
                self.latched |= 1 << i;
            } else if q < down {
                self.latched &= !(1 << i);
            }
        }
        if self.latched.count_ones() % 2 == 1 { force * side } else { -force * side }
    }
}

/// Wells of (depth, centre, width) along the travel.
fn wells_force(wells: &[(f64, f64, f64)], q: f64) -> f64 {
    wells
        .iter()
        .map(|&(depth, centre, width)| {
            let x = (q - centre) / width;
            -depth / width * x * (-0.5 * x * x).exp()
        })
        .sum()
}
