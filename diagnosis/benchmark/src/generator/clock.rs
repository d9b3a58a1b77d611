//! The recorder's clock: when rows are taken, and which times are written down for them.

use crate::rng::Rng;

/// The regularity of the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    Even,
    /// Uniform jitter of ± this share of the interval.
    Jitter(f64),
    /// As a host's clock: normal jitter of this share, and rows missing now and then.
    Host(f64),
}

/// The way in which the time of a row is written down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stamping {
    True,
    /// Off by chance with this standard deviation, s.
    Noisy(f64),
    /// In whole steps of so many s.
    Rounded(f64),
    /// A clock that is fast by so much.
    Fast(f64),
}

impl Clock {
    /// Draws the clock of a recorder of `rate` rows a second.
    pub(crate) fn draw(rng: &mut Rng, rate: f64) -> Self {
        match rng.below(4) {
            0 | 1 => Self::Even,
            2 => Self::Jitter(rng.range(0.02, 0.15)),
            _ if rate <= 2000.0 => Self::Host(rng.range(0.02, 0.08)),
            _ => Self::Jitter(rng.range(0.02, 0.1)),
        }
    }

    /// Draws the stamps of `rate` rows a second over `duration` s, in s, each a whole number of
    /// microseconds.
    pub(crate) fn stamps(self, rate: f64, duration: f64, rng: &mut Rng) -> Vec<f64> {
        let interval = 1.0 / rate;
        let count = (duration * rate) as usize;
        let mut times: Vec<f64> = Vec::with_capacity(count);
        for i in 0..count {
            let jitter = match self {
                Self::Even => 0.0,
                Self::Jitter(share) => share * rng.range(-1.0, 1.0),
                Self::Host(share) => share * rng.bounded_normal(4.0),
            };
            if matches!(self, Self::Host(_)) && rng.chance(2e-4) {
                continue;
            }
            let t = (((i as f64 + 0.5 + jitter) * interval) * 1e6).round() * 1e-6;
            if times.last().is_none_or(|&last| t > last + 1.5e-6) {
                times.push(t);
            }
        }
        times
    }
}

impl Stamping {
    /// Draws a stamping that is never so far off that the place read at top speed is more than a
    /// count or so wrong; `count_time` is the time of a count at that speed, in s.
    pub(crate) fn draw(rng: &mut Rng, rate: f64, count_time: f64) -> Self {
        match rng.below(10) {
            0 | 1 => Self::Noisy((rng.log_range(0.005, 0.1) / rate).min(count_time)),
            2 => Self::Rounded((rng.log_range(0.02, 0.2) / rate).min(2.0 * count_time).max(2e-6)),
            3 => Self::Fast(rng.sign() * rng.log_range(1e-5, 2e-4)),
            _ => Self::True,
        }
    }

    /// True if it errs independently at every row.
    pub(crate) fn by_chance(self) -> bool {
        matches!(self, Self::Noisy(_) | Self::Rounded(_))
    }

    /// Returns the times in the file, in whole microseconds, increasing.
    pub(crate) fn of(self, times: &[f64], rng: &mut Rng) -> Vec<f64> {
        let mut last = f64::NEG_INFINITY;
        times
            .iter()
            .map(|&t| {
                let written = match self {
                    Self::True => t,
                    Self::Noisy(sd) => t + sd * rng.bounded_normal(3.0),
                    Self::Rounded(step) => (t / step).round() * step,
                    Self::Fast(by) => t * (1.0 + by),
                };
                last = ((written * 1e6).round() * 1e-6).max(last + 1e-6);
                last
            })
            .collect()
    }
}
