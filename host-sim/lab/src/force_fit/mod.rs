//! From insertions at several speeds and angles to the force table of Paper 000, and how good it is
//! on insertions that it has not seen.
//!
//! [`insertions`] reads recordings, [`mod@falls`], [`curve`] and [`table`] are the numerics,
//! [`page`] shows measured against fitted. It may not run a device, and it takes a force as it was
//! measured, whoever measured it. What is judged is the table that is written.

pub mod curve;
pub mod falls;
pub mod insertions;
pub mod page;
pub mod table;
pub mod writer;

use control_core::config::MAX_LAYERS;
use curve::{Landmarks, Overlaid};
use falls::{Fall, falls};
use insertions::Insertion;
use table::{ForceGrid, Measured};

/// Speeds that differ by less than this share are one speed of the design.
const SAME_SPEED: f64 = 0.2;
/// Angles that differ by less than this are one angle of the design, °.
const SAME_ANGLE_DEG: f64 = 4.0;

/// The quality of the fit of an insertion.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Which insertion.
    pub name: String,
    /// Its speed and angle, mm/s and °.
    pub speed_mm_s: f64,
    /// As above.
    pub angle_deg: f64,
    /// Root mean square of the measured force, N.
    pub size_n: f64,
    /// Root mean square of measured less fitted, where the table has not seen this insertion, N.
    pub unseen_n: f64,
    /// The same with a table that has seen it; none for one that was given to judge by.
    pub seen_n: Option<f64>,
    /// True if the table had another insertion at this speed and angle.
    pub has_neighbours: bool,
    /// The force at which each layer gives way: measured and in the table, N.
    pub peaks_n: Vec<(f64, f64)>,
}

impl Judgement {
    /// The largest share by which a peak is missed; none where no layer gives way.
    pub fn worst_peak(&self) -> Option<f64> {
        self.peaks_n.iter().map(|(measured, table)| (table / measured - 1.0).abs()).max_by(f64::total_cmp)
    }
}

/// The largest share by which a peak of any of them is missed.
pub fn worst_peak(judged: &[Judgement]) -> Option<f64> {
    judged.iter().filter_map(Judgement::worst_peak).max_by(f64::total_cmp)
}

/// A fitted table and what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The table.
    pub table: ForceGrid,
    /// The insertions that it was fitted to.
    pub insertions: Vec<Insertion>,
    /// The insertions that it was judged by: those given for it, or each of the others in its turn,
    /// left out.
    pub judged: Vec<Judgement>,
}

/// Fits the table to `insertions`. It is judged by `unseen`, or, if that is empty, by each
/// insertion in turn, left out of the fit. Returns `None` if there is nothing to fit.
pub fn fit(insertions: Vec<Insertion>, unseen: &[Insertion]) -> Option<Fit> {
    let table = fit_table(&insertions)?;
    let judged = if unseen.is_empty() {
        let each = 0..insertions.len();
        each.filter_map(|out| {
            let mut rest = insertions.clone();
            let left_out = rest.remove(out);
            let without = fit_table(&rest)?;
            let seen_n = Some(rms(&table, &left_out));
            Some(judge(&without, &rest, &left_out, seen_n))
        })
        .collect()
    } else {
        unseen.iter().map(|one| judge(&table, &insertions, one, None)).collect()
    };
    Some(Fit { table, insertions, judged })
}

fn judge(table: &ForceGrid, seen: &[Insertion], one: &Insertion, seen_n: Option<f64>) -> Judgement {
    let mean_square = one.points.iter().map(|p| p.1 * p.1).sum::<f64>() / one.points.len().max(1) as f64;
    let beside = |other: &Insertion| {
        (other.speed_mm_s / one.speed_mm_s - 1.0).abs() < SAME_SPEED
            && (other.angle_deg - one.angle_deg).abs() < SAME_ANGLE_DEG
    };
    let found = falls(&one.points);
    // Where a layer was seen that the table does not have, or the other way, peaks cannot be
    // distinguished.
    let curve = table.curve(one.speed_mm_s, one.angle_deg);
    let is_same = found.len() == table.gives_way.len();
    let peaks = table.gives_way.iter().map(|knot| curve.forces_n[*knot]);
    let peaks_n =
        if is_same { found.iter().map(|fall| fall.peak_n).zip(peaks).collect() } else { Vec::new() };
    Judgement {
        name: one.name.clone(),
        speed_mm_s: one.speed_mm_s,
        angle_deg: one.angle_deg,
        size_n: mean_square.sqrt(),
        unseen_n: rms(table, one),
        seen_n,
        has_neighbours: seen.iter().any(beside),
        peaks_n,
    }
}

