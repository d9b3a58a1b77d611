//! A first-order filter in the reading that the rig declares: how far the reading lags behind the
//! axis.
//!
//! With ℓ the position less its filtered reading, ℓ′ = v − ℓ/τ. It is a state of its own in
//! addition to position and speed, so every force, linear or not, acts on the axis and only the
//! reading is filtered.

/// The terms of the lag at some time in a block, per unit.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct LagTerms {
    /// The effect of the lag at the block's start.
    pub(crate) lag: f64,
    /// The effect of the speed at the block's start, s, and of an acceleration held over the block,
    /// s².
    pub(crate) speed: f64,
    pub(crate) acceleration: f64,
    /// The effect of the change of position and of speed that an input makes over the block (no
    /// unit and s).
    pub(crate) dq: f64,
    pub(crate) dv: f64,
}

/// The lag over one block.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LagStep {
    /// At the block's end, and the mean over its rows.
    pub(crate) end: LagTerms,
    pub(crate) seen: LagTerms,
    /// Covariance of the lag at the end with position, speed and itself by a white acceleration of
    /// unit strength.
    pub(crate) white: [f64; 3],
}

impl LagStep {
    /// Over a block of `span` s whose rows lie at `rows` s since its start, behind a filter of
    /// `time_constant` s.
    pub(crate) fn new(time_constant: f64, span: f64, rows: impl Iterator<Item = f64>) -> Self {
        let tau = time_constant;
        let end = LagTerms::at(tau, span, span);
        let (mut seen, mut count) = (LagTerms::default(), 0.0_f64);
        for row in rows {
            let at = LagTerms::at(tau, span, row);
            seen = seen.plus(&at, 1.0);
            count += 1.0;
        }
        let seen = LagTerms::default().plus(&seen, 1.0 / count.max(1.0));
        // An impulse u s before the end moves position by u, speed by one and the lag by τ(1 −
        // e^(−u/τ)).
        let (h, e) = (span, end.lag);
        let with_position = 0.5 * tau * h * h - tau * tau * (end.speed - h * e);
        let with_itself = tau * tau * (h - 2.0 * end.speed + 0.5 * end.speed * (1.0 + e));
        Self { end, seen, white: [with_position, end.acceleration, with_itself] }
    }
}

impl LagTerms {
    /// At `time` s since the start of a block of `span` s. An input's speed is taken as 2αt + 3βt²
    /// with the changes that it makes.
    fn at(tau: f64, span: f64, time: f64) -> Self {
        let speed = -tau * (-time / tau).exp_m1();
        let acceleration = tau * (time - speed);
        let square = tau * (time * time - 2.0 * acceleration);
        let h = span;
        Self {
            lag: (-time / tau).exp(),
            speed,
            acceleration,
            dq: 6.0 * (acceleration - square / h) / (h * h),
            dv: (3.0 * square / h - 2.0 * acceleration) / h,
        }
    }

    fn plus(&self, other: &Self, factor: f64) -> Self {
        Self {
            lag: self.lag + factor * other.lag,
            speed: self.speed + factor * other.speed,
            acceleration: self.acceleration + factor * other.acceleration,
            dq: self.dq + factor * other.dq,
            dv: self.dv + factor * other.dv,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lag_is_that_of_a_filter_run_in_small_steps() {
        let (h, steps) = (2.5e-3, 250_000);
        let dt = h / f64::from(steps);
        for tau in [2e-4, 4e-3, 0.2] {
            let run = |mut lag: f64, speed: &dyn Fn(f64) -> f64| {
                for i in 0..steps {
                    lag += dt * (speed((f64::from(i) + 0.5) * dt) - lag / tau);
                }
                lag
            };
            let LagStep { end, white, .. } = LagStep::new(tau, h, std::iter::empty());
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-3 * b.abs(), "{a} {b} at {tau} s");
            near(end.lag, run(1.0, &|_| 0.0));
            near(end.speed, run(0.0, &|_| 1.0));
            near(end.acceleration, run(0.0, &|t| t));
            // An input held over the first half alone: dv and dq are h/2 and 3h²/8.
            let half = |t: f64| t.min(0.5 * h);
            let said = end.dv * 0.5 * h + end.dq * 0.375 * h * h;
            assert!((said / run(0.0, &half) - 1.0).abs() < 0.05, "{said} at {tau} s");
            let to_impulse = |u: f64| tau * (1.0 - (-u / tau).exp());
            let sum = |of: &dyn Fn(f64) -> f64| (0..steps).map(|i| of((f64::from(i) + 0.5) * dt) * dt).sum();
            near(white[0], sum(&|u| u * to_impulse(u)));
            near(white[1], sum(&to_impulse));
            near(white[2], sum(&|u| to_impulse(u).powi(2)));
        }
    }

    #[test]
    fn what_is_seen_is_the_mean_over_the_rows() {
        let (tau, h) = (4e-3, 2e-3);
        let seen = LagStep::new(tau, h, [0.0, 1e-3].into_iter()).seen;
        assert!((seen.lag - 0.5 * (1.0 + (-0.25_f64).exp())).abs() < 1e-12);
        assert!((seen.speed - 0.5 * tau * (1.0 - (-0.25_f64).exp())).abs() < 1e-12);
    }
}
