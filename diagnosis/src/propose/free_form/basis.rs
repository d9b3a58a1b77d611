//! Fixed bases for forces of any form: cosines over variables made dimensionless, so that a
//! Gaussian process is a linear regression with a prior (Solin and Särkkä 2020, doi
//! 10.1007/s11222-019-09886-w). Nothing here is fitted.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::input::Input;
use crate::laws::Variable;
use std::f64::consts::{PI, TAU};

/// The inputs of one free form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Inputs {
    Speed,
    Travel,
    Command,
    Angle,
    TravelSpeed,
    SinceReversalSpeed,
    TimeSpeed,
    TimeCommand,
    TravelCommand,
    AngleCommand,
}

impl Inputs {
    pub(crate) const ALL: [Self; 10] = [
        Self::Speed,
        Self::Travel,
        Self::Command,
        Self::Angle,
        Self::TravelSpeed,
        Self::SinceReversalSpeed,
        Self::TimeSpeed,
        Self::TimeCommand,
        Self::TravelCommand,
        Self::AngleCommand,
    ];

    /// The variables.
    pub(crate) fn variables(self) -> &'static [Variable] {
        use Variable as V;
        match self {
            Self::Speed => &[V::Speed],
            Self::Travel => &[V::Travel],
            Self::Command => &[V::Command],
            Self::Angle => &[V::Angle],
            Self::TravelSpeed => &[V::Travel, V::Speed],
            Self::SinceReversalSpeed => &[V::SinceReversal, V::Speed],
            Self::TimeSpeed => &[V::Time, V::Speed],
            Self::TimeCommand => &[V::Time, V::Command],
            Self::TravelCommand => &[V::Travel, V::Command],
            Self::AngleCommand => &[V::Angle, V::Command],
        }
    }

    /// Returns their names in reports.
    pub(crate) fn in_words(self) -> String {
        let words: Vec<&str> = self.variables().iter().map(|v| v.in_words()).collect();
        words.join(" and ")
    }

    /// True if each recording has coefficients of its own, as the encoder's zero differs.
    pub(crate) fn own(self) -> bool {
        matches!(self, Self::Angle | Self::AngleCommand)
    }

    /// True if the form is a part of the command's own force, rather than any force over the
    /// command.
    fn scales_command(self) -> bool {
        matches!(self, Self::TimeCommand | Self::TravelCommand | Self::AngleCommand)
    }
}

/// The axis's state during one block, or a place of a table.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Point {
    /// Sign of the velocity; zero where that is not known.
    pub(crate) direction: f64,
    /// Its size, rad/s or m/s.
    pub(crate) speed: f64,
    pub(crate) travel: f64,
    /// Travel within the block, over which an angle is averaged.
    pub(crate) passed: f64,
    pub(crate) command: f64,
    pub(crate) since_reversal: f64,
    pub(crate) time: f64,
}

/// The places of a recording's blocks.
pub(crate) fn points(track: &BlockedRecording) -> Vec<Point> {
    let command = track.block_mean(&track.rows.command);
    let (mut way, mut turned) = (0.0, 0.0);
    (0..track.block_count())
        .map(|j| {
            let (v, time) = (track.motion.v[j], track.blocks.start[j] + 0.5 * track.blocks.span[j]);
            let now = if v < 0.0 { -1.0 } else { 1.0 };
            if now != way {
                (way, turned) = (now, time);
            }
            Point {
                direction: if track.motion.rest[j] { 0.0 } else { v.signum() },
                speed: v.abs(),
                travel: track.place_at(j),
                passed: v * track.blocks.span[j],
                command: command[j],
                since_reversal: time - turned,
                time,
            }
        })
        .collect()
}

/// A variable from 0 to 1: half by its range, half by its rank, so that the form may be finer where
/// the axis is often.
#[derive(Debug, Clone)]
pub(crate) struct Warp {
    quantiles: Vec<f64>,
}

const QUANTILES: usize = 64;

