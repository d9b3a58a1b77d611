//! Mistakes that people make with units, signs and columns, seen in the recordings before anything
//! is searched: each gets the sentence that helps, and none may end in a name.

use crate::data::recording::Recording;
use crate::data::rig::{Kind, Rig};
use crate::simulation::Motion;
use numerics::digits::in_sentence;
use numerics::linear::{Factor, Square};
use numerics::spread::spread;
use std::f64::consts::{PI, TAU};

/// Readings of an encoder are whole counts: where more than this part is not, and fewer counts than
/// this are travelled, they are something else.
const BROKEN: f64 = 0.5;
const FEW_COUNTS: f64 = 2000.0;
/// Part of the force's variance that motion has to explain before its scale or sign is judged.
const EXPLAINED: f64 = 0.6;
/// Ratio from which a scale error is taken for a wrong unit, and the largest that is still taken
/// for a factor of a thousand.
const OFF: f64 = 250.0;
const FAR: f64 = 4000.0;

fn broken(column: &[f64]) -> f64 {
    column.iter().filter(|x| x.fract() != 0.0).count() as f64 / column.len().max(1) as f64
}

/// The sentence for a mistake in a recording, if there is one.
pub(crate) fn mistake(recording: &Recording, rig: &Rig) -> Option<String> {
    swapped(recording)
        .or_else(|| no_counts(recording, rig))
        .or_else(|| mixed_axes(recording))
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

fn no_counts(recording: &Recording, rig: &Rig) -> Option<String> {
    let counts = &recording.position_counts;
    let span = spread(counts);
    let is_analogue = rig.encoder.noise_counts.is_some_and(|noise| noise > 0.0);
    (!is_analogue && broken(counts) > BROKEN && span > 0.0 && span < FEW_COUNTS).then(|| {
        format!(
            "position_counts of {} are not whole counts and span {span:.4}: they seem to be in radians, degrees or metres; multiply them by counts_per_unit, or let host-sim import do it with --column position=position_counts:deg; if they are of an analogue sensor, which scatters by about {} counts from row to row, set encoder.noise_counts to that",
            recording.file,
            in_sentence(scatter_of_rows(counts))
        )
    })
}

/// The standard deviation by which readings scatter from row to row: of their fourth differences,
/// in which a smooth motion is next to nothing.
fn scatter_of_rows(counts: &[f64]) -> f64 {
    /// The squares of 1, 4, 6, 4 and 1, and the median of the size of a normal variable.
    const SQUARES: f64 = 70.0;
    const MEDIAN: f64 = 0.6745;
    let mut sizes: Vec<f64> =
        counts.windows(5).map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).map_or(0.0, |median| median / MEDIAN / SQUARES.sqrt())
}

/// Most axes whose rows may follow one another in turn, and the factor between the travel from row
/// to row and that from a row to the next of its own axis: an axis alone goes farther in more rows.
const MOST_AXES: usize = 8;
const OWN_ROW: f64 = 3.0;

