//! Folders of cases that somebody else made, with their layout (`docs/design/benchmark.md`).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::expected_answer::{self, ExpectedAnswer};
use crate::key::Key;
use crate::tool::Paths;

/// The truth about a case: a generator's key, or the belief about a machine.
#[derive(Clone, Debug)]
pub(crate) enum Truth {
    Known(Key),
    Believed(ExpectedAnswer),
}

/// One case of a folder.
#[derive(Clone, Debug)]
pub(crate) struct ExternalCase {
    pub(crate) id: String,
    pub(crate) paths: Paths,
    pub(crate) truth: Truth,
}

/// Finds the cases of `top`, in the order of their names.
///
/// # Errors
/// One sentence: what is missing or cannot be read, and where.
pub(crate) fn find(top: &Path) -> Result<Vec<ExternalCase>, String> {
    let inner = top.join("cases");
    let cases = if inner.is_dir() { inner } else { top.to_path_buf() };
    let keys = keys(top)?;
    let mut found = BTreeMap::new();
    let entries =
        std::fs::read_dir(&cases).map_err(|e| format!("cannot read the folder {}: {e}", cases.display()))?;
    for entry in entries.flatten() {
        let path = entry.path();
        if path.join("rig.toml").is_file() {
            found.insert(entry.file_name().to_string_lossy().into_owned(), path);
        }
    }
    if found.is_empty() {
        return Err(format!(
            "{} holds no case: a case is a folder with rig.toml, fit*.csv and holdout*.csv",
            cases.display()
        ));
    }
    if let Some(id) = keys.keys().find(|id| !found.contains_key(*id)) {
        return Err(format!("the key lists `{id}`, and {} has no such case", cases.display()));
    }
    found.into_iter().map(|(id, path)| case(&id, &path, &keys)).collect()
}

fn case(id: &str, path: &Path, keys: &BTreeMap<String, Truth>) -> Result<ExternalCase, String> {
    let truth =
        keys.get(id).cloned().ok_or_else(|| format!("the key does not list the case {}", path.display()))?;
    Ok(ExternalCase { id: id.into(), paths: paths(path)?, truth })
}

/// The files of the case in a folder. Where no recording is named `fit*` or `holdout*`, the last in
/// the order of their names judges and the others are fitted.
///
/// # Errors
/// One sentence: what is missing or cannot be read.
pub(crate) fn paths(path: &Path) -> Result<Paths, String> {
    let (mut fit, mut holdout, mut others) = (Vec::new(), Vec::new(), Vec::new());
    let entries = std::fs::read_dir(path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        match name.ends_with(".csv") {
            true if name.starts_with("fit") => fit.push(entry.path()),
            true if name.starts_with("holdout") => holdout.push(entry.path()),
            true => others.push(entry.path()),
            false => {}
        }
    }
    [&mut fit, &mut holdout, &mut others].into_iter().for_each(|list| list.sort());
    if fit.is_empty() && holdout.is_empty() && others.len() > 1 {
        holdout.extend(others.pop());
        fit = others;
    }
    if fit.is_empty() || holdout.is_empty() {
        return Err(format!(
            "{} needs fit*.csv and holdout*.csv, at least one of each, or two recordings of other names",
            path.display()
        ));
    }
    Ok(Paths { rig: path.join("rig.toml"), fit, holdout })
}

/// The beliefs about the machines of a folder, by case; none where it has no `believed.tsv`.
///
/// # Errors
/// One sentence: what cannot be read, and where.
pub(crate) fn beliefs(top: &Path) -> Result<BTreeMap<String, ExpectedAnswer>, String> {
    let path = top.join("believed.tsv");
    if !path.is_file() {
        return Ok(BTreeMap::new());
    }
    let text = std::fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    let list = expected_answer::parse(&text).map_err(|e| format!("{}, {e}", path.display()))?;
    Ok(list.into_iter().collect())
}

fn keys(top: &Path) -> Result<BTreeMap<String, Truth>, String> {
    let read = |path: &PathBuf| {
        std::fs::read_to_string(path).map_err(|e| format!("cannot read {}: {e}", path.display()))
    };
    let (key, believed) = (top.join("key.json"), top.join("believed.tsv"));
    if key.is_file() {
        let value: Value =
            serde_json::from_str(&read(&key)?).map_err(|e| format!("{}: {e}", key.display()))?;
        let cases = value["cases"].as_object().ok_or_else(|| format!("{} has no `cases`", key.display()))?;
        let one = |(id, value): (&String, &Value)| {
            let known = Key::read(value).map_err(|e| format!("{}, case {id}: {e}", key.display()))?;
            Ok((id.clone(), Truth::Known(known)))
        };
        return cases.iter().map(one).collect();
    }
    if believed.is_file() {
        return Ok(beliefs(top)?.into_iter().map(|(id, belief)| (id, Truth::Believed(belief))).collect());
    }
    Err(format!(
        "{} has neither key.json nor believed.tsv, so its cases cannot be judged; docs/design/benchmark.md describes the format",
        top.display()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_folder_lacks_is_said() {
        let top = std::env::temp_dir().join(format!("proof-folder-{}", std::process::id()));
        let case = top.join("cases/a");
        std::fs::create_dir_all(&case).unwrap();
        let says = |what: &str| {
            let error = find(&top).unwrap_err();
            assert!(error.contains(what), "{error}");
        };
        says("neither key.json");
        std::fs::write(top.join("key.json"), r#"{"cases": {"a": {"kind": "null"}}}"#).unwrap();
        says("holds no case");
        std::fs::write(case.join("rig.toml"), "").unwrap();
        says("needs fit*.csv");
        for name in ["fit.csv", "fit2.csv", "holdout.csv", "notes.csv"] {
            std::fs::write(case.join(name), "").unwrap();
        }
        let found = find(&top).unwrap();
        assert_eq!((found.len(), found[0].paths.fit.len(), found[0].paths.holdout.len()), (1, 2, 1));
        ["fit.csv", "fit2.csv"].iter().for_each(|name| std::fs::remove_file(case.join(name)).unwrap());
        says("needs fit*.csv");
        std::fs::write(top.join("key.json"), r#"{"cases": {"b": {"kind": "null"}}}"#).unwrap();
        says("`b`");
        std::fs::remove_dir_all(&top).unwrap();
    }

    #[test]
    fn of_recordings_of_other_names_the_last_judges() {
        let top = std::env::temp_dir().join(format!("proof-names-{}", std::process::id()));
        std::fs::create_dir_all(&top).unwrap();
        for name in ["train.csv", "pulses.csv", "slow.csv", "rig.toml"] {
            std::fs::write(top.join(name), "").unwrap();
        }
        let Paths { fit, holdout, .. } = paths(&top).unwrap();
        assert_eq!(fit, [top.join("pulses.csv"), top.join("slow.csv")]);
        assert_eq!(holdout, [top.join("train.csv")]);
        std::fs::remove_dir_all(&top).unwrap();
    }
}