impl Warp {
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        if values.is_empty() {
            values = vec![0.0, 1.0];
        }
        Self { quantiles: (0..=QUANTILES).map(|i| values[(values.len() - 1) * i / QUANTILES]).collect() }
    }

    pub(crate) fn range(&self) -> (f64, f64) {
        (self.quantiles[0], self.quantiles[QUANTILES])
    }

    fn at(&self, x: f64) -> f64 {
        let q = &self.quantiles;
        let (low, high) = self.range();
        if high <= low {
            return 0.5;
        }
        let x = x.clamp(low, high);
        let above = q.partition_point(|q| *q < x).clamp(1, QUANTILES);
        let (a, b) = (q[above - 1], q[above]);
        let part = if b > a { (x - a) / (b - a) } else { 0.5 };
        let rank = ((above - 1) as f64 + part) / QUANTILES as f64;
        0.5 * (rank + (x - low) / (high - low))
    }

    /// The variable where it is this far along, 0 to 1.
    pub(crate) fn inverse(&self, part: f64) -> f64 {
        let (mut low, mut high) = self.range();
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if self.at(middle) < part {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}

/// The warps of all variables over the fitted recordings.
pub(crate) struct Warps {
    pub(crate) speed: Warp,
    pub(crate) travel: Warp,
    pub(crate) command: Warp,
    pub(crate) since_reversal: Warp,
    pub(crate) time: Warp,
    pub(crate) turn: Option<f64>,
}

/// Least part of a turn that an angle asks for.
const LEAST_TURN: f64 = 0.6;

impl Warps {
    pub(crate) fn of(all: &[Vec<Point>], turn: Option<f64>) -> Self {
        let pooled = |pick: &dyn Fn(&Point) -> f64| -> Warp {
            let moving = |point: &&Point| point.direction != 0.0;
            Warp::of(all.iter().flatten().filter(moving).map(pick).collect())
        };
        let travel = pooled(&|p| p.travel);
        let (low, high) = travel.range();
        Self {
            speed: pooled(&|p| p.speed),
            command: pooled(&|p| p.command),
            since_reversal: pooled(&|p| p.since_reversal),
            time: pooled(&|p| p.time),
            turn: turn.filter(|turn| high - low > LEAST_TURN * turn),
            travel,
        }
    }
}

/// Sizes of the bases.
const SPEED_WAVES: usize = 12;
const TRAVEL_WAVES: usize = 48;
const COMMAND_WAVES: usize = 16;
const PAIR_WAVES: usize = 10;
const PAIR_SPEED_WAVES: usize = 6;
const DRIFT_SPEED_WAVES: usize = 3;
const SCALED_WAVES: usize = 10;
const ORDERS: usize = 40;
/// Half waves over the travel alone that count as one: it may hold many places.
const FINE: f64 = 4.0;

/// A basis over its inputs.
pub(crate) struct Basis<'a> {
    pub(crate) inputs: Inputs,
    pub(crate) warps: &'a Warps,
    /// Half waves over the range of both variables, per column.
    pub(crate) frequency: Vec<f64>,
}

fn cosines(part: f64, count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |m| (PI * m as f64 * part).cos())
}

impl<'a> Basis<'a> {
    pub(crate) fn new(inputs: Inputs, warps: &'a Warps) -> Self {
        let line = |count: usize| (0..count).map(|m| m as f64).collect::<Vec<f64>>();
        let with_speed = |count: usize, speeds: usize| -> Vec<f64> {
            let pairs = (0..count).flat_map(|a| (0..speeds).map(move |b| (a as f64).hypot(b as f64)));
            // Forward and backward.
            pairs.flat_map(|frequency| [frequency; 2]).collect()
        };
        let frequency = match inputs {
            Inputs::Speed => with_speed(1, SPEED_WAVES),
            Inputs::Travel => (1..TRAVEL_WAVES).map(|m| m as f64 / FINE).collect(),
            Inputs::Command => line(COMMAND_WAVES),
            Inputs::Angle | Inputs::AngleCommand => {
                vec![0.0; if warps.turn.is_some() { 2 * ORDERS } else { 0 }]
            }
            Inputs::TravelSpeed | Inputs::SinceReversalSpeed => with_speed(PAIR_WAVES, PAIR_SPEED_WAVES),
            Inputs::TimeSpeed => with_speed(PAIR_WAVES, DRIFT_SPEED_WAVES),
            Inputs::TimeCommand | Inputs::TravelCommand => line(SCALED_WAVES),
        };
        Self { inputs, warps, frequency }
    }

