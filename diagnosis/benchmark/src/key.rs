//! The key of a case, as its author wrote it, and its file format: `docs/design/benchmark.md`.
//!
//! Whoever generates cases, this project or others, hands the judge these and nothing else.

use serde_json::{Map, Value, json};

/// The kind of a case, which determines the right answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Category {
    /// One effect: name it, or a class of three at most that holds it.
    Single,
    /// Two effects: both, and none else.
    Pair,
    /// Three effects: two of them at least, and none else.
    Triple,
    /// The nominal model itself with noise: no name.
    Null,
    /// The nominal model itself under a strong disturbance: no name.
    Disturbance,
    /// Right structure, wrong values: no name.
    ParametersOnly,
    /// Physics that has no name: no name.
    Outside,
    /// Recordings that do not suffice for a verdict: a class with the truth in it, or no name.
    CannotTell,
}

impl Category {
    /// All of them, in the order of the tables.
    pub(crate) const ALL: [Self; 8] = [
        Self::Single,
        Self::Pair,
        Self::Triple,
        Self::Null,
        Self::Disturbance,
        Self::ParametersOnly,
        Self::Outside,
        Self::CannotTell,
    ];

    /// The word for it in key files and tables.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Single => "effect",
            Self::Pair => "pair",
            Self::Triple => "triple",
            Self::Null => "null",
            Self::Disturbance => "disturbance",
            Self::ParametersOnly => "params",
            Self::Outside => "unknown",
            Self::CannotTell => "insufficient",
        }
    }

    /// Other words that `--only` and key files may use.
    fn aliases(self) -> &'static [&'static str] {
        match self {
            Self::Single => &["single"],
            Self::ParametersOnly => &["parameters_only"],
            Self::Outside => &["outside"],
            Self::CannotTell => &["cannot_tell"],
            _ => &[],
        }
    }

    /// True if `text` is part of one of its words.
    pub(crate) fn matches(self, text: &str) -> bool {
        self.word().contains(text) || self.aliases().iter().any(|alias| alias.contains(text))
    }

    fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|c| c.word() == word || c.aliases().contains(&word))
    }
}

/// The residual of the true model on the held-out recordings, and the way to measure it: both
/// residuals go twice through a Butterworth low-pass of second order, rows at rest do not count.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Oracle {
    /// Rms of the noise alone, N·m or N.
    pub(crate) floor: f64,
    /// Rms that the refitted nominal structure leaves, noise included, N·m or N.
    pub(crate) refit: f64,
    /// Corners of the two low-passes, Hz.
    pub(crate) filters_hz: [f64; 2],
    /// From the start of the recording, not judged, s.
    pub(crate) skip_s: f64,
    /// Times at rest, not judged, s.
    pub(crate) still_s: Vec<[f64; 2]>,
}

/// A true value of a parameter that the contract names.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Parameter {
    /// The effect that it belongs to.
    pub(crate) effect: String,
    /// The contract's name of it.
    pub(crate) name: String,
    pub(crate) value: f64,
    /// The unit has force in it: a tool knows it only up to the gain that it believes.
    pub(crate) force: bool,
}

/// The hidden truth about a case.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Key {
    pub(crate) category: Category,
    /// Contract names of the hidden effects; empty where nothing is hidden or what is has no name.
    pub(crate) effects: Vec<String>,
    /// The author's word for physics without a name.
    pub(crate) unknown: Option<String>,
    /// The tool has a detector for this kind: it is no longer outside, and is counted apart.
    pub(crate) detector: bool,
    /// It does not repeat from recording to recording.
    pub(crate) random: bool,
    /// Effect over noise as asked for; zero where nothing is hidden.
    pub(crate) strength: f64,
    /// The strength reached, if the author gives it.
    pub(crate) snr: Option<f64>,
    /// The reason why the recordings cannot decide: `hidden` or `twin`.
    pub(crate) poverty: Option<String>,
    /// The machine in a few words.
    pub(crate) rig: String,
    pub(crate) oracle: Option<Oracle>,
    pub(crate) parameters: Vec<Parameter>,
    /// True gain of the drive, for parameters with force in their unit.
    pub(crate) true_gain: Option<f64>,
    /// True inertia, the scale of the oracle's forces.
    pub(crate) true_inertia: Option<f64>,
}

impl Key {
    /// A key that holds a category and nothing else.
    pub(crate) fn of(category: Category) -> Self {
        Self {
            category,
            effects: Vec::new(),
            unknown: None,
            detector: false,
            random: false,
            strength: 0.0,
            snr: None,
            poverty: None,
            rig: String::new(),
            oracle: None,
            parameters: Vec::new(),
            true_gain: None,
            true_inertia: None,
        }
    }

    /// Returns the hidden effects, in words.
    pub(crate) fn hidden(&self) -> String {
        match &self.unknown {
            Some(unknown) => unknown.clone(),
            None if self.effects.is_empty() => "nothing".into(),
            None => self.effects.join(" + "),
        }
    }

