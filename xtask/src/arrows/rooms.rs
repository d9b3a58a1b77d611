//! The rooms of the repository, its top folders, and which room's crates may use which: a crate
//! belongs to whom it serves, and no arrow leads back.

use super::krate;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

/// A room and the rooms below it; each may use itself.
const BELOW: [(&str, &[&str]); 7] = [
    ("control-core", &[]),
    ("link", &["control-core"]),
    ("firmware", &["control-core", "link"]),
    ("diagnosis", &[]),
    ("host-sim", &["control-core", "link", "diagnosis"]),
    ("tests", &["control-core", "link", "firmware", "diagnosis", "host-sim"]),
    ("xtask", &[]),
];
/// Crates that use what their room may not, and why.
const EXCEPTIONS: [(&str, &[&str], &str); 1] = [(
    "diagnosis/python",
    &["convert", "lab", "same-features"],
    "a program of its own, which nothing else uses: its `import_recording` and `settle` are those of `host-sim`",
)];
/// All that the judge takes of the diagnosis: the call, as a user makes it, and the reader that
/// says whether a rig written by the judge is one.
const OF_THE_DIAGNOSIS: [&str; 3] = ["diagnose", "Request", "rig::Rig::parse"];

/// Returns a sentence for every dependency between rooms that leads back, and for every name of
/// the diagnosis that its judge uses beside the call.
pub(super) fn wrong(top: &Path) -> io::Result<Vec<String>> {
    let manifest = fs::read_to_string(top.join("Cargo.toml"))?;
    let mut wrong = Vec::new();
    let places = places(&manifest);
    for folder in super::crates(top)? {
        let place = folder.strip_prefix(top).unwrap_or(&folder).display().to_string();
        wrong.extend(wrong_dependencies(&place, &fs::read_to_string(folder.join("Cargo.toml"))?, &places));
    }
    for (file, text) in krate::sources(&top.join("diagnosis/benchmark/src"), ".rs")? {
        wrong.extend(uses_beyond_the_call(&text).map(|line| {
            format!("diagnosis/benchmark/src/{file}: `{line}`: the judge may use {OF_THE_DIAGNOSIS:?} of the diagnosis and no law, fit or number")
        }));
    }
    Ok(wrong)
}

/// The folder of each of the workspace's crates by its name.
fn places(manifest: &str) -> BTreeMap<&str, &str> {
    manifest
        .lines()
        .filter_map(|line| {
            let (name, rest) = line.split_once(" = { path = \"")?;
            Some((name, rest.split_once('"')?.0))
        })
        .collect()
}

fn wrong_dependencies(place: &str, manifest: &str, places: &BTreeMap<&str, &str>) -> Vec<String> {
    let room = room_of(place);
    let Some((_, below)) = BELOW.iter().find(|(name, _)| *name == room) else {
        return vec![format!("{place}: no room is called {room}; see `BELOW` in xtask/src/arrows/rooms.rs")];
    };
    let excepted =
        EXCEPTIONS.iter().find(|(name, ..)| *name == place).map_or(&[][..], |(_, crates, _)| crates);
    let is_wrong = |name: &&str| {
        let used = places.get(*name).map(|used| room_of(used));
        used.is_some_and(|used| used != room && !below.contains(&used)) && !excepted.contains(name)
    };
    dependencies(manifest)
        .into_iter()
        .filter(is_wrong)
        .map(|name| format!("{place} uses {name} ({}): {room} may use {below:?} only", places[name]))
        .collect()
}

fn room_of(place: &str) -> &str {
    place.split('/').next().unwrap_or(place)
}

/// The names under `[dependencies]`.
fn dependencies(manifest: &str) -> Vec<&str> {
    let from = manifest.lines().skip_while(|line| *line != "[dependencies]").skip(1);
    from.take_while(|line| !line.starts_with('['))
        .filter_map(|line| line.split_once(" = ").map(|(name, _)| name))
        .collect()
}

/// The lines of a source that name more of the diagnosis than the judge may.
fn uses_beyond_the_call(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().map(str::trim).filter(|line| !line.starts_with("//"));
    lines.filter(|line| {
        let mut named = line.split("diagnosis::").skip(1);
        named.any(|rest| !OF_THE_DIAGNOSIS.iter().any(|name| rest.starts_with(name)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: &str = "link = { path = \"link\" }\nserver = { path = \"host-sim/server\" }\n\
                          convert = { path = \"host-sim/convert\" }\n";

    #[test]
    fn a_dependency_that_leads_back_is_wrong() {
        let places = places(PLACES);
        let manifest = "[dependencies]\nserver = { workspace = true }\nserde = \"1\"\n\n[dev-dependencies]\nconvert = \"1\"";
        assert_eq!(wrong_dependencies("link", manifest, &places).len(), 1);
        assert!(wrong_dependencies("host-sim/lab", manifest, &places).is_empty());
        assert!(wrong_dependencies("anatomy", "", &places)[0].contains("no room"));
        let python = "[dependencies]\nconvert = { workspace = true }";
        assert!(wrong_dependencies("diagnosis/python", python, &places).is_empty());
        assert_eq!(wrong_dependencies("diagnosis/experiment", python, &places).len(), 1);
    }

    #[test]
    fn the_judge_calls_the_diagnosis_and_no_more() {
        let text = "let request = diagnosis::Request { rig };\n// diagnosis::laws\nuse diagnosis::laws::Law;";
        assert_eq!(uses_beyond_the_call(text).collect::<Vec<_>>(), ["use diagnosis::laws::Law;"]);
    }
}