fn mixed_axes(recording: &Recording) -> Option<String> {
    let counts = &recording.position_counts;
    let mean = |rows: usize| {
        let steps = counts.windows(rows + 1).map(|w| (w[rows] - w[0]).abs());
        steps.sum::<f64>() / counts.len().saturating_sub(rows).max(1) as f64
    };
    let next = mean(1);
    let axes = (2..=MOST_AXES).find(|rows| OWN_ROW * mean(*rows) < next)?;
    Some(format!(
        "position_counts of {} go to and fro with a period of {axes} rows, as where {axes} axes are in one column: let host-sim import read one of them with --rows 1/{axes}",
        recording.file
    ))
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

/// Smoothed force and motion of a recording, to be regressed on each other.
struct Smoothed {
    force: Vec<f64>,
    acceleration: Vec<f64>,
    velocity: Vec<f64>,
    /// The sign of the speed, zero where it is slow.
    direction: Vec<f64>,
    /// rad or m, from its mean.
    position: Vec<f64>,
}

impl Smoothed {
    fn new(recording: &Recording, rig: &Rig) -> Self {
        let motion = Motion::new(recording, rig);
        let force: Vec<f64> = recording.command.iter().map(|u| rig.actuator.gain * u).collect();
        let slow = 0.02 * motion.velocity.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let mean = motion.position.iter().sum::<f64>() / motion.position.len() as f64;
        Self {
            force: motion.smoothed(&force),
            acceleration: motion.smoothed(&motion.accelerations()),
            direction: motion
                .velocity
                .iter()
                .map(|v| if v.abs() > slow { v.signum() } else { 0.0 })
                .collect(),
            position: motion.position.iter().map(|q| q - mean).collect(),
            velocity: motion.velocity,
        }
    }

    /// The inertia for which the motion asks, fitted together with friction and a constant, and the
    /// part of the force's variance that they explain; none where acceleration explains too little
    /// for its scale to say anything.
    fn inertia(&self) -> Option<(f64, f64)> {
        let force = &self.force;
        let constant = vec![1.0; force.len()];
        let columns = [&self.acceleration, &self.velocity, &self.direction, &constant];
        let factors = least_squares(&columns, force)?;
        let mean = force.iter().sum::<f64>() / force.len() as f64;
        let left: f64 =
            force.iter().enumerate().map(|(row, f)| (f - combined(&columns, &factors, row)).powi(2)).sum();
        let all: f64 = force.iter().map(|f| (f - mean).powi(2)).sum();
        let by_acceleration = factors[0] * factors[0] * self.acceleration.iter().map(|a| a * a).sum::<f64>();
        (all > 0.0 && by_acceleration > 0.3 * all).then(|| (factors[0], 1.0 - left / all))
    }

    /// The inertia for which the motion asks if its angle is `unit` times as large, fitted together
    /// with friction, gravity and a constant; none where that explains too little.
    fn inertia_in(&self, unit: f64) -> Option<f64> {
        let force = &self.force;
        let scaled = |column: &[f64]| column.iter().map(|x| unit * x).collect::<Vec<f64>>();
        let angle = scaled(&self.position);
        let of_angle = |f: fn(f64) -> f64| angle.iter().map(|x| f(*x)).collect::<Vec<f64>>();
        let mut columns = vec![
            scaled(&self.acceleration),
            scaled(&self.velocity),
            self.direction.clone(),
            vec![1.0; force.len()],
        ];
        match spread(&angle) > FAR_FOR_GRAVITY {
            true => columns.extend([of_angle(f64::sin), of_angle(f64::cos)]),
            false => columns.push(angle),
        }
        let columns: Vec<&Vec<f64>> = columns.iter().collect();
        let factors = least_squares(&columns, force)?;
        let left: Vec<f64> =
            force.iter().enumerate().map(|(row, f)| f - combined(&columns, &factors, row)).collect();
        let all = scatter(force);
        let by_acceleration = factors[0] * factors[0] * scatter(columns[0]);
        let is_enough =
            all > 0.0 && by_acceleration > BY_ACCELERATION * all && scatter(&left) < (1.0 - EXPLAINED) * all;
        is_enough.then_some(factors[0])
    }

    /// True if the axis gives energy to its drive and would gain more by friction. A spring gives
    /// back what it stored and may be most of the force, so the inertia has to be negative, and to
    /// show, in a fit with a spring as well.
    fn gains_by_friction(&self) -> bool {
        let constant = vec![1.0; self.force.len()];
        let columns = [&self.acceleration, &self.velocity, &self.direction, &constant, &self.position];
        least_squares(&columns, &self.force).is_some_and(|factors| {
            let rows = self.velocity.iter().zip(&self.direction);
            let work = self.force.iter().zip(&self.velocity).map(|(f, v)| (f - factors[3]) * v).sum::<f64>();
            let by_acceleration = factors[0] * factors[0] * scatter(&self.acceleration);
            factors[0] < 0.0
                && by_acceleration > BY_ACCELERATION * scatter(&self.force)
                && work < 0.0
                && rows.map(|(v, sign)| (factors[1] * v + factors[2] * sign) * v).sum::<f64>() < 0.0
        })
    }
}

/// The sum of the squares of a column about its mean.
fn scatter(column: &[f64]) -> f64 {
    let mean = column.iter().sum::<f64>() / column.len() as f64;
    column.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
}

/// The sum of columns times their factors, in one row.
fn combined(columns: &[&Vec<f64>], factors: &[f64], row: usize) -> f64 {
    columns.iter().zip(factors).map(|(column, x)| column[row] * x).sum()
}

/// The factors of columns whose sum is nearest to `y`; none where a column is zero.
fn least_squares(columns: &[&Vec<f64>], y: &[f64]) -> Option<Vec<f64>> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let norm: Vec<f64> = columns.iter().map(|column| product(column, column).sqrt()).collect();
    if norm.contains(&0.0) {
        return None;
    }
    let mut information = Square::zero(columns.len());
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            information.add(i, j, product(a, b) / (norm[i] * norm[j]));
        }
    }
    let score: Vec<f64> = columns.iter().zip(&norm).map(|(column, n)| product(column, y) / n).collect();
    Some(Factor::new(&information).solve(&score).iter().zip(&norm).map(|(x, n)| x / n).collect())
}

