//! The servo of an excitation, for the mechanism that it moves.

use control_core::excitation::Servo;
use control_core::units::{Damping, Stiffness};
use fixed::types::{I8F24, I16F16};

/// A soft servo for an inertia in kg·m² on a roller of this radius.
pub fn servo(inertia: f64, radius_mm: f64) -> Servo {
    let radius = radius_mm * 1e-3;
    // Inertia seen along the surface of the roller, kg; N/m and N·s/m are 1,000 of a N/mm and a
    // N·s/mm.
    let mass = inertia / (radius * radius);
    let soft = experiment::Servo::of(mass);
    Servo {
        stiffness: Stiffness(I16F16::saturating_from_num(soft.stiffness * 1e-3)),
        damping: Damping(I8F24::saturating_from_num(soft.damping * 1e-3)),
    }
}
