//! LuGre friction identified from a recording of periodic penetration (Paper 002, section V): a
//! needle goes to and fro in one block, at several speeds, so that nothing is cut and friction is
//! all that is left. All parameters are fitted at once, by damped least squares from several
//! beginnings.

mod lugre;
mod writer;

pub use lugre::Lugre;
pub use writer::toml;

use crate::force_fit::insertions::{self, Moment};
use device_sim::error::Error;
use lugre::Motion;
use numerics::linear::{Factor, Square, dot};
use std::path::Path;

/// Fewest times that the needle turns round: less says little of the bristles.
const FEWEST_TURNS: usize = 4;
/// A way that is drawn back by this much has turned, mm.
const TURNED_MM: f64 = 0.5;
/// The fastest way is at least this many times as fast as the slowest: speeds that are alike do not
/// tell what falls from what grows with speed.
const SPEEDS_APART: f64 = 5.0;
/// As many rows as are fitted to; more are averaged in groups.
const MOST_ROWS: usize = 20_000;
const ROUNDS: usize = 40;
/// A round that takes off less than this part ends a descent.
const ENOUGH: f64 = 1e-9;
/// Rows whose rest may have one cause: a reversal.
const BLOCK: usize = 200;
/// By which a value is changed to see what follows.
const SMALL_STEP: f64 = 1e-5;
/// Beginnings of a descent: how far bristles bend, mm, and v_s, mm/s.
const REACHES_MM: [f64; 3] = [0.1, 0.4, 1.0];
const STRIBECK_MM_S: [f64; 3] = [1.0, 5.0, 20.0];
/// Values of the parameter vector: σ₀, F_c, F_s − F_c and v_s as logarithms, σ₁, σ₂ and the zero.
const VALUES: usize = 7;

/// A fit, and how well it is known.
#[derive(Clone, Debug)]
pub struct FrictionFit {
    /// The parameters that leave least.
    pub friction: Lugre,
    /// Standard errors of the parameters, in the same units.
    pub errors: Lugre,
    /// Root mean square of what the fit leaves of the force, N.
    pub left_n: f64,
    /// Root mean square of the force without the sensor's zero, N.
    pub force_n: f64,
    /// Times that the needle turned round.
    pub turns: usize,
    /// The speeds of the ways between, mm/s.
    pub speeds_mm_s: Vec<f64>,
}

/// Fits LuGre friction to the recording at `path`, MCAP or CSV with `time_s`, `depth_mm` and
/// `force_n`; where a recording has several stretches, to the longest.
///
/// # Errors
///
/// If the file cannot be read, a force is larger than any needle's, the needle does not go to and
/// fro often enough or at speeds that differ, or the force is not that of friction.
pub fn fit(path: &Path) -> Result<FrictionFit, Error> {
    let shown = path.display();
    let stretches = insertions::moments(path, insertions::Angle::Ignored)?;
    // Each stretch has a time and bristles of its own.
    let moments = stretches.into_iter().max_by_key(Vec::len).unwrap_or_default();
    let furthest = moments.iter().map(|m| m.force_n).max_by(|a, b| a.abs().total_cmp(&b.abs()));
    if let Some(far) = furthest.filter(|force| force.abs() > insertions::LARGEST_N) {
        return Err(insertions::too_large(&shown.to_string(), far));
    }
    let ways = ways(&moments);
    if ways.len() <= FEWEST_TURNS {
        return Err(Error::input(format_args!(
            "{shown}: the needle turns round {} times; let it go to and fro at least {FEWEST_TURNS} times by more than {TURNED_MM} mm",
            ways.len().saturating_sub(1)
        )));
    }
    let (first, last) = (ways[0].0, ways[ways.len() - 1].1);
    let speeds_mm_s: Vec<f64> = ways.iter().map(|way| speed(&moments[way.0..=way.1])).collect();
    let (slowest, fastest) = speeds_mm_s.iter().fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
    if fastest < SPEEDS_APART * slowest {
        return Err(Error::input(format_args!(
            "{shown}: all ways have speeds between {slowest:.1} and {fastest:.1} mm/s; record slow and fast ones, at least {SPEEDS_APART} times apart"
        )));
    }
    let group = (last - first).div_ceil(MOST_ROWS);
    let rows = thinned(&moments[first..=last], group);
    let found = Problem::new(&rows, (ways[1].0 - first) / group).best().filter(|fit| fit.left_n < fit.force_n / 2.0).ok_or_else(|| {
        Error::input(format_args!(
            "{shown}: the force is not that of friction: less than half of it follows LuGre; is force_n positive against insertion, and is nothing cut?"
        ))
    })?;
    Ok(FrictionFit { turns: ways.len() - 1, speeds_mm_s, ..found })
}

