//! A machine in the terms of other simulators: one joint and its motor. Each effect adds what such
//! terms can say of it.

/// A joint and its motor; N·m and rad, or N and m.
#[derive(Debug, Clone, Default)]
pub(crate) struct JointTerms {
    /// Inertia, kg·m² or kg.
    pub(crate) inertia: f64,
    /// Force per speed, dry friction, and a force that is there all the time.
    pub(crate) viscous: f64,
    pub(crate) dry: f64,
    pub(crate) bias: f64,
    /// Force per travel of a spring, and where it is slack, from the start.
    pub(crate) stiffness: f64,
    pub(crate) slack: f64,
    /// Force per unit of command.
    pub(crate) gain: f64,
    /// Largest |command| that is applied, where there is a limit, in units of command.
    pub(crate) limit: Option<f64>,
    /// Time between command and force, and time constant of their first-order lag, s.
    pub(crate) delay: f64,
    pub(crate) lag: f64,
    /// A gap between motor and load.
    pub(crate) gap: Option<Gap>,
    /// Bristles that bend before the dry friction slides.
    pub(crate) bristles: Option<Bristles>,
    /// A drop of the dry friction with speed.
    pub(crate) drop: Option<Drop>,
    /// Forces periodic in the coordinate.
    pub(crate) waves: Vec<Wave>,
    /// Notes on what a joint and its motor cannot express.
    pub(crate) notes: Vec<String>,
}

/// A gap between the motor and its load.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gap {
    /// rad or m.
    pub(crate) width: f64,
    /// Load inertia over motor inertia.
    pub(crate) ratio: f64,
    /// Friction of the load alone: its part of what the joint has.
    pub(crate) load_dry: f64,
    pub(crate) load_damping: f64,
    /// Natural frequency of both while a flank touches, Hz, and its damping ratio.
    pub(crate) contact_hz: f64,
    pub(crate) damping: f64,
}

/// LuGre's bristles: a part of the dry friction holds elastically before it slides.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bristles {
    /// That part, N·m or N.
    pub(crate) dry: f64,
    /// Travel over which they bend, rad or m.
    pub(crate) deflection: f64,
    /// Force per speed of their bending.
    pub(crate) damping: f64,
}

/// A peak of dry friction at rest that falls by `exp(-(v/speed)²)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drop {
    /// N·m or N.
    pub(crate) peak: f64,
    /// rad/s or m/s.
    pub(crate) speed: f64,
}

/// A force `amplitude · sin(wave · q + phase)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wave {
    /// N·m or N.
    pub(crate) amplitude: f64,
    /// rad per unit of travel.
    pub(crate) wave: f64,
    /// rad.
    pub(crate) phase: f64,
}
