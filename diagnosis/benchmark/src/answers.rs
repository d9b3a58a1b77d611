//! Two programs on the same recordings: what differs between their answers, to the digit, by key.
//!
//! A change that is meant to leave the diagnosis as it is, is checked by its answers:
//! `diagnosis.json` is compared value by value, and `patched-rig.toml` as text. Where verdict or
//! names differ, the reasons that the two programs themselves give are told. Recordings come from
//! the generator, in the short form of the small run.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use crate::generator::case::build;
use crate::generator::files;
use crate::generator::spec::Spec;
use crate::options::Options;
use crate::pool;
use crate::scratch::Scratch;
use crate::tool::{Paths, Tool};

/// Recordings that are compared, unless `--cases` says otherwise.
pub(crate) const CASES: usize = 100;

/// A value that two answers do not share: its key, with `[]` for the place in a list, and both
/// values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Difference {
    pub(crate) key: String,
    pub(crate) before: String,
    pub(crate) after: String,
}

/// A recording with what differs between the answers of two programs.
struct Compared {
    name: String,
    differences: Vec<Difference>,
    /// The verdict and names that are other ones, each with the program's reason; none where they
    /// are the same.
    change: Option<String>,
}

/// Compares the answers of two programs on the first `count` of `specs` that can be built.
///
/// # Errors
/// One sentence: the number of recordings with other answers, or what could not be written.
pub(crate) fn run(
    options: &Options,
    specs: &[Spec],
    count: usize,
    [before, after]: [&dyn Tool; 2],
) -> Result<(), String> {
    let scratch = Scratch::new()?;
    let mut compared: Vec<Compared> = Vec::new();
    let mut rest = specs;
    while compared.len() < count && !rest.is_empty() {
        let (now, later) = rest.split_at(rest.len().min(count - compared.len()));
        rest = later;
        let found = pool::map(options.jobs, None, "comparing answers", now, |spec| {
            compare(spec, options.seed, [before, after], &scratch.0)
        });
        let found = found.into_iter().flatten().collect::<Result<Vec<_>, String>>()?;
        compared.extend(found.into_iter().flatten());
    }
    print!("{}", table(&compared));
    let other = compared.iter().filter(|one| !one.differences.is_empty()).count();
    match (compared.len(), other) {
        (0, _) => Err("no recording was drawn, so nothing was compared; leave out --only".into()),
        (_, 0) => Ok(()),
        (all, other) => Err(format!(
            "{other} of {all} recordings have other answers; the table above lists the keys that differ"
        )),
    }
}

/// Draws a recording, asks both programs and returns what differs; `None` if it cannot be built.
fn compare(
    spec: &Spec,
    seed: u64,
    tools: [&dyn Tool; 2],
    scratch: &Path,
) -> Result<Option<Compared>, String> {
    let Some(case) = build(spec, seed, true) else { return Ok(None) };
    let dir = scratch.join(spec.name());
    let paths = files::write_case(&case, &dir).map_err(|e| format!("cannot write {}: {e}", dir.display()))?;
    let [before, after] = [0, 1].map(|i| answer(tools[i], &paths, &dir.join(format!("answer-{i}"))));
    let (before, after) = (before?, after?);
    std::fs::remove_dir_all(&dir).map_err(|e| format!("cannot remove {}: {e}", dir.display()))?;
    let (differences, change) = (differences(&before, &after), change(&before, &after));
    Ok(Some(Compared { name: spec.name(), differences, change }))
}

/// Returns what became of verdict and names, each with the program's own reason; none where they
/// are the same.
fn change(before: &Value, after: &Value) -> Option<String> {
    let [was, is] = [before, after].map(names);
    let gone = was.iter().filter(|name| !is.contains(name));
    let new = is.iter().filter(|name| !was.contains(name));
    let mut said: Vec<String> =
        gone.map(|name| format!("{name} is not named any more ({})", refused(after, name))).collect();
    said.extend(new.map(|name| format!("{name} is named (before: {})", refused(before, name))));
    let [was, is] = [before, after].map(verdict);
    if was != is {
        said.push(format!("{was} → {is}"));
    }
    (!said.is_empty()).then(|| said.join("; "))
}

