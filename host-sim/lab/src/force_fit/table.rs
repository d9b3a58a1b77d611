//! The force of paper 000 as a table over depth, speed and angle, and what to do with the cells
//! that nobody measured.
//!
//! Depth is perpendicular to the skin, so that a layer is met at the same place whatever the angle.
//! Knots of the same number belong together in all cells: the beginning of a fall, its end, and
//! what is between in the same proportion. Between the cells depth and force of a knot are
//! interpolated, as the device does it.
//!
//! Cells that were not measured are filled as if speed scaled the force by a factor of its own: the
//! nearest measured curve of that angle times what this speed is to its speed where both were
//! measured (`F(d, v, a) = f_a(d)·g(v)`), or, at an angle without any, `base(d)·g(v)·h(a)`; its
//! knots lie as much deeper than that curve's as they do at another angle where both speeds were
//! measured. With the paper's five cells of nine that is as much as can be known, and it is marked
//! as what it is.

use super::curve::{Curve, Knots, Landmarks, Overlaid, is_rise, place_knots};
use control_core::config::MAX_DEPTHS;

/// The origin of a cell's force.
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
    /// Force over perpendicular depth.
    pub force: Curve,
    /// Its origin.
    pub origin: Origin,
}

/// Force in N over perpendicular depth, speed and angle, rounded as the file holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceGrid {
    /// mm/s, rising.
    pub speeds_mm_s: Vec<f64>,
    /// Angles to the skin in °, rising.
    pub angles_deg: Vec<f64>,
    /// `cells[speed][angle]`.
    pub cells: Vec<Vec<Cell>>,
    /// Knots at which a layer gives way.
    pub gives_way: Vec<usize>,
}

/// All insertions at one speed and one angle.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The means of their landmarks.
    pub marks: Landmarks,
    /// Their points.
    pub points: Overlaid,
}

/// Rounds in which base and factors are found from each other; they settle in three or four.
const ROUNDS: usize = 12;
/// Knots of a table are at least this far apart, mm.
const LEAST_GAP_MM: f64 = 0.05;

impl ForceGrid {
    /// Fits the cells that were measured, `measured[speed][angle]`, which have as many landmarks
    /// each, and fills the others. None where no cell was.
    pub fn fit(
        speeds_mm_s: Vec<f64>,
        angles_deg: Vec<f64>,
        measured: &[Vec<Option<Measured>>],
    ) -> Option<Self> {
        let all: Vec<&Measured> = measured.iter().flatten().flatten().collect();
        let pieces = all.first()?.marks.pieces();
        let ends = (0..pieces).filter(|piece| is_rise(*piece)).count() * 2;
        let points: Vec<&Overlaid> = all.iter().map(|cell| &cell.points).collect();
        let knots = place_knots(&points, pieces, MAX_DEPTHS.saturating_sub(ends));
        let curve = |cell: &Option<Measured>| cell.as_ref().map(|cell| fitted(cell, &knots));
        let fitted: Vec<Vec<_>> = measured.iter().map(|row| row.iter().map(curve).collect()).collect();
        let parts = Separable::of(&fitted)?;
        let cells = (0..speeds_mm_s.len())
            .map(|s| (0..angles_deg.len()).map(|a| parts.cell(&fitted, s, a)).collect::<Option<Vec<_>>>())
            .collect::<Option<Vec<_>>>()?;
        let cells = cells.into_iter().map(|row| row.into_iter().map(rounded).collect()).collect();
        Some(Self { speeds_mm_s, angles_deg, cells, gives_way: gives_way(&knots) })
    }

