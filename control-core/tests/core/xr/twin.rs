//! Paper 000's table in floating point: the tip between counts, and force between knots.

use control_core::config::ForceTable;

/// The way between counts and the steady speed, in floating point.
pub(super) struct Way {
    count_mm: f64,
    depth: f64,
    part: f64,
    steady: f64,
}

impl Way {
    pub(super) fn new(count_mm: f64) -> Self {
        Self { count_mm, depth: 0.0, part: 0.0, steady: 0.0 }
    }

    pub(super) fn tick(&mut self, depth: f64, speed: f64) -> (f64, f64) {
        self.steady += (speed - self.steady) / 512.0;
        self.part = if depth == self.depth {
            (self.part + self.steady * 1e-4).clamp(0.0, self.count_mm)
        } else if depth > self.depth {
            0.0
        } else {
            self.count_mm
        };
        self.depth = depth;
        (depth + self.part - self.count_mm / 2.0, self.steady)
    }
}

/// Depth and force of each knot between the cells, then force between the knots.
pub(super) fn force(table: &ForceTable, depth: f64, speed: f64, mrad: f64) -> f64 {
    let place = |knots: &[f64], at: f64| {
        let index = knots.iter().rposition(|knot| *knot <= at).unwrap_or(0);
        let next = (index + 1).min(knots.len() - 1);
        let gap = knots[next] - knots[index];
        let share = if gap > 0.0 { ((at - knots[index]) / gap).clamp(0.0, 1.0) } else { 0.0 };
        [(index, 1.0 - share), (next, share)]
    };
    let speeds: Vec<f64> = table.speeds.iter().map(|k| k.0.to_num()).collect();
    let angles: Vec<f64> = table.angles.iter().map(|k| f64::from(k.0)).collect();
    let (per_speed, cells) = (angles.len(), speeds.len() * angles.len());
    let (s, a) = (place(&speeds, speed), place(&angles, mrad));
    let mix = |value: &dyn Fn(usize) -> f64| {
        let corners =
            s.iter().flat_map(|(si, sw)| a.iter().map(move |(ai, aw)| (si * per_speed + ai, sw * aw)));
        corners.map(|(cell, weight)| weight * value(cell)).sum::<f64>()
    };
    let knots = table.forces.len() / cells;
    let depth_of = |knot: usize, cell: usize| {
        f64::from(if table.depths.len() == knots {
            table.depths[knot]
        } else {
            table.depths[knot * cells + cell]
        })
    };
    let depths: Vec<f64> = (0..knots).map(|k| mix(&|cell| depth_of(k, cell)) * 0.01).collect();
    let force = |knot: usize| mix(&|cell| f64::from(table.forces[knot * cells + cell]) * 1e-3);
    place(&depths, depth).iter().map(|(knot, weight)| weight * force(*knot)).sum()
}
