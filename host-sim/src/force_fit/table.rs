//! The force of seed 000 as a table over depth, speed and angle, and what to do with the cells that nobody measured.
//!
//! Depth is perpendicular to the skin, so that a layer is met at the same place whatever the angle. Cells that were not measured are
//! filled as if speed scaled the force by a factor of its own: the nearest measured curve of that angle times what this speed is to
//! its speed where both were measured (`F(d, v, a) = f_a(d)·g(v)`), or, at an angle without any, `base(d)·g(v)·h(a)`. With the paper's
//! five cells of nine that is as much as can be known, and it is marked as what it is.

use super::curve::Curve;

/// Where a cell's force comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Insertions at this speed and angle.
    Measured,
    /// Insertions at this speed and others at this angle.
    Separable,
    /// None at this speed, or none at this angle: the nearest cell that has a force.
    Nearest,
}

/// One speed at one angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Force in N over perpendicular depth in mm.
    pub force: Curve,
    /// Where it comes from.
    pub origin: Origin,
}

/// Force in N over perpendicular depth, speed and angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// mm/s, rising.
    pub speeds_mm_s: Vec<f64>,
    /// Angles to the skin in °, rising.
    pub angles_deg: Vec<f64>,
    /// `cells[speed][angle]`.
    pub cells: Vec<Vec<Cell>>,
}

/// How the knots lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knots {
    /// The first, mm.
    pub first_mm: f64,
    /// From one to the next, mm.
    pub step_mm: f64,
    /// How many.
    pub count: usize,
}

/// Rounds in which base and factors are found from each other; they settle in three or four.
const ROUNDS: usize = 12;

impl Table {
    /// Fits the cells that have points, `points[speed][angle]` being (perpendicular depth in mm, force in N), and fills the others. None where no
    /// cell has any.
    pub fn fit(
        speeds_mm_s: Vec<f64>,
        angles_deg: Vec<f64>,
        points: &[Vec<Vec<(f64, f64)>>],
        knots: Knots,
    ) -> Option<Self> {
        let fitted: Vec<Vec<Option<Curve>>> = points
            .iter()
            .map(|row| {
                let fit = |p: &Vec<_>| Curve::fit(p, knots.first_mm, knots.step_mm, knots.count);
                row.iter().map(fit).collect()
            })
            .collect();
        let parts = Separable::of(&fitted)?;
        let cells = (0..speeds_mm_s.len())
            .map(|s| (0..angles_deg.len()).map(|a| parts.cell(&fitted, s, a)).collect::<Option<Vec<_>>>())
            .collect::<Option<Vec<_>>>()?;
        Some(Self { speeds_mm_s, angles_deg, cells })
    }

    /// Force in N; between the cells in proportion, beyond them as at the nearest.
    pub fn force_n(&self, depth_mm: f64, speed_mm_s: f64, angle_deg: f64) -> f64 {
        let (s, t) = between(&self.speeds_mm_s, speed_mm_s);
        let (a, u) = between(&self.angles_deg, angle_deg);
        let at = |s: usize, a: usize| {
            let s = s.min(self.speeds_mm_s.len() - 1);
            let a = a.min(self.angles_deg.len() - 1);
            self.cells[s][a].force.at(depth_mm)
        };
        let low = at(s, a) + u * (at(s, a + 1) - at(s, a));
        let high = at(s + 1, a) + u * (at(s + 1, a + 1) - at(s + 1, a));
        low + t * (high - low)
    }

    /// Speeds and angles that nobody measured together, mm/s and °.
    pub fn not_measured(&self) -> impl Iterator<Item = (f64, f64, Origin)> + '_ {
        self.cells.iter().zip(&self.speeds_mm_s).flat_map(move |(row, speed)| {
            let named = row.iter().zip(&self.angles_deg);
            named
                .filter(|(cell, _)| cell.origin != Origin::Measured)
                .map(move |(cell, angle)| (*speed, *angle, cell.origin))
        })
    }
}

