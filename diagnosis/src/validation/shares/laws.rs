//! The columns of an effect, as what the drive has to give more.

use super::sight::{Scale, Sight};
use crate::effects::definition::FREE;
use crate::effects::{CommandLaw, Effect};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::effective_command::effective_command;
use crate::estimation::input::Input;
use crate::estimation::nominal::Nominal;
use crate::estimation::regressors::effect_inputs;
use std::sync::OnceLock;

/// Part of a deadband over which its inverse rises from one side to the other.
const RAMP: f64 = 0.3;
/// Bounds of the coefficient of a law of the command, which is one if the shape alone is right.
pub(crate) const AS_IT_IS: (f64, f64) = (0.75, 1.33);

/// The columns of an effect on every recording, per term.
pub(crate) struct Columns {
    pub(crate) effect: Effect,
    /// Per recording, per term, at the kept rows.
    pub(crate) of: Vec<Vec<Vec<f64>>>,
    /// True if every recording has its own phase: pairs of cosine and sine.
    pub(crate) own: bool,
    /// Bounds of each term, as forces.
    pub(crate) bounds: Vec<(f64, f64)>,
    /// Standard deviation of each term as a force, where something is known of it.
    pub(crate) sd: f64,
}

/// The drive's force that the motion asks for, on every recording.
pub(crate) struct Asked {
    /// N·m or N, per recording and block.
    pub(crate) force: Vec<Vec<f64>>,
    /// The recordings with the command that makes it; made when first needed.
    tracks: OnceLock<Vec<BlockedRecording>>,
}

impl Asked {
    pub(crate) fn new(force: Vec<Vec<f64>>) -> Self {
        Self { force, tracks: OnceLock::new() }
    }

    fn tracks(&self, sights: &[Sight], scale: Scale) -> &[BlockedRecording] {
        let with = |(sight, force): (&Sight, &Vec<f64>)| {
            let mut track = BlockedRecording::clone(sight.track);
            let last = track.rows.per_block;
            let rows = track.rows.hold.len();
            let command =
                (0..rows).map(|row| force[(row / last).min(force.len() - 1)] / scale.gain).collect();
            track.set_command(command);
            track
        };
        self.tracks.get_or_init(|| sights.iter().zip(&self.force).map(with).collect())
    }
}

/// Returns the columns of an effect; none where a regression has no law of it or cannot see it.
pub(crate) fn columns(
    effect: &Effect,
    sights: &[Sight],
    nominal: &Nominal,
    asked: &Asked,
) -> Option<Columns> {
    let definition = effect.name.definition();
    let scale = Scale::of(nominal);
    if let Some(law) = CommandLaw::new(effect) {
        let column =
            |(sight, asked): (&Sight, &Vec<f64>)| Some(vec![sight.see(&more(&law, sight, asked, scale)?)]);
        let of: Option<Vec<_>> = sights.iter().zip(&asked.force).map(column).collect();
        return Some(Columns {
            effect: effect.clone(),
            of: of?,
            own: false,
            bounds: vec![AS_IT_IS],
            sd: f64::INFINITY,
        });
    }
    // A loss in proportion to the recorded command would shrink what it is to explain.
    let rests_on_command = is_by_command(effect) || effect.name.definition().follows_drive(effect);
    let with_asked = rests_on_command.then(|| asked.tracks(sights, scale));
    let track = |r: usize| with_asked.map_or(sights[r].track, |tracks| &tracks[r]);
    let inputs: Vec<Vec<Input>> = (0..sights.len()).map(|r| inputs_of(effect, track(r))).collect();
    let all = || sights.iter().zip(&inputs);
    if all().all(|(sight, inputs)| inputs.iter().all(|input| sight.is_constant(input))) {
        // Dry friction on an axis that runs one way is a constant, as is each recording's own
        // offset.
        return None;
    }
    let of: Vec<Vec<Vec<f64>>> = all().map(|(sight, inputs)| seen(effect, sight, inputs)).collect();
    let terms = of.first()?.len();
    if terms == 0 {
        return None;
    }
    let bounds = (0..terms).map(|term| bounds(effect, term, nominal, scale)).collect();
    Some(Columns { effect: effect.clone(), of, own: definition.has_own_phase(), bounds, sd: f64::INFINITY })
}

/// The column of a law of the command: the force that it takes from the recorded one. Its
/// coefficient is one where the law is right; none for an effect that is no such law.
pub(super) fn taken_from_command(effect: &Effect, sights: &[Sight], nominal: &Nominal) -> Option<Columns> {
    let gain = Scale::of(nominal).gain;
    let column = |sight: &Sight| {
        let effective = effective_command(sight.track, std::slice::from_ref(effect))?;
        let mut mapped = BlockedRecording::clone(sight.track);
        mapped.set_command(effective);
        let of = |track: &BlockedRecording| sight.blocks_of(&track.rows.command_input);
        let taken = of(sight.track)
            .iter()
            .zip(of(&mapped))
            .map(|(u, passed)| gain * (u - passed))
            .collect::<Vec<f64>>();
        Some(vec![sight.see(&taken)])
    };
    let of = sights.iter().map(column).collect::<Option<Vec<_>>>()?;
    Some(Columns { effect: effect.clone(), of, own: false, bounds: vec![FREE], sd: f64::INFINITY })
}

/// Bounds of a term, as a force. A law that may have either sign is not held to what the rig says
/// of friction or gain: shares judge it.
fn bounds(effect: &Effect, term: usize, nominal: &Nominal, scale: Scale) -> (f64, f64) {
    let (low, high) = nominal.limits(effect.name, term);
    if low < 0.0 && high > 0.0 {
        return FREE;
    }
    (low * scale.inertia, high * scale.inertia)
}

