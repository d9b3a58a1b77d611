//! Which shapes of each effect are worth trying on given recordings: the grids from which refinement starts.

use crate::effects::{Effect, EffectName as N};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::model::{Machine, Nominal};
use crate::io::rig::Kind;
use crate::numerics::golden::logarithmic;
use crate::numerics::linear::correlation;
use std::f64::consts::TAU;

/// What the recordings span.
#[derive(Debug, Clone)]
pub(crate) struct Span {
    /// Speed that 99 % of the blocks stay below, and the floor under which its sign is unknown.
    pub(crate) speed: f64,
    pub(crate) speed_floor: f64,
    /// Speed that a twelfth of the moving blocks stay below.
    pub(crate) slow: f64,
    /// Travel relative to the start of each recording.
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Largest |command|.
    pub(crate) command: f64,
    /// Longest recording, s.
    pub(crate) duration: f64,
    /// Mean time between rows, s, and between blocks.
    pub(crate) row: f64,
    pub(crate) block: f64,
    /// One count.
    pub(crate) count: f64,
    /// Smallest part of the largest command at which a drive may clip. Where the inertia is hardly known, a drive that
    /// clips at little explains slow motion as well as forces in balance do.
    pub(crate) clip: f64,
    /// Largest command that may do nothing.
    pub(crate) dead: f64,
    /// Whether the columns are there and vary.
    pub(crate) tilt: bool,
    pub(crate) force: bool,
    /// Whether the tilt is the axis' own angle.
    pub(crate) tilt_is_angle: bool,
}

/// Correlation of tilt and angle from which on they are the same.
const SAME_ANGLE: f64 = 0.98;

/// Whether the tilt of every recording follows its travel.
fn tilt_is_angle(tracks: &[BlockedRecording]) -> bool {
    tracks
        .iter()
        .all(|track| track.tilt.as_ref().is_some_and(|tilt| correlation(tilt, &track.x).abs() > SAME_ANGLE))
}

fn varies(columns: impl Iterator<Item = Option<f64>>) -> bool {
    let mut all = columns.flatten();
    let Some(first) = all.next() else { return false };
    let (low, high) = all.fold((first, first), |(a, b), x| (a.min(x), b.max(x)));
    high - low > 1e-9 * (high.abs() + low.abs()).max(1e-300)
}

impl Span {
    pub(crate) fn of(tracks: &[BlockedRecording], nominal: &Nominal) -> Self {
        let mut speeds: Vec<f64> = tracks.iter().flat_map(|t| t.v.iter().map(|v| v.abs())).collect();
        speeds.sort_by(f64::total_cmp);
        let fold = |pick: &dyn Fn(&BlockedRecording) -> f64| {
            tracks.iter().map(pick).fold(f64::NEG_INFINITY, f64::max)
        };
        let rows: f64 = tracks.iter().map(|t| t.row_hold.len() as f64).sum();
        let blocks: f64 = tracks.iter().map(|t| t.blocks() as f64).sum();
        let seconds: f64 = tracks.iter().map(|t| t.row_time.last().copied().unwrap_or(0.0)).sum();
        let mut moving: Vec<f64> = tracks
            .iter()
            .flat_map(|t| t.v.iter().zip(&t.rest).filter(|(_, rest)| !**rest).map(|(v, _)| v.abs()))
            .collect();
        moving.sort_by(f64::total_cmp);
        let command = fold(&|t| t.command.iter().fold(0.0, |m: f64, u| m.max(u.abs())));
        let fast = speeds[speeds.len() * 99 / 100];
        Self {
            slow: moving.get(moving.len() / 12).copied().unwrap_or(0.3 * fast).min(0.3 * fast),
            speed: fast,
            speed_floor: fold(&|t| t.speed_floor),
            low: -fold(&|t| -t.x.iter().copied().fold(f64::INFINITY, f64::min)),
            high: fold(&|t| t.x.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
            command,
            duration: fold(&|t| t.row_time.last().copied().unwrap_or(0.0)),
            row: seconds / rows,
            block: seconds / blocks,
            count: 1.0 / nominal.rig.encoder.counts_per_unit,
            clip: if nominal.anchor.is_some() { 0.45 } else { 0.27 },
            dead: nominal.most_ignored() * command,
            tilt: varies(tracks.iter().flat_map(|t| column(&t.tilt))),
            tilt_is_angle: tilt_is_angle(tracks),
            force: varies(tracks.iter().flat_map(|t| column(&t.force))),
        }
    }

    /// Highest resonance of a load on a spring that still shows in how fast the motor answers, Hz.
    fn highest_resonance(&self) -> f64 {
        (0.5 / self.block).max((0.25 / self.row).min(STIFFEST_HZ))
    }

    /// Widest gap worth looking for: one that the axis crosses within a moment at its fast speed.
    fn widest_gap(&self) -> f64 {
        (0.08 * self.speed).max(60.0 * self.count)
    }

    /// Least command at which a grip lets go: what slips under friction alone never held.
    fn least_grip(&self, machine: &Machine) -> f64 {
        (machine.dry / machine.per_command.abs()).clamp(0.02 * self.command, 0.5 * self.command)
    }

    pub(crate) fn travel(&self) -> f64 {
        self.high - self.low
    }
}

fn column(values: &Option<Vec<f64>>) -> impl Iterator<Item = Option<f64>> + '_ {
    values.iter().flatten().map(|x| Some(*x))
}