/// The index below `value` and how far it is to the next.
fn between(grid: &[f64], value: f64) -> (usize, f64) {
    let above = grid.partition_point(|g| *g <= value);
    match above.checked_sub(1) {
        None => (0, 0.0),
        Some(below) => match grid.get(above) {
            Some(next) => (below, (value - grid[below]) / (next - grid[below])),
            None => (below, 0.0),
        },
    }
}

/// `base(d)·g(v)·h(a)` from the cells that are there.
struct Separable {
    base: Curve,
    /// Logarithms of g and h; none for a speed or an angle that no measured cell ties to the others.
    speeds: Vec<Option<f64>>,
    angles: Vec<Option<f64>>,
}

impl Separable {
    fn of(fitted: &[Vec<Option<Curve>>]) -> Option<Self> {
        let measured: Vec<(usize, usize, &Curve)> = fitted
            .iter()
            .enumerate()
            .flat_map(|(s, row)| row.iter().enumerate().filter_map(move |(a, c)| Some((s, a, c.as_ref()?))))
            .collect();
        let (_, _, first) = measured.first()?;
        let mut base = (*first).clone();
        let mut sizes = vec![1.0; measured.len()];
        for _ in 0..ROUNDS {
            for (size, (_, _, curve)) in sizes.iter_mut().zip(&measured) {
                *size = scale(curve, &base);
            }
            let mean = sizes.iter().sum::<f64>() / sizes.len() as f64;
            sizes.iter_mut().for_each(|size| *size /= mean.max(1e-12));
            for knot in 0..base.values.len() {
                let (mut above, mut below, mut support) = (0.0, 0.0, 0.0);
                for (size, (_, _, curve)) in sizes.iter().zip(&measured) {
                    let n = curve.support[knot];
                    above += n * size * curve.values[knot];
                    below += n * size * size;
                    support += n;
                }
                if below > 0.0 {
                    base.values[knot] = above / below;
                    base.support[knot] = support;
                }
            }
        }
        let logs: Vec<_> =
            measured.iter().zip(&sizes).map(|((s, a, _), z)| (*s, *a, z.max(1e-6).ln())).collect();
        let (speeds, angles) = factors(&logs, fitted.len(), fitted.first().map_or(0, Vec::len));
        Some(Self { base, speeds, angles })
    }

    fn cell(&self, fitted: &[Vec<Option<Curve>>], s: usize, a: usize) -> Option<Cell> {
        if let Some(force) = &fitted[s][a] {
            return Some(Cell { force: force.clone(), origin: Origin::Measured });
        }
        if let (Some(g), Some(h)) = (self.speeds[s], self.angles[a]) {
            // A measured curve of the same angle keeps what that angle does to the shape, which no factor can tell.
            let beside = fitted
                .iter()
                .enumerate()
                .filter_map(|(s2, row)| Some((s2, row[a].as_ref()?, self.speeds[s2]?)));
            let nearest = beside.min_by_key(|(s2, ..)| s.abs_diff(*s2));
            let (shape, factor) =
                nearest.map_or((&self.base, (g + h).exp()), |(_, c, g2)| (c, (g - g2).exp()));
            let values = shape.values.iter().map(|v| v * factor).collect();
            let support = vec![0.0; shape.support.len()];
            return Some(Cell { force: Curve { values, support, ..*shape }, origin: Origin::Separable });
        }
        let far = |s2: usize, a2: usize| s.abs_diff(s2) + a.abs_diff(a2);
        let nearest = fitted.iter().enumerate().flat_map(|(s2, row)| {
            row.iter().enumerate().filter_map(move |(a2, c)| Some((far(s2, a2), c.as_ref()?)))
        });
        let (_, force) = nearest.min_by_key(|(far, _)| *far)?;
        let support = vec![0.0; force.support.len()];
        Some(Cell { force: Curve { support, ..force.clone() }, origin: Origin::Nearest })
    }
}

