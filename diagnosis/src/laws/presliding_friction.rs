//! Elastic bristles before sliding: the hysteresis just after a reversal (Dahl 1968; LuGre, Canudas
//! de Wit et al. 1995).

use super::bristles::{Bristles, Shape, lengths};
use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Movable, Reported,
    Span,
};
use super::joint_terms::{self, JointTerms};
use super::law::{first_or_both, sign};
use super::shape::ShapeKey;
use super::{Effect, EffectName, State};
use numerics::golden_section::logarithmic;

/// Longest over shortest of the lengths over which bristles bend, where they are not all alike:
/// asperities of many sizes.
const SPREAD: f64 = 10.0;

#[derive(Debug, Clone)]
struct PreslidingFrictionLaw {
    bristles: Bristles,
    /// Alike, they are LuGre's, which dampen as they bend.
    alike: bool,
}

impl ForceLaw for PreslidingFrictionLaw {
    fn names(&self) -> Vec<String> {
        first_or_both("coulomb", "damping", self.alike)
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        // Bristles bend on where the sign is too unsure for dry friction, and hold alone there.
        let (bent, more) = self.bristles.bend(state.velocity * state.dt);
        out[0] = sign(velocity) - bent;
        if let Some(damping) = out.get_mut(1) {
            *damping = if state.dt > 0.0 { -more / state.dt } else { 0.0 };
        }
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct PreslidingFriction;

impl EffectLaw for PreslidingFriction {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(PreslidingFrictionLaw {
            bristles: Bristles::new(effect),
            alike: Shape::of(effect).spread <= 1.0,
        }))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        let Shape { deflection, spread } = Shape::of(effect);
        if spread > 1.0 {
            return false;
        }
        // Ours dampen by the bend as a part of the deflection, LuGre's by the bend itself.
        let damping = effect.coefficient("damping") / deflection;
        joint.bristles =
            Some(joint_terms::Bristles { dry: effect.coefficient("coulomb"), deflection, damping });
        true
    }
}

impl EffectSearch for PreslidingFriction {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let bristles = |spread: f64| {
            logarithmic(2.0 * span.count, 0.03 * span.travel(), 9).into_iter().map(move |deflection| {
                Effect::shaped(name, &[("deflection", deflection), ("spread", spread)])
            })
        };
        bristles(1.0).chain(bristles(SPREAD)).collect()
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("deflection", 0.5 * span.count, 0.1 * span.travel())]
    }
    fn bends_at_reversals(&self) -> bool {
        true
    }
    fn gives_way_over(&self, effect: &Effect) -> Option<f64> {
        Some(Shape::of(effect).deflection)
    }
    fn is_in_doubt_at_limit(&self, term: usize) -> bool {
        // Bristles without damping are bristles all the same.
        term == 0
    }
}

impl EffectReport for PreslidingFriction {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let (c, cs) = fitted.scaled(fitted.term(0));
        let (d, ds) = fitted.shape("deflection");
        // From straight, before any slides.
        let lengths = lengths(fitted.effect);
        let value = c * lengths.iter().map(|length| length.recip()).sum::<f64>() / lengths.len() as f64;
        let sd = value.abs() * ((cs / c).powi(2) + (ds / d).powi(2)).sqrt();
        vec![
            // How far they bend may be hardly known where how much they hold is.
            Reported::new("breakaway", (c, cs), fitted.force),
            Reported::new("stiffness", (value, sd), format!("{}/{}", fitted.force, fitted.length)),
        ]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.15
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        matches!(other, EffectName::Backlash | EffectName::StribeckFriction).then_some(
            "a ladder of reversals with amplitudes from a few counts to a turn: bristles give a loop at every amplitude, a gap only above its width",
        )
    }
}
