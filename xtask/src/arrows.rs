//! The arrow check: no files of a crate use each other in a circle, no function of a crate or of a
//! script in JavaScript is longer than 60 lines, and files are included by `#[path]` where that has
//! a reason only.
//!
//! A file uses another if its code, tests aside, names something that the other defines. A name
//! that a module only hands on (`pub use`) belongs to the file that defines it. A module and the
//! modules that it is made of are one house: what it uses of them is no arrow, what they use of it
//! is one. Crates of the PC's side have eight floors at most. Between crates, [`rooms`] says which
//! top folder may use which.

mod floors;
mod included;
mod krate;
mod lengths;
mod rooms;
mod source;

use crate::shell::{self, Error};
use krate::Crate;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Folders that hold no crate of ours.
const SKIPPED: [&str; 4] = ["target", ".git", ".venv", "node_modules"];
/// Uses that the whole repository has at least; fewer, and the reader of sources is blind.
const FEWEST_USES: usize = 1000;

/// Most floors of a crate of the PC's side. The folders of the diagnosis are checked where they
/// are, in `diagnosis/tests/behaviour/layout.rs`.
const MOST_FLOORS: usize = 8;

/// The uses of each file of a crate: the other file, and a name of it.
type Uses = BTreeMap<String, BTreeMap<String, String>>;

/// Checks every crate of the repository, prints each circle, and fails if there is one.
pub(crate) fn check() -> Result<(), Error> {
    let unreadable = |error: io::Error| Error::new(format!("the sources could not be read: {error}"));
    let mut count = 0;
    let (mut circles, mut long, mut high) = (Vec::new(), Vec::new(), Vec::new());
    for folder in crates(&shell::top()).map_err(unreadable)? {
        let uses = Crate::read(&folder.join("src")).map_err(unreadable)?.uses();
        count += uses.values().map(BTreeMap::len).sum::<usize>();
        let name = folder.strip_prefix(shell::top()).unwrap_or(&folder).display().to_string();
        high.extend(too_high(&name, floors::floors(&uses)));
        circles.extend(circles_of(&uses).iter().map(|circle| message(&name, circle, &uses)));
        for (file, text) in krate::sources(&folder.join("src"), ".rs").map_err(unreadable)? {
            long.extend(
                lengths::too_long(&text).iter().map(|one| one.message(&format!("{name}/src/{file}"))),
            );
        }
    }
    for (file, text) in krate::sources(&shell::top(), "js").map_err(unreadable)? {
        long.extend(lengths::too_long_in_script(&text).iter().map(|one| one.message(&file)));
    }
    let included = included::unlisted(&shell::top()).map_err(unreadable)?;
    let back = rooms::wrong(&shell::top()).map_err(unreadable)?;
    let all = [&circles, &long, &included, &high, &back];
    all.into_iter().flatten().for_each(|one| eprintln!("{one}"));
    if count < FEWEST_USES {
        return Err(Error::new(format!("only {count} uses were seen: the reader of sources is blind")));
    }
    if all.iter().all(|found| found.is_empty()) {
        return Ok(());
    }
    Err(Error::new(format!(
        "{} circles, each printed above: move what both files need into a file below them; {} functions that are too long; {} includes; {} crates that are too high; {} arrows between rooms that lead back",
        circles.len(),
        long.len(),
        included.len(),
        high.len(),
        back.len()
    )))
}

/// A crate of the PC's side with more floors than [`MOST_FLOORS`].
fn too_high(name: &str, floors: usize) -> Option<String> {
    (name.starts_with("host-sim") && floors > MOST_FLOORS).then(|| {
        format!("{name}: {floors} levels of files depend on each other, and {MOST_FLOORS} may: take a part out of it")
    })
}

/// Folders of the repository with a manifest and sources.
fn crates(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    if folder.join("Cargo.toml").is_file() && folder.join("src").is_dir() {
        found.push(folder.to_path_buf());
    }
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let is_skipped = entry.file_name().to_str().is_none_or(|name| SKIPPED.contains(&name));
        if entry.file_type()?.is_dir() && !is_skipped {
            found.extend(crates(&entry.path())?);
        }
    }
    found.sort();
    Ok(found)
}

