//! The law of an effect on force or sensor: its terms, linear in the coefficients, with internal
//! state; and what several share.

use super::definition::ForceLaw;
use super::{Effect, EffectName, State};

/// Names of terms of which the second is not always there.
pub(super) fn first_or_both(first: &str, second: &str, both: bool) -> Vec<String> {
    [first, second].into_iter().take(if both { 2 } else { 1 }).map(str::to_owned).collect()
}

/// Sign with `sgn(0) = 0`.
pub(super) fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// An effect with its internal state. The force is the sum of coefficient times term; sensor
/// effects give travel instead.
#[derive(Debug)]
pub struct Law {
    name: EffectName,
    /// Names of the terms, in the order of [`Law::terms`].
    names: Vec<String>,
    law: Box<dyn ForceLaw>,
}

impl Clone for Law {
    fn clone(&self) -> Self {
        Self { name: self.name, names: self.names.clone(), law: self.law.copy() }
    }
}

impl Law {
    /// The law of an effect on force or sensor; none where it acts on the command.
    pub fn new(effect: &Effect) -> Option<Self> {
        let law = effect.name.definition().law(effect)?;
        Some(Self { name: effect.name, names: law.names(), law })
    }

    /// Names of the terms, in order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// True if the terms are travel added to what the encoder reads, rather than force.
    pub(crate) fn in_sensor(&self) -> bool {
        self.name.definition().in_sensor()
    }

    /// True if the force is dry friction, which holds an axis at rest rather than moving it.
    pub(crate) fn is_dry(&self) -> bool {
        self.name.definition().is_dry()
    }

    /// The part of a force without a name that holds an axis at rest, per unit of its coefficient,
    /// N·m or N.
    pub(crate) fn dry_part(&self, state: &State) -> f64 {
        self.law.dry_part(state)
    }

    /// The terms for this step; `out` has one place per name.
    pub fn terms(&mut self, state: &State, out: &mut [f64]) {
        let velocity = if state.rest { 0.0 } else { state.velocity };
        self.law.terms(state, velocity, out);
    }
}

/// Mean cosine and sine of a wave, rad per unit of travel, over `passed` travel about `position`.
pub(crate) fn wave_mean(wave: f64, position: f64, passed: f64) -> (f64, f64) {
    let (sin, cos) = (wave * position).sin_cos();
    let half = 0.5 * wave * passed;
    let part = sinc(half);
    (part * cos, part * sin)
}

/// sin x / x, to the last digits: by its series where that is faster.
pub(crate) fn sinc(x: f64) -> f64 {
    let y = x * x;
    if y > 0.09 {
        return x.sin() / x;
    }
    1.0 - y / 6.0 * (1.0 - y / 20.0 * (1.0 - y / 42.0 * (1.0 - y / 72.0 * (1.0 - y / 110.0))))
}

