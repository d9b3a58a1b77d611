//! A line of straight pieces through many noisy points: local regression at even knots. Numbers only, no units.

/// A line of straight pieces over even knots.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Place of the first knot.
    pub first: f64,
    /// From knot to knot; above 0.
    pub step: f64,
    /// At the knots.
    pub values: Vec<f64>,
    /// How many points speak for each knot; 0 is a guess from its neighbours.
    pub support: Vec<f64>,
}

impl Curve {
    /// The value at `x`; beyond the ends it stays what it is there.
    pub fn at(&self, x: f64) -> f64 {
        let last = self.values.len().saturating_sub(1);
        let place = ((x - self.first) / self.step).clamp(0.0, last as f64);
        let left = (place as usize).min(last.saturating_sub(1));
        let share = place - left as f64;
        match (self.values.get(left), self.values.get(left + 1)) {
            (Some(a), Some(b)) => a + share * (b - a),
            (Some(a), None) => *a,
            _ => 0.0,
        }
    }

    /// Place of the last knot.
    pub fn end(&self) -> f64 {
        self.first + self.values.len().saturating_sub(1) as f64 * self.step
    }

    /// At each knot the value of the straight line that fits the points within a step of it best, nearer ones counting more (local linear
    /// regression with a triangular kernel, Fan and Gijbels 1996): a fall touches no knot but the nearest, where least squares over all knots
    /// at once would ring. Knots that no point is near lie on a straight line between their neighbours, at the ends level with them.
    /// Points outside the knots are left out. None where no point lies within, or where there are fewer than two knots.
    pub fn fit(points: &[(f64, f64)], first: f64, step: f64, knots: usize) -> Option<Self> {
        if knots < 2 || step.is_nan() || step <= 0.0 {
            return None;
        }
        let mut local = vec![Local::default(); knots];
        let end = (knots - 1) as f64;
        for (x, y) in points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()) {
            let place = (x - first) / step;
            if !(0.0..=end).contains(&place) {
                continue;
            }
            let left = (place as usize).min(knots - 2);
            let share = place - left as f64;
            local[left].take(1.0 - share, share, *y);
            local[left + 1].take(share, share - 1.0, *y);
        }
        let values: Vec<Option<f64>> = local.iter().map(Local::value).collect();
        let support = local.iter().map(|l| l.weight).collect();
        Some(Self { first, step, values: filled(&values)?, support })
    }
}

/// Sums for the straight line through the points near a knot; places are in steps from it.
#[derive(Clone, Copy, Debug, Default)]
struct Local {
    weight: f64,
    place: f64,
    square: f64,
    value: f64,
    product: f64,
}

impl Local {
    fn take(&mut self, weight: f64, place: f64, value: f64) {
        self.weight += weight;
        self.place += weight * place;
        self.square += weight * place * place;
        self.value += weight * value;
        self.product += weight * place * value;
    }

    /// At the knot itself; the mean where the points lie too close together for a slope.
    fn value(&self) -> Option<f64> {
        if self.weight <= 1e-9 {
            return None;
        }
        let spread = self.weight * self.square - self.place * self.place;
        if spread > 1e-3 * self.weight * self.weight {
            Some((self.square * self.value - self.place * self.product) / spread)
        } else {
            Some(self.value / self.weight)
        }
    }
}

/// What is missing between two neighbours lies on a straight line, at an end level; none where all is missing.
fn filled(values: &[Option<f64>]) -> Option<Vec<f64>> {
    let known = |i: usize| Some((i, values[i]?));
    let fill = |index: usize| {
        let before = (0..=index).rev().find_map(known);
        let after = (index..values.len()).find_map(known);
        match (before, after) {
            (Some((i, a)), Some((j, b))) if j > i => Some(a + (b - a) * (index - i) as f64 / (j - i) as f64),
            (Some((_, a)), _) => Some(a),
            (None, after) => after.map(|(_, b)| b),
        }
    };
    (0..values.len()).map(fill).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of known size that is the same every time.
    fn noise(n: usize) -> f64 {
        ((n as f64 * 12.9898).sin() * 43_758.547).rem_euclid(1.0) - 0.5
    }

    #[test]
    fn a_known_line_is_found_within_its_noise() {
        // Rises as a parabola to a puncture at 4, falls, rises again: pieces of 0.25 draw all of it but the fall.
        let truth = |x: f64| if x < 4.0 { x * x / 9.0 } else { 0.6 + 0.05 * (x - 4.0) };
        let points: Vec<_> = (0..8_000)
            .map(|n| {
                let x = n as f64 * 1e-3;
                (x, truth(x) + 0.2 * noise(n))
            })
            .collect();
        let curve = Curve::fit(&points, 0.0, 0.25, 33).expect("there are points");
        for n in 0..320 {
            let x = f64::from(n) * 0.025;
            if (x - 4.0).abs() > 0.26 {
                assert!((curve.at(x) - truth(x)).abs() < 0.02, "{} at {x}, not {}", curve.at(x), truth(x));
            }
        }
    }

    #[test]
    fn straight_pieces_are_found_exactly_and_gaps_are_bridged() {
        let truth = |x: f64| 2.0 - 0.5 * x;
        let points: Vec<_> =
            (0..400).map(|n| f64::from(n) * 0.01).filter(|x| !(1.2..2.4).contains(x)).collect();
        let points: Vec<_> = points.into_iter().map(|x| (x, truth(x))).collect();
        let curve = Curve::fit(&points, 0.0, 0.25, 33).expect("there are points");
        for x in [0.0, 0.9, 1.3, 1.8, 2.2, 3.0, 3.9] {
            assert!((curve.at(x) - truth(x)).abs() < 1e-6, "{} at {x}", curve.at(x));
        }
        assert!(curve.support[2] > 20.0 && curve.support[7] == 0.0, "{:?}", curve.support);
        assert_eq!(curve.at(-3.0), curve.at(0.0), "it stays what it is at its end");
        assert_eq!(curve.at(99.0), curve.at(4.0), "and beyond the points");
    }

    #[test]
    fn nothing_to_fit_is_none() {
        assert_eq!(Curve::fit(&[], 0.0, 1.0, 5), None);
        assert_eq!(Curve::fit(&[(99.0, 1.0), (f64::NAN, 1.0)], 0.0, 1.0, 5), None);
        assert_eq!(Curve::fit(&[(0.0, 1.0)], 0.0, 1.0, 1), None);
        let alone = Curve::fit(&[(1.0, 3.0)], 0.0, 1.0, 5).expect("one point is a level");
        assert!((alone.at(1.0) - 3.0).abs() < 1e-3, "{alone:?}");
    }
}
