//! A rival under an input.

use crate::case::{Limits, Rival};
use crate::input::{Input, Servo};
use diagnosis::simulation::{Plant, Surroundings};

/// Step of the plant and row of a prediction, s.
pub(crate) const STEP_S: f64 = 1e-4;

/// The motion of one rival under an input, a row each 0.1 ms.
#[derive(Clone, Debug, Default)]
pub struct Prediction {
    /// rad or m, from the start.
    pub position: Vec<f64>,
    /// rad/s or m/s.
    pub velocity: Vec<f64>,
    /// In the rig's unit.
    pub command: Vec<f64>,
    /// The servo's reference, rad or m from the start.
    pub reference: Vec<f64>,
}

impl Prediction {
    /// Simulates a rival under an input and the servo; the force is limited to `limits`.
    pub fn new(rival: &Rival, input: &Input, servo: Servo, limits: &Limits) -> Self {
        let mut plant = Plant::unpowered(&rival.rig);
        let gain = rival.rig.actuator.gain;
        let mut out = Self::default();
        // From segment to segment the reference goes on from where it is, as on the device.
        let mut begin = plant.reading();
        for segment in &input.segments {
            let rows = (segment.seconds / STEP_S).round() as usize;
            for row in 0..rows {
                let target = segment.signal.at(row as f64 * STEP_S);
                let (position, velocity) = (plant.reading(), plant.velocity());
                let reference = begin + target.position;
                let force = servo.stiffness * (reference - position)
                    + servo.damping * (target.speed - velocity)
                    + target.force;
                let command = force.clamp(-limits.force, limits.force) / gain;
                out.position.push(plant.position());
                out.velocity.push(velocity);
                out.command.push(command);
                out.reference.push(reference);
                plant.step(command, Surroundings::default(), STEP_S);
            }
            begin += segment.signal.at(rows as f64 * STEP_S).position;
        }
        out
    }

    /// True if the motion stays within limits.
    pub fn is_within(&self, limits: &Limits, gain: f64) -> bool {
        let most = |column: &[f64]| column.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let ahead = self.position.iter().copied().fold(0.0, f64::max);
        let behind = -self.position.iter().copied().fold(0.0, f64::min);
        let is_inside = ahead <= limits.travel && behind <= limits.back;
        // A force at its limit was cut there: the input asks for more than may be.
        is_inside && most(&self.velocity) <= limits.speed && most(&self.command) * gain.abs() < limits.force
    }
}