/// Legendre polynomials of degree 1 and up, times a factor.
pub(crate) fn legendre(x: f64, times: f64, out: &mut [f64]) {
    let (mut before, mut now) = (1.0, x);
    for (k, term) in out.iter_mut().enumerate() {
        *term = times * now;
        let n = (k + 1) as f64;
        let next = ((2.0 * n + 1.0) * x * now - n * before) / (n + 1.0);
        (before, now) = (now, next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bristles() -> Law {
        Law::new(&Effect::shaped(EffectName::PreslidingFriction, &[("deflection", 1.0)])).unwrap()
    }

    /// The bristles' force and their damping after a long slide forward and one step.
    fn after_a_slide(velocity: f64, rest: bool) -> [f64; 2] {
        let (mut law, mut out) = (bristles(), [0.0; 2]);
        law.terms(&State { velocity: 100.0, dt: 1.0, ..State::default() }, &mut out);
        law.terms(&State { velocity, rest, dt: 1e-3, ..State::default() }, &mut out);
        out
    }

    #[test]
    fn bristles_replace_dry_friction_where_its_sign_is_unknown() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
        assert!(near(after_a_slide(0.1, false)[0], 0.0), "sliding on, dry friction is whole");
        assert!(near(after_a_slide(-0.1, false)[0], -2.0), "turned round, the bristles still push back");
        for velocity in [0.1, 0.0, -0.1] {
            assert!(near(after_a_slide(velocity, true)[0], -1.0), "at rest they hold alone");
        }
    }

    #[test]
    fn bristles_dampen_only_while_they_bend() {
        assert!(after_a_slide(0.1, false)[1].abs() < 1e-9, "sliding on, nothing bends");
        // Turned round at −0.1 they unbend by 2·0.1 of their length a second.
        assert!((after_a_slide(-0.1, false)[1] - 0.2).abs() < 1e-3);
    }

    #[test]
    fn what_is_not_there_does_not_drift() {
        let names = |shape: &[(&str, f64)]| {
            let drift = Effect::shaped(EffectName::FrictionDrift, shape);
            Law::new(&drift).unwrap().names().to_vec()
        };
        assert_eq!(names(&[]), ["coulomb", "viscous"]);
        assert_eq!(names(&[("dry_only", 1.0)]), ["coulomb"]);
    }

    #[test]
    fn a_spring_that_fades_holds_what_is_bent_at_once_and_lets_go() {
        let spring = |fades: &[(&str, f64)], seconds: usize| {
            let mut law = Law::new(&Effect::shaped(EffectName::PositionSpring, fades)).unwrap();
            let mut out = [0.0];
            for _ in 0..1000 * seconds {
                law.terms(&State { position: 2.0, dt: 1e-3, ..State::default() }, &mut out);
            }
            out[0]
        };
        assert_eq!(spring(&[], 5), -2.0);
        assert!((spring(&[("fades_s", 1.0)], 1) + 2.0 * (-1.0_f64).exp()).abs() < 0.01);
        assert!(spring(&[("fades_s", 1.0)], 10).abs() < 1e-3);
    }

    #[test]
    fn an_inertia_along_the_travel_has_its_slopes_force_too() {
        let shape = [("low", 0.0), ("high", 4.0), ("degree", 2.0), ("of_inertia", 1.0)];
        let mut law = Law::new(&Effect::shaped(EffectName::PositionDependentDamping, &shape)).unwrap();
        let mut out = [0.0; 2];
        law.terms(&State { position: 3.0, velocity: 2.0, acceleration: 5.0, ..State::default() }, &mut out);
        // x = (q − 2)/2 = ½: P₁ = x with slope ½, P₂ = (3x² − 1)/2 with slope 3x/2.
        for (term, expected) in out.iter().zip([-0.5 * 5.0 - 0.25 * 4.0, 0.125 * 5.0 - 0.375 * 4.0]) {
            assert!((term - expected).abs() < 1e-4, "{term} instead of {expected}");
        }
    }

    #[test]
    fn a_waves_mean_over_a_step_is_equal_by_series_and_by_sine() {
        for x in [1e-9_f64, 1e-3, 0.1, 0.299_999, 0.300_001, 2.0, -0.2] {
            assert!((sinc(x) - x.sin() / x).abs() < 4e-16, "{x}");
        }
        assert_eq!(sinc(0.0), 1.0);
    }

    #[test]
    fn friction_grows_with_the_load_or_with_what_the_drive_carries() {
        let friction = |name, velocity: f64| {
            let effect = Effect::shaped(name, &[]);
            let (mut law, mut out) = (Law::new(&effect).unwrap(), [0.0]);
            law.terms(&State { velocity, external: 2.0, drive: -3.0, ..State::default() }, &mut out);
            out[0]
        };
        let (load, drive) = (EffectName::LoadDependentFriction, EffectName::DriveLoss);
        assert_eq!([friction(load, 1.0), friction(load, -1.0)], [-2.0, 2.0]);
        assert_eq!([friction(drive, 1.0), friction(drive, -1.0)], [-3.0, 3.0]);
    }

    #[test]
    fn at_rest_nothing_that_depends_on_speed_acts() {
        let of_speed: [(EffectName, &[(&str, f64)]); 3] = [
            (EffectName::ViscousFriction, &[]),
            (EffectName::QuadraticDrag, &[]),
            (EffectName::StribeckFriction, &[("speed", 1.0)]),
        ];
        for (name, shape) in of_speed {
            let (mut law, mut out) = (Law::new(&Effect::shaped(name, shape)).unwrap(), [1.0]);
            law.terms(&State { velocity: 3.0, rest: true, dt: 1e-3, ..State::default() }, &mut out);
            assert_eq!(out[0], 0.0, "{name}");
        }
    }
}
