//! Dry friction that changes along the travel: `-Σ legendre_k·P_k(q)·sgn(q̇)`.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span};
use super::law::{legendre, sign};
use super::shape::ShapeKey;
use super::travel_profile::{self, Profile};
use super::{Effect, EffectName, State, experiments};

#[derive(Debug, Clone)]
struct PositionDependentFrictionLaw(Profile);

impl ForceLaw for PositionDependentFrictionLaw {
    fn names(&self) -> Vec<String> {
        self.0.names()
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        legendre(self.0.along(state.position), -sign(velocity), out);
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct PositionDependentFriction;

impl EffectLaw for PositionDependentFriction {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(PositionDependentFrictionLaw(Profile::new(effect))))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[travel_profile::Shape::KEYS]
    }
    fn is_dry(&self) -> bool {
        true
    }
    fn follows_travel(&self) -> bool {
        true
    }
}

impl EffectSearch for PositionDependentFriction {
    fn profile_values(&self, effect: &Effect) -> f64 {
        travel_profile::degree(effect)
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        travel_profile::grid(name, span)
    }
    fn freedom(&self, effect: &Effect, _recordings: usize) -> usize {
        travel_profile::freedom(effect)
    }
}

impl EffectReport for PositionDependentFriction {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("span", travel_profile::span(fitted), fitted.force)]
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
