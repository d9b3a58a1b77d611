//! The servo of an excitation, for the mechanism that it moves.

use control_core::excitation::Servo;
use control_core::units::{Damping, Stiffness};
use fixed::types::{I8F24, I16F16};

/// A soft servo for an inertia in kg·m² on a roller of this radius.
pub fn servo(inertia: f64, radius_mm: f64) -> Servo {
    on_roller(experiment::Servo::of(inertia), radius_mm)
}

/// A servo of the angle, N·m/rad and N·m·s/rad, along the surface of a roller of this radius.
pub fn on_roller(of_angle: experiment::Servo, radius_mm: f64) -> Servo {
    let radius = radius_mm * 1e-3;
    // N/m and N·s/m are 1,000 of a N/mm and a N·s/mm.
    let along = |of_angle: f64| 1e-3 * of_angle / (radius * radius);
    Servo {
        stiffness: Stiffness(I16F16::saturating_from_num(along(of_angle.stiffness))),
        damping: Damping(I8F24::saturating_from_num(along(of_angle.damping))),
    }
}
