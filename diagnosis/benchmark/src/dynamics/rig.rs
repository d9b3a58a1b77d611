//! A rig file as the judge reads it, patched or not.

use std::collections::BTreeMap;

use toml::Value;

/// Numbers by name.
pub(crate) type Numbers = BTreeMap<String, f64>;

/// A force over one or two variables: straight between its places, level beyond its ends, the last
/// variable fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct InterpolatedForce {
    pub(crate) over: Vec<String>,
    pub(crate) grid: Vec<Vec<f64>>,
    pub(crate) force: Vec<f64>,
}

impl InterpolatedForce {
    /// The force at one value a variable.
    pub(crate) fn at(&self, values: &[f64]) -> f64 {
        // Every corner of the cell by its share of the way there.
        let (mut first, mut shares) = (vec![(0, 1.0)], Vec::new());
        for (places, value) in self.grid.iter().zip(values) {
            let above = places.partition_point(|p| p <= value).clamp(1, places.len() - 1);
            let (low, high) = (places[above - 1], places[above]);
            let part = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
            shares.clear();
            for (index, share) in &first {
                let row = index * places.len() + above;
                shares.extend([(row - 1, share * (1.0 - part)), (row, share * part)]);
            }
            std::mem::swap(&mut first, &mut shares);
        }
        first.iter().map(|(index, share)| share * self.force[*index]).sum()
    }

    fn parse(value: &Value) -> Result<Self, String> {
        let table = value.as_table().ok_or("an effect's `table` is no table")?;
        let list = |value: &Value| -> Vec<f64> {
            value.as_array().into_iter().flatten().filter_map(as_number).collect()
        };
        let array = |key: &str| table.get(key).and_then(Value::as_array).into_iter().flatten();
        let read = Self {
            over: array("over").filter_map(|v| v.as_str().map(String::from)).collect(),
            grid: array("grid").map(list).collect(),
            force: table.get("force").map(list).unwrap_or_default(),
        };
        let places: usize = read.grid.iter().map(Vec::len).product();
        let usable = !read.over.is_empty()
            && read.over.len() == read.grid.len()
            && read.grid.iter().all(|g| g.len() > 1)
            && read.force.len() == places;
        if usable { Ok(read) } else { Err("a table's over, grid and force do not go together".into()) }
    }
}

/// An effect of a patched rig.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) shape: Numbers,
    pub(crate) coefficients: Numbers,
    pub(crate) table: Option<InterpolatedForce>,
}

impl Entry {
    pub(crate) fn shape(&self, key: &str, otherwise: f64) -> f64 {
        self.shape.get(key).copied().unwrap_or(otherwise)
    }

    pub(crate) fn coefficient(&self, key: &str) -> f64 {
        self.coefficients.get(key).copied().unwrap_or(0.0)
    }

    pub(crate) fn is_set(&self, key: &str) -> bool {
        self.shape(key, 0.0) > 0.5
    }
}

/// The parts of a rig that the judge needs; units as in the contract.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rig {
    pub(crate) inertia: f64,
    pub(crate) viscous: Option<f64>,
    pub(crate) coulomb: Option<f64>,
    pub(crate) offset: Option<f64>,
    pub(crate) weight: Option<f64>,
    pub(crate) gain: f64,
    pub(crate) limit: f64,
    pub(crate) counts_per_unit: f64,
    /// Travel per turn; 2π where it is rotary, unknown where it is linear and not given.
    pub(crate) turn: Option<f64>,
    pub(crate) start_spread: Option<f64>,
    /// Relative standard deviations by name; absolute for the offset.
    pub(crate) uncertainty: Numbers,
    pub(crate) effects: Vec<Entry>,
}

