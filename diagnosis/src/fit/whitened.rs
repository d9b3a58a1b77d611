//! The nominal columns of a recording under one noise, which no effect changes.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::{Gains, Noise};
use crate::fit::input::Input;
use crate::fit::kept::Whitened;
use crate::fit::model::{Column, total};
use crate::fit::nominal::Key;
use numerics::linear::{Square, dot};
use numerics::parallel;
use std::sync::Arc;

/// The nominal columns, which are the first of `columns`, under a noise.
pub(crate) fn nominal_columns(track: &BlockedRecording, noise: &Noise, columns: &[Column]) -> Arc<Whitened> {
    let count = columns.iter().take_while(|column| !matches!(column.key, Key::Term { .. })).count();
    let nominal = &columns[..count];
    track.kept.columns(|one| is_of(one, track, noise, nominal), || whitened(track, noise, nominal))
}

fn whitened(track: &BlockedRecording, noise: &Noise, nominal: &[Column]) -> Whitened {
    let observed = track.observed();
    let gains = Gains::new(&observed, noise);
    let reference: Vec<f64> = nominal.iter().map(|c| c.prior.mean).collect();
    let residual = gains.innovations(&observed, &total(track, nominal, &reference));
    let inputs: Vec<&Input> = nominal.iter().map(|c| &c.input).collect();
    let responses = gains.all_responses(&observed, &inputs);
    let segments = grams(track, &responses, &residual, None);
    let inputs = inputs.into_iter().cloned().collect();
    let (any_force, stuck) = (track.motion.any_force.clone(), track.motion.stuck.clone());
    Whitened { noise: *noise, any_force, stuck, inputs, reference, gains, residual, responses, segments }
}

/// True if nominal columns are those of a recording as it is now.
fn is_of(known: &Whitened, track: &BlockedRecording, noise: &Noise, nominal: &[Column]) -> bool {
    known.noise == *noise
        && known.any_force == track.motion.any_force
        && known.stuck == track.motion.stuck
        && known.reference.len() == nominal.len()
        && known.reference.iter().zip(nominal).all(|(mean, column)| *mean == column.prior.mean)
        && known.inputs.iter().zip(nominal).all(|(input, column)| *input == column.input)
}

/// Gram matrices of columns and a residual, per segment; those of the first columns may be known.
pub(super) fn grams(
    track: &BlockedRecording,
    responses: &[Vec<f64>],
    residual: &[f64],
    known: Option<&Whitened>,
) -> Vec<Square> {
    let p = responses.len();
    let first = known.map_or(0, |known| known.responses.len());
    parallel::map(track.segment_count(), |s| {
        let (a, b) = (track.blocks.segments[s], track.blocks.segments[s + 1]);
        let mut m = Square::zero(p + 1);
        let column = |i: usize| if i == p { &residual[a..b] } else { &responses[i][a..b] };
        // The place of a column among those that are known.
        let place = |i: usize| if i == p { Some(first) } else { (i < first).then_some(i) };
        for i in 0..=p {
            for j in 0..=i {
                let x = match (known, place(i), place(j)) {
                    (Some(known), Some(i), Some(j)) => known.segments[s].at(i, j),
                    _ => dot(column(i), column(j)),
                };
                m.a[i * (p + 1) + j] = x;
                m.a[j * (p + 1) + i] = x;
            }
        }
        m
    })
}

#[cfg(test)]
mod tests {
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::fit::blocked_recording::BlockedRecording;
    use crate::fit::filter::Noise;
    use crate::fit::linear_fit::Fit;
    use crate::fit::model::Model;
    use crate::fit::nominal::Nominal;
    use crate::laws::{Effect, EffectName};

    /// Four seconds in which an axis is driven to and fro; speeds are those of the sine times
    /// `speed`.
    fn track(speed: f64) -> BlockedRecording {
        let time_s: Vec<f64> = (0..4001).map(|row| f64::from(row) * 1e-3).collect();
        let recording = Recording {
            command: time_s.iter().map(|t| (3.0 * t).sin()).collect(),
            position_counts: time_s.iter().map(|t| (9000.0 * (3.0 * t).cos()).round()).collect(),
            time_s,
            ..Recording::default()
        };
        let mut track = BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.02, 0.05));
        move_at(&mut track, speed);
        track
    }

    fn move_at(track: &mut BlockedRecording, speed: f64) {
        track.motion.v = track.blocks.start.iter().map(|t| speed * (3.0 * t).cos()).collect();
        track.motion.rest = track.motion.v.iter().map(|v| v.abs() < 0.1).collect();
        track.motion.any_force.clone_from(&track.motion.rest);
    }

    fn values(track: &BlockedRecording, white: f64) -> Vec<f64> {
        let rig = Rig::of_values(0.01, 0.02, 0.05);
        let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
        let noise = Noise { sensor: 1.0, white, slow: 1.0, tau: 0.05, rest: 1.0, blur: 0.0 };
        let shape = [("gap", 0.01), ("coast", 3.0), ("contact_hz", 180.0), ("ratio", 1.0), ("dry", 5.0)];
        let effects = vec![Effect::shaped(EffectName::Backlash, &shape)];
        let model = Model { effects, ..Model::default() };
        let fit = Fit::new(&model, &nominal, std::slice::from_ref(track), &noise);
        fit.theta(0).into_iter().chain([fit.log_likelihood]).collect()
    }

    #[test]
    fn a_fit_is_the_same_whatever_was_fitted_before() {
        let mut used = track(1.0);
        let first = values(&used, 1.0);
        assert_ne!(first, values(&used, 2.0), "under another noise");
        assert_eq!(first, values(&used, 1.0), "of columns that were kept");
        move_at(&mut used, 2.0);
        assert_eq!(values(&used, 1.0), values(&track(2.0), 1.0), "in another motion");
        let command: Vec<f64> = used.rows.command.iter().map(|u| 0.5 * u).collect();
        used.set_command(command.clone());
        let mut other = track(2.0);
        other.set_command(command);
        assert_eq!(values(&used, 1.0), values(&other, 1.0), "under another command");
        assert_ne!(values(&used, 1.0), values(&track(2.0), 1.0));
    }
}
