//! What to record next: the experiment that would separate two effects, or show one at all.

use crate::effects::EffectName as N;

/// The recording that would decide within a class.
pub(crate) fn separating(class: &[N]) -> Option<String> {
    if class.len() < 2 {
        return None;
    }
    let has = |name: N| class.contains(&name);
    let text = if has(N::CommandDelay) && has(N::ElectricalLag) {
        "a multisine in the command up to a fifth of the sampling rate: a delay keeps its amplitude and turns its phase in proportion to frequency, a lag loses amplitude"
    } else if has(N::GainDrift) && has(N::FrictionDrift) {
        "a long run whose load or acceleration is varied late, once warm: a drifting gain scales every torque, a drifting friction only the one against motion"
    } else if has(N::PreslidingFriction) && (has(N::Backlash) || has(N::StribeckFriction)) {
        "a ladder of reversals with amplitudes from a few counts to a turn: bristles give a loop at every amplitude, a gap only above its width"
    } else if has(N::MassImbalance) && has(N::EncoderEccentricity) {
        "the same turns at a low and at a high constant speed: the error of an eccentric encoder grows with the square of speed, gravity does not"
    } else if has(N::MassImbalance) && has(N::PositionSpring) {
        "many turns in one direction at two tilts: gravity repeats every turn, a spring grows with travel"
    } else if has(N::MassImbalance) && has(N::Cogging) {
        "slow turns at two tilts of the axis: gravity changes with tilt, cogging does not"
    } else if has(N::QuadraticDrag) || (has(N::StribeckFriction) && has(N::ViscousFriction)) {
        SPEEDS
    } else if has(N::Cogging) && has(N::TorqueRipple) {
        "slow turns with a small and with a large constant load: ripple grows with the command, cogging does not"
    } else if has(N::CommandSaturation) && has(N::RollerSlip) {
        "a ramp of the command against a blocked axis with the force measured: a drive that clips holds its force, one that slips lets it fall"
    } else if has(N::CommandDeadband) {
        "a slow triangle of small commands through zero while the axis is kept moving by another load"
    } else if has(N::PositionDependentFriction) || has(N::PositionDependentDamping) || has(N::PositionSpring)
    {
        "strokes over the whole travel at two speeds, both ways: a spring does not change sign with direction, damping grows with speed"
    } else {
        "a two-decade staircase of speeds both ways, followed by a multisine in the command"
    };
    Some(text.to_owned())
}

/// What a recording needs so that a diagnosis is possible at all.
pub(crate) const GENERAL: &str = "ten seconds or more at 500 Hz or more with reversals, several speeds both ways and a \
    command that is not constant, for example a slow triangle with a multisine on top";

/// What recordings at one speed need beside them.
pub(crate) const SPEEDS: &str = "a staircase of constant speeds over two decades, both ways";