/// Root mean square of measured less fitted, N.
fn rms(table: &ForceGrid, one: &Insertion) -> f64 {
    let curve = table.curve(one.speed_mm_s, one.angle_deg);
    let squares = one.points.iter().map(|(depth, force)| (force - curve.at(*depth)).powi(2));
    (squares.sum::<f64>() / one.points.len().max(1) as f64).sqrt()
}

fn fit_table(insertions: &[Insertion]) -> Option<ForceGrid> {
    let speeds = groups(insertions.iter().map(|i| i.speed_mm_s), |mean, v| v < mean * (1.0 + SAME_SPEED));
    let angles = groups(insertions.iter().map(|i| i.angle_deg), |mean, a| a < mean + SAME_ANGLE_DEG);
    let deepest = insertions.iter().flat_map(|i| i.points.iter().map(|p| p.0)).fold(0.0, f64::max);
    if deepest <= 0.0 {
        return None;
    }
    let found = same_falls(insertions);
    let cell_of = |one: &Insertion| (nearest(&speeds, one.speed_mm_s), nearest(&angles, one.angle_deg));
    let cell = |s: usize, a: usize| {
        let there: Vec<usize> =
            (0..insertions.len()).filter(|index| cell_of(&insertions[*index]) == (s, a)).collect();
        let marks = |falls: &[Fall]| landmarks(falls, deepest);
        // An insertion in which a layer was not seen to give way is laid over the others as they
        // do.
        let usual = mean_falls(there.iter().filter_map(|index| found[*index].as_deref()))
            .or_else(|| mean_falls(found.iter().flatten().map(Vec::as_slice)))?;
        let mut points = Overlaid::new(marks(&usual).pieces());
        for &index in &there {
            points.add(&marks(found[index].as_deref().unwrap_or(&usual)), &insertions[index].points);
        }
        (!there.is_empty()).then(|| Measured { marks: marks(&usual), points })
    };
    let cells: Vec<Vec<_>> =
        (0..speeds.len()).map(|s| (0..angles.len()).map(|a| cell(s, a)).collect()).collect();
    ForceGrid::fit(speeds, angles, &cells)
}

/// As many falls for each insertion as most of them have, the largest ones; none for one that has
/// fewer.
fn same_falls(insertions: &[Insertion]) -> Vec<Option<Vec<Fall>>> {
    let all: Vec<Vec<Fall>> = insertions.iter().map(|one| falls(&one.points)).collect();
    let mut counts: Vec<usize> = all.iter().map(Vec::len).collect();
    counts.sort_unstable();
    let usual = counts.get(counts.len() / 2).copied().unwrap_or(0).min(MAX_LAYERS);
    let largest = |mut falls: Vec<Fall>| {
        falls.sort_by(|a, b| b.drop_n.total_cmp(&a.drop_n));
        falls.truncate(usual);
        falls.sort_by(|a, b| a.peak_mm.total_cmp(&b.peak_mm));
        (falls.len() == usual).then_some(falls)
    };
    all.into_iter().map(largest).collect()
}

/// The means of falls that belong together; none where there is no insertion.
fn mean_falls<'a>(all: impl Iterator<Item = &'a [Fall]>) -> Option<Vec<Fall>> {
    let all: Vec<&[Fall]> = all.collect();
    let first = all.first()?;
    let mean = |index: usize, of: fn(&Fall) -> f64| {
        all.iter().map(|falls| of(&falls[index])).sum::<f64>() / all.len() as f64
    };
    let falls = (0..first.len()).map(|index| Fall {
        peak_mm: mean(index, |fall| fall.peak_mm),
        end_mm: mean(index, |fall| fall.end_mm),
        peak_n: mean(index, |fall| fall.peak_n),
        drop_n: mean(index, |fall| fall.drop_n),
    });
    Some(falls.collect())
}

/// The skin, the beginning and the end of each fall, the deepest place.
fn landmarks(falls: &[Fall], deepest_mm: f64) -> Landmarks {
    let mut marks = vec![0.0];
    marks.extend(falls.iter().flat_map(|fall| [fall.peak_mm, fall.end_mm]));
    // At least a little beyond the last fall, and beyond the deepest point, so that it counts.
    let last = marks.last().copied().unwrap_or(0.0);
    marks.push(deepest_mm.max(last + 0.2) + 1e-6);
    Landmarks(marks)
}

