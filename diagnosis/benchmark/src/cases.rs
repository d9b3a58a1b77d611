//! The list of cases of one run: every effect at three strengths, pairs, nulls, wrong values,
//! physics without a name, and recordings that do not suffice for a verdict.

use crate::generator::effects::{EFFECTS, go_together};
use crate::generator::excite::Kind;
use crate::generator::outside::FOREIGN;
use crate::generator::spec::Spec;
use crate::key::Category;
use crate::metrics::STRENGTHS;
use crate::rng::Rng;

/// So many effects by chance that may be hidden together.
fn draw_together(count: usize, rng: &mut Rng) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = Vec::new();
    while names.len() < count {
        let name = *rng.pick(&EFFECTS);
        if names.iter().all(|other| go_together(other, name)) {
            names.push(name);
        }
    }
    names
}

/// Near twins with recordings that do not distinguish them.
const POOR: [(&str, &[Kind]); 10] = [
    ("command_delay", &[Kind::SlowMultisine]),
    ("electrical_lag", &[Kind::SlowMultisine]),
    ("quadratic_drag", &[Kind::OneTriangle]),
    ("stribeck_friction", &[Kind::OneSpeed]),
    ("gain_drift", &[Kind::OneTriangle]),
    ("friction_drift", &[Kind::OneTriangle]),
    ("mass_imbalance", &[Kind::OneTriangle]),
    ("encoder_eccentricity", &[Kind::OneSine]),
    ("backlash", &[Kind::OneSine]),
    ("asymmetric_friction", &[Kind::Staircase]),
];

/// The number of cases of each kind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Amounts {
    /// Draws of each effect at each strength.
    pub(crate) singles: usize,
    /// One effect of so many is drawn.
    pub(crate) every: usize,
    pub(crate) strengths: usize,
    pub(crate) pairs: usize,
    pub(crate) triples: usize,
    pub(crate) nulls: usize,
    pub(crate) disturbances: usize,
    pub(crate) parameters_only: usize,
    pub(crate) outside: usize,
    pub(crate) cannot_tell: usize,
}

impl Amounts {
    /// A run with `k` draws of every effect at every strength, and the rest in proportion.
    pub(crate) fn full(k: usize) -> Self {
        Self {
            singles: k,
            every: 1,
            strengths: 3,
            pairs: 12 * k,
            triples: 8 * k,
            nulls: 30 * k,
            disturbances: 6 * k,
            parameters_only: 15 * k,
            outside: 22 * k,
            cannot_tell: 10 * k,
        }
    }

    /// The small fixed run: a sample of everything. Each effect is found in the diagnosis's own
    /// tests; here the benchmark's independent plant plays every second one.
    pub(crate) fn quick() -> Self {
        Self {
            singles: 1,
            every: 2,
            strengths: 1,
            pairs: 1,
            triples: 1,
            nulls: 4,
            disturbances: 1,
            parameters_only: 1,
            outside: 2,
            cannot_tell: 1,
        }
    }
}

/// The specifications, in an order that says nothing of what they hold.
pub(crate) fn list(amounts: Amounts, seed: u64) -> Vec<Spec> {
    let mut specs = Vec::new();
    let drawn = Rng::new(seed).fork("together");
    let mut put = |category, hidden: Vec<&'static str>, strength, repeat, poor| {
        specs.push(Spec { id: 0, category, hidden, strength, repeat, poor, recorder: None });
    };
    for repeat in 0..amounts.singles {
        for name in EFFECTS.into_iter().step_by(amounts.every) {
            for strength in STRENGTHS.iter().take(amounts.strengths) {
                put(Category::Single, vec![name], *strength, repeat, None);
            }
        }
    }
    for i in 0..amounts.pairs {
        let names = draw_together(2, &mut drawn.fork(&format!("pair/{i}")));
        put(Category::Pair, names, 10.0, i, None);
    }
    for i in 0..amounts.triples {
        let names = draw_together(3, &mut drawn.fork(&format!("triple/{i}")));
        put(Category::Triple, names, 10.0, i, None);
    }
    for i in 0..amounts.nulls {
        put(Category::Null, Vec::new(), 0.0, i, None);
    }
    for i in 0..amounts.disturbances {
        put(Category::Disturbance, Vec::new(), 0.0, i, None);
    }
    for i in 0..amounts.parameters_only {
        put(Category::ParametersOnly, Vec::new(), 0.0, i, None);
    }
    for i in 0..amounts.outside {
        let strength = if (i / FOREIGN.len()).is_multiple_of(2) { 10.0 } else { 5.0 };
        put(Category::Outside, vec![FOREIGN[i % FOREIGN.len()]], strength, i / FOREIGN.len(), None);
    }
    for i in 0..amounts.cannot_tell {
        let (name, poor) = POOR[i % POOR.len()];
        put(Category::CannotTell, vec![name], 5.0, i / POOR.len(), Some(poor));
    }
    // Shuffled (Fisher–Yates), so that the number of a case says nothing.
    let mut rng = Rng::new(seed).fork("order");
    for i in (1..specs.len()).rev() {
        specs.swap(i, rng.below(i + 1));
    }
    for (i, spec) in specs.iter_mut().enumerate() {
        spec.id = i + 1;
    }
    specs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hidden_together_may_be_and_depends_on_the_seed() {
        let pairs = |seed: u64| -> Vec<Vec<&'static str>> {
            let specs = list(Amounts::full(1), seed);
            specs.into_iter().filter(|s| s.category == Category::Pair).map(|s| s.hidden).collect()
        };
        assert_eq!(pairs(3).len(), 12);
        assert!(pairs(3).iter().all(|p| go_together(p[0], p[1])));
        let sorted = |seed: u64| {
            let mut list = pairs(seed);
            list.sort();
            list
        };
        assert_eq!(sorted(3), sorted(3));
        assert_ne!(sorted(3), sorted(4));
    }
}