/// The names that an answer gives.
fn names(answer: &Value) -> Vec<&str> {
    let effects = answer["effects"].as_array().into_iter().flatten();
    effects.filter_map(|effect| effect["name"].as_str()).collect()
}

/// The verdict of an answer with its reason; the sentence of a program that refused.
fn verdict(answer: &Value) -> String {
    match (answer["failed"].as_str(), answer["verdict"].as_str(), answer["reason"].as_str()) {
        (Some(sentence), _, _) => format!("refused: {sentence}"),
        (None, verdict, None) => verdict.unwrap_or("no verdict").to_owned(),
        (None, verdict, Some(reason)) => format!("{}: {reason}", verdict.unwrap_or("no verdict")),
    }
}

/// The reason for which an answer does not give a name.
fn refused<'a>(answer: &'a Value, name: &str) -> &'a str {
    let reason = |list: &str, key: &str| {
        let all = answer[list].as_array()?;
        all.iter().find(|one| one["name"] == name)?[key].as_str()
    };
    reason("hypotheses", "rejected_because")
        .or_else(|| reason("untested", "because"))
        .unwrap_or("not looked for")
}

/// Returns the files of an answer as one value; of a program that fails, its sentence.
fn answer(tool: &dyn Tool, paths: &Paths, out: &Path) -> Result<Value, String> {
    std::fs::create_dir_all(out).map_err(|e| format!("cannot create {}: {e}", out.display()))?;
    if let Err(said) = tool.diagnose(paths, out) {
        return Ok(serde_json::json!({ "failed": said }));
    }
    let read = |name: &str| {
        let file = out.join(name);
        std::fs::read_to_string(&file).map_err(|e| format!("cannot read {}: {e}", file.display()))
    };
    let mut value: Value =
        serde_json::from_str(&read("diagnosis.json")?).map_err(|e| format!("diagnosis.json: {e}"))?;
    value["patched-rig.toml"] = read("patched-rig.toml").map_or(Value::Null, Value::String);
    Ok(value)
}

/// Returns every value that differs between two answers.
pub(crate) fn differences(before: &Value, after: &Value) -> Vec<Difference> {
    let mut found = Vec::new();
    walk("", before, after, &mut found);
    found
}

