//! The keys of a rig file: one that is misspelt is named with the nearest that is known.

/// Tables and their keys, as docs/guide/files.md has them.
const KEYS: [(&str, &[&str]); 5] = [
    ("", &["format", "name", "kind", "model", "uncertainty", "actuator", "encoder", "effect"]),
    ("model", &["inertia", "viscous", "coulomb", "offset", "weight", "gravity", "gravity_zero"]),
    ("uncertainty", &["inertia", "viscous", "coulomb", "offset", "weight", "gravity", "gain"]),
    ("actuator", &["gain", "command_unit", "limit", "delay_s", "lag_s"]),
    ("encoder", &["counts_per_unit", "absolute", "noise_counts", "filter_s", "turn", "start_spread"]),
];

/// Changes of a letter that lead from one word to another (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut before = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let here = (before + usize::from(x != *y)).min(row[j] + 1).min(row[j + 1] + 1);
            before = std::mem::replace(&mut row[j + 1], here);
        }
    }
    row[b.len()]
}

/// A sentence on the first key that is not known; none where all are.
pub(crate) fn unknown(rig: &toml::Table) -> Option<String> {
    for (table, keys) in KEYS {
        let inside: Vec<&toml::Table> = match (table, rig.get(table)) {
            ("", _) => vec![rig],
            (_, Some(toml::Value::Table(inside))) => vec![inside],
            _ => continue,
        };
        let found = inside.iter().flat_map(|t| t.keys()).find(|key| !keys.contains(&key.as_str()));
        let Some(key) = found else { continue };
        let place = |table: &str| if table.is_empty() { String::new() } else { format!("[{table}] ") };
        // In its own table first, then in the others: a key under the wrong heading.
        let near = |keys: &'static [&'static str]| {
            keys.iter()
                .map(|known| (distance(key, known), *known))
                .min()
                .filter(|(d, k)| 2 * d <= k.len().max(2))
        };
        let elsewhere = KEYS.iter().filter(|(other, _)| *other != table);
        let hint =
            near(keys).map(|(_, known)| format!("do you mean {}{known}", place(table))).or_else(|| {
                elsewhere
                    .filter_map(|(other, keys)| {
                        near(keys).filter(|(d, _)| *d == 0).map(|(_, known)| (other, known))
                    })
                    .next()
                    .map(|(other, known)| format!("it belongs in {}, as {known}", place(other).trim()))
            });
        let hint = hint.unwrap_or_else(|| format!("known are {}", keys.join(", ")));
        return Some(format!("{}{key} is not a key of a rig file; {hint}", place(table)));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the documentation has every key, and can be read.
    #[test]
    fn the_documented_rig_has_every_key() {
        let page = include_str!("../../../docs/guide/files.md");
        let example = page.split("```").nth(1).and_then(|block| block.strip_prefix("toml"));
        let rig =
            crate::rig::Rig::parse(example.expect("a rig"), "docs/guide/files.md").expect("it can be read");
        assert_eq!(rig.effects.len(), 1);
        let table: toml::Table = example.expect("a rig").parse().expect("it is TOML");
        for (name, keys) in KEYS {
            let inside = if name.is_empty() { &table } else { table[name].as_table().expect("a table") };
            let missing = keys.iter().find(|key| !inside.contains_key(**key));
            assert_eq!(missing, None, "[{name}]");
        }
    }

    #[test]
    fn a_misspelt_or_misplaced_key_is_named_with_the_right_one() {
        let said = |text: &str| unknown(&text.parse().expect("it is TOML"));
        assert_eq!(said("format = 1\n[model]\ninertia = 1.0\nviscous = 2.0"), None);
        assert_eq!(
            said("[model]\nviscos = 2.0").as_deref(),
            Some("[model] viscos is not a key of a rig file; do you mean [model] viscous")
        );
        assert_eq!(
            said("[model]\ncounts_per_unit = 2.0").as_deref(),
            Some(
                "[model] counts_per_unit is not a key of a rig file; it belongs in [encoder], as counts_per_unit"
            )
        );
        assert!(
            said("[actuator]\ncolour = 2").is_some_and(|s| s.contains("known are gain, command_unit, limit"))
        );
    }
}
