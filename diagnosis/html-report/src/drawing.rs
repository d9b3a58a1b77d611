//! Parts of every drawing: the ticks of an axis, and curves with gaps.

use std::fmt::Write as _;

/// Most ticks of an axis.
const MOST_TICKS: usize = 20;

/// Returns the distance of ticks: 1, 2 or 5 times a power of ten, not below `wanted`; 1 if that is
/// no distance.
pub(crate) fn round_step(wanted: f64) -> f64 {
    if !(wanted > 0.0 && wanted.is_finite()) {
        return 1.0;
    }
    let power = 10_f64.powf(wanted.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|m| m * power);
    steps.into_iter().find(|s| *s >= 0.999 * wanted).unwrap_or(wanted)
}

/// Returns the multiples of `step` from `low` to `high`; `low` alone if the range is empty.
pub(crate) fn ticks(low: f64, high: f64, step: f64) -> Vec<f64> {
    if low >= high {
        return vec![low];
    }
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).take(MOST_TICKS).map(|k| k as f64 * step).collect()
}

/// Returns the number of decimals that distinguish a multiple of `step` from its neighbours.
pub(crate) fn decimals(step: f64) -> usize {
    (-(step * 1.0001).log10().floor()).clamp(0.0, 9.0) as usize
}

/// Appends the path of a curve: the `d` of SVG. The curve has a gap at every `None`.
pub fn path(out: &mut String, points: impl IntoIterator<Item = Option<(f64, f64)>>) {
    let mut pen = 'M';
    for point in points {
        pen = match point {
            Some((x, y)) => {
                let _ = write!(out, "{pen}{x:.2} {y:.2}");
                'L'
            }
            None => 'M',
        };
    }
}

/// Returns no more points than `columns` show: of each column the first, the least, the greatest
/// and the last. A gap is a point that is not finite.
pub fn thinned(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    if points.len() <= 4 * columns {
        return points.to_vec();
    }
    let mut kept = Vec::new();
    for part in points.chunks(points.len().div_ceil(columns)) {
        let order = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let mut some: Vec<(f64, f64)> = part.first().into_iter().copied().collect();
        some.extend(part.iter().min_by(order));
        some.extend(part.iter().max_by(order));
        some.extend(part.last());
        // In their order in time, so that a curve that turns back still does.
        let place = |p: &(f64, f64)| part.iter().position(|q| q == p).unwrap_or(0);
        some.sort_by_key(place);
        some.dedup();
        kept.extend(some);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_their_range() {
        for (low, high) in [(-0.0137, 0.0141), (0.0, 24.813), (-371.0, 9.0), (1e-9, 4.4e-9), (0.2, 0.21)] {
            let step = round_step((high - low) / 5.0);
            let found = ticks(low, high, step);
            assert!((3..=8).contains(&found.len()), "{found:?}");
            let mantissa = step / 10_f64.powf((step * 1.000_001).log10().floor());
            assert!([1.0, 2.0, 5.0].iter().any(|m| (mantissa - m).abs() < 1e-6), "{step}");
            assert!(found.iter().all(|t| *t >= low - 1e-6 * step && *t <= high + 1e-6 * step));
            let distances = found.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(distances.into_iter().all(|d| (d - step).abs() < 1e-6 * step), "{found:?}");
        }
    }

    #[test]
    fn an_empty_range_has_one_tick() {
        assert_eq!(ticks(3.0, 3.0, round_step(0.0)), [3.0]);
        assert_eq!((round_step(f64::NAN), round_step(f64::INFINITY)), (1.0, 1.0));
    }

    #[test]
    fn decimals_distinguish_neighbours() {
        assert_eq!([50.0, 1.0, 0.5, 0.1, 0.02, 1e-3].map(decimals), [0, 0, 1, 1, 2, 3]);
    }

    #[test]
    fn a_curve_has_a_gap_where_a_point_is_missing() {
        let mut out = String::new();
        path(&mut out, [None, Some((1.0, 2.0)), Some((2.0, 2.5)), None, Some((4.0, 1.0))]);
        assert_eq!(out, "M1.00 2.00L2.00 2.50M4.00 1.00");
    }
}