/// Longest over shortest of the lengths over which bristles bend, where they are not all alike: asperities of many sizes.
const SPREAD: f64 = 10.0;

/// Resonance above which a spring holds like a solid shaft, Hz.
const STIFFEST_HZ: f64 = 400.0;

/// Degrees of the polynomial that a profile along the travel may have: a slope or bend, a step or bump, and one that is
/// narrow beside the travel.
const PROFILE_DEGREES: [f64; 3] = [3.0, 6.0, 12.0];

/// Part of a turn over which once a turn is told from a slope, and over which gravity bends from a spring's straight line.
const LEAST_TURNS: f64 = 0.6;
const LEAST_OF_AXIS: f64 = 0.15;

fn once_a_turn(name: N, turn: f64) -> Effect {
    Effect::shaped(name, &[("turn", turn), ("order_1", 1.0)])
}

/// Turns over which an axis runs on rather than to and fro: a law of the travel is of a stroke.
const RUNS_ON: f64 = 100.0;
/// Part of the travel within which recordings must start for a law of the travel to be the same in all.
const SAME_PLACE: f64 = 0.3;

/// Whether a law of the travel may hold for all recordings.
fn has_stroke(span: &Span, nominal: &Nominal) -> bool {
    let runs_on = nominal.rig.kind == Kind::Rotary && span.travel() > RUNS_ON * TAU;
    match nominal.rig.encoder.start_spread {
        Some(spread) => spread < SAME_PLACE * span.travel(),
        None => !runs_on || nominal.rig.encoder.absolute,
    }
}

