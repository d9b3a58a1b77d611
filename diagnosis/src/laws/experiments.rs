//! Recordings that would distinguish effects, where more than one effect asks for the same.

/// At one speed, effects that depend on speed look like those that do not.
pub(crate) const SPEEDS: &str = "a staircase of constant speeds over two decades, both ways";

/// A spring, a damping and a friction along the travel.
pub(super) const STROKES: &str = "strokes over the whole travel at two speeds, both ways: a spring does not change sign with direction, damping grows with speed";

/// Gain and friction that drift.
pub(super) const LATE: &str = "a long run whose load or acceleration is varied late, once warm: a drifting gain scales every torque, a drifting friction only the one against motion";

/// Delay and lag.
pub(super) const PHASE: &str = "a multisine in the command up to a fifth of the sampling rate: a delay keeps its amplitude and turns its phase in proportion to frequency, a lag loses amplitude";

/// A drive that clips and a joint that slips.
pub(super) const BLOCKED: &str = "a ramp of the command against a blocked axis with the force measured: a drive that clips holds its force, one that slips lets it fall";

/// The recording to make where no effect asks for another.
pub(crate) const RICH: &str =
    "a two-decade staircase of speeds both ways, followed by a multisine in the command";
