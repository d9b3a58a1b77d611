//! A fitted free form as people see it and as the simulator runs it: its force over a grid, with a
//! band.

use super::basis::{Basis, Inputs, Point, Warp, Warps};
use crate::laws::{ForceTable, Variable};
use numerics::linear::Square;

/// A force over a grid.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    pub(crate) table: ForceTable,
    /// Standard deviation of each place's force, N·m or N.
    pub(crate) deviation: Vec<f64>,
    /// The number of blocks of the fitted recordings that were nearest to each place.
    pub(crate) visits: Vec<f64>,
}

/// Places of a variable that is alone, of one of two, and of an angle.
const ALONE: usize = 33;
const OF_TWO: usize = 15;
const OF_TURN: usize = 241;
/// Largest command of a table over the command, over the largest in the recordings: the force is in
/// proportion.
const BEYOND: f64 = 1.5;

/// Coefficients of a form's columns with their covariance, accelerations.
pub(super) struct Coefficients {
    pub(super) mean: Vec<f64>,
    pub(super) covariance: Square,
}

fn grid(variable: Variable, inputs: Inputs, warps: &Warps) -> Vec<f64> {
    let count = if inputs.variables().len() > 1 { OF_TWO } else { ALONE };
    let spread = |warp: &Warp, count: usize| -> Vec<f64> {
        (0..count).map(|i| warp.inverse(i as f64 / (count - 1) as f64)).collect()
    };
    match variable {
        Variable::Speed => {
            let mut ahead = spread(&warps.speed, count);
            // Each side of rest has a limit of its own.
            ahead[0] = 0.0;
            ahead.iter().rev().map(|v| -v).chain(ahead.iter().copied()).collect()
        }
        Variable::Travel => spread(&warps.travel, count),
        Variable::Angle => {
            let turn = warps.turn.unwrap_or(1.0);
            (0..OF_TURN).map(|i| turn * i as f64 / (OF_TURN - 1) as f64).collect()
        }
        Variable::Command if inputs == Inputs::Command => spread(&warps.command, count),
        Variable::Command => {
            let (low, high) = warps.command.range();
            let most = BEYOND * low.abs().max(high.abs());
            vec![-most, 0.0, most]
        }
        Variable::SinceReversal => spread(&warps.since_reversal, count),
        Variable::Time => spread(&warps.time, count),
    }
}

/// A point with one variable set; `side` is the sign of the speed where that is zero.
fn set(point: &mut Point, variable: Variable, value: f64, side: f64) {
    match variable {
        Variable::Speed => {
            point.direction = if value == 0.0 { side } else { value.signum() };
            point.speed = value.abs();
        }
        Variable::Travel | Variable::Angle => point.travel = value,
        Variable::Command => point.command = value,
        Variable::SinceReversal => point.since_reversal = value,
        Variable::Time => point.time = value,
    }
}

fn get(point: &Point, variable: Variable, turn: Option<f64>) -> f64 {
    match variable {
        Variable::Speed => point.direction * point.speed,
        Variable::Travel => point.travel,
        Variable::Angle => turn.map_or(point.travel, |turn| point.travel.rem_euclid(turn)),
        Variable::Command => point.command,
        Variable::SinceReversal => point.since_reversal,
        Variable::Time => point.time,
    }
}

/// The place of a grid that is nearest to a value.
fn nearest(grid: &[f64], value: f64) -> usize {
    let above = grid.partition_point(|place| *place < value).min(grid.len() - 1);
    let below = above.saturating_sub(1);
    if (value - grid[below]).abs() < (grid[above] - value).abs() { below } else { above }
}

impl Shape {
    /// The force of a form; `gain` is the acceleration per unit of the command, `inertia` makes
    /// force of acceleration.
    pub(super) fn new(
        basis: &Basis,
        of: &Coefficients,
        points: &[Vec<Point>],
        gain: f64,
        inertia: f64,
    ) -> Self {
        let over = basis.inputs.variables();
        let grids: Vec<Vec<f64>> =
            over.iter().map(|variable| grid(*variable, basis.inputs, basis.warps)).collect();
        let second = grids.get(1).map_or(1, Vec::len);
        let (mut force, mut deviation, mut row) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..grids[0].len() * second {
            let places = [i / second, i % second];
            let mut point = Point { direction: 1.0, ..Point::default() };
            for ((variable, grid), place) in over.iter().zip(&grids).zip(places) {
                let side = if place < grid.len() / 2 { -1.0 } else { 1.0 };
                set(&mut point, *variable, grid[place], side);
            }
            basis.at(&point, &mut row);
            let scale = basis.factor(&point, gain) * inertia;
            let sum: f64 = row.iter().zip(&of.mean).map(|(x, c)| x * c).sum();
            let mut variance = 0.0;
            for (a, x) in row.iter().enumerate() {
                variance += x * row.iter().enumerate().map(|(b, y)| y * of.covariance.at(a, b)).sum::<f64>();
            }
            force.push(sum * scale);
            deviation.push(variance.max(0.0).sqrt() * scale.abs());
        }
        let mut visits = vec![0.0; force.len()];
        for point in points.iter().flatten().filter(|point| point.direction != 0.0) {
            let place = |k: usize| nearest(&grids[k], get(point, over[k], basis.warps.turn));
            let first = place(0) * second;
            visits[if over.len() > 1 { first + place(1) } else { first }] += 1.0;
        }
        Self { table: ForceTable { over: over.to_vec(), grid: grids, force }, deviation, visits }
    }
}