/// The shapes of an effect to start from; none where the recordings cannot show it or the rig holds it already.
/// Periodic effects and missed counts are sought in a way of their own.
pub(crate) fn shapes(name: N, span: &Span, nominal: &Nominal) -> Vec<Effect> {
    let follows_travel =
        matches!(name, N::PositionDependentFriction | N::PositionDependentDamping | N::PositionSpring);
    // A command that holds a part of the motion is none to clip or to delay, no joint is seen by it, and where force and command
    // are all but equal its scale is what everything is told by.
    let is_of_command = matches!(
        name,
        N::GainDrift
            | N::TorqueRipple
            | N::CommandDeadband
            | N::CommandSaturation
            | N::CommandDelay
            | N::ElectricalLag
            | N::Backlash
            | N::DriveCompliance
            | N::RollerSlip
    );
    if is_of_command && nominal.virtual_inertia > 0.0 {
        return Vec::new();
    }
    if nominal.holds(name) || (follows_travel && !has_stroke(span, nominal)) {
        return Vec::new();
    }
    let machine = nominal.machine(None);
    let one = |key: &str, values: Vec<f64>| -> Vec<Effect> {
        values.into_iter().map(|value| Effect::shaped(name, &[(key, value)])).collect()
    };
    let turn = nominal.rig.turn();
    let turns = turn.map_or(0.0, |turn| span.travel() / turn);
    match name {
        N::ViscousFriction | N::CoulombFriction | N::QuadraticDrag | N::MissedCounts => {
            vec![Effect::shaped(name, &[])]
        }
        N::AsymmetricFriction => {
            let known = nominal.rig.model.offset.is_some();
            vec![Effect::shaped(name, if known { &[("viscous_only", 1.0)] } else { &[] })]
        }
        N::StribeckFriction => {
            let from = (2.0 * span.speed_floor).max(0.004 * span.speed);
            let mut out = Vec::new();
            for exponent in [1.0, 2.0] {
                for speed in logarithmic(from, 0.4 * span.speed, 8) {
                    out.push(Effect::shaped(name, &[("speed", speed), ("exponent", exponent)]));
                }
            }
            out
        }
        N::PreslidingFriction => {
            let mut out = Vec::new();
            for spread in [1.0, SPREAD] {
                for deflection in logarithmic(2.0 * span.count, 0.03 * span.travel(), 9) {
                    out.push(Effect::shaped(name, &[("deflection", deflection), ("spread", spread)]));
                }
            }
            out
        }
        N::PositionDependentFriction | N::PositionDependentDamping => {
            let of =
                |degree| Effect::shaped(name, &[("low", span.low), ("high", span.high), ("degree", degree)]);
            PROFILE_DEGREES.map(of).to_vec()
        }
        N::LoadDependentFriction if span.force => vec![Effect::shaped(name, &[])],
        N::FrictionDrift | N::GainDrift => {
            let mut out = one("time_constant", logarithmic(0.08 * span.duration, 2.0 * span.duration, 5));
            if name == N::FrictionDrift && !nominal.holds(N::ViscousFriction) {
                for drift in &mut out {
                    drift.shape.insert("dry_only".into(), 1.0);
                }
            }
            out
        }
        N::CommandDeadband => {
            let mut out = Vec::new();
            for shift in [0.0, 1.0] {
                for width in logarithmic(0.01 * span.command, 0.85 * span.dead, 11) {
                    out.push(Effect::shaped(name, &[("half_width", width), ("shift", shift)]));
                }
            }
            out
        }
        N::CommandSaturation => one(
            "limit",
            (0..10).map(|i| span.command * (span.clip + (0.945 - span.clip) / 9.0 * f64::from(i))).collect(),
        ),
        N::RollerSlip => {
            let mut out = Vec::new();
            let own = [("coast", machine.dry), ("ratio", 1.0)];
            for creep in [0.003, 0.02].map(|part| part * span.speed) {
                for limit in logarithmic(span.least_grip(&machine), 0.945 * span.command, 10) {
                    let shape = [("limit", limit), ("creep", creep)];
                    out.push(Effect::shaped(name, &[shape.as_slice(), &own, &machine.shape()].concat()));
                }
            }
            out
        }
        N::CommandDelay => one("delay", logarithmic((0.2 * span.row).max(1e-5), 0.03, 16)),
        N::ElectricalLag => one("time_constant", logarithmic((0.2 * span.row).max(1e-5), 0.05, 9)),
        N::TiltGravity if span.tilt => vec![Effect::shaped(name, &[])],
        N::PositionSpring => {
            // A rig without an offset has no other term for a spring that is not at rest where the recording starts. Where
            // the inertia is hardly known one more term explains slow motion as well as forces in balance do.
            let is_free = nominal.rig.model.offset.is_none() && nominal.anchor.is_none();
            let preload = f64::from(u8::from(is_free));
            let mut out = vec![Effect::shaped(name, &[("from", 0.0), ("preload", preload)])];
            for part in [0.25, 0.5, 0.75] {
                let from = span.low + part * span.travel();
                out.push(Effect::shaped(name, &[("from", from), ("one_sided", 1.0)]));
            }
            out
        }
        N::Backlash => {
            let mut out = Vec::new();
            for coast in [0.6, 1.5].map(|part| part * machine.dry) {
                for gap in logarithmic(2.0 * span.count, span.widest_gap(), 12) {
                    let shape = [("gap", gap), ("coast", coast), ("contact_hz", 180.0), ("ratio", 1.0)];
                    out.push(Effect::shaped(name, &[shape.as_slice(), &machine.shape()].concat()));
                }
            }
            out
        }
        N::DriveCompliance => {
            let mut out = Vec::new();
            for damping in [0.02, 0.12] {
                for hz in logarithmic(5.0, 0.7 * span.highest_resonance(), 12) {
                    out.push(Effect::shaped(name, &[("resonance_hz", hz), ("damping", damping)]));
                }
            }
            out
        }
        N::EncoderEccentricity if turns > LEAST_TURNS => vec![once_a_turn(name, turn.unwrap_or(1.0))],
        // A weight whose tilt follows the angle is the gravity of that very mass.
        N::MassImbalance if nominal.holds(N::TiltGravity) && span.tilt_is_angle => Vec::new(),
        N::MassImbalance => {
            // Gravity turns with the axis, an unbalanced rotor with the motor.
            let axis = (nominal.rig.kind == Kind::Rotary).then_some(TAU);
            let motor = turn.filter(|turn| axis.is_none_or(|axis| (turn / axis - 1.0).abs() > 1e-6));
            let seen = |turn: &f64, least: f64| span.travel() > least * turn;
            let axis = axis.filter(|turn| seen(turn, LEAST_OF_AXIS));
            axis.into_iter()
                .chain(motor.filter(|turn| seen(turn, LEAST_TURNS)))
                .map(|turn| once_a_turn(name, turn))
                .collect()
        }
        _ => Vec::new(),
    }
}

