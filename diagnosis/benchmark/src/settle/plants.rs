//! Plants to conceal in the virtual device, as rig files. They are drawn without any knowledge of
//! how experiments are designed: this file knows names of effects and sizes, and a rig as text.

use crate::rng::Rng;
use std::fmt::Write as _;

/// The kind of a plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// An effect that has a near twin.
    Twin,
    /// An effect without one.
    Single,
    /// Two effects.
    Pair,
    /// Nothing but values that are off.
    Null,
    /// A force outside the library.
    Outside,
}

impl Kind {
    /// The kind of these words.
    pub(crate) fn of(words: &str) -> Option<Self> {
        let all = [Self::Twin, Self::Single, Self::Pair, Self::Null, Self::Outside];
        all.into_iter().find(|kind| kind.words() == words)
    }

    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Twin => "twins",
            Self::Single => "singles",
            Self::Pair => "pairs",
            Self::Null => "nulls",
            Self::Outside => "outside",
        }
    }
}

/// A concealed plant.
#[derive(Clone, Debug)]
pub(crate) struct Plant {
    pub(crate) kind: Kind,
    /// The effects; none where nothing is to be named.
    pub(crate) names: Vec<String>,
    /// The rig file.
    pub(crate) toml: String,
}

/// Effects with a near twin, in pairs.
const TWINS: [&str; 16] = [
    "command_delay",
    "electrical_lag",
    "presliding_friction",
    "backlash",
    "drive_compliance",
    "backlash",
    "gain_drift",
    "friction_drift",
    "position_spring",
    "mass_imbalance",
    "quadratic_drag",
    "stribeck_friction",
    "encoder_eccentricity",
    "mass_imbalance",
    "command_saturation",
    "command_delay",
];
const SINGLES: [&str; 4] = ["cogging", "torque_ripple", "command_deadband", "asymmetric_friction"];
/// Kinds in turn: of twelve plants six have a twin, two have none, two hold a pair, one is a null
/// and one is outside.
const TURN: [Kind; 12] = [
    Kind::Twin,
    Kind::Single,
    Kind::Twin,
    Kind::Null,
    Kind::Twin,
    Kind::Twin,
    Kind::Outside,
    Kind::Twin,
    Kind::Single,
    Kind::Twin,
    Kind::Pair,
    Kind::Pair,
];
/// Effects of which a pair holds two different ones.
const IN_PAIRS: [&str; 8] = [
    "cogging",
    "torque_ripple",
    "command_deadband",
    "asymmetric_friction",
    "stribeck_friction",
    "command_delay",
    "mass_imbalance",
    "friction_drift",
];

/// The numbers of a rig that sizes are drawn from, and its text.
#[derive(Clone, Debug)]
pub(crate) struct Base {
    pub(crate) inertia: f64,
    pub(crate) dry: f64,
    pub(crate) viscous: f64,
    pub(crate) gain: f64,
    pub(crate) counts_per_unit: f64,
    pub(crate) limit: f64,
}

impl Base {
    /// Reads the rig file of a device without concealed effects.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let rig: toml::Table = text.parse().map_err(|cause| format!("the rig cannot be read ({cause})"))?;
        let number = |part: &str, key: &str| {
            let value = rig.get(part).and_then(|part| part.get(key));
            value.and_then(toml::Value::as_float).ok_or_else(|| format!("the rig has no {part}.{key}"))
        };
        Ok(Self {
            inertia: number("model", "inertia")?,
            dry: number("model", "coulomb")?,
            viscous: number("model", "viscous")?,
            gain: number("actuator", "gain")?,
            counts_per_unit: number("encoder", "counts_per_unit")?,
            limit: number("actuator", "limit")?,
        })
    }
}