    /// The force over depth at a speed and an angle; between the cells in proportion, beyond them
    /// as at the nearest.
    pub fn curve(&self, speed_mm_s: f64, angle_deg: f64) -> Curve {
        let (s, t) = between(&self.speeds_mm_s, speed_mm_s);
        let (a, u) = between(&self.angles_deg, angle_deg);
        let (s2, a2) = ((s + 1).min(self.speeds_mm_s.len() - 1), (a + 1).min(self.angles_deg.len() - 1));
        let mix = |of: &dyn Fn(&Curve) -> &Vec<f64>| {
            let corner = |s: usize, a: usize, knot: usize| of(&self.cells[s][a].force)[knot];
            let at = |knot: usize| {
                let low = corner(s, a, knot) + u * (corner(s, a2, knot) - corner(s, a, knot));
                let high = corner(s2, a, knot) + u * (corner(s2, a2, knot) - corner(s2, a, knot));
                low + t * (high - low)
            };
            (0..of(&self.cells[s][a].force).len()).map(at).collect()
        };
        Curve { depths_mm: mix(&|curve| &curve.depths_mm), forces_n: mix(&|curve| &curve.forces_n) }
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

/// The last knot of each rise but the last.
fn gives_way(knots: &Knots) -> Vec<usize> {
    let rises: Vec<usize> = knots.iter().step_by(2).map(Vec::len).collect();
    let ends = rises.iter().scan(0, |sum, count| {
        *sum += count;
        Some(*sum - 1)
    });
    ends.take(rises.len() - 1).collect()
}

fn fitted(cell: &Measured, knots: &Knots) -> Curve {
    let mut curve = Curve { depths_mm: Vec::new(), forces_n: Vec::new() };
    for (piece, knots) in knots.iter().enumerate().filter(|(piece, _)| is_rise(*piece)) {
        curve.depths_mm.extend(knots.iter().map(|share| cell.marks.depth(piece, *share)));
        let before = curve.forces_n.last().copied().unwrap_or(0.0);
        curve.forces_n.extend(cell.points.fit(piece, knots).unwrap_or_else(|| vec![before; knots.len()]));
    }
    curve
}

/// As the file and the device hold it: hundredths of a mm and mN, rising in depth, and no pull for
/// a push.
fn rounded(cell: Cell) -> Cell {
    let mut depths_mm: Vec<f64> =
        cell.force.depths_mm.iter().map(|mm| (mm * 100.0).round() / 100.0).collect();
    for knot in 1..depths_mm.len() {
        depths_mm[knot] = depths_mm[knot].max(((depths_mm[knot - 1] + LEAST_GAP_MM) * 100.0).round() / 100.0);
    }
    let forces_n = cell.force.forces_n.iter().map(|n| (n.max(0.0) * 1e3).round() / 1e3).collect();
    Cell { force: Curve { depths_mm, forces_n }, ..cell }
}

/// `base(d)·g(v)·h(a)` from the cells that are there.
struct Separable {
    base: Vec<f64>,
    /// Logarithms of g and h; none for a speed or an angle that no measured cell ties to the
    /// others.
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
        let mut base = first.forces_n.clone();
        let mut sizes = vec![1.0; measured.len()];
        for _ in 0..ROUNDS {
            for (size, (_, _, curve)) in sizes.iter_mut().zip(&measured) {
                *size = scale(&curve.forces_n, &base);
            }
            let mean = sizes.iter().sum::<f64>() / sizes.len() as f64;
            sizes.iter_mut().for_each(|size| *size /= mean.max(1e-12));
            let below: f64 = sizes.iter().map(|size| size * size).sum();
            for (knot, force) in base.iter_mut().enumerate() {
                let above: f64 = sizes.iter().zip(&measured).map(|(size, m)| size * m.2.forces_n[knot]).sum();
                *force = above / below.max(1e-12);
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
        let there = || {
            fitted.iter().enumerate().flat_map(|(s2, row)| {
                row.iter().enumerate().filter_map(move |(a2, curve)| Some((s2, a2, curve.as_ref()?)))
            })
        };
        let (_, _, nearest) = there().min_by_key(|(s2, a2, _)| s.abs_diff(*s2) + a.abs_diff(*a2))?;
        let (Some(g), Some(h)) = (self.speeds[s], self.angles[a]) else {
            return Some(Cell { force: nearest.clone(), origin: Origin::Nearest });
        };
        // A measured curve of the same angle keeps the effect of that angle on the shape, which no
        // factor can represent.
        let beside = there().filter(|(s2, a2, _)| *a2 == a && self.speeds[*s2].is_some());
        let Some((s2, _, shape)) = beside.min_by_key(|(s2, ..)| s.abs_diff(*s2)) else {
            let forces_n = self.base.iter().map(|n| n * (g + h).exp()).collect();
            return Some(Cell { force: Curve { forces_n, ..nearest.clone() }, origin: Origin::Separable });
        };
        let factor = (g - self.speeds[s2].unwrap_or(g)).exp();
        // How much deeper a knot is at this speed than at that one, at an angle at which both were
        // measured.
        let both =
            (0..fitted[s].len()).find_map(|a2| Some((fitted[s][a2].as_ref()?, fitted[s2][a2].as_ref()?)));
        let deeper =
            |knot: usize| both.map_or(0.0, |(here, there)| here.depths_mm[knot] - there.depths_mm[knot]);
        let depths_mm = shape.depths_mm.iter().enumerate().map(|(knot, mm)| mm + deeper(knot)).collect();
        let forces_n = shape.forces_n.iter().map(|n| n * factor).collect();
        Some(Cell { force: Curve { depths_mm, forces_n }, origin: Origin::Separable })
    }
}

/// The factor that `base` needs to be `forces`.
fn scale(forces: &[f64], base: &[f64]) -> f64 {
    let (above, below) =
        forces.iter().zip(base).fold((0.0, 0.0), |(above, below), (f, b)| (above + f * b, below + b * b));
    if below > 0.0 { above / below } else { 1.0 }
}

/// `log size = g + h` by least squares on the cells that are there; none for what no chain of cells
/// ties to the first.
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

    /// Separable, with a puncture at 3 mm: known by its formula.
    fn truth(depth: f64, speed: f64, angle: f64) -> f64 {
        let base = if depth < 3.0 { depth * depth / 9.0 } else { 0.5 + 0.06 * (depth - 3.0) };
        base * (1.0 + 0.08 * speed) * (0.7 + angle / 100.0)
    }

    fn fit_to(
        force: impl Fn(f64, f64, f64) -> f64,
        gives_way: impl Fn(f64, f64) -> f64,
        measured: impl Fn(f64, f64) -> bool,
    ) -> Option<ForceGrid> {
        let cell = |v: f64, a: f64| {
            let marks = Landmarks(vec![0.0, gives_way(v, a), gives_way(v, a) + 0.1, 10.0]);
            let mut points = Overlaid::new(3);
            let depths = (0..2_000).map(|n| f64::from(n) * 0.005);
            points.add(&marks, &depths.map(|d| (d, force(d, v, a))).collect::<Vec<_>>());
            measured(v, a).then_some(Measured { marks, points })
        };
        let cells: Vec<Vec<_>> =
            SPEEDS.iter().map(|v| ANGLES.iter().map(|a| cell(*v, *a)).collect()).collect();
        ForceGrid::fit(SPEEDS.to_vec(), ANGLES.to_vec(), &cells)
    }

    fn fit(measured: impl Fn(f64, f64) -> bool) -> ForceGrid {
        fit_to(truth, |_, _| 3.0, measured).expect("some were measured")
    }

    fn worst(table: &ForceGrid, cells: impl Fn(f64, f64) -> bool) -> f64 {
        let all = SPEEDS.iter().flat_map(|v| ANGLES.iter().map(move |a| (*v, *a)));
        let mut worst: f64 = 0.0;
        for (v, a) in all.filter(|c| cells(c.0, c.1)) {
            let curve = table.curve(v, a);
            for depth in (0..400).map(|n| f64::from(n) * 0.025).filter(|d| !(2.99..3.11).contains(d)) {
                worst = worst.max((curve.at(depth) - truth(depth, v, a)).abs());
            }
        }
        worst
    }

    #[test]
    fn measured_cells_are_what_was_measured() {
        let table = fit(|_, _| true);
        assert!(worst(&table, |_, _| true) < 0.01, "{}", worst(&table, |_, _| true));
        assert_eq!(table.not_measured().count(), 0);
        let knot = table.gives_way[0];
        assert_eq!((table.gives_way.len(), table.cells[1][1].force.depths_mm[knot]), (1, 3.0));
    }

    /// Paper 000, Fig. 2: 60° at 1, 3 and 5 mm/s; 5 mm/s at 30, 45 and 60°.
    #[test]
    fn the_papers_five_cells_give_a_separable_truths_other_four() {
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
    fn a_layer_that_gives_way_elsewhere_is_kept_and_carried_over() {
        // The flatter and the faster, the earlier and the later the wall gives way under the skin.
        let gives_way = |v: f64, a: f64| 1.0 + a / 30.0 + 0.1 * v;
        let shaped = |d: f64, v: f64, a: f64| {
            (1.0 + 0.08 * v) * if d < gives_way(v, a) { 2.0 * d / gives_way(v, a) } else { 0.3 }
        };
        let table = fit_to(shaped, gives_way, |v, a| a == 60.0 || v == 5.0).expect("some were measured");
        for (v, a) in [(1.0, 30.0), (3.0, 45.0), (5.0, 30.0), (1.0, 60.0)] {
            let curve = table.curve(v, a);
            for depth in [0.5, 1.5, gives_way(v, a) - 0.02, gives_way(v, a) + 0.15, 4.5] {
                let (got, wanted) = (curve.at(depth), shaped(depth, v, a));
                assert!((got - wanted).abs() < 0.04, "{v} mm/s, {a}°: {got} N at {depth} mm, not {wanted} N");
            }
        }
        // Between two cells it gives way between their depths, and with one peak.
        let between = table.curve(4.0, 60.0);
        assert!((between.at(3.38) - shaped(3.38, 4.0, 60.0)).abs() < 0.05 && between.at(3.55) < 0.5);
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
        assert!(fit_to(truth, |_, _| 3.0, |_, _| false).is_none());
    }

    #[test]
    fn between_cells_in_proportion_and_beyond_them_as_at_the_edge() {
        let table = fit(|_, _| true);
        let middle = table.curve(2.0, 37.5).at(2.0);
        let corners = [(1.0, 30.0), (1.0, 45.0), (3.0, 30.0), (3.0, 45.0)].map(|(v, a)| truth(2.0, v, a));
        assert!((middle - corners.iter().sum::<f64>() / 4.0).abs() < 0.01, "{middle}");
        assert_eq!(table.curve(99.0, 99.0), table.curve(5.0, 60.0));
        assert_eq!(table.curve(-1.0, 0.0), table.curve(1.0, 30.0));
    }
}
