//! Mistakes that people make with units, signs and columns, seen in the recordings before anything is searched: each gets the
//! sentence that helps, and none may end in a name.

use crate::io::recording::Recording;
use crate::io::rig::Rig;
use crate::numerics::linear::{Factor, Square};
use crate::simulation::Motion;

/// Readings of an encoder are whole counts: where more than this part is not, and fewer counts than this are travelled, they are
/// something else.
const BROKEN: f64 = 0.5;
const FEW_COUNTS: f64 = 2000.0;
/// Part of the force's variance that motion has to explain before its scale or sign is judged.
const EXPLAINED: f64 = 0.6;
/// Ratio from which a scale error is taken for a wrong unit, and the largest that is still taken for a factor of a thousand.
const OFF: f64 = 250.0;
const FAR: f64 = 4000.0;

fn spread(column: &[f64]) -> f64 {
    let low = column.iter().copied().fold(f64::INFINITY, f64::min);
    column.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
}

fn broken(column: &[f64]) -> f64 {
    column.iter().filter(|x| x.fract() != 0.0).count() as f64 / column.len().max(1) as f64
}

/// The sentence for a mistake in a recording, if there is one.
pub(crate) fn mistake(recording: &Recording, rig: &Rig) -> Option<String> {
    swapped(recording)
        .or_else(|| no_counts(recording))
        .or_else(|| wrapped(recording, rig))
        .or_else(|| scale_or_sign(recording, rig))
}

fn swapped(recording: &Recording) -> Option<String> {
    let counts_in_command = broken(&recording.command) == 0.0 && spread(&recording.command) >= 100.0;
    let none_in_position =
        broken(&recording.position_counts) > BROKEN && spread(&recording.position_counts) < FEW_COUNTS;
    (counts_in_command && none_in_position).then(|| {
        format!(
            "the command of {} is in whole numbers over {:.0} and its position_counts are not: the two columns seem swapped; swap their names in the header",
            recording.file,
            spread(&recording.command)
        )
    })
}

fn no_counts(recording: &Recording) -> Option<String> {
    let counts = &recording.position_counts;
    let span = spread(counts);
    (broken(counts) > BROKEN && span > 0.0 && span < FEW_COUNTS).then(|| {
        format!(
            "position_counts of {} are not whole counts and span {span:.4}: they seem to be in radians, degrees or metres; multiply them by counts_per_unit, or let host-sim import do it with --column position=position_counts:deg",
            recording.file
        )
    })
}

fn wrapped(recording: &Recording, rig: &Rig) -> Option<String> {
    let counts = &recording.position_counts;
    let span = spread(counts);
    let jumps: Vec<f64> =
        counts.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|jump| *jump > 0.75 * span).collect();
    // A turn of the motor, or a counter of so many bits, is what a reading wraps at.
    let turn = rig.turn().map(|turn| turn * rig.encoder.counts_per_unit);
    let known = turn.into_iter().chain((8..=32).map(|bits| f64::from(bits).exp2()));
    let whole = known.into_iter().any(|turn| (0.8..=1.02).contains(&(span / turn)));
    (span > 20.0 && jumps.len() >= 2 && whole).then(|| {
        format!(
            "position_counts of {} jump {} times by about {:.0} counts, all that they span: they wrap; make them continuous, as host-sim import does",
            recording.file,
            jumps.len(),
            jumps[0]
        )
    })
}

/// The force against the recorded motion: what inertia it asks for, with friction and a constant beside, and how much of it
/// that explains.
fn asked(recording: &Recording, rig: &Rig, motion: &Motion) -> Option<(f64, f64, f64)> {
    let force: Vec<f64> = recording.command.iter().map(|u| rig.actuator.gain * u).collect();
    let force = motion.smoothed(&force);
    let acceleration = motion.smoothed(&motion.accelerations());
    let slow = 0.02 * motion.velocity.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let rows: Vec<[f64; 4]> = motion
        .velocity
        .iter()
        .zip(&acceleration)
        .map(|(v, a)| [*a, *v, if v.abs() > slow { v.signum() } else { 0.0 }, 1.0])
        .collect();
    let norm: Vec<f64> = (0..4).map(|k| rows.iter().map(|r| r[k] * r[k]).sum::<f64>().sqrt()).collect();
    if norm.contains(&0.0) {
        return None;
    }
    let (mut information, mut score) = (Square::zero(4), vec![0.0; 4]);
    for (row, f) in rows.iter().zip(&force) {
        for i in 0..4 {
            score[i] += row[i] / norm[i] * f;
            for j in 0..4 {
                information.add(i, j, row[i] / norm[i] * row[j] / norm[j]);
            }
        }
    }
    let theta: Vec<f64> =
        Factor::new(&information).solve(&score).iter().zip(&norm).map(|(x, n)| x / n).collect();
    let n = force.len() as f64;
    let mean = force.iter().sum::<f64>() / n;
    let (mut left, mut all, mut work) = (0.0, 0.0, 0.0);
    for ((row, f), v) in rows.iter().zip(&force).zip(&motion.velocity) {
        left += (f - row.iter().zip(&theta).map(|(a, b)| a * b).sum::<f64>()).powi(2);
        all += (f - mean).powi(2);
        work += (f - theta[3]) * v;
    }
    // Without the acceleration, what would be left: only where it matters does its scale say anything.
    let by_acceleration = theta[0] * theta[0] * acceleration.iter().map(|a| a * a).sum::<f64>();
    let matters = by_acceleration > 0.3 * all;
    (all > 0.0 && matters).then(|| (theta[0], 1.0 - left / all, work))
}

fn scale_or_sign(recording: &Recording, rig: &Rig) -> Option<String> {
    if !rig.effects.is_empty() || recording.force.is_some() {
        return None;
    }
    let motion = Motion::new(recording, rig);
    let (inertia, explained, work) = asked(recording, rig, &motion)?;
    if explained < EXPLAINED {
        return None;
    }
    let file = &recording.file;
    let ratio = inertia / rig.model.inertia;
    if ratio < -0.1 && work < 0.0 {
        return Some(format!(
            "the axis of {file} moves against its command, whose work is negative: a sign is wrong; change the sign of actuator.gain, or of one column"
        ));
    }
    if (OFF..FAR).contains(&ratio) {
        return Some(format!(
            "the force of {file} is about {ratio:.0} times what its motion takes with the rig's inertia: command or gain is in thousandths, as mN·m for N·m; correct actuator.gain"
        ));
    }
    if (1.0 / FAR..1.0 / OFF).contains(&ratio) {
        return Some(format!(
            "the force of {file} is about {:.0} times too small for its motion with the rig's inertia: command or gain is in thousands, as N·m for mN·m, or the inertia is in g·m²; correct actuator.gain or model.inertia",
            1.0 / ratio
        ));
    }
    None
}