/// The ways between one turning point and the next: first and last row.
fn ways(moments: &[Moment]) -> Vec<(usize, usize)> {
    let (mut turns, mut low, mut high) = (Vec::new(), 0, 0);
    let mut goes_in = None;
    for (row, moment) in moments.iter().enumerate() {
        if moment.depth_mm > moments[high].depth_mm {
            high = row;
        }
        if moment.depth_mm < moments[low].depth_mm {
            low = row;
        }
        if goes_in != Some(false) && moment.depth_mm < moments[high].depth_mm - TURNED_MM {
            turns.push(high);
            (goes_in, low) = (Some(false), row);
        } else if goes_in != Some(true) && moment.depth_mm > moments[low].depth_mm + TURNED_MM {
            turns.push(low);
            (goes_in, high) = (Some(true), row);
        }
    }
    if goes_in.is_some() {
        turns.push(if goes_in == Some(true) { high } else { low });
    }
    turns.windows(2).map(|two| (two[0], two[1])).filter(|way| way.0 < way.1).collect()
}

fn speed(way: &[Moment]) -> f64 {
    let (first, last) = (way[0], way[way.len() - 1]);
    (last.depth_mm - first.depth_mm).abs() / (last.time_s - first.time_s)
}

/// Groups of `group` rows as their means.
fn thinned(moments: &[Moment], group: usize) -> Vec<Moment> {
    let mean =
        |rows: &[Moment], value: fn(&Moment) -> f64| rows.iter().map(value).sum::<f64>() / rows.len() as f64;
    let middle = |rows: &[Moment]| Moment {
        time_s: mean(rows, |m| m.time_s),
        depth_mm: mean(rows, |m| m.depth_mm),
        angle_deg: mean(rows, |m| m.angle_deg),
        force_n: mean(rows, |m| m.force_n),
    };
    moments.chunks(group).map(middle).collect()
}

/// Parameters as the fit moves them.
type Values = [f64; VALUES];

fn friction(values: &Values) -> Lugre {
    let [stiffness, sliding, more, speed, damping, viscous, zero] = *values;
    Lugre {
        stiffness_n_per_mm: stiffness.exp(),
        sliding_n: sliding.exp(),
        sticking_n: sliding.exp() + more.exp(),
        stribeck_mm_s: speed.exp(),
        damping_n_s_per_mm: damping,
        viscous_n_s_per_mm: viscous,
        zero_n: zero,
    }
}

/// The rows that the friction is fitted to.
struct Problem {
    motion: Motion,
    forces: Vec<f64>,
    /// The first row that counts: before it the bristles may be bent in any way.
    from: usize,
}

impl Problem {
    /// All rows of the ways; the first way only brings the bristles to where they are known.
    fn new(rows: &[Moment], from: usize) -> Self {
        Self { motion: Motion::of(rows), forces: rows.iter().map(|m| m.force_n).collect(), from }
    }

    fn judged(&self) -> &[f64] {
        &self.forces[self.from..]
    }

    /// The forces that count with these values.
    fn computed(&self, values: &Values) -> Vec<f64> {
        friction(values).forces(&self.motion).split_off(self.from)
    }

    /// The residual of the forces with these values, N.
    fn rest(&self, values: &Values) -> Vec<f64> {
        self.judged()
            .iter()
            .zip(self.computed(values))
            .map(|(measured, computed)| measured - computed)
            .collect()
    }

