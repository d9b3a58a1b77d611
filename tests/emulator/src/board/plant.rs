//! The plant on the device's shaft: it takes the drive and gives the encoder's angle.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Virtual time since the board was switched on, in nanoseconds.
pub type Nanos = u64;

/// The device's outputs to the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drive {
    /// The DAC code, 0 to 4095; mid-scale is zero torque. `None` while the pin is not driven.
    pub code: Option<u16>,
    /// True if the amplifier is enabled.
    pub enabled: bool,
}

/// The mechanical side of the pins.
pub trait PlantSide: Send {
    /// Moves on to `at` under `drive` and answers the encoder's angle in counts (quadruple
    /// evaluation: four to a line), counted from where the board was switched on.
    fn step(&mut self, at: Nanos, drive: Drive) -> i64;
}

impl<F: FnMut(Nanos, Drive) -> i64 + Send> PlantSide for F {
    fn step(&mut self, at: Nanos, drive: Drive) -> i64 {
        self(at, drive)
    }
}

impl fmt::Debug for dyn PlantSide {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a plant")
    }
}

/// A shaft held still.
#[must_use]
pub fn held() -> impl PlantSide {
    |_: Nanos, _: Drive| 0
}

/// A hand strong enough to follow a path whatever the motor does: points of time and angle, joined
/// by straight lines, the last angle held.
#[must_use]
pub fn path(points: Vec<(Nanos, i64)>) -> impl PlantSide {
    move |at: Nanos, _: Drive| {
        let after = points.partition_point(|&(time, _)| time <= at);
        match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
            (Some((from, start)), Some(&(to, end))) => {
                let span = i128::from(to - from);
                let done = i128::from(at - from);
                start + (i128::from(end - start) * done / span) as i64
            }
            (Some((_, angle)), None) => angle,
            (None, _) => points.first().map_or(0, |&(_, angle)| angle),
        }
    }
}

/// The same, with every leg begun and ended as gently as a hand does: half a period of a cosine.
#[must_use]
pub fn eased(points: Vec<(Nanos, i64)>) -> impl PlantSide {
    let mut straight = path(points.clone());
    move |at: Nanos, drive: Drive| {
        let after = points.partition_point(|&(time, _)| time <= at);
        let (Some(&(from, _)), Some(&(to, _))) =
            (after.checked_sub(1).and_then(|before| points.get(before)), points.get(after))
        else {
            return straight.step(at, drive);
        };
        let done = (at - from) as f64 / (to - from) as f64;
        let eased = 0.5 - 0.5 * (std::f64::consts::PI * done).cos();
        straight.step(from + ((to - from) as f64 * eased) as Nanos, drive)
    }
}

/// A living hand: `plant` with a tremor of 10 Hz, two counts to either side.
#[must_use]
pub fn by_hand(mut plant: impl PlantSide) -> impl PlantSide {
    const PERIOD: Nanos = 100_000_000;
    move |at: Nanos, drive: Drive| {
        let eighth = (at % PERIOD * 8 / PERIOD) as usize;
        plant.step(at, drive) + [0, 1, 2, 1, 0, -1, -2, -1][eighth]
    }
}

/// The two tracks of an incremental encoder.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Encoder {
    /// The angle whose levels are on the wires, in counts.
    angle: i64,
    target: i64,
    next_edge: Nanos,
    spacing: Nanos,
}

/// The least time between two edges: a shaft at 4,000,000 counts a second, far beyond a hand and
/// slow enough for the input filters.
pub(super) const LEAST_EDGE_SPACING: Nanos = 250;

impl Encoder {
    pub(super) fn new() -> Self {
        Self { angle: 0, target: 0, next_edge: 0, spacing: LEAST_EDGE_SPACING }
    }

    /// The shaft is to be at `target` when the next step comes, `step` from `now`.
    pub(super) fn aim(&mut self, now: Nanos, target: i64, step: Nanos) {
        self.target = target;
        if let Some(spacing) = step.checked_div(target.abs_diff(self.angle)) {
            self.spacing = spacing.max(LEAST_EDGE_SPACING);
            self.next_edge = now;
        }
    }

    /// Returns the time of the next edge.
    pub(super) fn due(&self) -> Option<Nanos> {
        (self.angle != self.target).then_some(self.next_edge)
    }

    /// Makes the edge that is due and answers the levels of both tracks. Track A leads when the
    /// angle grows.
    pub(super) fn edge(&mut self) -> (bool, bool) {
        self.angle += (self.target - self.angle).signum();
        self.next_edge += self.spacing;
        self.levels()
    }

    /// The levels of both tracks.
    pub(super) fn levels(&self) -> (bool, bool) {
        match self.angle.rem_euclid(4) {
            0 => (false, false),
            1 => (true, false),
            2 => (true, true),
            _ => (false, true),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tracks_walk_the_gray_code_one_edge_at_a_time() {
        let mut encoder = Encoder::new();
        encoder.aim(1_000, 5, 10_000);
        let mut seen = vec![encoder.levels()];
        let mut times = Vec::new();
        while let Some(due) = encoder.due() {
            times.push(due);
            seen.push(encoder.edge());
        }
        assert_eq!(times, [1_000, 3_000, 5_000, 7_000, 9_000]);
        for pair in seen.windows(2) {
            let changed = usize::from(pair[0].0 != pair[1].0) + usize::from(pair[0].1 != pair[1].1);
            assert_eq!(changed, 1, "{pair:?}");
        }
    }

    #[test]
    fn an_eased_path_meets_its_points_and_leaves_them_slowly() {
        let mut path = eased(vec![(1_000, 0), (2_000, 1_000)]);
        let drive = Drive { code: None, enabled: false };
        let angles: Vec<i64> = [0, 1_000, 1_100, 1_500, 2_000, 9_000].map(|at| path.step(at, drive)).to_vec();
        assert_eq!((angles[0], angles[1], angles[4], angles[5]), (0, 0, 1_000, 1_000));
        assert!((20..30).contains(&angles[2]) && (495..=500).contains(&angles[3]), "{angles:?}");
    }

    #[test]
    fn a_path_goes_straight_between_its_points_and_then_holds() {
        let mut path = path(vec![(1_000, 10), (2_000, -10)]);
        let drive = Drive { code: None, enabled: false };
        let angles: Vec<i64> = [0, 1_000, 1_500, 2_000, 9_000].map(|at| path.step(at, drive)).to_vec();
        assert_eq!(angles, [10, 10, 0, -10, -10]);
    }
}
