//! A formula as one of the effects: its law, its search, its part of a report.

use super::Formula;
use crate::laws::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Movable, Reported, Span,
};
use crate::laws::{Effect, EffectName, State};
use regression::laws::Bounds;

/// A formula along a recording or in a plant, with the values of its shape.
#[derive(Debug, Clone)]
struct FormulaLaw {
    formula: &'static Formula,
    shape: Vec<f64>,
}

impl ForceLaw for FormulaLaw {
    fn names(&self) -> Vec<String> {
        self.formula.terms()
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        self.formula.values(state, velocity, &self.shape, out);
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

/// Points along a value of a formula's shape, for so many of them together.
const POINTS: [usize; 3] = [9, 5, 3];

impl EffectLaw for Formula {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let formula = effect.name.formula()?;
        // Without a value: the middle of what it may be.
        let value =
            |(key, low, high): &Movable| effect.shape.get(*key).copied().unwrap_or(0.5 * (low + high));
        Some(Box::new(FormulaLaw { formula, shape: formula.shape.iter().map(value).collect() }))
    }
    fn is_dry(&self) -> bool {
        self.is_dry
    }
}

impl EffectSearch for Formula {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        if self.uses("tilt") && !span.tilt {
            return Vec::new();
        }
        let points = POINTS[self.shape.len().clamp(1, POINTS.len()) - 1];
        let mut out = vec![Effect::shaped(name, &[])];
        for (k, (key, low, high)) in self.shape.iter().enumerate() {
            let count = if k < POINTS.len() { points } else { 1 };
            // Bounds of one sign lie decades apart as often as not.
            let value = |i: usize| {
                let part = (i as f64 + 0.5) / count as f64;
                if *low > 0.0 { low * (high / low).powf(part) } else { low + (high - low) * part }
            };
            let with_value = |effect: &Effect, i: usize| {
                let mut effect = effect.clone();
                effect.shape.insert((*key).to_owned(), value(i));
                effect
            };
            out = out
                .iter()
                .flat_map(|effect| (0..count).map(|i| with_value(effect, i)).collect::<Vec<_>>())
                .collect();
        }
        out
    }
    fn movable(&self, _effect: &Effect, _span: &Span) -> Vec<Movable> {
        // Refinement moves logarithms.
        self.shape.iter().filter(|(_, low, _)| *low > 0.0).copied().collect()
    }
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        self.terms().len()
    }
}

impl Formula {
    /// Returns the bounds of a term's coefficient: its sign, since it is fitted per inertia, which
    /// is not known exactly.
    pub(crate) fn bounds_of(&self, term: usize) -> Bounds {
        match self.linear.get(term).and_then(|name| self.text.parameters.get(name)) {
            Some([low, _]) if *low >= 0.0 => Bounds::POSITIVE,
            Some([_, high]) if *high <= 0.0 => Bounds { high: 0.0, ..Bounds::FREE },
            Some(_) => Bounds::FREE,
            None => Bounds::POSITIVE,
        }
    }
}

impl EffectReport for Formula {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let terms = self.terms().into_iter().enumerate();
        let of_terms = terms.map(|(k, name)| Reported::new(name, fitted.scaled(fitted.term(k)), "1"));
        let of_shape = self.shape.iter().map(|(name, _, _)| Reported::new(*name, fitted.shape(name), "1"));
        of_terms.chain(of_shape).collect()
    }
}
