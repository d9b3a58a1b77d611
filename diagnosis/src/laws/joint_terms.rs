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