    /// The best of the fits from several beginnings.
    fn best(&self) -> Option<FrictionFit> {
        let zero = self.judged().iter().sum::<f64>() / self.judged().len() as f64;
        let size = root_mean_square(self.judged().iter().map(|force| force - zero));
        let begins = REACHES_MM.into_iter().flat_map(|reach_mm| {
            STRIBECK_MM_S.map(|speed: f64| {
                [(size / reach_mm).ln(), (0.9 * size).ln(), (0.2 * size).ln(), speed.ln(), 0.0, 0.0, zero]
            })
        });
        let fits = begins.map(|begin| self.descend(begin));
        let (values, least) = fits.filter(|fit| fit.1.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let fit = friction(&values);
        Some(FrictionFit {
            friction: fit,
            errors: self.standard_errors(&values),
            left_n: (least / self.judged().len() as f64).sqrt(),
            force_n: root_mean_square(self.judged().iter().map(|force| force - fit.zero_n)),
            turns: 0,
            speeds_mm_s: Vec::new(),
        })
    }

    /// Levenberg's and Marquardt's descent; the values, and the squares that they leave.
    fn descend(&self, mut values: Values) -> (Values, f64) {
        let square = |values: &Values| {
            let rest = self.rest(values);
            dot(&rest, &rest)
        };
        let (mut least, mut damping) = (square(&values), 1e-2);
        for _ in 0..ROUNDS {
            let slopes = self.slopes(&values);
            let step = step(&slopes, &self.rest(&values), damping);
            let tried: Values = std::array::from_fn(|i| within(i, values[i] + step[i]));
            let now = square(&tried);
            if now < least {
                let gained = 1.0 - now / least;
                (values, least, damping) = (tried, now, damping / 5.0);
                if gained < ENOUGH {
                    break;
                }
            } else {
                damping *= 10.0;
            }
        }
        (values, least)
    }

    /// The change of each row's force with each value, by small steps of it.
    fn slopes(&self, values: &Values) -> [Vec<f64>; VALUES] {
        let here = self.computed(values);
        std::array::from_fn(|which| {
            let mut beside = *values;
            beside[which] += SMALL_STEP;
            self.computed(&beside).iter().zip(&here).map(|(a, b)| (a - b) / SMALL_STEP).collect()
        })
    }

    /// Standard errors that hold however the residual is correlated within [`BLOCK`] rows (White's
    /// estimator over blocks).
    fn standard_errors(&self, values: &Values) -> Lugre {
        let slopes = self.slopes(values);
        let inverse = Factor::new(&normal(&slopes)).inverse();
        let rest = self.rest(values);
        let pulls: Vec<Values> = (0..rest.len())
            .step_by(BLOCK)
            .map(|from| {
                let rows = from..(from + BLOCK).min(rest.len());
                let moved: Values =
                    std::array::from_fn(|i| dot(&slopes[i][rows.clone()], &rest[rows.clone()]));
                std::array::from_fn(|i| (0..VALUES).map(|j| inverse.at(i, j) * moved[j]).sum())
            })
            .collect();
        let error = |i: usize| pulls.iter().map(|pull| pull[i] * pull[i]).sum::<f64>().sqrt();
        let fit = friction(values);
        Lugre {
            stiffness_n_per_mm: fit.stiffness_n_per_mm * error(0),
            sliding_n: fit.sliding_n * error(1),
            sticking_n: (fit.sliding_n * error(1)).hypot((fit.sticking_n - fit.sliding_n) * error(2)),
            stribeck_mm_s: fit.stribeck_mm_s * error(3),
            damping_n_s_per_mm: error(4),
            viscous_n_s_per_mm: error(5),
            zero_n: error(6),
        }
    }
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Nothing grows without bound where a recording says nothing of it; no damping is negative.
fn within(which: usize, value: f64) -> f64 {
    match which {
        0..4 => value.clamp(-12.0, 8.0),
        4 | 5 => value.max(0.0),
        _ => value,
    }
}

fn normal(slopes: &[Vec<f64>; VALUES]) -> Square {
    let mut normal = Square::zero(VALUES);
    for (i, one) in slopes.iter().enumerate() {
        for (j, other) in slopes.iter().enumerate() {
            normal.add(i, j, dot(one, other));
        }
    }
    normal
}

/// A step of damped least squares.
fn step(slopes: &[Vec<f64>; VALUES], rest: &[f64], damping: f64) -> Vec<f64> {
    let mut normal = normal(slopes);
    for i in 0..VALUES {
        normal.add(i, i, damping * normal.at(i, i));
    }
    let right: Vec<f64> = slopes.iter().map(|slope| dot(slope, rest)).collect();
    Factor::new(&normal).solve(&right)
}

#[cfg(test)]
mod tests;