/// Sets of files each of which uses every other of its set, by way of the rest.
fn circles_of(uses: &Uses) -> Vec<Vec<String>> {
    let reached: BTreeMap<&str, BTreeSet<&str>> =
        uses.keys().map(|file| (file.as_str(), reach(file, uses))).collect();
    let mut seen = BTreeSet::new();
    let mut circles = Vec::new();
    for (file, from_file) in &reached {
        if !from_file.contains(file) || !seen.insert(*file) {
            continue;
        }
        let back = |other: &&&str| reached.get(**other).is_some_and(|from| from.contains(file));
        let circle: Vec<String> = from_file.iter().filter(back).map(|other| (*other).to_owned()).collect();
        for other in from_file.iter().filter(back) {
            seen.insert(other);
        }
        circles.push(circle);
    }
    circles
}

/// Files that a file uses, directly or by way of others.
fn reach<'a>(file: &str, uses: &'a Uses) -> BTreeSet<&'a str> {
    let mut found = BTreeSet::new();
    let mut open: Vec<&str> = uses.get(file).into_iter().flatten().map(|(other, _)| other.as_str()).collect();
    while let Some(next) = open.pop() {
        if found.insert(next) {
            open.extend(uses.get(next).into_iter().flatten().map(|(other, _)| other.as_str()));
        }
    }
    found
}

/// The circle with what ties it, a line for each arrow.
fn message(name: &str, circle: &[String], uses: &Uses) -> String {
    let mut text = format!("{name}: {} files use each other in a circle:", circle.len());
    for file in circle {
        for (other, what) in uses.get(file).into_iter().flatten().filter(|(other, _)| circle.contains(other))
        {
            text.push_str(&format!("\n  src/{file} uses {what} of src/{other}"));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circles(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        circles_of(&Crate::of(files.iter().map(|(name, text)| (String::from(*name), *text))).uses())
    }

    #[test]
    fn files_that_use_each_other_are_a_circle() {
        let found = circles(&[
            ("lib.rs", "mod a;\nmod b;\nmod c;\nuse a::A;"),
            ("a.rs", "use crate::b::{self, B};\npub struct A(B);"),
            ("b.rs", "pub struct B;\nfn f() { crate::c::g(); }"),
            ("c.rs", "use super::a::A;\npub fn g() {}"),
        ]);
        assert_eq!(found, [["a.rs", "b.rs", "c.rs"]]);
    }

    #[test]
    fn a_name_belongs_to_the_file_that_defines_it() {
        let faces = [
            ("lib.rs", "mod a;"),
            ("a/mod.rs", "mod one;\nmod two;\npub(crate) use one::One;\npub(crate) use two::Two;"),
            ("a/one.rs", "use super::Two;\npub(crate) struct One(Two);"),
            ("a/two.rs", "pub(crate) struct Two;"),
        ];
        assert!(circles(&faces).is_empty());
    }

    #[test]
    fn a_module_may_use_what_it_is_made_of() {
        let mut files = vec![
            ("lib.rs", "mod a;\nmod b;"),
            ("a/mod.rs", "mod one;\npub(crate) struct Two;\nfn f() { one::g(); }"),
            ("a/one.rs", "use super::Two;\npub(super) fn g() -> Two { Two }"),
            ("b.rs", "pub(crate) fn h() {}"),
        ];
        assert!(circles(&files).is_empty());
        files[1].1 = "mod one;\npub(crate) struct Two;\nfn f() { crate::b::h(); }";
        files[3].1 = "pub(crate) fn h() -> crate::a::Two { crate::a::Two }";
        assert_eq!(circles(&files), [["a/mod.rs", "b.rs"]]);
    }

    #[test]
    fn files_that_a_macro_declares_count_and_those_of_tests_do_not() {
        let found = circles(&[
            (
                "lib.rs",
                "macro_rules! all { ($($m:ident;)*) => { $(mod $m;)* } }\nall! { a; b; }\n#[cfg(test)]\nmod c;",
            ),
            ("a.rs", "use crate::b::B;\npub struct A(B);"),
            ("b.rs", "pub struct B;\nfn f() { crate::a::g(); }"),
            ("c.rs", "use crate::a::A;\npub struct C(A);"),
        ]);
        assert_eq!(found, [["a.rs", "b.rs"]]);
    }

    #[test]
    fn tests_comments_and_strings_are_no_uses() {
        let found = circles(&[
            ("lib.rs", "mod a;\nmod b;"),
            ("a.rs", "use crate::b::B;\npub struct A(B);"),
            (
                "b.rs",
                "// crate::a::A\npub struct B(&'static str);\nconst C: &str = \"crate::a::A\";\n#[cfg(test)]\nmod tests { use crate::a::A; }",
            ),
        ]);
        assert!(found.is_empty(), "{found:?}");
    }
}