impl Rig {
    /// Reads the text of a rig file.
    ///
    /// # Errors
    /// What is missing, without the file's name.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let table: toml::Table = text.parse().map_err(|e: toml::de::Error| e.message().to_string())?;
        let section = |name: &str| table.get(name).and_then(Value::as_table);
        let number = |name: &str, key: &str| section(name).and_then(|t| t.get(key)).and_then(as_number);
        let needed = |name: &str, key: &str| number(name, key).ok_or(format!("[{name}] has no `{key}`"));
        // What a linear rig says of neither is not in the equation of the judge.
        for key in ["gravity"] {
            if number("model", key).is_some_and(|x| x != 0.0) {
                return Err(format!("the judge has no term for `{key}`"));
            }
        }
        let rotary = table.get("kind").and_then(Value::as_str) == Some("rotary");
        let effects = table.get("effect").and_then(Value::as_array).into_iter().flatten();
        let entry = |value: &Value| {
            let t = value.as_table().ok_or("an [[effect]] is no table")?;
            Ok::<_, String>(Entry {
                name: t.get("name").and_then(Value::as_str).ok_or("an [[effect]] has no name")?.to_string(),
                shape: numbers(t.get("shape")),
                coefficients: numbers(t.get("coefficients")),
                table: t.get("table").map(InterpolatedForce::parse).transpose()?,
            })
        };
        Ok(Self {
            inertia: needed("model", "inertia")?,
            viscous: number("model", "viscous"),
            coulomb: number("model", "coulomb"),
            offset: number("model", "offset"),
            weight: number("model", "weight"),
            gain: needed("actuator", "gain")?,
            limit: number("actuator", "limit").unwrap_or(f64::INFINITY),
            counts_per_unit: needed("encoder", "counts_per_unit")?,
            turn: number("encoder", "turn").or(rotary.then_some(std::f64::consts::TAU)),
            start_spread: number("encoder", "start_spread"),
            uncertainty: numbers(table.get("uncertainty")),
            effects: effects.map(entry).collect::<Result<_, _>>()?,
        })
    }

    /// Relative standard deviation of a nominal value, or what is assumed where none is declared.
    pub(crate) fn sigma(&self, key: &str, otherwise: f64) -> f64 {
        self.uncertainty.get(key).copied().unwrap_or(otherwise).max(1e-4)
    }
}

fn as_number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(x) => Some(*x),
        Value::Integer(x) => Some(*x as f64),
        _ => None,
    }
}

fn numbers(value: Option<&Value>) -> Numbers {
    let table = value.and_then(Value::as_table);
    table.into_iter().flatten().filter_map(|(k, v)| Some((k.clone(), as_number(v)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patched_rig_is_read() {
        let text = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 2\ncoulomb = 0.1\n[uncertainty]\ncoulomb = 0.3\n\
            [actuator]\ngain = 0.5\n[encoder]\ncounts_per_unit = 1000\n\
            [[effect]]\nname = \"stribeck_friction\"\n[effect.shape]\nspeed = 3.0\n[effect.coefficients]\npeak = 0.2\n";
        let rig = Rig::parse(text).unwrap();
        assert_eq!((rig.inertia, rig.coulomb, rig.viscous), (2.0, Some(0.1), None));
        assert_eq!(rig.turn, Some(std::f64::consts::TAU));
        assert_eq!((rig.effects[0].shape("speed", 0.0), rig.effects[0].coefficient("peak")), (3.0, 0.2));
        assert_eq!((rig.sigma("coulomb", 0.5), rig.sigma("inertia", 0.1)), (0.3, 0.1));
        assert!(Rig::parse("[model]\n").unwrap_err().contains("inertia"));
        let table = format!(
            "{text}[[effect]]\nname = \"table\"\n[effect.table]\nover = [\"speed\"]\ngrid = [[0, 1]]\n"
        );
        assert!(Rig::parse(&table).unwrap_err().contains("do not go together"));
        let rig = Rig::parse(&(table + "force = [1, 3]\n")).unwrap();
        assert_eq!(rig.effects[1].table.as_ref().unwrap().at(&[0.25]), 1.5);
    }

    #[test]
    fn a_table_is_straight_between_its_places_and_level_beyond() {
        let table = InterpolatedForce {
            over: vec!["speed".into(), "time".into()],
            grid: vec![vec![0.0, 1.0], vec![-1.0, 1.0, 3.0]],
            force: vec![0.0, 2.0, 4.0, 10.0, 12.0, 14.0],
        };
        for (at, force) in [([0.0, 0.0], 1.0), ([0.5, 2.0], 8.0), ([7.0, 9.0], 14.0), ([-7.0, -9.0], 0.0)] {
            assert!((table.at(&at) - force).abs() < 1e-12, "{at:?}: {}", table.at(&at));
        }
        let jump = InterpolatedForce {
            over: vec!["speed".into()],
            grid: vec![vec![-1.0, 0.0, 0.0, 1.0]],
            force: vec![-2.0, -2.0, 2.0, 2.0],
        };
        assert_eq!([jump.at(&[-0.1]), jump.at(&[0.1])], [-2.0, 2.0]);
    }
}
