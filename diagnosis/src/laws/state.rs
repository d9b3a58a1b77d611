//! The state of the plant, as the law of an effect sees it.

/// The plant's state during one step.
#[derive(Debug, Clone, Copy, Default)]
pub struct State {
    /// Position from the start of the recording or simulation, rad or m.
    pub position: f64,
    /// rad/s or m/s.
    pub velocity: f64,
    /// rad/s² or m/s²; asked only by what no plant has.
    pub acceleration: f64,
    /// True if the sign of the velocity is unknown: friction is a reaction then and not in the
    /// model.
    pub rest: bool,
    /// Force that the command asks for: gain · effective command, N·m or N.
    pub drive: f64,
    /// Effective command, in the rig's unit.
    pub command: f64,
    /// Inclination below the horizontal, rad.
    pub tilt: f64,
    /// External load on the coordinate, N·m or N.
    pub external: f64,
    /// Acceleration by the force that is there all the time, rad/s² or m/s².
    pub bias: f64,
    /// Since the start, s.
    pub time: f64,
    /// Length of the step, s.
    pub dt: f64,
}
