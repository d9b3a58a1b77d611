//! The innovations that a rival predicts while another is true, and the distance between both.
//!
//! Along the true motion (of rival i) the axis accelerates by F_i/J_i where the rival j expects
//! F_j/J_j, and the sensor adds s_i where j expects s_j. A steady Kalman filter of j for position
//! and speed, with the sensor's counting and a white force as noise, turns both differences into
//! innovations that j did not expect. They are linear in the differences, so that refitting j to
//! them is a regularised least squares; half of the remaining sum of squares is the
//! Kullback–Leibler distance, in nats.

use crate::case::{Case, Rival};
use crate::predict::{Prediction, STEP_S};
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};

/// The shortest and longest block, s.
const BLOCK_S: (f64, f64) = (2.5e-3, 0.05);
/// Rows before and after a block that decide whether the axis rests, s.
const REST_S: f64 = 0.01;
/// Counts within which it rests.
const REST_COUNTS: f64 = 1.5;

/// The filter: its noise is the same for all rivals of a case.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filter {
    block_s: f64,
    rows: usize,
    gain: [f64; 2],
    deviation: f64,
    count: f64,
}

impl Filter {
    pub(crate) fn new(case: &Case) -> Self {
        let rig = &case.rivals[0].rig;
        let count = 1.0 / rig.encoder.counts_per_unit.abs();
        let block_s = (0.125 / case.bandwidth_hz).clamp(BLOCK_S.0, BLOCK_S.1).max(case.reading_s);
        let rows = (block_s / STEP_S).round() as usize;
        let noise = rig.encoder.noise_counts.unwrap_or(0.0) * count;
        // The mean over the block's rows.
        let reading = (count * count / 12.0 + noise * noise) / rows as f64;
        // A white force of this root mean square below the bandwidth, over the blocks' own band.
        let acceleration = case.disturbance / rig.model.inertia;
        let accelerating = acceleration * acceleration * (0.5 / block_s) / case.bandwidth_hz;
        let (gain, deviation) = steady(block_s, reading, accelerating);
        Self { block_s, rows, gain, deviation, count }
    }

    /// Innovations, in standard deviations, that differences of acceleration and reading leave, a
    /// block each.
    fn innovations(&self, acceleration: &[f64], reading: &[f64]) -> Vec<f64> {
        let (mut position, mut speed) = (0.0, 0.0);
        let t = self.block_s;
        acceleration
            .iter()
            .zip(reading)
            .map(|(a, y)| {
                let innovation = position + y;
                position -= self.gain[0] * innovation;
                speed -= self.gain[1] * innovation;
                position += t * speed + 0.5 * t * t * a;
                speed += t * a;
                innovation / self.deviation
            })
            .collect()
    }
}

/// Gain and standard deviation of the innovation of the steady filter for a step of `t` s.
fn steady(t: f64, reading: f64, accelerating: f64) -> ([f64; 2], f64) {
    let input = [0.5 * t * t, t];
    let noise = |i: usize, j: usize| accelerating * input[i] * input[j];
    let (mut a, mut b, mut c) = (reading, 0.0, reading / (t * t));
    let mut gain = [0.0; 2];
    for _ in 0..20_000 {
        let s = a + reading;
        gain = [a / s, b / s];
        // After the reading, then after the step.
        let (a1, b1, c1) = (a - gain[0] * a, b - gain[0] * b, c - gain[1] * b);
        a = a1 + 2.0 * t * b1 + t * t * c1 + noise(0, 0);
        b = b1 + t * c1 + noise(0, 1);
        c = c1 + noise(1, 1);
    }
    (gain, (a + reading).sqrt())
}

/// Acceleration and reading error of a rig along a motion, block by block.
struct Along {
    acceleration: Vec<f64>,
    reading: Vec<f64>,
}

fn along(rig: &Rig, motion: &Prediction, rows: usize) -> Along {
    let mut plant = Plant::unpowered(rig);
    let blocks = motion.position.len() / rows;
    let mut out = Along { acceleration: Vec::with_capacity(blocks), reading: Vec::with_capacity(blocks) };
    for block in 0..blocks {
        let (mut acceleration, mut reading) = (0.0, 0.0);
        for i in block * rows..(block + 1) * rows {
            plant.place(motion.position[i], motion.velocity[i]);
            plant.step(motion.command[i], Surroundings::default(), STEP_S);
            acceleration += (plant.velocity() - motion.velocity[i]) / STEP_S;
            reading += plant.reading() - plant.position();
        }
        out.acceleration.push(acceleration / rows as f64);
        out.reading.push(reading / rows as f64);
    }
    out
}