    /// The columns at a place, per unit of the command where they are a part of its force.
    pub(crate) fn at(&self, p: &Point, out: &mut Vec<f64>) {
        out.clear();
        let warps = self.warps;
        let (time, travel) = (|| warps.time.at(p.time), || warps.travel.at(p.travel));
        match self.inputs {
            Inputs::Speed => self.with_speed(p, 0.0, 1, SPEED_WAVES, out),
            Inputs::Travel => out.extend(cosines(travel(), TRAVEL_WAVES).skip(1)),
            Inputs::Command => out.extend(cosines(warps.command.at(p.command), COMMAND_WAVES)),
            Inputs::Angle | Inputs::AngleCommand => self.harmonics(p, out),
            Inputs::TravelSpeed => self.with_speed(p, travel(), PAIR_WAVES, PAIR_SPEED_WAVES, out),
            Inputs::SinceReversalSpeed => {
                let since = warps.since_reversal.at(p.since_reversal);
                self.with_speed(p, since, PAIR_WAVES, PAIR_SPEED_WAVES, out);
            }
            Inputs::TimeSpeed => self.with_speed(p, time(), PAIR_WAVES, DRIFT_SPEED_WAVES, out),
            Inputs::TimeCommand => out.extend(cosines(time(), SCALED_WAVES)),
            Inputs::TravelCommand => out.extend(cosines(travel(), SCALED_WAVES)),
        }
    }

    /// Forward and backward apart: no form is smooth through a reversal.
    fn with_speed(&self, p: &Point, part: f64, count: usize, speeds: usize, out: &mut Vec<f64>) {
        let speed: Vec<f64> = cosines(self.warps.speed.at(p.speed), speeds).collect();
        for a in cosines(part, count) {
            for b in &speed {
                let (forward, backward) = (p.direction > 0.0, p.direction < 0.0);
                out.extend([forward, backward].map(|there| if there { a * b } else { 0.0 }));
            }
        }
    }

    fn harmonics(&self, p: &Point, out: &mut Vec<f64>) {
        let Some(turn) = self.warps.turn else { return };
        for order in 1..=ORDERS {
            let k = TAU * order as f64 / turn;
            let half = 0.5 * k * p.passed;
            let mean = if half.abs() > 1e-6 { half.sin() / half } else { 1.0 };
            let (sin, cos) = (k * p.travel).sin_cos();
            out.extend([cos * mean, sin * mean]);
        }
    }

    /// Over the command, what a column is per unit of it; 1 elsewhere.
    pub(crate) fn factor(&self, p: &Point, gain: f64) -> f64 {
        if self.inputs.scales_command() { gain * p.command } else { 1.0 }
    }

    /// The columns over a recording; `gain` is the acceleration per unit of the command.
    pub(crate) fn columns(&self, track: &BlockedRecording, points: &[Point], gain: f64) -> Vec<Input> {
        let mut columns = vec![Vec::with_capacity(points.len()); self.frequency.len()];
        let mut row = Vec::new();
        for point in points {
            self.at(point, &mut row);
            columns.iter_mut().zip(&row).for_each(|(column, x)| column.push(*x));
        }
        let input = |mut column: Vec<f64>| {
            if self.inputs.scales_command() {
                column.iter_mut().for_each(|x| *x *= gain);
                track.rows.command_input.scaled(&column)
            } else {
                Input::Held(column)
            }
        };
        columns.into_iter().map(input).collect()
    }
}
