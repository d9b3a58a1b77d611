//! The candidate shapes of each effect for given recordings: the grids from which refinement
//! starts.

use crate::data::rig::Kind;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::nominal::Nominal;
use crate::laws::definition::{Movable, NominalTerm, RigFacts, Span};
use crate::laws::{Effect, EffectName as N};
use numerics::linear::correlation;
use regression::laws::Need;
use std::f64::consts::TAU;

/// Correlation of tilt and angle from which they count as the same.
const SAME_ANGLE: f64 = 0.98;

/// True if the tilt of every recording follows its travel.
fn tilt_is_angle(tracks: &[BlockedRecording]) -> bool {
    tracks.iter().all(|track| {
        track.blocks.tilt.as_ref().is_some_and(|tilt| correlation(tilt, &track.motion.x).abs() > SAME_ANGLE)
    })
}

fn varies(columns: impl Iterator<Item = Option<f64>>) -> bool {
    let mut all = columns.flatten();
    let Some(first) = all.next() else { return false };
    let (low, high) = all.fold((first, first), |(a, b), x| (a.min(x), b.max(x)));
    high - low > 1e-9 * (high.abs() + low.abs()).max(1e-300)
}

/// Returns the range of recordings whose motion is smoothed, with the rig's statement of their
/// machine.
pub(crate) fn span_of(tracks: &[BlockedRecording], nominal: &Nominal) -> Span {
    let mut speeds: Vec<f64> = tracks.iter().flat_map(|t| t.motion.v.iter().map(|v| v.abs())).collect();
    speeds.sort_by(f64::total_cmp);
    let fold =
        |pick: &dyn Fn(&BlockedRecording) -> f64| tracks.iter().map(pick).fold(f64::NEG_INFINITY, f64::max);
    let rows: f64 = tracks.iter().map(|t| t.rows.hold.len() as f64).sum();
    let blocks: f64 = tracks.iter().map(|t| t.block_count() as f64).sum();
    let seconds: f64 = tracks.iter().map(|t| t.rows.time.last().copied().unwrap_or(0.0)).sum();
    let mut moving: Vec<f64> = tracks
        .iter()
        .flat_map(|t| t.motion.v.iter().zip(&t.motion.rest).filter(|(_, rest)| !**rest).map(|(v, _)| v.abs()))
        .collect();
    moving.sort_by(f64::total_cmp);
    let command = fold(&|t| t.rows.command.iter().fold(0.0, |m: f64, u| m.max(u.abs())));
    let square = |t: &BlockedRecording| -> f64 {
        t.rows.command.iter().zip(t.rows.hold.iter()).map(|(u, hold)| u * u * hold).sum()
    };
    let fast = speeds[speeds.len() * 99 / 100];
    let machine = nominal.machine(&|_| None);
    let mut span = Span {
        slow: moving.get(moving.len() / 12).copied().unwrap_or(0.3 * fast).min(0.3 * fast),
        speed: fast,
        speed_floor: fold(&|t| t.motion.speed_floor),
        low: -fold(&|t| -t.places().fold(f64::INFINITY, f64::min)),
        high: fold(&|t| t.places().fold(f64::NEG_INFINITY, f64::max)),
        command,
        command_changes: tracks.iter().any(|t| varies(t.rows.command.iter().map(|u| Some(*u)))),
        mean_square: tracks.iter().map(square).sum::<f64>() / seconds,
        duration: fold(&|t| t.rows.time.last().copied().unwrap_or(0.0)),
        row: seconds / rows,
        block: seconds / blocks,
        count: 1.0 / nominal.rig.encoder.counts_per_unit,
        clip: least_clip(tracks, nominal.anchor.is_some(), command, machine.dry / machine.per_command.abs()),
        dead: nominal.most_ignored() * command,
        one_way: nominal.one_way,
        tilt: varies(tracks.iter().flat_map(|t| column(&t.blocks.tilt))),
        force: varies(tracks.iter().flat_map(|t| column(&t.blocks.force))),
        rig: RigFacts {
            turn: nominal.rig.turn(),
            axis_turn: (nominal.rig.kind == Kind::Rotary).then_some(TAU),
            has_stroke: true,
            has_offset: nominal.rig.model.offset.is_some(),
            has_viscous: nominal.has(NominalTerm::Viscous),
            has_gravity: nominal.has(NominalTerm::Weight) && tilt_is_angle(tracks),
            is_anchored: nominal.anchor.is_some(),
            dry: machine.dry,
            per_command: machine.per_command,
            machine: machine.shape().to_vec(),
        },
    };
    span.rig.has_stroke = has_stroke(&span, nominal);
    span
}