/// True for each block in which the axis rests: friction is a reaction there and gives no evidence.
fn rests(motion: &Prediction, filter: &Filter) -> Vec<bool> {
    let around = (REST_S / STEP_S) as usize;
    let last = motion.position.len() - 1;
    (0..motion.position.len() / filter.rows)
        .map(|block| {
            let from = (block * filter.rows).saturating_sub(around);
            let to = ((block + 1) * filter.rows + around).min(last);
            (motion.position[to] - motion.position[from]).abs() < REST_COUNTS * filter.count
        })
        .collect()
}

/// A value of a rival that a refit may move: the rig with it moved by one unit, and its standard
/// deviation in units.
struct Moved {
    rig: Rig,
    deviation: f64,
}

/// Relative move of a value, and relative standard deviations of what is measured easily, of
/// friction and of effects.
const MOVE: f64 = 0.05;
const EASY: f64 = 0.1;
const FRICTION: f64 = 0.5;
const COEFFICIENT: f64 = 1.0;

/// The values of a rig that a refit may move; those of its effects only `with_effects`.
fn moved(rig: &Rig, with_effects: bool) -> Vec<Moved> {
    let mut out = Vec::new();
    let mut push = |change: &dyn Fn(&mut Rig) -> bool, deviation: f64| {
        let mut changed = rig.clone();
        if change(&mut changed) {
            out.push(Moved { rig: changed, deviation: deviation / MOVE });
        }
    };
    let scaled = |value: &mut Option<f64>| {
        let there = value.is_some_and(|x| x != 0.0);
        *value = value.map(|x| x * (1.0 + MOVE));
        there
    };
    push(
        &|rig| {
            rig.actuator.gain *= 1.0 + MOVE;
            true
        },
        EASY,
    );
    push(&|rig| scaled(&mut rig.model.viscous), FRICTION);
    push(&|rig| scaled(&mut rig.model.coulomb), FRICTION);
    let offset = MOVE * rig.model.coulomb.unwrap_or(0.0).max(1e-3 * rig.model.inertia);
    push(
        &|rig| {
            rig.model.offset = Some(rig.model.offset.unwrap_or(0.0) + offset);
            true
        },
        COEFFICIENT,
    );
    for (i, effect) in rig.effects.iter().enumerate().filter(|_| with_effects) {
        for (key, value) in effect.coefficients.iter().filter(|(_, value)| **value != 0.0) {
            let change = |rig: &mut Rig| {
                rig.effects[i].coefficients.insert(key.clone(), value * (1.0 + MOVE));
                true
            };
            push(&change, COEFFICIENT);
        }
        for (key, value) in effect.uncertain_values() {
            let change = |rig: &mut Rig| {
                rig.effects[i].shape.insert(key.to_owned(), value * (1.0 + MOVE));
                true
            };
            push(&change, FRICTION);
        }
    }
    out
}

/// Sums of products of the innovations that a rival did not expect and of what each of its values
/// would change: they add up over segments.
#[derive(Clone, Debug)]
pub(crate) struct Gram {
    size: usize,
    /// Row by row; the last row and column are those of the innovations.
    sums: Vec<f64>,
    /// Standard deviations of the values.
    deviations: Vec<f64>,
}

impl Gram {
    /// Adds the sums of another segment of the same pair.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        let sums = self.sums.iter().zip(&other.sums).map(|(a, b)| a + b).collect();
        Self { size: self.size, sums, deviations: self.deviations.clone() }
    }

    /// The distance after the refit, nats, and the refit's moves.
    pub(crate) fn refitted(&self) -> (f64, Vec<f64>) {
        let p = self.size - 1;
        let at = |i: usize, j: usize| self.sums[i * self.size + j];
        let mut matrix: Vec<Vec<f64>> = (0..p)
            .map(|i| {
                let mut row: Vec<f64> = (0..p).map(|j| at(i, j)).collect();
                row[i] += 1.0 / self.deviations[i].powi(2);
                row.push(at(i, p));
                row
            })
            .collect();
        let moves = solved(&mut matrix);
        let explained: f64 = moves.iter().enumerate().map(|(i, x)| x * at(i, p)).sum();
        ((0.5 * (at(p, p) - explained)).max(0.0), moves)
    }
}

/// Solves a symmetric positive definite system whose right side is the last column.
fn solved(matrix: &mut [Vec<f64>]) -> Vec<f64> {
    let p = matrix.len();
    for i in 0..p {
        let pivot = matrix[i][i];
        let row = matrix[i].clone();
        for below in matrix.iter_mut().skip(i + 1) {
            let factor = below[i] / pivot;
            below.iter_mut().zip(&row).for_each(|(x, y)| *x -= factor * y);
        }
    }
    let mut x = vec![0.0; p];
    for i in (0..p).rev() {
        let rest: f64 = (i + 1..p).map(|j| matrix[i][j] * x[j]).sum();
        x[i] = (matrix[i][p] - rest) / matrix[i][i];
    }
    x
}

