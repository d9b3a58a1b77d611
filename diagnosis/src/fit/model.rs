//! A candidate model as columns of a linear regression: the nominal terms, each recording's offset,
//! and effects.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::effective_command::effective_command;
use crate::fit::filter::Noise;
use crate::fit::input::{Input, Total};
use crate::fit::nominal::{Key, Nominal};
use crate::fit::regressors::kept_inputs;
use crate::laws::Effect;
use crate::laws::definition::NominalTerm;
use numerics::linear::Prior;

/// One column over one recording.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    pub(crate) key: Key,
    pub(crate) input: Input,
    /// True if each recording has a coefficient of its own.
    pub(crate) own: bool,
    pub(crate) prior: Prior,
}

/// A model: the nominal terms plus effects whose shapes are fixed and whose coefficients are
/// fitted.
#[derive(Debug, Clone, Default)]
pub(crate) struct Model {
    pub(crate) effects: Vec<Effect>,
    /// Acceleration by the force that is there all the time, for a second mass to take up, per
    /// fitted recording; without an entry, the track's own.
    pub(crate) bias: Vec<f64>,
}

/// Sign of the velocity where it is known, the mean over each block.
pub(crate) fn direction(track: &BlockedRecording) -> Vec<f64> {
    let motion = &track.motion;
    let mean = |j: usize| match motion.sides(j) {
        _ if motion.rest[j] => 0.0,
        Some(sides) => sides.iter().map(|side| side.part * side.velocity.signum()).sum(),
        None => motion.v[j].signum(),
    };
    (0..motion.v.len()).map(mean).collect()
}

impl Model {
    /// Acceleration by the force that is there all the time in a recording.
    fn bias_on(&self, track: &BlockedRecording) -> f64 {
        track.place.and_then(|place| self.bias.get(place)).copied().unwrap_or(track.bias)
    }

    /// The columns of this model over a recording, nominal terms first.
    pub(crate) fn columns(&self, nominal: &Nominal, track: &BlockedRecording, noise: &Noise) -> Vec<Column> {
        let effective = effective_command(track, &self.effects);
        let command = effective.as_deref().unwrap_or(&track.rows.command);
        let drive = track.drive(effective.as_deref());
        let direction = direction(track);
        let mut columns = Vec::new();
        let mut push = |key: Key, input: Input, own: bool| {
            columns.push(Column { key, input, own, prior: nominal.priors(key, noise) });
        };
        if nominal.has(NominalTerm::Viscous) {
            push(Key::Viscous, Input::Held(track.motion.v.iter().map(|v| -v).collect()), false);
        }
        if nominal.has(NominalTerm::Coulomb) {
            push(Key::Coulomb, Input::Held(direction.iter().map(|s| -s).collect()), false);
        }
        push(Key::Offset, Input::Held(vec![1.0; track.block_count()]), true);
        if nominal.skew_rows.is_some() {
            push(Key::Skew, track.rows.lateness_input.clone(), false);
            push(Key::Spread, track.rows.spread_input.clone(), false);
        }
        if let (true, Some(tilt)) = (nominal.has(NominalTerm::Weight), &track.blocks.tilt) {
            push(Key::Weight, Input::Held(tilt.iter().map(|x| x.sin()).collect()), false);
        }
        if nominal.has(NominalTerm::Gravity) {
            let zero = nominal.rig.model.gravity_zero.unwrap_or(0.0) - track.blocks.origin;
            push(
                Key::Gravity,
                Input::Held(track.motion.x.iter().map(|x| -(x - zero).sin()).collect()),
                false,
            );
        }
        if let Some(force) = &track.blocks.force {
            push(Key::External, Input::Held(force.clone()), false);
        }
        for (index, effect) in self.effects.iter().enumerate() {
            for (term, input) in kept_inputs(track, effect, command, self.bias_on(track), || drive.clone())
                .into_iter()
                .enumerate()
            {
                push(Key::Term { effect: index, term }, input, effect.name.definition().has_own_phase());
            }
        }
        for column in &mut columns {
            if let Key::Term { effect, term } = column.key {
                (column.prior.low, column.prior.high) = nominal.limits(self.effects[effect].name, term);
            }
        }
        let mut push = |key: Key, input: Input, own: bool| {
            columns.push(Column { key, input, own, prior: nominal.priors(key, noise) });
        };
        push(Key::Gain, drive, false);
        columns.rotate_right(1);
        columns
    }
}

/// The total input of columns with their coefficients.
pub(crate) fn total(track: &BlockedRecording, columns: &[Column], theta: &[f64]) -> Total {
    let mut total = Total::zero(track.block_count());
    for (column, theta) in columns.iter().zip(theta) {
        if *theta != 0.0 {
            track.add_input(&mut total, &column.input, *theta);
        }
    }
    total
}