/// The shape values that refinement may move, with their bounds.
pub(crate) fn movable(effect: &Effect, span: &Span) -> Vec<(&'static str, f64, f64)> {
    match effect.name {
        N::StribeckFriction => {
            vec![("speed", 0.002 * span.speed, span.speed), ("exponent", 0.7, 2.3)]
        }
        N::PreslidingFriction => vec![("deflection", 0.5 * span.count, 0.1 * span.travel())],
        N::FrictionDrift | N::GainDrift => vec![("time_constant", 0.02 * span.duration, 5.0 * span.duration)],
        N::CommandDeadband => vec![("half_width", 0.001 * span.command, span.dead)],
        N::CommandSaturation => vec![("limit", 0.9 * span.clip * span.command, span.command)],
        N::RollerSlip => {
            let dry = effect.shape_or("dry", 1.0);
            vec![
                // Beyond the largest command: what the load's own friction takes a grip carries too.
                ("limit", 0.01 * span.command, 2.0 * span.command),
                ("creep", 1e-4 * span.speed, 0.3 * span.speed),
                ("coast", 0.35 * dry, 2.5 * dry),
                ("ratio", RATIOS.0, RATIOS.1),
            ]
        }
        N::CommandDelay => vec![("delay", 1e-6, 0.06)],
        N::ElectricalLag => vec![("time_constant", 1e-6, 0.2)],
        N::PositionSpring if effect.shape_or("one_sided", 0.0) > 0.5 => Vec::new(),
        N::Backlash => {
            let dry = effect.shape_or("dry", 1.0);
            vec![
                ("gap", span.count, 2.0 * span.widest_gap()),
                ("coast", 0.2 * dry, 4.0 * dry),
                ("ratio", RATIOS.0, RATIOS.1),
                ("contact_hz", 30.0, 600.0),
            ]
        }
        N::DriveCompliance => vec![("resonance_hz", 4.0, span.highest_resonance()), ("damping", 0.003, 0.7)],
        _ => Vec::new(),
    }
}

/// Inertia of a load over its motor's.
const RATIOS: (f64, f64) = (0.2, 5.0);

/// Largest part of the travel over which bristles bend: microns of a slide, tenths of a degree of a turn.
const BRISTLES: f64 = 0.03;

/// How near, as a part of it, the end of what a value may be is to be at it.
const AT_END: f64 = 0.05;

