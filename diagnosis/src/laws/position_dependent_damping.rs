//! Damping that changes along the travel: `-Σ legendre_k·P_k(q)·q̇`; with `of_inertia` it is the
//! inertia that follows the travel, which has no name and speaks only against others.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span, Unnamed};
use super::law::legendre;
use super::shape::{ShapeKey, shape};
use super::travel_profile::{self, Profile};
use super::{Effect, EffectName, State, experiments};

#[derive(Debug, Clone)]
struct PositionDependentDampingLaw {
    profile: Profile,
    of_inertia: bool,
}

impl PositionDependentDampingLaw {
    /// Terms of an inertia J(q) in addition to a constant one, by Lagrange's equation: J′v²/2 and
    /// its part of the acceleration.
    fn inertia(&self, state: &State, out: &mut [f64]) {
        let step = 1e-3 * 0.5 * (self.profile.high - self.profile.low);
        let mut beyond = vec![0.0; out.len()];
        legendre(self.profile.along(state.position + step), 1.0, &mut beyond);
        legendre(self.profile.along(state.position - step), 1.0, out);
        for (term, beyond) in out.iter_mut().zip(beyond) {
            let slope = (beyond - *term) / (2.0 * step);
            *term =
                -0.5 * (beyond + *term) * state.acceleration - 0.5 * slope * state.velocity * state.velocity;
        }
    }
}

impl ForceLaw for PositionDependentDampingLaw {
    fn names(&self) -> Vec<String> {
        self.profile.names()
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        if self.of_inertia {
            self.inertia(state, out);
        } else {
            legendre(self.profile.along(state.position), -velocity, out);
        }
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

/// Degree of the polynomial along the travel that an inertia may follow.
const INERTIA_DEGREE: f64 = 12.0;

shape! {
    /// The quantity that changes along the travel.
    struct Shape {
        /// True if it is the inertia, which has no name and speaks only against others.
        of_inertia: flag,
    }
}

pub(super) struct PositionDependentDamping;

impl EffectLaw for PositionDependentDamping {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(PositionDependentDampingLaw {
            profile: Profile::new(effect),
            of_inertia: Shape::of(effect).of_inertia,
        }))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[travel_profile::Shape::KEYS, Shape::KEYS]
    }
    fn follows_travel(&self) -> bool {
        true
    }
}

impl EffectSearch for PositionDependentDamping {
    fn profile_values(&self, effect: &Effect) -> f64 {
        travel_profile::degree(effect)
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        travel_profile::grid(name, span)
    }
    fn freedom(&self, effect: &Effect, _recordings: usize) -> usize {
        travel_profile::freedom(effect)
    }
    fn unnamed(&self, name: EffectName, fitted: Option<&Effect>, span: &Span) -> Vec<Unnamed> {
        // All of them show by an acceleration that changes with the travel.
        let alike = [name, EffectName::EncoderEccentricity, EffectName::MassImbalance];
        if fitted.is_some_and(|effect| !alike.contains(&effect.name)) {
            return Vec::new();
        }
        let shape = [("low", span.low), ("high", span.high), ("degree", INERTIA_DEGREE), ("of_inertia", 1.0)];
        vec![Unnamed {
            effect: Effect::shaped(name, &shape),
            freedom: INERTIA_DEGREE,
            what: "an inertia that changes along the travel".into(),
        }]
    }
}

impl EffectReport for PositionDependentDamping {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let unit = format!("{}·s/{}", fitted.force, fitted.length);
        vec![Reported::new("span", travel_profile::span(fitted), unit)]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.13
    }
    fn variable(&self) -> &'static str {
        "travel"
    }
    fn experiment(&self, _other: EffectName) -> Option<&'static str> {
        Some(experiments::STROKES)
    }
}