/// The innovations that each of several rivals does not expect along the motion of the true one.
pub(crate) struct Unexpected {
    /// Innovations as they are, in standard deviations.
    pub(crate) innovations: Vec<f64>,
    /// The change of the innovations by one unit of each value.
    columns: Vec<Vec<f64>>,
    deviations: Vec<f64>,
}

impl Unexpected {
    /// Along the motion of `truth`, what `rival` does not expect.
    pub(crate) fn new(filter: &Filter, truth: &Rival, motion: &Prediction, rival: &Rival) -> Self {
        let rest = rests(motion, filter);
        let own = along(&truth.rig, motion, filter.rows);
        let theirs = along(&rival.rig, motion, filter.rows);
        let difference = |a: &Along, b: &Along| {
            let acceleration: Vec<f64> = a
                .acceleration
                .iter()
                .zip(&b.acceleration)
                .zip(&rest)
                .map(|((a, b), rest)| if *rest { 0.0 } else { a - b })
                .collect();
            let reading: Vec<f64> = a.reading.iter().zip(&b.reading).map(|(a, b)| a - b).collect();
            filter.innovations(&acceleration, &reading)
        };
        // The model without an effect is the effect of size zero: a rival with more effects than
        // the truth keeps their sizes, or no input could ever speak for the truth.
        let with_effects = rival.rig.effects.len() <= truth.rig.effects.len();
        let moved = moved(&rival.rig, with_effects);
        let columns =
            moved.iter().map(|m| difference(&along(&m.rig, motion, filter.rows), &theirs)).collect();
        let deviations = moved.iter().map(|m| m.deviation).collect();
        Self { innovations: difference(&own, &theirs), columns, deviations }
    }

    /// The sums over all blocks.
    pub(crate) fn gram(&self) -> Gram {
        let size = self.columns.len() + 1;
        let column = |i: usize| self.columns.get(i).unwrap_or(&self.innovations);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let sums = (0..size * size).map(|k| dot(column(k / size), column(k % size))).collect();
        Gram { size, sums, deviations: self.deviations.clone() }
    }

    /// Nats gathered up to each block after the refit.
    pub(crate) fn gathered(&self) -> Vec<f64> {
        let moves = self.gram().refitted().1;
        let mut sum = 0.0;
        (0..self.innovations.len())
            .map(|block| {
                let explained: f64 = self.columns.iter().zip(&moves).map(|(c, x)| c[block] * x).sum();
                sum += 0.5 * (self.innovations[block] - explained).powi(2);
                sum
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steady_filter_whitens_its_own_innovations() {
        let (t, reading, accelerating) = (2.5e-3, 1e-9, 4.0);
        let (gain, deviation) = steady(t, reading, accelerating);
        // A pseudo-random run of the model through the filter: the innovations have the computed
        // variance and do not correlate.
        let mut state = 1_u64;
        let mut normal = || {
            let mut unit = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| unit()).sum::<f64>() - 6.0
        };
        let (mut position, mut speed) = (0.0, 0.0);
        let (mut sum, mut next, mut before) = (0.0, 0.0, 0.0);
        let n = 40_000;
        for _ in 0..n {
            let innovation: f64 = position + reading.sqrt() * normal();
            sum += innovation * innovation;
            next += innovation * before;
            before = innovation;
            position -= gain[0] * innovation;
            speed -= gain[1] * innovation;
            let a = accelerating.sqrt() * normal();
            position += t * speed + 0.5 * t * t * a;
            speed += t * a;
        }
        let variance = sum / f64::from(n);
        assert!((variance / deviation.powi(2) - 1.0).abs() < 0.05, "{variance} {}", deviation.powi(2));
        assert!((next / sum).abs() < 0.02, "{}", next / sum);
    }

    #[test]
    fn a_refit_takes_what_its_values_explain_and_no_more() {
        let unexpected =
            Unexpected { innovations: vec![3.0, 4.0], columns: vec![vec![1.0, 0.0]], deviations: vec![1e6] };
        let (nats, moves) = unexpected.gram().refitted();
        assert!((nats - 8.0).abs() < 1e-6 && (moves[0] - 3.0).abs() < 1e-6, "{nats} {moves:?}");
        assert!((unexpected.gathered()[1] - 8.0).abs() < 1e-6);
        let twice = unexpected.gram().plus(&unexpected.gram());
        assert!((twice.refitted().0 - 16.0).abs() < 1e-6);
    }
}