/// Whether a drift is at the end of what may be told from something else: what settles at once is how a recording begins,
/// and what has hardly begun at its end is any slow change.
pub(crate) fn is_at_end(effect: &Effect, span: &Span) -> bool {
    matches!(effect.name, N::FrictionDrift | N::GainDrift)
        && movable(effect, span).iter().any(|(key, low, high)| {
            let value = effect.shape[*key];
            value < low * (1.0 + AT_END) || value > high * (1.0 - AT_END)
        })
}

/// Whether values of a shape go together: the load's own friction is no more than the machine's, and a grip holds its load
/// against it, or it never held.
pub(crate) fn is_possible(effect: &Effect) -> bool {
    let get = |key: &str| effect.shape_or(key, 0.0);
    let own = get("coast") * get("ratio") / (1.0 + get("ratio"));
    let holds = || get("limit") * get("per_command").abs() >= HOLDS * get("coast");
    match effect.name {
        N::RollerSlip => own <= MOST_OF_DRY * get("dry") && holds(),
        N::Backlash => own <= MOST_OF_DRY * get("dry"),
        _ => true,
    }
}

/// Part of the machine's friction that the load's may be: the rig may have the machine's too small.
const MOST_OF_DRY: f64 = 1.2;

/// What a grip carries at the least over its load's own friction, of which the rig tells no more than this.
const HOLDS: f64 = 0.9;

/// Part of the travel over which bristles bend, where that is more than bristles do: such a spring creeps.
pub(crate) fn creeps(effect: &Effect, span: &Span) -> Option<f64> {
    let part = effect.shape_or("deflection", 0.0) / span.travel();
    (effect.name == N::PreslidingFriction && part > BRISTLES).then_some(part)
}

/// Whether the likelihood of an effect's first shape value has several optima.
pub(crate) fn has_optima_apart(name: N) -> bool {
    matches!(
        name,
        N::CommandDeadband
            | N::CommandDelay
            | N::ElectricalLag
            | N::FrictionDrift
            | N::GainDrift
            | N::Backlash
            | N::RollerSlip
            | N::DriveCompliance
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drifts_settle_within_the_recording_bristles_are_short_and_grips_hold() {
        let span = Span {
            speed: 10.0,
            speed_floor: 0.1,
            slow: 1.0,
            low: 0.0,
            high: 20.0,
            command: 1.0,
            duration: 50.0,
            row: 1e-3,
            block: 2.5e-3,
            count: 1e-3,
            clip: 0.27,
            dead: 0.8,
            tilt: false,
            force: false,
            tilt_is_angle: false,
        };
        let at_end = |name: N, time_constant: f64| {
            is_at_end(&Effect::shaped(name, &[("time_constant", time_constant)]), &span)
        };
        for name in [N::FrictionDrift, N::GainDrift] {
            assert!(at_end(name, 1.0) && at_end(name, 250.0));
            assert!(!at_end(name, 2.0) && !at_end(name, 15.0) && !at_end(name, 100.0));
        }
        let bristles =
            |deflection| creeps(&Effect::shaped(N::PreslidingFriction, &[("deflection", deflection)]), &span);
        assert_eq!((bristles(1e-3), bristles(0.3), bristles(2.0)), (None, None, Some(0.1)));
        let grip = |limit, coast| {
            let shape =
                [("limit", limit), ("coast", coast), ("per_command", -10.0), ("dry", 5.0), ("ratio", 1.0)];
            is_possible(&Effect::shaped(N::RollerSlip, &shape))
        };
        assert!(grip(0.5, 5.0) && !grip(0.5, 6.0), "what cannot move its load is no grip");
        let gap = |ratio| {
            let shape = [("coast", 6.0), ("dry", 4.0), ("ratio", ratio)];
            is_possible(&Effect::shaped(N::Backlash, &shape))
        };
        assert!(gap(3.0) && !gap(5.0), "a load has no more friction than the machine");
        assert!(!at_end(N::ElectricalLag, 1e-6), "what is instant may be no lag, and is judged by its size");
    }
}
