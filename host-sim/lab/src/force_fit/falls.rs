//! The places where the force of an insertion falls because a layer gives way: the landmarks that
//! insertions have in common. Numbers only: depth in mm, force in N.

/// Points are taken together over this depth to look for falls.
const BIN_MM: f64 = 0.05;
/// A fall is one by this share of its peak, or of the largest force by [`LEAST_OF_LARGEST`], or by
/// [`LEAST_SIGMAS`] of the noise of a bin.
const LEAST_OF_PEAK: f64 = 0.15;
const LEAST_OF_LARGEST: f64 = 0.04;
const LEAST_SIGMAS: f64 = 6.0;
/// A fall has ended when no more than this share of it is left.
const LEFT: f64 = 0.07;
/// Over this depth a straight line follows the rise to a peak.
const RISE_MM: f64 = 0.3;
/// So many points in a row below the rise are the fall; fewer are noise.
const IN_A_ROW: usize = 3;

/// A force that falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fall {
    /// Depth at which it begins.
    pub peak_mm: f64,
    /// Depth at which it has ended.
    pub end_mm: f64,
    /// The force at its beginning, from a straight line through the rise before it.
    pub peak_n: f64,
    /// The fall of the force.
    pub drop_n: f64,
}

/// The falls of points that lie in the order of their depth, shallowest first.
pub fn falls(points: &[(f64, f64)]) -> Vec<Fall> {
    let bins = bins(points);
    let largest = bins.iter().fold(0.0, |most, bin| bin.1.max(most));
    let least = (LEAST_OF_LARGEST * largest).max(LEAST_SIGMAS * noise(&bins));
    turns(&bins, least)
        .into_iter()
        .filter(|(peak, valley)| bins[*peak].1 - bins[*valley].1 > LEAST_OF_PEAK * bins[*peak].1)
        .map(|(peak, valley)| fall(points, &bins, peak, valley))
        .collect()
}

/// Means of depth and force, one for each [`BIN_MM`] that has points.
fn bins(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut bins: Vec<(f64, f64)> = Vec::new();
    let (mut of, mut sum, mut count) = (i64::MIN, (0.0, 0.0), 0.0);
    for &(depth, force) in points {
        let bin = (depth / BIN_MM).floor() as i64;
        if bin > of && count > 0.0 {
            bins.push((sum.0 / count, sum.1 / count));
            (sum, count) = ((0.0, 0.0), 0.0);
        }
        of = bin.max(of);
        sum = (sum.0 + depth, sum.1 + force);
        count += 1.0;
    }
    if count > 0.0 {
        bins.push((sum.0 / count, sum.1 / count));
    }
    bins
}

/// Standard deviation of the noise of a bin: second differences of a smooth curve have nothing else
/// in them.
fn noise(bins: &[(f64, f64)]) -> f64 {
    let mut bends: Vec<f64> = bins.windows(3).map(|w| (w[0].1 - 2.0 * w[1].1 + w[2].1).abs()).collect();
    bends.sort_by(f64::total_cmp);
    // Of a normal distribution the median of the magnitude is 0.6745 of sigma; a second difference
    // has six times the variance.
    bends.get(bends.len() / 2).map_or(0.0, |median| median / 0.6745 / 6.0_f64.sqrt())
}

/// Peaks and the valleys after them, by their bins, where the force turns by more than `least`.
fn turns(bins: &[(f64, f64)], least: f64) -> Vec<(usize, usize)> {
    let (mut found, mut peak, mut valley, mut rises) = (Vec::new(), 0, 0, true);
    for (index, bin) in bins.iter().enumerate() {
        if rises {
            if bin.1 > bins[peak].1 {
                peak = index;
            } else if bin.1 < bins[peak].1 - least {
                (rises, valley) = (false, index);
            }
        } else if bin.1 < bins[valley].1 {
            valley = index;
        } else if bin.1 > bins[valley].1 + least {
            found.push((peak, valley));
            (rises, peak) = (true, index);
        }
    }
    if !rises {
        found.push((peak, valley));
    }
    found
}

