//! LuGre friction along a recorded motion (Canudas de Wit 1995):
//! `ż = v − σ₀|v|z/g(v)`, `g = F_c + (F_s − F_c)e^{−(v/v_s)²}`, `F = σ₀z + σ₁ż + σ₂v`.

use crate::force_fit::insertions::Moment;

/// Speed is the slope of the depth over the way that a needle takes this long for at most, s, and
/// over as little of it as this many mm: long compared with an encoder's step, short compared with
/// the way on which bristles bend.
const LONGEST_S: f64 = 0.04;
const SHORTEST_MM: f64 = 0.1;

/// The friction's parameters, and the zero of the sensor that measured it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lugre {
    /// σ₀, N/mm.
    pub stiffness_n_per_mm: f64,
    /// F_c, N.
    pub sliding_n: f64,
    /// F_s, N.
    pub sticking_n: f64,
    /// v_s, mm/s.
    pub stribeck_mm_s: f64,
    /// σ₁, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// σ₂, N·s/mm.
    pub viscous_n_s_per_mm: f64,
    /// The sensor's reading without a force, N.
    pub zero_n: f64,
}

/// A motion row by row: what moves the bristles, and how fast.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) steps_mm: Vec<f64>,
    pub(super) speeds_mm_s: Vec<f64>,
}

impl Motion {
    pub(super) fn of(moments: &[Moment]) -> Self {
        Self {
            steps_mm: std::iter::once(0.0)
                .chain(moments.windows(2).map(|two| two[1].depth_mm - two[0].depth_mm))
                .collect(),
            speeds_mm_s: speeds(moments),
        }
    }
}

/// The slope of the depth at each row, mm/s: of the lines through the rows before, about and after
/// it, the one that fits best, so that no line reaches round a turning point.
fn speeds(moments: &[Moment]) -> Vec<f64> {
    let last = moments.len() - 1;
    let is_enough = |from: usize, to: usize| {
        let (first, last) = (moments[from], moments[to]);
        (last.depth_mm - first.depth_mm).abs() >= SHORTEST_MM || last.time_s - first.time_s >= LONGEST_S
    };
    let speed = |row: usize| {
        let before = (0..row).rev().find(|from| is_enough(*from, row)).unwrap_or(0);
        let after = (row + 1..=last).find(|to| is_enough(row, *to)).unwrap_or(last);
        let middle = (row.midpoint(before), row.midpoint(after));
        let lines = [(before, row), middle, (row, after)].map(|(from, to)| line(&moments[from..=to]));
        lines.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |(slope, _)| slope)
    };
    (0..moments.len()).map(speed).collect()
}

/// The slope of a line by least squares, mm/s, and the mean square that it leaves, mm²; of a single
/// row none.
fn line(near: &[Moment]) -> (f64, f64) {
    let rows = near.len() as f64;
    let time = near.iter().map(|m| m.time_s).sum::<f64>() / rows;
    let depth = near.iter().map(|m| m.depth_mm).sum::<f64>() / rows;
    let (cross, square) = near.iter().fold((0.0, 0.0), |(cross, square), m| {
        let off = m.time_s - time;
        (cross + off * (m.depth_mm - depth), square + off * off)
    });
    if square <= 0.0 {
        return (0.0, f64::INFINITY);
    }
    let slope = cross / square;
    let left = near.iter().map(|m| (m.depth_mm - depth - slope * (m.time_s - time)).powi(2)).sum::<f64>();
    (slope, left / rows)
}

impl Lugre {
    /// The force that the sensor reads on each row, N. The bristles begin unbent.
    pub(super) fn forces(&self, motion: &Motion) -> Vec<f64> {
        let mut bristles = 0.0;
        let rows = motion.steps_mm.iter().zip(&motion.speeds_mm_s);
        rows.map(|(step, speed)| {
            let more = (self.sticking_n - self.sliding_n) * (-(speed / self.stribeck_mm_s).powi(2)).exp();
            let bent = (self.sliding_n + more) / self.stiffness_n_per_mm;
            // The equation solved over a step in which g does not change.
            let there = bent.copysign(*step);
            bristles = there + (bristles - there) * (-step.abs() / bent).exp();
            let rate = speed - speed.abs() * bristles / bent;
            self.stiffness_n_per_mm * bristles
                + self.damping_n_s_per_mm * rate
                + self.viscous_n_s_per_mm * speed
                + self.zero_n
        })
        .collect()
    }
}