/// Means of groups of values that lie together, rising.
fn groups(values: impl Iterator<Item = f64>, is_together: impl Fn(f64, f64) -> bool) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let mut groups: Vec<(f64, f64)> = Vec::new();
    for value in sorted {
        match groups.last_mut() {
            Some((sum, count)) if is_together(*sum / *count, value) => {
                *sum += value;
                *count += 1.0;
            }
            _ => groups.push((value, 1.0)),
        }
    }
    groups.into_iter().map(|(sum, count)| sum / count).collect()
}

fn nearest(grid: &[f64], value: f64) -> usize {
    let far = |index: &usize| (grid[*index] - value).abs();
    (0..grid.len()).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use table::Origin;

    fn truth(depth: f64, speed: f64, angle: f64) -> f64 {
        let base = if depth < 2.5 { depth * depth / 7.0 } else { 0.4 + 0.05 * (depth - 2.5) };
        base * (1.0 + 0.1 * speed) * (0.6 + angle / 120.0)
    }

    /// Measured with noise of 10 mN rms, at a speed and an angle that are a little off; the same
    /// every time.
    fn insertion(speed: f64, angle: f64, take: u32) -> Insertion {
        let points = (0..1_600_u32).map(|n| {
            let depth = f64::from(n) * 0.005;
            let noise = ((f64::from(n + 7_919 * take) * 12.9898).sin() * 43_758.547).fract() * 0.0173;
            (depth, truth(depth, speed, angle) + noise)
        });
        let off = 1.0 + 0.01 * f64::from(take);
        let name = format!("{speed} mm/s, {angle}°, take {take}");
        Insertion { name, speed_mm_s: speed * off, angle_deg: angle * off, points: points.collect() }
    }

    /// The five cells of Paper 000, Fig. 2, each `takes` times.
    fn five_cells(takes: u32) -> Vec<Insertion> {
        let cells = [(1.0, 60.0), (3.0, 60.0), (5.0, 60.0), (5.0, 30.0), (5.0, 45.0)];
        cells.iter().flat_map(|(v, a)| (0..takes).map(move |take| insertion(*v, *a, take))).collect()
    }

    #[test]
    fn held_out_takes_are_predicted_down_to_their_noise() {
        let fit = fit(five_cells(3), &[]).expect("there is something to fit");
        assert_eq!((fit.table.speeds_mm_s.len(), fit.table.angles_deg.len()), (3, 3));
        assert_eq!(fit.judged.len(), 15);
        for one in &fit.judged {
            // 10 mN of noise, and the fall of up to 0.7 N that is drawn over a step of the knots.
            assert!(one.has_neighbours && one.unseen_n < 0.06, "{}: {} N", one.name, one.unseen_n);
            let seen_n = one.seen_n.expect("it was seen");
            assert!(seen_n <= one.unseen_n + 1e-3 && one.unseen_n < seen_n + 0.005, "{one:?}");
        }
        let missing: Vec<_> = fit.table.not_measured().map(|m| m.2).collect();
        assert_eq!(missing, [Origin::Separable; 4]);
    }

    #[test]
    fn insertions_in_unmeasured_cells_judge_the_interpolation() {
        let unseen = [insertion(1.0, 30.0, 0), insertion(3.0, 45.0, 0)];
        let fit = fit(five_cells(1), &unseen).expect("there is something to fit");
        assert_eq!(fit.judged.len(), 2);
        for one in &fit.judged {
            // 0.4 to 0.6 N in size, and separable in truth.
            assert!(!one.has_neighbours && one.seen_n.is_none() && one.unseen_n < 0.06, "{one:?}");
        }
        // A truth that is not: the same filling is far off, and says so.
        let mut odd = insertion(1.0, 30.0, 0);
        odd.points.iter_mut().for_each(|p| p.1 *= 2.0);
        let judged = super::fit(five_cells(1), &[odd]).expect("fits").judged;
        assert!(judged[0].unseen_n > 0.1, "{:?}", judged[0]);
    }

    #[test]
    fn values_that_are_close_together_are_one() {
        let values = [5.1, 1.0, 4.9, 3.05, 0.98, 2.95];
        let speeds = groups(values.into_iter(), |mean, v| v < mean * (1.0 + SAME_SPEED));
        assert!(speeds.iter().zip([0.99, 3.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-9) && speeds.len() == 3);
        assert_eq!(fit(Vec::new(), &[]), None);
    }
}
