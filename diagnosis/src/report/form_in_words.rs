//! A force of any form in one sentence. Nothing here knows recordings.

use crate::laws::{ForceTable, Variable};
use numerics::digits::short;

/// Part of a form's mean square that counts as all of it, in words.
const NEARLY_ALL: f64 = 0.85;
/// Part of the mean square that proportion to speed must explain to be reported as such: a square
/// of the speed has 0.94.
const PROPORTIONAL: f64 = 0.97;
/// Part of the mean square that a product of two variables must explain to be reported as one.
const PRODUCT: f64 = 0.7;
/// Part of its size over which a form must change to change at all, and part of its range that
/// makes a turn of it.
const CHANGES: f64 = 0.25;
const TURNS: f64 = 0.2;

/// A grid of places with the force and how often the recordings were there; rows are of the first
/// variable, columns of the size of the speed or of the second variable.
struct Sheet {
    rows: Vec<f64>,
    columns: Vec<f64>,
    force: Vec<Vec<f64>>,
    visits: Vec<Vec<f64>>,
}

/// The sentence, without a stop; `visits` has one weight per place of the table, `length` is the
/// unit of the coordinate.
pub(super) fn sentence(table: &ForceTable, visits: &[f64], length: &str) -> String {
    let speed = table.over.iter().position(|v| *v == Variable::Speed);
    let other = table.over.iter().copied().find(|v| *v != Variable::Speed);
    let columns = table.grid.last().map_or(1, Vec::len);
    let cut = |x: &[f64]| -> Vec<Vec<f64>> { x.chunks(columns).map(<[f64]>::to_vec).collect() };
    let whole = Sheet {
        rows: if table.grid.len() > 1 { table.grid[0].clone() } else { vec![0.0] },
        columns: table.grid[table.grid.len() - 1].clone(),
        force: cut(&table.force),
        visits: cut(visits),
    };
    if speed.is_none() {
        return match table.over.as_slice() {
            [one] => format!("a force that {}", along(*one, &whole.columns, &whole.by_column(), length)),
            [one, Variable::Command] => {
                let last = whole.columns.len() - 1;
                let part: Vec<(f64, f64)> =
                    whole.force.iter().zip(&whole.visits).map(|(f, v)| (f[last], v.iter().sum())).collect();
                format!("a part of the command's force that {}", along(*one, &whole.rows, &part, length))
            }
            _ => format!("a force over {} of no simple form", over(table)),
        };
    }
    let (forward, backward) = whole.halves();
    let (ahead, back) = (forward.square(), backward.square());
    let share = ahead / (ahead + back).max(1e-300);
    let (way, end, sheet) = if share > NEARLY_ALL {
        (forward.sense(1.0), ", forward only", forward)
    } else if share < 1.0 - NEARLY_ALL {
        (backward.sense(-1.0), ", backward only", backward)
    } else {
        let (odd, even) = (forward.with(&backward, -1.0), forward.with(&backward, 1.0));
        let whole = odd.square() + even.square();
        if odd.square() > NEARLY_ALL * whole {
            (odd.sense(1.0), "", odd)
        } else if even.square() > NEARLY_ALL * whole {
            ("", ", the same in both directions", even)
        } else {
            ("", ", not the same in both directions", forward)
        }
    };
    format!("a force{way} that {}{end}", sheet.in_words(other, length))
}

fn over(table: &ForceTable) -> String {
    let words: Vec<&str> = table.over.iter().map(|v| v.in_words()).collect();
    words.join(" and ")
}

impl Sheet {
    /// Forward and backward, each over the size of the speed.
    fn halves(&self) -> (Self, Self) {
        let middle = self.columns.len() / 2;
        let forward = |x: &[Vec<f64>]| x.iter().map(|row| row[middle..].to_vec()).collect();
        let backward =
            |x: &[Vec<f64>]| x.iter().map(|row| row[..middle].iter().rev().copied().collect()).collect();
        let half = |force, visits| Self {
            rows: self.rows.clone(),
            columns: self.columns[middle..].to_vec(),
            force,
            visits,
        };
        (
            half(forward(&self.force), forward(&self.visits)),
            half(backward(&self.force), backward(&self.visits)),
        )
    }