/// The factor that `base` needs to be `curve`, where both have points.
fn scale(curve: &Curve, base: &Curve) -> f64 {
    let terms = curve.values.iter().zip(&base.values).zip(curve.support.iter().zip(&base.support));
    let (above, below) = terms
        .filter(|(_, (n, m))| **n > 0.0 && **m > 0.0)
        .fold((0.0, 0.0), |(above, below), ((c, b), (n, _))| (above + n * c * b, below + n * b * b));
    if below > 0.0 { above / below } else { 1.0 }
}

/// `log size = g + h` by least squares on the cells that are there; none for what no chain of cells ties to the first.
fn factors(
    logs: &[(usize, usize, f64)],
    speeds: usize,
    angles: usize,
) -> (Vec<Option<f64>>, Vec<Option<f64>>) {
    let (mut g, mut h) = (vec![None; speeds], vec![None; angles]);
    let Some((s0, ..)) = logs.first() else { return (g, h) };
    g[*s0] = Some(0.0);
    // What is tied to the first, whichever way.
    for _ in 0..speeds + angles {
        for (s, a, z) in logs {
            match (g[*s], h[*a]) {
                (Some(gs), None) => h[*a] = Some(z - gs),
                (None, Some(ha)) => g[*s] = Some(z - ha),
                _ => {}
            }
        }
    }
    // Then the means of what each is asked for, until they settle: least squares by alternation.
    for _ in 0..200 {
        for (index, angle) in h.iter_mut().enumerate() {
            let asked = logs.iter().filter(|l| l.1 == index).filter_map(|l| Some(l.2 - g[l.0]?));
            *angle = mean(asked).or(*angle);
        }
        for (index, speed) in g.iter_mut().enumerate() {
            let asked = logs.iter().filter(|l| l.0 == index).filter_map(|l| Some(l.2 - h[l.1]?));
            *speed = mean(asked).or(*speed);
        }
    }
    (g, h)
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEEDS: [f64; 3] = [1.0, 3.0, 5.0];
    const ANGLES: [f64; 3] = [30.0, 45.0, 60.0];
    const KNOTS: Knots = Knots { first_mm: 0.0, step_mm: 0.25, count: 41 };

    /// Separable, with a puncture at 3 mm: known by its formula.
    fn truth(depth: f64, speed: f64, angle: f64) -> f64 {
        let base = if depth < 3.0 { depth * depth / 9.0 } else { 0.5 + 0.06 * (depth - 3.0) };
        base * (1.0 + 0.08 * speed) * (0.7 + angle / 100.0)
    }

    fn points(measured: impl Fn(f64, f64) -> bool) -> Vec<Vec<Vec<(f64, f64)>>> {
        let cell = |v: f64, a: f64| -> Vec<(f64, f64)> {
            let depths = (0..2_000).map(|n| f64::from(n) * 0.005);
            if measured(v, a) { depths.map(|d| (d, truth(d, v, a))).collect() } else { Vec::new() }
        };
        SPEEDS.iter().map(|v| ANGLES.iter().map(|a| cell(*v, *a)).collect()).collect()
    }

    fn fit(measured: impl Fn(f64, f64) -> bool) -> Table {
        Table::fit(SPEEDS.to_vec(), ANGLES.to_vec(), &points(measured), KNOTS).expect("some were measured")
    }

    fn worst(table: &Table, cells: impl Fn(f64, f64) -> bool) -> f64 {
        let mut worst: f64 = 0.0;
        for (v, a) in
            SPEEDS.iter().flat_map(|v| ANGLES.iter().map(move |a| (*v, *a))).filter(|c| cells(c.0, c.1))
        {
            for n in 0..400 {
                let depth = f64::from(n) * 0.025;
                if (depth - 3.0).abs() > 0.3 {
                    worst = worst.max((table.force_n(depth, v, a) - truth(depth, v, a)).abs());
                }
            }
        }
        worst
    }

    #[test]
    fn measured_cells_are_what_was_measured() {
        let table = fit(|_, _| true);
        assert!(worst(&table, |_, _| true) < 0.01, "{}", worst(&table, |_, _| true));
        assert_eq!(table.not_measured().count(), 0);
    }

    /// Seed 000, Fig. 2: 60° at 1, 3 and 5 mm/s; 5 mm/s at 30, 45 and 60°.
    #[test]
    fn the_papers_five_cells_give_the_other_four_where_the_truth_is_separable() {
        let measured = |v: f64, a: f64| a == 60.0 || v == 5.0;
        let table = fit(measured);
        let worst = worst(&table, |v, a| !measured(v, a));
        assert!(worst < 0.02, "{worst} N beside up to 1.6 N");
        let missing: Vec<_> = table.not_measured().collect();
        let said =
            [(1.0, 30.0), (1.0, 45.0), (3.0, 30.0), (3.0, 45.0)].map(|(v, a)| (v, a, Origin::Separable));
        assert_eq!(missing, said);
    }

    #[test]
    fn an_angle_that_changes_the_shape_is_kept_where_it_was_measured() {
        // The flatter the needle, the earlier the wall gives way under the skin: no factor of the angle tells that.
        let shaped = |d: f64, v: f64, a: f64| {
            let gives_way = 1.0 + a / 30.0;
            (1.0 + 0.08 * v) * if d < gives_way { d } else { 0.3 }
        };
        let cell = |v: f64, a: f64| -> Vec<(f64, f64)> {
            let depths = (0..2_000).map(|n| f64::from(n) * 0.005);
            if a == 60.0 || v == 5.0 { depths.map(|d| (d, shaped(d, v, a))).collect() } else { Vec::new() }
        };
        let points: Vec<Vec<_>> =
            SPEEDS.iter().map(|v| ANGLES.iter().map(|a| cell(*v, *a)).collect()).collect();
        let table = Table::fit(SPEEDS.to_vec(), ANGLES.to_vec(), &points, KNOTS).expect("some were measured");
        for depth in [0.5, 1.5, 2.5, 4.0] {
            let (got, wanted) = (table.force_n(depth, 1.0, 30.0), shaped(depth, 1.0, 30.0));
            assert!((got - wanted).abs() < 0.03, "{got} N at {depth} mm, not {wanted} N");
        }
    }

    #[test]
    fn what_nothing_ties_to_the_rest_is_the_nearest_and_says_so() {
        let table = fit(|v, a| (v, a) == (1.0, 30.0) || (v, a) == (5.0, 60.0));
        assert_eq!(table.cells[1][1].origin, Origin::Nearest);
        assert_eq!(
            table.cells[0][2].origin,
            Origin::Nearest,
            "its speed and its angle were never measured together"
        );
        assert_eq!(table.cells[0][0].origin, Origin::Measured);
        assert!(Table::fit(SPEEDS.to_vec(), ANGLES.to_vec(), &points(|_, _| false), KNOTS).is_none());
    }

    #[test]
    fn between_cells_in_proportion_and_beyond_them_as_at_the_edge() {
        let table = fit(|_, _| true);
        let middle = table.force_n(2.0, 2.0, 37.5);
        let corners = [(1.0, 30.0), (1.0, 45.0), (3.0, 30.0), (3.0, 45.0)].map(|(v, a)| truth(2.0, v, a));
        assert!((middle - corners.iter().sum::<f64>() / 4.0).abs() < 0.01, "{middle}");
        assert_eq!(table.force_n(2.0, 99.0, 99.0), table.force_n(2.0, 5.0, 60.0));
        assert_eq!(table.force_n(2.0, -1.0, 0.0), table.force_n(2.0, 1.0, 30.0));
    }
}
