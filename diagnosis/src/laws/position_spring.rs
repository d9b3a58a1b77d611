//! A spring along the travel, a bending needle or elastic tissue: `-stiffness·(q - from)`, or only
//! beyond `from`; with `fades_s` it creeps, which has no name and speaks only against others.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Movable, Plain,
    Reported, Span, Unnamed,
};
use super::joint_terms::JointTerms;
use super::law::first_or_both;
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State, Variable, experiments};

shape! {
    /// The place and the kind of the spring.
    struct Shape {
        /// Place at which it is straight, rad or m.
        from: 0.0,
        /// True if it pulls beyond that place only.
        one_sided: flag,
        /// True if a force is there at the start, because it is not known where the spring is at
        /// rest.
        preload: flag,
        /// Time in which the force fades while the spring stays bent, s.
        fades_s: (f64::INFINITY),
    }
}

#[derive(Debug, Clone)]
struct PositionSpringLaw {
    shape: Shape,
    faded: f64,
}

impl ForceLaw for PositionSpringLaw {
    fn names(&self) -> Vec<String> {
        // Where it is at rest is not known: a force that is there at the start.
        first_or_both("stiffness", "preload", self.shape.preload)
    }
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        let x = state.position - self.shape.from;
        // Maxwell's spring and dashpot in series: what has faded is no longer bent.
        self.faded += (x - self.faded) * (1.0 - (-state.dt / self.shape.fades_s).exp());
        let bent = x - self.faded;
        out[0] = if self.shape.one_sided { -bent.max(0.0) } else { -bent };
        if let Some(preload) = out.get_mut(1) {
            *preload = 1.0;
        }
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

/// Times in which the force of a spring that creeps may fade, s.
const FADES_S: [f64; 6] = [0.1, 0.25, 0.6, 1.5, 4.0, 10.0];

pub(super) struct PositionSpring;

impl EffectLaw for PositionSpring {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(PositionSpringLaw { shape: Shape::of(effect), faded: 0.0 }))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        let Shape { from, one_sided, fades_s, .. } = Shape::of(effect);
        if fades_s.is_finite() || one_sided {
            return false;
        }
        joint.stiffness += effect.coefficient("stiffness");
        joint.slack = from;
        joint.bias += effect.coefficient("preload");
        true
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Travel)
    }
}

impl EffectSearch for PositionSpring {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        // A rig without an offset has no other term for a spring that is not at rest where the
        // recording starts. Where the inertia is hardly known one more term explains slow motion as
        // well as forces in balance do.
        let preload = f64::from(u8::from(!span.rig.has_offset && !span.rig.is_anchored));
        let mut out = vec![Effect::shaped(name, &[("from", 0.0), ("preload", preload)])];
        if !span.rig.has_stroke {
            // Where each recording starts is not known, and only a spring that never goes slack is
            // the same from anywhere.
            return out;
        }
        for part in [0.25, 0.5, 0.75] {
            let from = span.low + part * span.travel();
            out.push(Effect::shaped(name, &[("from", from), ("one_sided", 1.0)]));
        }
        out
    }
    fn movable(&self, _effect: &Effect, _span: &Span) -> Vec<Movable> {
        Vec::new()
    }
    fn freedom(&self, effect: &Effect, _recordings: usize) -> usize {
        1 + usize::from(Shape::of(effect).preload)
    }
    fn plain(&self, effect: &Effect) -> Option<Plain> {
        (!Shape::of(effect).one_sided).then_some(Plain { rank: 5, has_twin: true })
    }
    fn unnamed(&self, name: EffectName, fitted: Option<&Effect>, _span: &Span) -> Vec<Unnamed> {
        let spring = match fitted {
            None => Effect::shaped(name, &[("from", 0.0)]),
            Some(effect) if effect.name == name => effect.clone(),
            Some(_) => return Vec::new(),
        };
        let fading = |time: f64| {
            let mut effect = spring.clone();
            effect.shape.insert("fades_s".into(), time);
            let what = format!("a spring that creeps, whose force fades within {time} s,");
            Unnamed { effect, freedom: 4.0, what }
        };
        FADES_S.map(fading).into()
    }
}

impl EffectReport for PositionSpring {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        fitted.one_force("stiffness", format!("{}/{}", fitted.force, fitted.length))
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.13
    }
    fn variable(&self) -> &'static str {
        "travel"
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other != EffectName::MassImbalance).then_some(experiments::STROKES)
    }
}