    /// Half of this and, times a sign, another.
    fn with(&self, other: &Self, sign: f64) -> Self {
        let both = |a: &[Vec<f64>], b: &[Vec<f64>], f: &dyn Fn(f64, f64) -> f64| -> Vec<Vec<f64>> {
            a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect()).collect()
        };
        Self {
            rows: self.rows.clone(),
            columns: self.columns.clone(),
            force: both(&self.force, &other.force, &|a, b| 0.5 * (a + sign * b)),
            visits: both(&self.visits, &other.visits, &|a, b| a + b),
        }
    }

    fn places(&self) -> impl Iterator<Item = (f64, f64, f64, f64)> + '_ {
        self.rows.iter().enumerate().flat_map(move |(i, a)| {
            self.columns.iter().enumerate().map(move |(j, b)| (*a, *b, self.force[i][j], self.visits[i][j]))
        })
    }

    fn square(&self) -> f64 {
        self.places().map(|(_, _, f, w)| w * f * f).sum()
    }

    /// True if it acts against or with a motion of this direction, where most of it does.
    fn sense(&self, direction: f64) -> &'static str {
        let sum: f64 = self.places().map(|(_, _, f, w)| w * f * direction).sum();
        let size: f64 = self.places().map(|(_, _, f, w)| w * f.abs()).sum();
        if sum < -0.5 * size {
            " against the motion"
        } else if sum > 0.5 * size {
            " with the motion"
        } else {
            ""
        }
    }

    /// Mean over the rows per column, and over the columns per row, each with its weight.
    fn by_column(&self) -> Vec<(f64, f64)> {
        (0..self.columns.len())
            .map(|j| mean(self.force.iter().zip(&self.visits).map(|(f, w)| (f[j], w[j]))))
            .collect()
    }

    fn by_row(&self) -> Vec<(f64, f64)> {
        self.force
            .iter()
            .zip(&self.visits)
            .map(|(f, w)| mean(f.iter().copied().zip(w.iter().copied())))
            .collect()
    }

    /// Part of the mean square that some prediction explains.
    fn explained(&self, prediction: impl Fn(usize, usize) -> f64) -> f64 {
        let mut left = 0.0;
        for (i, row) in self.force.iter().enumerate() {
            for (j, f) in row.iter().enumerate() {
                left += self.visits[i][j] * (f - prediction(i, j)).powi(2);
            }
        }
        1.0 - left / self.square().max(1e-300)
    }

    fn in_words(&self, other: Option<Variable>, length: &str) -> String {
        let by_speed = self.by_column();
        if self.explained(|_, j| self.per_speed() * self.columns[j]) > PROPORTIONAL {
            return "grows in proportion to speed, as viscous friction does".into();
        }
        let Some(other) = other else {
            return along(Variable::Speed, &self.columns, &by_speed, length);
        };
        let by_other = self.by_row();
        if self.explained(|_, j| by_speed[j].0) > NEARLY_ALL {
            return along(Variable::Speed, &self.columns, &by_speed, length);
        }
        if self.explained(|i, _| by_other[i].0) > NEARLY_ALL {
            return along(other, &self.rows, &by_other, length);
        }
        let (a, b) = self.product();
        if self.explained(|i, j| self.columns[j] * (a + b * self.rows[i])) > PRODUCT {
            return format!("grows with speed times {}", other.in_words());
        }
        let per_speed: Vec<(f64, f64)> = self
            .force
            .iter()
            .zip(&self.visits)
            .map(|(f, w)| {
                let (mut along, mut square) = (0.0, 0.0);
                for ((f, w), v) in f.iter().zip(w).zip(&self.columns) {
                    along += w * f * v;
                    square += w * v * v;
                }
                (along / square.max(1e-300), w.iter().sum())
            })
            .collect();
        if self.explained(|i, j| per_speed[i].0 * self.columns[j]) > PRODUCT {
            let along = along(other, &self.rows, &per_speed, length);
            return format!("grows with speed, by a factor that {along}");
        }
        format!("depends on {} and speed together, in no simple form", other.in_words())
    }

    /// Least squares of speed times a constant.
    fn per_speed(&self) -> f64 {
        let (along, square) = self
            .places()
            .fold((0.0, 0.0), |(along, square), (_, v, f, w)| (along + w * v * f, square + w * v * v));
        along / square.max(1e-300)
    }

    /// Least squares of speed times a line of the other variable.
    fn product(&self) -> (f64, f64) {
        let (mut m, mut r) = ([0.0; 3], [0.0; 2]);
        for (x, v, f, w) in self.places() {
            let (p, q) = (v, v * x);
            m[0] += w * p * p;
            m[1] += w * p * q;
            m[2] += w * q * q;
            r[0] += w * p * f;
            r[1] += w * q * f;
        }
        let det = m[0] * m[2] - m[1] * m[1];
        if det <= 1e-12 * m[0] * m[2] {
            return (0.0, 0.0);
        }
        ((m[2] * r[0] - m[1] * r[1]) / det, (m[0] * r[1] - m[1] * r[0]) / det)
    }
}