/// Smallest part of the largest command at which a drive may clip, where its inertia is known and
/// where it is hardly known.
const LEAST_CLIP: f64 = 0.27;
const LEAST_CLIP_ANCHORED: f64 = 0.45;
/// Times the dry friction that a drive which moves an axis carries at least.
const CARRIES: f64 = 2.0;

/// The smallest part of the largest command, `most`, at which a drive may clip. How far beyond a
/// clip commands go says nothing of the drive, as a servo that waits for a clipped drive asks for
/// any amount: a clip may also lie as low as the median command, if that is clearly more than dry
/// friction, which is `dry` as a command.
fn least_clip(tracks: &[BlockedRecording], is_anchored: bool, most: f64, dry: f64) -> f64 {
    if is_anchored {
        return LEAST_CLIP_ANCHORED;
    }
    if dry <= 0.0 {
        return LEAST_CLIP;
    }
    let mut commands: Vec<f64> = tracks.iter().flat_map(|t| t.rows.command.iter().map(|u| u.abs())).collect();
    let middle = commands.len() / 2;
    if commands.is_empty() {
        return LEAST_CLIP;
    }
    let (_, median, _) = commands.select_nth_unstable_by(middle, f64::total_cmp);
    (median.max(CARRIES * dry) / most).min(LEAST_CLIP)
}

fn column(values: &Option<Vec<f64>>) -> impl Iterator<Item = Option<f64>> + '_ {
    values.iter().flatten().map(|x| Some(*x))
}

/// Turns over which an axis runs on rather than to and fro: a law of the travel is of a stroke.
const RUNS_ON: f64 = 100.0;
/// Part of the travel within which recordings must start for a law of the travel to be the same in
/// all.
const SAME_PLACE: f64 = 0.3;

/// True if a law of the travel may hold for all recordings.
fn has_stroke(span: &Span, nominal: &Nominal) -> bool {
    let runs_on = nominal.rig.kind == Kind::Rotary && span.travel() > RUNS_ON * TAU;
    match nominal.rig.encoder.start_spread {
        Some(spread) => spread < SAME_PLACE * span.travel(),
        None => !runs_on || nominal.rig.encoder.absolute,
    }
}

/// The shapes of an effect to start from; none where the recordings cannot show it or the rig holds
/// it already. Periodic effects and missed counts are sought in a way of their own.
pub(crate) fn shapes(name: N, span: &Span, nominal: &Nominal) -> Vec<Effect> {
    if nominal.holds(name) || !is_seen(name, nominal) || needs_another_command(name, span) {
        return Vec::new();
    }
    name.definition().grid(name, span)
}

/// True if an effect shows in such motion.
pub(crate) fn is_seen(name: N, nominal: &Nominal) -> bool {
    nominal.virtual_inertia == 0.0 || !name.needs(Need::Inertia)
}

/// True if only a command that changes would show an effect, and none does.
pub(crate) fn needs_another_command(name: N, span: &Span) -> bool {
    name.needs(Need::ChangingCommand) && !span.command_changes
}

/// The shape values that refinement may move, with their bounds.
pub(crate) fn movable(effect: &Effect, span: &Span) -> Vec<Movable> {
    effect.name.definition().movable(effect, span)
}

/// A value within this part of a bound counts as at the bound.
const AT_END: f64 = 0.05;

