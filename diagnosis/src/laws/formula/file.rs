//! A file of formulas, as `--effects` takes it.

use super::{Formula, FormulaText};
use crate::laws::EffectName;
use serde::Deserialize;
use std::collections::BTreeMap;

/// A file of effects for `--effects`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    effect: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    formula: String,
    #[serde(default)]
    parameters: BTreeMap<String, [f64; 2]>,
    #[serde(default)]
    words: String,
}

/// Reads the text of a file of effects; a reason with its place where it cannot be used.
pub(crate) fn read_effects(text: &str, file: &str) -> Result<Vec<EffectName>, String> {
    let read: File = toml::from_str(text).map_err(|cause| {
        let line =
            cause.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
        format!("{file}, line {line}: {}; give [[effect]] with name, formula and parameters", cause.message())
    })?;
    let register = |entry: Entry| {
        let Entry { name: title, formula, parameters, words } = entry;
        let shown = title.clone();
        Formula::register(FormulaText { title, formula, parameters, words })
            .map_err(|reason| format!("{file}, effect {shown}: {reason}"))
    };
    read.effect.into_iter().map(register).collect()
}