fn mean(values: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (sum, weight) = values.fold((0.0, 0.0), |(s, n), (x, w)| (s + w * x, n + w));
    (if weight > 0.0 { sum / weight } else { 0.0 }, weight)
}

/// Says how a form changes along one variable, from places and the force there with its weight.
fn along(variable: Variable, places: &[f64], values: &[(f64, f64)], length: &str) -> String {
    let name = variable.in_words();
    let seen: Vec<(f64, f64)> =
        places.iter().zip(values).filter(|(_, (_, w))| *w > 0.0).map(|(x, (f, _))| (*x, *f)).collect();
    let high = seen.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
    let low = seen.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let range = high - low;
    if seen.len() < 3 || range < CHANGES * high.abs().max(low.abs()) {
        return format!("is much the same whatever the {name}");
    }
    // Its size, where it hardly changes sign.
    let sign = if low >= -CHANGES * range || high > 4.0 * -low {
        1.0
    } else if high <= CHANGES * range || -low > 4.0 * high {
        -1.0
    } else {
        1.0
    };
    let turns = turns(&seen.iter().map(|p| sign * p.1).collect::<Vec<f64>>(), TURNS * range);
    match turns.as_slice() {
        [_] => {
            let rises = sign * seen[seen.len() - 1].1 > sign * seen[0].1;
            if rises { format!("grows with {name}") } else { format!("falls as {name} grows") }
        }
        [(at, up), _] => {
            let unit = match variable {
                Variable::Speed => format!(" {length}/s"),
                Variable::Travel | Variable::Angle => format!(" {length}"),
                Variable::Command => String::new(),
                Variable::SinceReversal | Variable::Time => " s".into(),
            };
            let what = if *up { "peaks" } else { "dips" };
            format!("{what} at a {name} of {}{unit}", short(seen[*at].0))
        }
        more => format!("swings with {name}, turning {} times", more.len() - 1),
    }
}

