//! A gap between motor and load that opens at reversals; the law is in `load`.

use super::definition::{
    Coupling, EffectLaw, EffectReport, EffectSearch, Factors, Fitted, ForceLaw, Movable, Reported, Span,
};
use super::joint_terms::JointTerms;
use super::load::{Load, MOST_OF_DRY, Machine, RATIOS, gap_of, own_friction};
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State};
use numerics::golden_section::logarithmic;

#[derive(Debug, Clone)]
struct BacklashLaw(Load);

impl ForceLaw for BacklashLaw {
    fn names(&self) -> Vec<String> {
        vec!["inertia_ratio".into()]
    }
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        out[0] = self.0.through_gap(state);
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

/// Narrowest gap that an encoder sees, counts.
const SEEN: f64 = 2.0;

/// Widest gap worth looking for: one that the axis crosses within a moment at its fast speed.
fn widest(span: &Span) -> f64 {
    (0.08 * span.speed).max(60.0 * span.count)
}

shape! {
    /// The gap.
    struct Shape {
        /// Its width, rad or m.
        gap: needed,
        /// Natural frequency of load and motor while a flank touches, Hz.
        contact_hz: needed,
    }
}

pub(super) struct Backlash;

impl EffectLaw for Backlash {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let Shape { gap, contact_hz } = Shape::of(effect);
        Some(Box::new(BacklashLaw(Load::behind_gap(effect, gap, contact_hz))))
    }
    fn coupling(&self) -> Option<Coupling> {
        Some(Coupling::Stiff)
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        let Shape { gap, contact_hz } = Shape::of(effect);
        joint.gap = Some(gap_of(effect, gap, contact_hz, joint.inertia));
        true
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS, Machine::KEYS]
    }
}

impl EffectSearch for Backlash {
    fn is_unseen(&self, effect: &Effect, count: f64) -> bool {
        Shape::of(effect).gap < SEEN * count
    }
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let mut out = Vec::new();
        for coast in [0.6, 1.5].map(|part| part * span.rig.dry) {
            for gap in logarithmic(2.0 * span.count, widest(span), 12) {
                let shape = [("gap", gap), ("coast", coast), ("contact_hz", 180.0), ("ratio", 1.0)];
                out.push(Effect::shaped(name, &[shape.as_slice(), &span.rig.machine].concat()));
            }
        }
        out
    }
    fn movable(&self, effect: &Effect, span: &Span) -> Vec<Movable> {
        let Machine { dry, .. } = Machine::of(effect);
        vec![
            ("gap", span.count, 2.0 * widest(span)),
            ("coast", 0.2 * dry, 4.0 * dry),
            ("ratio", RATIOS.0, RATIOS.1),
            ("contact_hz", 30.0, 600.0),
        ]
    }
    fn is_possible(&self, effect: &Effect) -> bool {
        own_friction(effect) <= MOST_OF_DRY * Machine::of(effect).dry
    }
    fn start_factors(&self) -> &'static [Factors] {
        &[("gap", &[0.6, 1.0, 1.6]), ("coast", &[0.5, 1.0, 1.7]), ("ratio", &[0.6, 1.0, 1.7])]
    }
}

impl EffectReport for Backlash {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("gap", fitted.shape("gap"), fitted.length)]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.4
    }
}
