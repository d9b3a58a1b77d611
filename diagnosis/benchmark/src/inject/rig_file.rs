//! The rig file of a carrier: the numbers that the concealing needs, and its text, in which single
//! values can be changed.

use toml::{Table, Value};

/// A rig file. Units as in the contract.
#[derive(Clone, Debug, Default)]
pub(crate) struct RigFile {
    pub(crate) text: String,
    pub(crate) rotary: bool,
    pub(crate) inertia: f64,
    pub(crate) viscous: Option<f64>,
    pub(crate) coulomb: Option<f64>,
    pub(crate) weight: Option<f64>,
    /// Amplitude and zero (rad) of a gravity over absolute counts.
    pub(crate) gravity: Option<(f64, f64)>,
    pub(crate) gain: f64,
    pub(crate) limit: Option<f64>,
    pub(crate) counts_per_unit: f64,
    /// Travel per turn of the motor, rad or m.
    pub(crate) turn: Option<f64>,
    pub(crate) absolute: bool,
    pub(crate) start_spread: Option<f64>,
    /// Delay and lag between command and force that the rig knows, s.
    pub(crate) late_s: f64,
}

impl RigFile {
    /// Reads the text of a rig file.
    ///
    /// # Errors
    /// What is missing, without the file's name.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let table: Table = text.parse().map_err(|e: toml::de::Error| e.message().to_string())?;
        let value = |section: &str, key: &str| table.get(section).and_then(|s| s.get(key));
        let number = |section: &str, key: &str| match value(section, key) {
            Some(Value::Float(x)) => Some(*x),
            Some(Value::Integer(x)) => Some(*x as f64),
            _ => None,
        };
        let needed =
            |section: &str, key: &str| number(section, key).ok_or(format!("[{section}] has no `{key}`"));
        let rotary = table.get("kind").and_then(Value::as_str) == Some("rotary");
        let zero = number("model", "gravity_zero").unwrap_or(0.0);
        Ok(Self {
            text: text.into(),
            rotary,
            inertia: needed("model", "inertia")?,
            viscous: number("model", "viscous"),
            coulomb: number("model", "coulomb"),
            weight: number("model", "weight"),
            gravity: number("model", "gravity").map(|g| (g, zero)),
            gain: needed("actuator", "gain")?,
            limit: number("actuator", "limit"),
            counts_per_unit: needed("encoder", "counts_per_unit")?,
            turn: number("encoder", "turn").or(rotary.then_some(std::f64::consts::TAU)),
            absolute: value("encoder", "absolute").and_then(Value::as_bool) == Some(true),
            start_spread: number("encoder", "start_spread"),
            late_s: ["delay_s", "lag_s"].iter().filter_map(|key| number("actuator", key)).sum(),
        })
    }

    /// The text with another value for a key of a section; unchanged where the key is missing.
    pub(crate) fn text_with(&self, section: &str, key: &str, value: f64) -> String {
        let mut inside = String::new();
        let mut out = String::with_capacity(self.text.len());
        for line in self.text.lines() {
            let bare = line.trim();
            if bare.starts_with('[') {
                inside = bare.trim_matches(['[', ']']).trim().to_string();
            }
            let named = line.split_once('=').is_some_and(|(name, _)| name.trim() == key);
            if inside == section && named {
                out += &format!("{key} = {value:e}\n");
            } else {
                out += line;
                out.push('\n');
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_value_asked_for_changes() {
        let text = "kind = \"rotary\"\n[model]\ninertia = 2\ncoulomb = 0.5 # N·m\n[uncertainty]\ncoulomb = 0.3\n\
            [actuator]\ngain = 0.1\ndelay_s = 0.01\n[encoder]\ncounts_per_unit = 100\n";
        let rig = RigFile::parse(text).unwrap();
        assert_eq!((rig.coulomb, rig.viscous, rig.late_s), (Some(0.5), None, 0.01));
        let raised = RigFile::parse(&rig.text_with("model", "coulomb", 0.75)).unwrap();
        assert_eq!(raised.coulomb, Some(0.75));
        assert!(raised.text.contains("[uncertainty]\ncoulomb = 0.3\n"));
        assert!(RigFile::parse("[model]\ninertia = 1\n").unwrap_err().contains("gain"));
    }
}