/// Draws plant `index`.
pub(crate) fn draw(base: &Base, seed: u64, index: usize) -> Plant {
    let mut rng = Rng::new(seed).fork(&format!("settle {index}"));
    let kind = TURN[index % TURN.len()];
    let (names, effects) = match kind {
        Kind::Twin => named(&[TWINS[rng.below(TWINS.len())]], base, &mut rng),
        Kind::Single => named(&[SINGLES[rng.below(SINGLES.len())]], base, &mut rng),
        Kind::Pair => {
            let (first, step) = (rng.below(IN_PAIRS.len()), 1 + rng.below(IN_PAIRS.len() - 1));
            named(&[IN_PAIRS[first], IN_PAIRS[(first + step) % IN_PAIRS.len()]], base, &mut rng)
        }
        Kind::Null => (Vec::new(), String::new()),
        Kind::Outside => (Vec::new(), outside(base, &mut rng)),
    };
    let mut toml = String::from("format = 1\nname = \"concealed\"\nkind = \"rotary\"\n[model]\n");
    // Within what the rig declares: a third of 15 % for the inertia, a quarter of 50 % for
    // friction.
    let near = |rng: &mut Rng, part: f64| 1.0 + part * rng.bounded_normal(2.0);
    let _ = writeln!(toml, "inertia = {:e}", base.inertia * near(&mut rng, 0.05));
    let _ = writeln!(toml, "viscous = {:e}", base.viscous * near(&mut rng, 0.12));
    let _ = writeln!(toml, "coulomb = {:e}", base.dry * near(&mut rng, 0.12));
    let _ =
        writeln!(toml, "[actuator]\ngain = {:e}\ncommand_unit = \"dac\"", base.gain * near(&mut rng, 0.03));
    let _ =
        writeln!(toml, "limit = {:?}\n[encoder]\ncounts_per_unit = {:?}", base.limit, base.counts_per_unit);
    let _ = writeln!(toml, "turn = {:?}", std::f64::consts::TAU);
    toml += &effects;
    Plant { kind, names, toml }
}

/// The text of an effect with its shape and coefficients.
fn text(name: &str, shape: &[(&str, f64)], coefficients: &[(&str, f64)]) -> String {
    let table = |values: &[(&str, f64)]| {
        values.iter().map(|(key, value)| format!("{key} = {value:?}")).collect::<Vec<_>>().join(", ")
    };
    format!(
        "[[effect]]\nname = \"{name}\"\nshape = {{ {} }}\ncoefficients = {{ {} }}\n",
        table(shape),
        table(coefficients)
    )
}

/// Effects of the library and their text.
fn named(names: &[&str], base: &Base, rng: &mut Rng) -> (Vec<String>, String) {
    (
        names.iter().map(ToString::to_string).collect(),
        names.iter().map(|name| effect(name, base, rng)).collect(),
    )
}

/// The text of an effect of the library, of a size that is a part of the dry friction or of the
/// drive.
fn effect(name: &str, base: &Base, rng: &mut Rng) -> String {
    let force = base.dry * rng.log_range(0.15, 0.6);
    let phase = rng.range(0.0, std::f64::consts::TAU);
    let wave = |amplitude: f64| (amplitude * phase.cos(), amplitude * phase.sin());
    let turn = ("turn", std::f64::consts::TAU);
    match name {
        "command_delay" => text(name, &[("delay", rng.log_range(1e-3, 4e-3))], &[]),
        "electrical_lag" => text(name, &[("time_constant", rng.log_range(1e-3, 4e-3))], &[]),
        "presliding_friction" => {
            let deflection = rng.log_range(3.0, 12.0) / base.counts_per_unit;
            text(name, &[("deflection", deflection)], &[("coulomb", base.dry), ("damping", 0.0)])
        }
        "backlash" => gap(base, rng),
        "drive_compliance" => text(
            name,
            &[("resonance_hz", rng.log_range(20.0, 60.0)), ("damping", 0.05)],
            &[("inertia_ratio", rng.range(0.1, 0.4))],
        ),
        "gain_drift" => text(
            name,
            &[("time_constant", rng.log_range(8.0, 30.0))],
            &[("change", rng.sign() * rng.range(0.1, 0.3))],
        ),
        "friction_drift" => text(
            name,
            &[("time_constant", rng.log_range(8.0, 30.0)), ("dry_only", 1.0)],
            &[("coulomb", rng.sign() * force)],
        ),
        "position_spring" => text(name, &[("from", 0.0)], &[("stiffness", force / rng.range(3.0, 12.0))]),
        "mass_imbalance" | "encoder_eccentricity" => {
            let counts = rng.log_range(4.0, 20.0) / base.counts_per_unit;
            let (cos, sin) = wave(if name == "mass_imbalance" { force } else { counts });
            text(name, &[turn], &[("cos_1", cos), ("sin_1", sin)])
        }
        "quadratic_drag" => text(name, &[], &[("coefficient", force / rng.range(15.0, 35.0).powi(2))]),
        "stribeck_friction" => {
            text(name, &[("speed", rng.log_range(0.5, 6.0)), ("exponent", 2.0)], &[("peak", force)])
        }
        "command_saturation" => text(name, &[("limit", rng.range(2.0, 4.0) * base.dry / base.gain)], &[]),
        "cogging" => {
            let (cos, sin) = wave(force);
            text(name, &[turn, ("order_7", 7.0)], &[("cos_7", cos), ("sin_7", sin)])
        }
        "torque_ripple" => {
            let (cos, sin) = wave(rng.range(0.1, 0.3));
            text(name, &[turn, ("order_6", 6.0)], &[("cos_6", cos), ("sin_6", sin)])
        }
        "command_deadband" => text(name, &[("half_width", force / base.gain)], &[]),
        _ => text(name, &[], &[("coulomb_difference", force), ("viscous_difference", 0.0)]),
    }
}