fn fall(points: &[(f64, f64)], bins: &[(f64, f64)], peak: usize, valley: usize) -> Fall {
    let (top, bottom) = (bins[peak].1, bins[valley].1);
    let around = bins[peak].0;
    let before: Vec<(f64, f64)> = points
        .iter()
        .copied()
        .filter(|(depth, _)| (around - RISE_MM..=around - BIN_MM / 2.0).contains(depth))
        .collect();
    let line = Line::through(&before);
    // The last point that still follows the rise.
    let (mut last, mut below) = (around - BIN_MM / 2.0, 0);
    for &(depth, force) in points.iter().filter(|(depth, _)| *depth > around - BIN_MM / 2.0) {
        if depth > bins[valley].0 || below == IN_A_ROW {
            break;
        }
        let is_below = force < line.at(depth) - (4.0 * line.scatter).max(0.05 * (top - bottom));
        below = if is_below { below + 1 } else { 0 };
        if !is_below {
            last = depth;
        }
    }
    let ended = bottom + LEFT * (top - bottom);
    let end = bins[peak..=valley].iter().find(|bin| bin.0 > last && bin.1 <= ended);
    Fall {
        peak_mm: last,
        end_mm: end.map_or(bins[valley].0, |bin| bin.0).max(last + BIN_MM),
        peak_n: line.at(last),
        drop_n: top - bottom,
    }
}

/// A straight line through points, and what they scatter about it.
struct Line {
    middle: (f64, f64),
    slope: f64,
    scatter: f64,
}

impl Line {
    fn through(points: &[(f64, f64)]) -> Self {
        let n = points.len().max(1) as f64;
        let middle =
            (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let spread: f64 = points.iter().map(|p| (p.0 - middle.0).powi(2)).sum();
        let together: f64 = points.iter().map(|p| (p.0 - middle.0) * (p.1 - middle.1)).sum();
        let mut line =
            Self { middle, slope: if spread > 0.0 { together / spread } else { 0.0 }, scatter: 0.0 };
        line.scatter = (points.iter().map(|p| (p.1 - line.at(p.0)).powi(2)).sum::<f64>() / n).sqrt();
        line
    }

    fn at(&self, depth: f64) -> f64 {
        self.middle.1 + self.slope * (depth - self.middle.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of known size that is the same every time, uniform, of standard deviation 1.
    fn noise_of(n: usize) -> f64 {
        (((n as f64 * 12.9898).sin() * 43_758.547).rem_euclid(1.0) - 0.5) * 12.0_f64.sqrt()
    }

    fn measured(truth: impl Fn(f64) -> f64, sigma: f64) -> Vec<(f64, f64)> {
        (0..2_000).map(|n| (n as f64 * 0.005, truth(n as f64 * 0.005) + sigma * noise_of(n))).collect()
    }

    #[test]
    fn two_sharp_falls_are_found_where_they_are() {
        let truth = |d: f64| match d {
            d if d < 2.4 => 0.6 * (d / 2.4).powi(2),
            d if d < 4.0 => 0.3,
            d if d < 5.0 => 0.3 + 0.5 * (d - 4.0),
            d => 0.35 + 0.03 * (d - 5.0),
        };
        for sigma in [0.0, 0.005, 0.015] {
            let found = falls(&measured(truth, sigma));
            assert_eq!(found.len(), 2, "{sigma} N: {found:?}");
            for (fall, (at, n)) in found.iter().zip([(2.4, 0.6), (5.0, 0.8)]) {
                assert!((fall.peak_mm - at).abs() < 0.04, "{sigma} N: {fall:?}");
                assert!((fall.peak_n / n - 1.0).abs() < 0.03, "{sigma} N: {fall:?}");
                assert!(fall.end_mm - fall.peak_mm < 0.15, "{sigma} N: {fall:?}");
            }
        }
    }

    #[test]
    fn noise_and_a_steady_rise_are_no_fall() {
        assert_eq!(falls(&measured(|d| 0.1 * d, 0.02)), []);
        assert_eq!(falls(&measured(|_| 0.0, 0.0)), []);
        assert_eq!(falls(&[]), []);
    }

    #[test]
    fn a_slow_fall_ends_where_it_ends() {
        let truth = |d: f64| if d < 3.0 { 0.3 * d } else { (0.9 - 0.5 * (d - 3.0)).max(0.4) };
        let found = falls(&measured(truth, 0.004));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].end_mm - 4.0).abs() < 0.15 && (found[0].peak_mm - 3.0).abs() < 0.1, "{found:?}");
    }
}
