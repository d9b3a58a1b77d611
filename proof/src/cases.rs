//! The list of cases of one run: every effect at three strengths, pairs, nulls, wrong values, physics without a name, and
//! recordings that cannot tell.

use crate::generator::case::Spec;
use crate::generator::effects::EFFECTS;
use crate::generator::excite::Kind;
use crate::generator::outside::FOREIGN;
use crate::key::Category;
use crate::rng::Rng;
use crate::sums::STRENGTHS;

/// Pairs that occur together on real machines and ask for different explanations.
const PAIRS: [[&str; 2]; 16] = [
    ["stribeck_friction", "cogging"],
    ["coulomb_friction", "cogging"],
    ["coulomb_friction", "asymmetric_friction"],
    ["viscous_friction", "coulomb_friction"],
    ["cogging", "torque_ripple"],
    ["command_deadband", "quadratic_drag"],
    ["electrical_lag", "stribeck_friction"],
    ["command_delay", "cogging"],
    ["friction_drift", "cogging"],
    ["position_spring", "stribeck_friction"],
    ["backlash", "cogging"],
    ["drive_compliance", "quadratic_drag"],
    ["mass_imbalance", "stribeck_friction"],
    ["tilt_gravity", "cogging"],
    ["position_dependent_friction", "quadratic_drag"],
    ["command_saturation", "position_spring"],
];

/// Near twins with recordings that do not tell them apart.
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

/// How many of what.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Amounts {
    /// Draws of each effect at each strength.
    pub(crate) singles: usize,
    pub(crate) strengths: usize,
    pub(crate) pairs: usize,
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
            strengths: 3,
            pairs: 12 * k,
            nulls: 30 * k,
            disturbances: 6 * k,
            parameters_only: 15 * k,
            outside: 16 * k,
            cannot_tell: 10 * k,
        }
    }

    /// The small fixed run: a sample of everything.
    pub(crate) fn quick() -> Self {
        Self {
            singles: 1,
            strengths: 1,
            pairs: 2,
            nulls: 4,
            disturbances: 1,
            parameters_only: 2,
            outside: 3,
            cannot_tell: 2,
        }
    }
}

/// The specifications, in an order that says nothing of what they hold.
pub(crate) fn list(amounts: Amounts, seed: u64) -> Vec<Spec> {
    let mut specs = Vec::new();
    let mut put = |category, hidden: Vec<&'static str>, strength, repeat, poor| {
        specs.push(Spec { id: 0, category, hidden, strength, repeat, poor, recorder: None });
    };
    for repeat in 0..amounts.singles {
        for name in EFFECTS {
            for strength in STRENGTHS.iter().take(amounts.strengths) {
                put(Category::Single, vec![name], *strength, repeat, None);
            }
        }
    }
    for i in 0..amounts.pairs {
        put(Category::Pair, PAIRS[i % PAIRS.len()].to_vec(), 10.0, i / PAIRS.len(), None);
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