fn walk(key: &str, before: &Value, after: &Value, found: &mut Vec<Difference>) {
    match (before, after) {
        (Value::Object(a), Value::Object(b)) => {
            let keys: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for name in keys {
                let below = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                let [a, b] = [a, b].map(|object| object.get(name).unwrap_or(&Value::Null));
                walk(&below, a, b, found);
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            for i in 0..a.len().max(b.len()) {
                let [a, b] = [a, b].map(|list| list.get(i).unwrap_or(&Value::Null));
                walk(&format!("{key}[]"), a, b, found);
            }
        }
        (a, b) if a != b => {
            found.push(Difference { key: key.to_owned(), before: a.to_string(), after: b.to_string() });
        }
        _ => {}
    }
}

/// The longest text of a value in the table, in characters.
const WIDEST: usize = 60;

/// Returns one line for each key that differs: on how many recordings, and the first of them with
/// both values; then one for each recording whose verdict or names differ.
fn table(compared: &[Compared]) -> String {
    let mut keys: BTreeMap<&str, (Vec<&str>, &Difference)> = BTreeMap::new();
    for Compared { name, differences, .. } in compared {
        for one in differences {
            let (names, _) = keys.entry(&one.key).or_insert((Vec::new(), one));
            if names.last() != Some(&name.as_str()) {
                names.push(name);
            }
        }
    }
    let mut out = String::new();
    let short = |text: &str| {
        let shown: String = text.chars().take(WIDEST).collect();
        if shown.len() < text.len() { shown + "…" } else { shown }
    };
    for (key, (names, first)) in &keys {
        let (before, after) = (short(&first.before), short(&first.after));
        let _ = writeln!(out, "{key}: {} recordings, first {}: {before} → {after}", names.len(), names[0]);
    }
    let changed = compared.iter().filter_map(|one| Some((&one.name, one.change.as_ref()?)));
    for (name, change) in changed.clone() {
        let _ = writeln!(out, "{name}: {change}");
    }
    let (all, same) = (compared.len(), compared.iter().filter(|one| one.differences.is_empty()).count());
    let _ = writeln!(out, "the same verdict and names on {} of {all} recordings", all - changed.count());
    let _ = writeln!(out, "the same answers, to the digit, on {same} of {all} recordings");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::{Amounts, list};
    use serde_json::json;

    /// A program that answers one text, whatever it is asked.
    struct Says(&'static str);

    impl Tool for Says {
        fn diagnose(&self, paths: &Paths, out: &Path) -> Result<(), String> {
            assert!(paths.rig.is_file() && paths.fit.iter().chain(&paths.holdout).all(|p| p.is_file()));
            std::fs::write(out.join("diagnosis.json"), self.0).map_err(|e| e.to_string())
        }
    }

    #[test]
    fn a_changed_digit_is_found_by_its_key() {
        let before = json!({ "a": 1, "effects": [{ "value": 0.1 }, { "value": 0.123_456_789_012_345_6 }] });
        let after = json!({ "a": 1, "effects": [{ "value": 0.1 }, { "value": 0.123_456_789_012_345_7 }] });
        assert_eq!(differences(&before, &before), []);
        let found = differences(&before, &after);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].key, "effects[].value");
        assert_ne!(found[0].before, found[0].after);
        let one = |name: &str, differences| Compared { name: name.into(), differences, change: None };
        let said = table(&[one("case-1", Vec::new()), one("case-2", found)]);
        assert!(
            said.starts_with("effects[].value: 1 recordings, first case-2: 0.1234567890123456 → "),
            "{said}"
        );
        assert!(said.ends_with("on 1 of 2 recordings\n"), "{said}");
    }

    #[test]
    fn another_name_is_told_with_both_programs_reasons() {
        let refused = |name: &str, why: &str| json!([{ "name": name, "rejected_because": why }]);
        let named = |name: &str| json!([{ "name": name, "value": 0.1 }]);
        let before = json!({ "verdict": "mismatch", "effects": named("cogging"),
            "hypotheses": refused("gain_drift", "it gains too little") });
        let after = json!({ "verdict": "mismatch", "effects": named("gain_drift"),
            "hypotheses": refused("cogging", "the travel is too short") });
        assert_eq!(
            change(&before, &after).as_deref(),
            Some(
                "cogging is not named any more (the travel is too short); gain_drift is named (before: it gains too little)"
            )
        );
        let refusal = json!({ "failed": "fit.csv is at rest" });
        let said = change(&before, &refusal).expect("the verdict is another one");
        assert!(said.ends_with("mismatch → refused: fit.csv is at rest"), "{said}");
        assert_eq!(change(&before, &before), None);
    }

    #[test]
    fn a_missing_key_and_a_longer_list_are_differences() {
        let keys = |before: Value, after: Value| -> Vec<String> {
            differences(&before, &after).into_iter().map(|one| one.key).collect()
        };
        assert_eq!(keys(json!({ "a": 1 }), json!({ "b": 1 })), ["a", "b"]);
        assert_eq!(keys(json!({ "a": [1] }), json!({ "a": [1, 2, 3] })), ["a[]", "a[]"]);
        assert_eq!(keys(json!({ "a": 1 }), json!({ "a": "1" })), ["a"]);
    }

    #[test]
    fn programs_are_compared_on_drawn_recordings() {
        let specs = list(Amounts::quick(), 3);
        let options = Options { jobs: 1, seed: 3, ..Options::default() };
        let (one, other) = (Says(r#"{"verdict": "no_mismatch"}"#), Says(r#"{"verdict": "unexplained"}"#));
        assert_eq!(run(&options, &specs, 2, [&one, &one]), Ok(()));
        let error = run(&options, &specs, 2, [&one, &other]).unwrap_err();
        assert!(error.starts_with("2 of 2 recordings have other answers"), "{error}");
        assert!(run(&options, &[], 2, [&one, &one]).is_err(), "nothing compared is no success");
    }
}
