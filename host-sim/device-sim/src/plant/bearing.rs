//! Friction of a bearing: viscous, dry, and a breakaway that is higher than the dry friction of
//! motion.

/// Friction coefficients of a bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// N·m·s/rad.
    pub viscous: f64,
    /// Dry friction while it turns, N·m.
    pub coulomb: f64,
    /// Torque that it takes to begin to turn, N·m; at least `coulomb`.
    pub breakaway: f64,
}

/// A bearing under an inertia, in steps of a fixed length: every division done.
#[derive(Clone, Copy, Debug)]
pub struct BearingStep {
    /// Change of speed for a torque, rad/s for N·m.
    per_torque: f64,
    /// Share of its speed that viscous friction leaves.
    keep: f64,
    /// Speed that dry friction takes while it turns.
    dry: f64,
    /// Speed below which it does not break away.
    breakaway: f64,
}

impl Bearing {
    /// Steps of `dt` s under `inertia` kg·m².
    pub fn steps(&self, inertia: f64, dt: f64) -> BearingStep {
        let per_torque = dt / inertia;
        BearingStep {
            per_torque,
            keep: 1.0 / (1.0 + self.viscous * per_torque),
            dry: self.coulomb * per_torque,
            breakaway: self.breakaway * per_torque,
        }
    }
}

impl BearingStep {
    /// The speed after a step under `torque` N·m.
    ///
    /// Dry friction is an impulse that can stop the bearing and never turn it round (time stepping
    /// after Moreau): it sticks at exactly zero, takes energy only, and does not chatter whatever
    /// the step.
    #[inline]
    pub fn step(&self, speed: f64, torque: f64) -> f64 {
        // Viscous friction implicitly: stable for any coefficient.
        let free = (speed + torque * self.per_torque) * self.keep;
        let stop = if speed == 0.0 { self.breakaway } else { self.dry };
        if free.abs() <= stop { 0.0 } else { free - self.dry.copysign(free) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEARING: Bearing = Bearing { viscous: 1.2e-6, coulomb: 4.0e-4, breakaway: 4.8e-4 };
    const INERTIA: f64 = 2.4e-6;
    const DT: f64 = 1e-5;

    #[test]
    fn sticks_below_breakaway_and_reaches_its_terminal_speed_above() {
        let bearing = BEARING.steps(INERTIA, DT);
        let run = |torque: f64, from: f64, seconds: f64| {
            (0..(seconds / DT) as u32).fold(from, |speed, _| bearing.step(speed, torque))
        };
        assert_eq!(run(4.7e-4, 0.0, 1.0), 0.0, "below breakaway it does not move at all");
        assert!(run(4.9e-4, 0.0, 1.0) > 10.0, "above breakaway it turns");
        assert!(run(4.5e-4, 50.0, 10.0) > 30.0, "moving, less than breakaway keeps it going");
        // Inertia over viscous is 2 s: 30 s is rest.
        let terminal = run(1.0e-3, 0.0, 30.0);
        assert!((terminal - (1.0e-3 - 4.0e-4) / 1.2e-6).abs() < 0.5, "terminal speed {terminal} rad/s");
    }

    #[test]
    fn coasting_it_comes_to_rest_where_the_equation_says_and_stays() {
        // ω̇ = −(b·ω + c)/J from ω₀: t = (J/b)·ln(1 + b·ω₀/c).
        let expected = INERTIA / BEARING.viscous * (1.0 + BEARING.viscous * 100.0 / BEARING.coulomb).ln();
        let bearing = BEARING.steps(INERTIA, DT);
        let (mut speed, mut rest) = (100.0, None);
        for step in 0..200_000_u32 {
            speed = bearing.step(speed, 0.0);
            if speed == 0.0 {
                rest = rest.or(Some(f64::from(step) * DT));
            }
            assert!(rest.is_none() || speed == 0.0, "it rests");
        }
        assert!((rest.expect("it stops") - expected).abs() < 1e-3, "{rest:?} s against {expected} s");
    }
}
