//! The modules of one crate, and which of its files use which.

use super::source::Source;
use super::{SKIPPED, Uses};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

/// The number of times that a name may be handed on.
const MOST_HANDED_ON: usize = 5;

/// The files of a crate by their module's path; the root's is empty.
pub(super) struct Crate {
    modules: BTreeMap<Vec<String>, Module>,
}

struct Module {
    /// The file's path below `src`.
    file: String,
    source: Source,
}

impl Crate {
    pub(super) fn read(folder: &Path) -> io::Result<Self> {
        let files = sources(folder, ".rs")?;
        Ok(Self::of(files.iter().map(|(name, text)| (name.clone(), text.as_str()))))
    }

    /// A crate of sources by their paths below `src`. `lib.rs` is its root; `main.rs` is its root
    /// if there is no library.
    pub(super) fn of<'a>(files: impl Iterator<Item = (String, &'a str)>) -> Self {
        let mut modules = BTreeMap::new();
        for (file, text) in files {
            let mut path: Vec<String> = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            if path.last().is_some_and(|last| last == "mod") {
                path.pop();
            } else if path.len() == 1 && ["lib", "main"].contains(&path[0].as_str()) {
                path = if path[0] == "lib" || !modules.contains_key(&Vec::new()) { Vec::new() } else { path };
            }
            modules.insert(path, Module { file, source: Source::new(text) });
        }
        Self { modules }
    }

    /// The uses of every file, also of one that a macro declares; files that only tests declare are
    /// left out, and so is what a module uses of the modules that it is made of.
    pub(super) fn uses(&self) -> Uses {
        let used = self.modules.keys().filter(|path| !self.is_for_tests(path));
        used.map(|path| (self.modules[path].file.clone(), self.uses_of(path))).collect()
    }

    fn is_for_tests(&self, path: &[String]) -> bool {
        let Some((name, above)) = path.split_last() else { return false };
        self.modules.get(above).is_some_and(|module| module.source.is_for_tests(name))
            || self.is_for_tests(above)
    }

    fn uses_of(&self, from: &[String]) -> BTreeMap<String, String> {
        let module = &self.modules[from];
        let declared = module.source.uses();
        // A public one of a name below only hands it on.
        let own = declared.iter().filter(|one| !one.is_public).map(|one| one.path.clone());
        let mut uses = BTreeMap::new();
        for path in own.chain(module.source.paths()) {
            let Some((place, what)) = self.absolute(from, &path).and_then(|path| self.resolve(&path, 0))
            else {
                continue;
            };
            if !place.starts_with(from) {
                uses.entry(self.modules[&place].file.clone()).or_insert(what);
            }
        }
        uses
    }

    /// A path as seen from the crate's root; none where it leads out of the crate.
    fn absolute(&self, from: &[String], path: &[String]) -> Option<Vec<String>> {
        let (first, rest) = path.split_first()?;
        let mut base = match first.as_str() {
            "crate" => Vec::new(),
            "self" => from.to_vec(),
            "super" => from.split_last()?.1.to_vec(),
            name => {
                let child: Vec<String> = from.iter().cloned().chain([name.to_owned()]).collect();
                return self
                    .modules
                    .contains_key(&child)
                    .then(|| child.into_iter().chain(rest.to_vec()).collect());
            }
        };
        for segment in rest {
            if segment == "super" {
                base.pop();
            } else {
                base.push(segment.clone());
            }
        }
        Some(base)
    }

    /// The module that defines what a path names, and its name there.
    fn resolve(&self, path: &[String], depth: usize) -> Option<(Vec<String>, String)> {
        let length = (0..=path.len()).rev().find(|length| self.modules.contains_key(&path[..*length]))?;
        let (place, rest) = path.split_at(length);
        let module = &self.modules[place];
        let Some(name) = rest.first() else {
            return Some((place.to_vec(), place.last().cloned().unwrap_or_default()));
        };
        if !module.source.defines(name) && depth < MOST_HANDED_ON {
            let handed = module.source.uses().into_iter().filter(|one| one.name == *name);
            for one in handed {
                let Some(target) = self.absolute(place, &one.path) else { continue };
                if target != path {
                    return self.resolve(&target, depth + 1);
                }
            }
        }
        Some((place.to_vec(), name.clone()))
    }
}

/// Every source below a folder whose name ends with `end`, with its path.
pub(super) fn sources(folder: &Path, end: &str) -> io::Result<Vec<(String, String)>> {
    let mut files = Vec::new();
    visit(folder, ("", end), &mut files)?;
    Ok(files)
}

/// Appends every source below a folder, whose path below the first one is `path`, if its name ends
/// with `end`.
fn visit(folder: &Path, (path, end): (&str, &str), files: &mut Vec<(String, String)>) -> io::Result<()> {
    let mut entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let below = if path.is_empty() { name.to_owned() } else { format!("{path}/{name}") };
        if entry.file_type()?.is_dir() {
            if SKIPPED.contains(&name) {
                continue;
            }
            visit(&entry.path(), (&below, end), files)?;
        } else if name.ends_with(end) {
            files.push((below, fs::read_to_string(entry.path())?));
        }
    }
    Ok(())
}
