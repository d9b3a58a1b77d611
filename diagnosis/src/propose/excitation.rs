//! The range of speeds and amplitudes in recordings. Effects that look alike within it cannot be
//! distinguished.

use crate::fit::blocked_recording::BlockedRecording;
use crate::laws::definition::ExcitationLimits;

/// Range of the motion of some recordings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Excitation {
    /// Speed that 95 % of the moving blocks stay below over the speed that 5 % do.
    pub(crate) speeds: f64,
    /// The same of the lengths of the strokes between reversals, nine tenths over one tenth.
    pub(crate) strokes: f64,
    /// Travel of all recordings in turns of the motor; infinite where the turn is not known.
    pub(crate) turns: f64,
}

/// Speeds within this factor are one speed: dry, viscous, quadratic and falling friction all fit
/// it.
const ONE_SPEED: f64 = 3.0;
/// Strokes within this factor have one length: bristles and a gap both fit it.
const ONE_LENGTH: f64 = 3.0;
/// Within less than a turn an off-centre mass pulls like a spring.
const ONE_TURN: f64 = 1.0;
/// Shortest stroke, counts: less is a tremor.
const STROKE_COUNTS: f64 = 4.0;

/// Upper over lower quantile of positive values; infinite without any value.
fn ratio(mut values: Vec<f64>, part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return f64::INFINITY };
    let quantile = |p: f64| values[(p * last as f64).round() as usize];
    quantile(1.0 - part) / quantile(part).max(1e-300)
}

/// Speeds of the blocks of one recording that move.
fn moving_speeds(track: &BlockedRecording) -> Vec<f64> {
    let blocks = track.motion.v.iter().zip(&track.motion.rest);
    blocks.filter(|(_, rest)| !**rest).map(|(v, _)| v.abs()).collect()
}

/// Lengths of the strokes of one recording.
fn strokes(track: &BlockedRecording, least: f64) -> Vec<f64> {
    let mut out = Vec::new();
    let mut from: Option<(usize, f64)> = None;
    for (j, (v, rest)) in track.motion.v.iter().zip(&track.motion.rest).enumerate() {
        if *rest {
            continue;
        }
        match from {
            Some((_, sign)) if sign == v.signum() => {}
            _ => {
                out.extend(from.map(|(start, _)| (track.motion.x[j] - track.motion.x[start]).abs()));
                from = Some((j, v.signum()));
            }
        }
    }
    out.extend(
        from.map(|(start, _)| (track.motion.x[track.block_count() - 1] - track.motion.x[start]).abs()),
    );
    out.retain(|length| *length > least);
    out
}

impl Excitation {
    /// Measures recordings whose motion is smoothed; `count` is one of the encoder's and `turn` the
    /// motor's, rad or m.
    pub(crate) fn of(tracks: &[BlockedRecording], count: f64, turn: Option<f64>) -> Self {
        let speeds = ratio(tracks.iter().flat_map(moving_speeds).collect(), 0.05);
        let strokes = ratio(tracks.iter().flat_map(|t| strokes(t, STROKE_COUNTS * count)).collect(), 0.1);
        let travel = |track: &BlockedRecording| numerics::spread::spread(&track.motion.x);
        let turns = turn.map_or(f64::INFINITY, |turn| {
            tracks.iter().map(|track| travel(track) / turn).fold(0.0, f64::max)
        });
        Self { speeds, strokes, turns }
    }

    /// True if all motion is at about one speed.
    pub(crate) fn is_one_speed(&self) -> bool {
        self.speeds < ONE_SPEED
    }

    /// Returns what decides between twins.
    pub(crate) fn limits(&self) -> ExcitationLimits {
        ExcitationLimits {
            one_speed: self.is_one_speed(),
            one_length: self.strokes < ONE_LENGTH,
            less_than_a_turn: self.turns < ONE_TURN,
            ..ExcitationLimits::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{Effect, EffectName as N};

    #[test]
    fn one_speed_one_length_and_part_of_a_turn_exclude_effects() {
        let rich = Excitation { speeds: 50.0, strokes: 20.0, turns: 9.0 };
        let twins = [
            (Excitation { speeds: 1.5, ..rich }, N::StribeckFriction, N::QuadraticDrag),
            (Excitation { speeds: 1.5, ..rich }, N::FrictionDrift, N::GainDrift),
            (Excitation { strokes: 1.5, ..rich }, N::PreslidingFriction, N::Backlash),
            (Excitation { turns: 0.5, ..rich }, N::PositionSpring, N::MassImbalance),
        ];
        for (poor, a, b) in twins {
            let twins = |name: N, seen: Excitation| Effect::shaped(name, &[]).twins(&seen.limits());
            assert_eq!((twins(a, poor), twins(b, poor)), (vec![b], vec![a]));
            assert!(twins(a, rich).is_empty() && twins(b, rich).is_empty());
        }
    }
}