/// True if a drift is at the end of what may be distinguished from something else: what settles at
/// once cannot be distinguished from how a recording begins, and what has hardly begun at its end
/// is any slow change.
pub(crate) fn is_at_end(effect: &Effect, span: &Span) -> bool {
    effect.name.definition().drifts()
        && movable(effect, span).iter().any(|(key, low, high)| {
            let value = effect.shape[*key];
            value < low * (1.0 + AT_END) || value > high * (1.0 - AT_END)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::fit::filter::{Gains, Noise};
    use crate::fit::input::{Input, Total};
    use crate::fit::refit::estimate_motion;
    use crate::fit::regressors::effect_inputs;
    use crate::fit::smoother::Knows;

    /// Two seconds in which an axis is driven to and fro, then a second that goes on or is
    /// mirrored, as its command is.
    fn followed(is_mirrored: bool, knows: Knows) -> (BlockedRecording, Nominal, Total) {
        let time_s: Vec<f64> = (0..3001).map(|row| f64::from(row) * 1e-3).collect();
        let after = |t: f64, x: f64, at: f64| if is_mirrored && t > 2.0 { 2.0 * at - x } else { x };
        // Farthest at first, so that the mirrored end reaches no farther.
        let moved = |t: f64| (-1.2 * t).exp() * (40_000.0 * (7.0 * t).sin() + 9000.0 * (31.0 * t).cos());
        let recording = Recording {
            command: time_s.iter().map(|t| after(*t, (3.0 * t).sin(), 0.0)).collect(),
            position_counts: time_s.iter().map(|t| after(*t, moved(*t), moved(2.0)).floor()).collect(),
            tilt_rad: Some(time_s.iter().map(|t| after(*t, 0.1 * t, 0.2)).collect()),
            force: Some(time_s.iter().map(|t| after(*t, t.cos(), 0.0)).collect()),
            time_s,
            ..Recording::default()
        };
        let rig = Rig::of_values(0.01, 0.02, 0.05);
        let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
        let mut tracks = [BlockedRecording::new(&recording, &nominal.rig)];
        let totals = [tracks[0].command_total(nominal.gain())];
        estimate_motion(&mut tracks, &totals, &NOISE, 1e-3, knows);
        let [track] = tracks;
        let [total] = totals;
        (track, nominal, total)
    }

    const NOISE: Noise = Noise { sensor: 1.0, white: 10.0, slow: 1e-3, tau: 0.1, rest: 1.0, blur: 0.0 };

    /// Largest difference of what an effect puts into the blocks before `until`, over its largest
    /// value there.
    fn difference(a: &Input, b: &Input, until: usize) -> f64 {
        let columns = |input: &Input| match input {
            Input::Held(x) | Input::Sensor(x) => vec![x[..until].to_vec()],
            Input::Rows { dv, dq, dz } => [dv, dq, dz].map(|x| x[..until].to_vec()).to_vec(),
        };
        let apart = |(a, b): (Vec<f64>, Vec<f64>)| {
            let most = a.iter().fold(1e-12_f64, |most, x| most.max(x.abs()));
            a.iter().zip(&b).fold(0.0_f64, |far, (a, b)| far.max((a - b).abs())) / most
        };
        columns(a).into_iter().zip(columns(b)).map(apart).fold(0.0, f64::max)
    }

    #[test]
    fn a_held_out_block_is_predicted_without_later_rows() {
        let farthest = |name: N, knows: Knows| {
            let [(a, nominal, total), (b, _, other)] =
                [false, true].map(|is_mirrored| followed(is_mirrored, knows));
            // An acceleration takes the neighbours of its block, a second mass those on both sides
            // of its speed.
            let until = a.blocks.start.partition_point(|start| *start < 2.0) - 3;
            let before = |total: &Total| {
                Gains::new(&a.observed(), &NOISE).innovations(&a.observed(), total)[..until].to_vec()
            };
            assert_eq!(before(&total), before(&other), "the command is the same until then");
            let span = span_of(std::slice::from_ref(&a), &nominal);
            let mut shapes = name.definition().grid(name, &span);
            if name.definition().is_periodic() {
                shapes.push(Effect::shaped(name, &[("turn", TAU), ("order_3", 3.0)]));
            }
            let inputs = |track: &BlockedRecording, effect: &Effect| {
                effect_inputs(track, effect, &track.rows.command, 0.0, || track.drive(None))
            };
            let apart = |effect: &Effect| {
                let both = inputs(&a, effect).into_iter().zip(inputs(&b, effect));
                both.map(|(a, b)| difference(&a, &b, until)).fold(0.0, f64::max)
            };
            (shapes.len(), shapes.iter().map(apart).fold(0.0, f64::max))
        };
        let mut looked_at = 0;
        for name in N::ALL {
            let (shapes, far) = farthest(*name, Knows::Past);
            assert!(far < 1e-6, "{name}: {far}");
            looked_at += usize::from(shapes > 0);
        }
        assert!(looked_at > 20, "{looked_at} effects");
        let (_, far) = farthest(N::ViscousFriction, Knows::All);
        assert!(far > 1e-4, "a smoother knows what comes: {far}");
    }

    fn span() -> Span {
        Span {
            speed: 10.0,
            speed_floor: 0.1,
            slow: 1.0,
            mean_square: 0.2,
            low: 0.0,
            high: 20.0,
            command: 1.0,
            command_changes: true,
            duration: 50.0,
            row: 1e-3,
            block: 2.5e-3,
            count: 1e-3,
            clip: 0.27,
            dead: 0.8,
            one_way: false,
            tilt: false,
            force: false,
            rig: RigFacts::default(),
        }
    }

    #[test]
    fn a_law_of_the_command_needs_one_that_changes() {
        let rig = Rig::of_values(0.01, 0.0, 0.05);
        let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
        let sought = |command_changes| {
            let span = Span { command_changes, ..span() };
            let all = N::ALL.iter();
            all.filter(|name| !shapes(**name, &span, &nominal).is_empty()).count()
        };
        assert_eq!(
            sought(true),
            sought(false) + 7,
            "deadband, clip, supply, delay, lag, loss and a gain that drifts"
        );
    }

    #[test]
    fn a_law_of_the_travel_needs_recordings_from_one_place() {
        let mut rig = Rig::of_values(0.01, 0.0, 0.05);
        let mut is_looked_for = |start_spread| {
            rig.encoder.start_spread = start_spread;
            let rig = rig.clone();
            let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
            let mut span = span();
            span.rig.has_stroke = has_stroke(&span, &nominal);
            let any = |name: N| !shapes(name, &span, &nominal).is_empty();
            [N::PositionSpring, N::PositionDependentFriction, N::PositionDependentDamping].map(any)
        };
        assert_eq!(is_looked_for(Some(1.0)), [true; 3]);
        // A spring pulls in proportion to the travel from anywhere: each recording's own offset
        // takes up where it starts.
        assert_eq!(
            is_looked_for(Some(15.0)),
            [true, false, false],
            "starts that lie 15 rad apart on a travel of 20"
        );
    }

    #[test]
    fn a_joint_is_not_looked_for_where_the_inertia_hardly_matters() {
        let nominal = Nominal::of(&Rig::of_values(0.01, 0.0, 0.05));
        let slow = Nominal { virtual_inertia: 0.01, ..nominal.clone() };
        let joints = [N::Backlash, N::DriveCompliance, N::RollerSlip];
        assert!(joints.iter().all(|name| is_seen(*name, &nominal) && !is_seen(*name, &slow)));
        for name in [N::TorqueRipple, N::CommandDeadband, N::CommandDelay] {
            assert!(is_seen(name, &slow), "{name} shows in the force that the motion asks for");
        }
    }

    #[test]
    fn each_law_has_limits_to_what_it_may_be() {
        let span = span();
        let at_end = |name: N, time_constant: f64| {
            is_at_end(&Effect::shaped(name, &[("time_constant", time_constant)]), &span)
        };
        for name in [N::FrictionDrift, N::GainDrift] {
            assert!(at_end(name, 1.0) && at_end(name, 250.0));
            assert!(!at_end(name, 2.0) && !at_end(name, 15.0) && !at_end(name, 100.0));
        }
        let grip = |limit, coast| {
            let shape =
                [("limit", limit), ("coast", coast), ("per_command", -10.0), ("dry", 5.0), ("ratio", 1.0)];
            N::RollerSlip.definition().is_possible(&Effect::shaped(N::RollerSlip, &shape))
        };
        assert!(grip(0.5, 5.0) && !grip(0.5, 6.0), "what cannot move its load is no grip");
        let gap = |ratio| {
            let shape = [("coast", 6.0), ("dry", 4.0), ("ratio", ratio)];
            N::Backlash.definition().is_possible(&Effect::shaped(N::Backlash, &shape))
        };
        assert!(gap(3.0) && !gap(5.0), "a load has no more friction than the machine");
        assert!(!at_end(N::ElectricalLag, 1e-6), "what is instant may be no lag, and is judged by its size");
    }
}