fn scale_or_sign(recording: &Recording, rig: &Rig) -> Option<String> {
    if !rig.effects.is_empty() || recording.force.is_some() {
        return None;
    }
    let smoothed = Smoothed::new(recording, rig);
    let (inertia, explained) = smoothed.inertia()?;
    if explained < EXPLAINED {
        return None;
    }
    let file = &recording.file;
    let ratio = inertia / rig.model.inertia;
    if ratio < -0.1 && smoothed.gains_by_friction() {
        return Some(format!(
            "the axis of {file} moves against its command and would gain energy by friction: a sign is wrong; change the sign of actuator.gain, or of one column"
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

/// Part of the force's variance that acceleration has to explain for a mistake that every recording
/// shows.
const BY_ACCELERATION: f64 = 0.03;
/// Travel, rad, beyond which gravity is a force over the angle and not over the travel.
const FAR_FOR_GRAVITY: f64 = 0.5;
/// A unit in which counts are given instead of radians.
struct UnitOfAngle {
    /// Radians in it.
    radians: f64,
    /// The factor around the rig's inertia within which every recording asks for it in the right
    /// unit: rigs err by more than people who convert turns.
    right: f64,
    mistake: &'static str,
}

const UNITS_OF_ANGLE: [UnitOfAngle; 4] = [
    UnitOfAngle {
        radians: PI / 180.0,
        right: 2.2,
        mistake: "counts_per_unit is per degree (multiply it by 57.2958)",
    },
    UnitOfAngle {
        radians: 180.0 / PI,
        right: 2.2,
        mistake: "counts_per_unit is 57.3 times too large, as where degrees were converted twice (divide it by 57.2958)",
    },
    UnitOfAngle { radians: TAU, right: 1.4, mistake: "counts_per_unit is per turn (divide it by 6.28319)" },
    UnitOfAngle {
        radians: 1.0 / TAU,
        right: 1.4,
        mistake: "counts_per_unit is 6.28 times too small, as where turns were converted twice (multiply it by 6.28319)",
    },
];

/// Returns the mistake in the unit of angle that all recordings share: each of them asks for the
/// rig's inertia if the angle is in another unit, and for an inertia that the rig's uncertainty
/// excludes if it is not.
pub(crate) fn unit_of_angle(all: &[&Recording], rig: &Rig) -> Option<String> {
    let unlikely = 3.0 * (rig.inertia_sd() + rig.gain_sd());
    let knows_inertia = unlikely < TAU.ln();
    if rig.kind != Kind::Rotary
        || !knows_inertia
        || !rig.effects.is_empty()
        || all.iter().any(|one| one.force.is_some())
    {
        return None;
    }
    let smoothed: Vec<Smoothed> = all.iter().map(|recording| Smoothed::new(recording, rig)).collect();
    let ratio_in = |one: &Smoothed, unit| one.inertia_in(unit).map(|inertia| inertia / rig.model.inertia);
    if smoothed.iter().any(|one| ratio_in(one, 1.0).is_some_and(|ratio| ratio.ln().abs() < unlikely)) {
        return None;
    }
    let asks_for_it = |unit: &&UnitOfAngle| {
        smoothed.iter().all(|one| {
            ratio_in(one, unit.radians).is_some_and(|ratio| (1.0 / unit.right..unit.right).contains(&ratio))
        })
    };
    let fitting: Vec<&UnitOfAngle> = UNITS_OF_ANGLE.iter().filter(asks_for_it).collect();
    let asked = ratio_in(smoothed.first()?, fitting.first()?.radians)? * fitting[0].radians;
    let (factor, change) = if asked < 1.0 { (1.0 / asked, "multiply") } else { (asked, "divide") };
    let units: Vec<&str> = fitting.iter().map(|unit| unit.mistake).collect();
    Some(format!(
        "the motion of every recording asks for an inertia {} times the rig's, and more than one mistake would explain that: {}; or command and angle are on two sides of a gear of about {factor:.0} ({change} actuator.gain by its ratio); or actuator.gain or model.inertia is wrong by that factor. Correct what is true of the machine",
        in_sentence(asked),
        units.join("; or ")
    ))
}

/// Factor between the inertia for which one recording asks and that of the others from which they
/// are of other units: no load that is changed between recordings makes as much.
const ANOTHER_UNIT: f64 = 5.0;

/// The recording whose force and motion are of other units than those of the others, as a sentence
/// with its place; of two, the one that is farther from the rig.
pub(crate) fn odd_one(all: &[&Recording], rig: &Rig) -> Option<(usize, String)> {
    // A force from outside, or an effect of the rig, may be most of the force in one recording and
    // nothing in another.
    if !rig.effects.is_empty() || all.iter().any(|recording| recording.force.is_some()) {
        return None;
    }
    let asked = |recording: &&Recording| {
        let (inertia, explained) = Smoothed::new(recording, rig).inertia()?;
        (explained > EXPLAINED && inertia > 0.0).then(|| inertia.ln())
    };
    let inertias: Vec<f64> = all.iter().map(asked).collect::<Option<_>>()?;
    let mut sorted = inertias.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = if all.len() > 2 { sorted[sorted.len() / 2] } else { rig.model.inertia.ln() };
    let far = |i: &usize| (inertias[*i] - usual).abs();
    let odd = (0..all.len()).max_by(|a, b| far(a).total_cmp(&far(b)))?;
    let from_others = |i: usize| inertias[odd] - inertias[i];
    let nearest = (0..all.len())
        .filter(|i| *i != odd)
        .map(from_others)
        .min_by(|a, b| a.abs().total_cmp(&b.abs()))
        .filter(|apart| apart.abs() > ANOTHER_UNIT.ln())?;
    let (factor, than) =
        if nearest > 0.0 { (nearest.exp(), "as large as") } else { ((-nearest).exp(), "smaller than") };
    let file = &all[odd].file;
    Some((
        odd,
        format!(
            "the force of {file} for its motion is {factor:.0} times {than} in the other recordings: its command or its counts have another unit; convert them, or leave the recording out"
        ),
    ))
}

#[cfg(test)]
mod tests;