/// A gap between the motor and a load that has a part of the machine's friction.
fn gap(base: &Base, rng: &mut Rng) -> String {
    let (ratio, dry) = (rng.range(0.3, 1.0), base.dry / base.inertia);
    text(
        "backlash",
        &[
            ("gap", rng.log_range(6.0, 30.0) / base.counts_per_unit),
            ("coast", rng.range(0.4, 0.9) * dry),
            ("contact_hz", rng.log_range(100.0, 250.0)),
            ("ratio", ratio),
            ("dry", dry),
            ("viscous", base.viscous / base.inertia),
            ("per_command", base.gain / base.inertia),
        ],
        &[("inertia_ratio", ratio * base.gain)],
    )
}

/// A force that no effect of the library is.
fn outside(base: &Base, rng: &mut Rng) -> String {
    let size = base.dry * rng.log_range(0.2, 0.6);
    let formula = match rng.below(3) {
        // An eddy-current brake.
        0 => format!("-2*a*(v/{0:.3})/(1 + (v/{0:.3})^2)", rng.log_range(3.0, 15.0)),
        // A drag that changes along the turn and grows with speed.
        1 => format!("-a*v/10*sin(q)^2*abs(v)/(abs(v) + {:.3})", rng.log_range(2.0, 8.0)),
        // A force that swings in time, whatever the axis does.
        _ => format!("a*sin({:.4}*t)", rng.log_range(2.0, 20.0)),
    };
    format!("[[effect]]\nname = \"formula\"\nformula = \"{formula}\"\ncoefficients = {{ a = {size:e} }}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: &str = "[model]\ninertia = 1e-6\nviscous = 1e-6\ncoulomb = 4e-4\n[actuator]\ngain = 1e-5\nlimit = 2048.0\n\
                       [encoder]\ncounts_per_unit = 636.6\n";

    #[test]
    fn every_drawn_plant_is_a_rig_that_can_be_run() {
        let base = Base::parse(RIG).expect("the text is whole");
        let mut seen = std::collections::BTreeSet::new();
        for index in 0..200 {
            let plant = draw(&base, 7, index);
            let rig = diagnosis::rig::Rig::parse(&plant.toml, "a plant").unwrap_or_else(|e| panic!("{e}"));
            let count = plant.names.len() + usize::from(plant.kind == Kind::Outside);
            assert_eq!(rig.effects.len(), count, "{}", plant.toml);
            for (effect, name) in rig.effects.iter().zip(&plant.names) {
                assert_eq!(effect.name.to_string(), *name);
            }
            assert!(plant.kind != Kind::Pair || plant.names[0] != plant.names[1]);
            seen.insert(plant.names.clone());
            assert_eq!(draw(&base, 7, index).toml, plant.toml, "a seed draws the same");
        }
        assert!(seen.len() > 15, "{seen:?}");
    }
}