/// True if the columns of an effect rest on the command.
pub(crate) fn is_by_command(effect: &Effect) -> bool {
    let definition = effect.name.definition();
    definition.scales_drive() || definition.command_law(effect).is_some()
}

/// The columns of a law on force or reading, with the signs of the drive's side, per unit of force.
fn seen(effect: &Effect, sight: &Sight, inputs: &[Input]) -> Vec<Vec<f64>> {
    let sensor = effect.name.definition().in_sensor() || effect.name.definition().is_of_jumps();
    let sign = if sensor { 1.0 } else { -1.0 };
    let see = |input| sight.see_input(input).into_iter().map(|x| sign * x).collect();
    inputs.iter().map(see).collect()
}

/// The inputs of a law on force or reading, per term.
fn inputs_of(effect: &Effect, track: &BlockedRecording) -> Vec<Input> {
    effect_inputs(track, effect, &track.rows.command, track.bias, || track.drive(None))
}

/// Additional command of each block, for a law of the command to let pass what the motion asks for.
fn more(law: &CommandLaw, sight: &Sight, asked: &[f64], scale: Scale) -> Option<Vec<f64>> {
    let spans = &sight.track.blocks.span;
    let n = asked.len();
    match law {
        CommandLaw::Deadband { half_width, shift: true } => {
            let width = half_width * scale.gain.abs();
            let ramp = RAMP * width;
            Some(asked.iter().map(|force| width * (force / ramp).clamp(-1.0, 1.0)).collect())
        }
        CommandLaw::Deadband { .. } | CommandLaw::Clip { .. } => None,
        CommandLaw::Lag { time_constant, .. } => Some(
            (0..n)
                .map(|j| {
                    let (a, b) = (j.saturating_sub(1), (j + 1).min(n - 1));
                    let apart: f64 = spans[a..b].iter().sum();
                    time_constant * (asked[b] - asked[a]) / apart
                })
                .collect(),
        ),
        CommandLaw::Delay { delay, .. } => Some(
            (0..n)
                .map(|j| {
                    let later = j as f64 + delay / spans[j];
                    let k = (later as usize).min(n - 1);
                    let next = (k + 1).min(n - 1);
                    asked[k] + (asked[next] - asked[k]) * (later - later.floor()) - asked[j]
                })
                .collect(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::EffectName as N;
    use crate::estimation::filter::Noise;
    use crate::estimation::force_residual::Estimator;
    use crate::io::recording::Recording;
    use crate::io::rig::Rig;

    /// The columns of an effect on an axis that swings while it advances with a mean speed,
    /// counts/s, on which the motion asks for one force.
    fn of_axis(effect: &Effect, advances: f64, asked: f64) -> Option<Columns> {
        let time_s: Vec<f64> = (0..6000).map(|row| f64::from(row) * 1e-3).collect();
        let counts = |t: &f64| (9000.0 * (3.0 * t).sin() + advances * t).round();
        let recording = Recording {
            command: time_s.iter().map(|t| (40.0 * t).sin()).collect(),
            position_counts: time_s.iter().map(counts).collect(),
            time_s,
            ..Recording::default()
        };
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let (mut track, nominal) = (BlockedRecording::new(&recording, &rig), Nominal::of(&rig));
        let speed = |t: &f64| (27_000.0 * (3.0 * t).cos() + advances) / rig.encoder.counts_per_unit;
        track.motion.v = track.blocks.start.iter().map(speed).collect();
        let noise = Noise { sensor: 1.0, white: 1e-3, slow: 1.0, tau: 0.1, rest: 1.0, blur: 0.0 };
        let sights = [Sight::new(&track, 0, &nominal, &noise, Estimator { bandwidth_hz: 12.0 })];
        columns(effect, &sights, &nominal, &Asked::new(vec![vec![asked; track.block_count()]]))
    }

    #[test]
    fn dry_friction_of_an_axis_that_runs_one_way_is_not_judged() {
        let is_judged = |name, advances| of_axis(&Effect::shaped(name, &[]), advances, 0.0).is_some();
        assert!(is_judged(N::CoulombFriction, 0.0), "it turns back");
        assert!(!is_judged(N::CoulombFriction, 40_000.0), "a constant is each recording's own offset");
        assert!(is_judged(N::QuadraticDrag, 40_000.0), "it changes with the speed");
    }

    #[test]
    fn a_joint_that_was_found_is_judged() {
        let gap = Effect::shaped(
            N::Backlash,
            &[("gap", 0.05), ("coast", 1.0), ("contact_hz", 180.0), ("ratio", 1.0), ("dry", 2.0)],
        );
        let columns = of_axis(&gap, 0.0, 0.0).expect("a regression has this law");
        assert!(columns.of[0][0].iter().any(|x| *x != 0.0), "the gap opens at reversals");
    }

    #[test]
    fn a_gears_loss_rests_on_the_force_that_the_motion_needs() {
        let loss = Effect::shaped(N::LoadDependentFriction, &[("of_drive", 1.0)]);
        let largest = |asked: f64| {
            let columns = of_axis(&loss, 0.0, asked).expect("a regression has this law");
            columns.of[0][0].iter().fold(0.0, |most: f64, x| most.max(x.abs()))
        };
        // Whatever was recorded: a motion that asks for no force loses none.
        assert_eq!(largest(0.0), 0.0);
        assert!(largest(1.0) > 0.0, "{}", largest(1.0));
    }
}