/// Returns the end of each run between turns by more than a threshold, and true if the run was
/// upward; the last is the sequence's end.
fn turns(values: &[f64], threshold: f64) -> Vec<(usize, bool)> {
    let mut out = Vec::new();
    let (mut highest, mut lowest) = (0, 0);
    let mut up = None;
    for (i, x) in values.iter().enumerate() {
        if *x > values[highest] {
            highest = i;
        }
        if *x < values[lowest] {
            lowest = i;
        }
        if up != Some(false) && values[highest] - x > threshold {
            if up == Some(true) || highest > 0 && values[highest] - values[0] > threshold {
                out.push((highest, true));
            }
            (up, lowest) = (Some(false), i);
        } else if up != Some(true) && x - values[lowest] > threshold {
            if up == Some(false) || lowest > 0 && values[0] - values[lowest] > threshold {
                out.push((lowest, false));
            }
            (up, highest) = (Some(true), i);
        }
    }
    out.push((values.len() - 1, up == Some(true)));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(from: f64, to: f64, count: usize) -> Vec<f64> {
        (0..count).map(|i| from + (to - from) * i as f64 / (count - 1) as f64).collect()
    }

    fn speeds() -> Vec<f64> {
        let ahead = line(0.0, 10.0, 21);
        ahead.iter().rev().map(|v| -v).chain(ahead.iter().copied()).collect()
    }

    /// The sentence of a force over speed, or over another variable and speed; at a speed of zero
    /// the side counts.
    fn told(other: Option<(Variable, Vec<f64>)>, force: impl Fn(f64, f64, f64) -> f64) -> String {
        let columns = speeds();
        let rows = other.as_ref().map_or(vec![0.0], |(_, places)| places.clone());
        let middle = columns.len() / 2;
        let table = ForceTable {
            force: rows
                .iter()
                .flat_map(|a| {
                    let force = &force;
                    columns
                        .iter()
                        .enumerate()
                        .map(move |(j, v)| force(*a, *v, if j < middle { -1.0 } else { 1.0 }))
                })
                .collect(),
            over: other.iter().map(|(v, _)| *v).chain([Variable::Speed]).collect(),
            grid: other.iter().map(|(_, places)| places.clone()).chain([columns.clone()]).collect(),
        };
        sentence(&table, &vec![1.0; table.force.len()], "rad")
    }

    #[test]
    fn forms_over_the_speed_read_as_an_engineer_writes() {
        let words = |force: &dyn Fn(f64, f64) -> f64| told(None, |_, v, way| force(v, way));
        assert_eq!(words(&|v, _| -v * v.abs()), "a force against the motion that grows with speed");
        assert_eq!(
            words(&|v, _| -2.0 * v),
            "a force against the motion that grows in proportion to speed, as viscous friction does"
        );
        assert_eq!(
            words(&|v, way| -way * (0.2 + (-v.abs()).exp())),
            "a force against the motion that falls as speed grows"
        );
        assert_eq!(
            words(&|_, way| -way),
            "a force against the motion that is much the same whatever the speed"
        );
        assert_eq!(words(&|v, _| (1.3 * v).sin()), "a force that swings with speed, turning 4 times");
        assert_eq!(
            words(&|v, way| -way * (-(v.abs() - 4.0).powi(2)).exp()),
            "a force against the motion that peaks at a speed of 4.000 rad/s"
        );
        assert_eq!(
            words(&|v, way| if way > 0.0 { -v } else { 0.0 }),
            "a force against the motion that grows in proportion to speed, as viscous friction does, forward only"
        );
    }

    #[test]
    fn forms_over_two_variables_are_described_by_those_that_matter() {
        let words =
            |force: &dyn Fn(f64, f64, f64) -> f64| told(Some((Variable::Travel, line(0.0, 5.0, 11))), force);
        assert_eq!(
            words(&|x, v, way| if way > 0.0 { -x * v } else { 0.0 }),
            "a force against the motion that grows with speed times travel, forward only"
        );
        assert_eq!(words(&|x, _, _| -x), "a force that grows with travel, the same in both directions");
        assert_eq!(
            words(&|x, v, _| -v * (0.1 + (-4.0 * (x - 2.0).powi(2)).exp())),
            "a force against the motion that grows with speed, by a factor that peaks at a travel of 2.000 rad"
        );
        assert_eq!(
            words(&|_, v, _| -v),
            "a force against the motion that grows in proportion to speed, as viscous friction does"
        );
        assert!(words(&|x, v, _| (3.0 * x * v).sin()).contains("in no simple form"));
    }

    #[test]
    fn forms_without_a_speed_are_given_along_their_variable() {
        let words = |over: Vec<Variable>, grid: Vec<Vec<f64>>, force: Vec<f64>| {
            let visits = vec![1.0; force.len()];
            sentence(&ForceTable { over, grid, force }, &visits, "m")
        };
        let places = line(0.0, 1.0, 21);
        let bump = places.iter().map(|x| (-50.0 * (x - 0.5).powi(2)).exp()).collect();
        assert_eq!(
            words(vec![Variable::Travel], vec![places.clone()], bump),
            "a force that peaks at a travel of 0.5000 m"
        );
        let fades = places.iter().flat_map(|t| [-1.0, 0.0, 1.0].map(|u| -u * t)).collect();
        assert_eq!(
            words(vec![Variable::Time, Variable::Command], vec![places, vec![-1.0, 0.0, 1.0]], fades),
            "a part of the command's force that grows with time"
        );
    }
}