    /// Reads one entry of `cases` in a `key.json`.
    ///
    /// # Errors
    /// What is missing or not usable, without the name of the file.
    pub(crate) fn read(value: &Value) -> Result<Self, String> {
        let word = value["kind"].as_str().ok_or("it has no `kind`")?;
        let category = Category::from_word(word).ok_or_else(|| {
            let all: Vec<&str> = Category::ALL.iter().map(|c| c.word()).collect();
            format!("`kind` is \"{word}\"; it is one of {}", all.join(", "))
        })?;
        let effects: Vec<String> = value["effects"]
            .as_array()
            .map(|list| list.iter().filter_map(|v| v.as_str().map(String::from)).collect())
            .unwrap_or_default();
        let wanted = match category {
            Category::Single | Category::CannotTell => 1,
            Category::Pair => 2,
            Category::Triple => 3,
            _ => 0,
        };
        if effects.len() < wanted {
            return Err(format!("a case of kind \"{word}\" needs {wanted} names in `effects`"));
        }
        let text = |key: &str| value[key].as_str().map(String::from);
        let unknown = text("unknown");
        if category == Category::Outside && unknown.is_none() {
            return Err("a case of kind \"unknown\" needs the author's word for it in `unknown`".into());
        }
        Ok(Self {
            category,
            effects: if category == Category::Outside { Vec::new() } else { effects },
            unknown,
            detector: value["detector"].as_bool().unwrap_or(false),
            random: value["repeatable"].as_bool() == Some(false),
            strength: value["strength"].as_f64().unwrap_or(0.0),
            snr: value["snr"].as_f64(),
            poverty: text("poverty"),
            rig: text("rig").or_else(|| text("rig_kind")).unwrap_or_default(),
            oracle: oracle(&value["oracle"]),
            parameters: parameters(&value["truth"]),
            true_gain: value["true"]["gain"].as_f64(),
            true_inertia: value["true"]["inertia"].as_f64(),
        })
    }

    /// The same as [`Key::read`] reads it.
    pub(crate) fn to_json(&self) -> Value {
        let mut map = Map::new();
        map.insert("kind".into(), json!(self.category.word()));
        map.insert("effects".into(), json!(self.effects));
        map.insert("strength".into(), json!(self.strength));
        let mut put = |name: &str, value: Value| {
            if !value.is_null() {
                map.insert(name.into(), value);
            }
        };
        put("unknown", json!(self.unknown));
        put("snr", json!(self.snr));
        put("poverty", json!(self.poverty));
        put("rig", json!(self.rig));
        put("true", json!({ "gain": self.true_gain, "inertia": self.true_inertia }));
        if self.detector {
            put("detector", json!(true));
        }
        if self.random {
            put("repeatable", json!(false));
        }
        if let Some(o) = &self.oracle {
            let oracle = json!({
                "floor": o.floor, "refit": o.refit, "filters_hz": o.filters_hz, "skip_s": o.skip_s, "still_s": o.still_s,
            });
            put("oracle", oracle);
        }
        let truth: Vec<Value> = self
            .parameters
            .iter()
            .map(|p| json!({ "effect": p.effect, "parameter": p.name, "value": p.value, "force": p.force }))
            .collect();
        put("truth", json!(truth));
        Value::Object(map)
    }
}

fn oracle(value: &Value) -> Option<Oracle> {
    let pair = |v: &Value| Some([v[0].as_f64()?, v[1].as_f64()?]);
    Some(Oracle {
        floor: value["floor"].as_f64()?,
        refit: value["refit"].as_f64()?,
        filters_hz: pair(&value["filters_hz"])?,
        skip_s: value["skip_s"].as_f64().unwrap_or(0.0),
        still_s: value["still_s"].as_array().into_iter().flatten().filter_map(pair).collect(),
    })
}

fn parameters(value: &Value) -> Vec<Parameter> {
    let one = |v: &Value| {
        Some(Parameter {
            effect: v["effect"].as_str()?.into(),
            name: v["parameter"].as_str()?.into(),
            value: v["value"].as_f64()?,
            force: v["force"].as_bool().unwrap_or(false),
        })
    };
    value.as_array().into_iter().flatten().filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_survives_its_file() {
        let key = Key {
            effects: vec!["cogging".into()],
            strength: 3.0,
            snr: Some(2.9),
            rig: "needle drive, 10000 Hz".into(),
            oracle: Some(Oracle {
                floor: 1e-5,
                refit: 3e-5,
                filters_hz: [100.0, 40.0],
                skip_s: 0.1,
                still_s: vec![[1.0, 2.0]],
            }),
            parameters: vec![Parameter {
                effect: "cogging".into(),
                name: "rms".into(),
                value: 2e-5,
                force: true,
            }],
            true_gain: Some(0.02),
            true_inertia: Some(3e-6),
            ..Key::of(Category::Single)
        };
        assert_eq!(Key::read(&key.to_json()), Ok(key));
    }

    #[test]
    fn what_a_key_lacks_is_said() {
        assert!(Key::read(&json!({})).unwrap_err().contains("kind"));
        assert!(Key::read(&json!({"kind": "effekt"})).unwrap_err().contains("effect, pair"));
        assert!(Key::read(&json!({"kind": "pair", "effects": ["cogging"]})).unwrap_err().contains("2 names"));
        assert!(Key::read(&json!({"kind": "unknown"})).unwrap_err().contains("`unknown`"));
        let second =
            json!({"kind": "unknown", "unknown": "unk_relay", "repeatable": false, "effects": ["x"]});
        let key = Key::read(&second).unwrap();
        assert!(key.random && key.effects.is_empty());
    }
}
