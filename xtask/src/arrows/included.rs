//! Sources that are compiled in a second place by `#[path]`: a reader does not expect them there,
//! and the compiler reads them twice. The few that remain are listed with the reason.

use super::krate;
use std::io;
use std::path::Path;

/// A file, a path that it includes, and why no crate or module can do instead.
const INCLUDED: [(&str, &str, &str); 8] = [
    ("diagnosis/examples/calibrate.rs", "../tests/behaviour/common.rs", SIMULATOR),
    ("diagnosis/examples/diagnosis_growth.rs", "../tests/behaviour/common.rs", SIMULATOR),
    ("diagnosis/examples/long.rs", "../tests/behaviour/common.rs", SIMULATOR),
    (
        "diagnosis/tests/behaviour/common.rs",
        "machine.rs",
        "an example that includes this file finds its part",
    ),
    ("firmware/tests/board.rs", "../src/board/mod.rs", IMAGE),
    ("firmware/tests/board.rs", "../src/chip/mod.rs", IMAGE),
    ("firmware/tests/board.rs", "../src/crash.rs", IMAGE),
    ("firmware/tests/board.rs", "../src/last_words.rs", IMAGE),
];
const SIMULATOR: &str =
    "the tests' simulator, which is no part of the library, nor of any crate that a user builds";
const IMAGE: &str =
    "the image's own modules, which exist on a board only: the library is built for the PC too";

/// Returns a sentence for every `#[path]` below `top` that is not listed, and for every one listed
/// that is gone.
pub(super) fn unlisted(top: &Path) -> io::Result<Vec<String>> {
    let mut found = Vec::new();
    for (file, text) in krate::sources(top, ".rs")? {
        found.extend(paths(&text).into_iter().map(|path| (file.clone(), path.to_owned())));
    }
    let is =
        |(file, path): &(String, String), listed: &(&str, &str, &str)| *file == listed.0 && *path == listed.1;
    let new = found.iter().filter(|one| !INCLUDED.iter().any(|listed| is(one, listed)));
    let new = new.map(|(file, path)| {
        format!("{file} includes {path} by #[path]: make it a module or a crate, or list it with the reason")
    });
    let gone = INCLUDED.iter().filter(|listed| !found.iter().any(|one| is(one, listed)));
    let gone = gone.map(|(file, path, why)| {
        format!("{file} does not include {path} any more ({why}): take it off the list in xtask/src/arrows/included.rs")
    });
    Ok(new.chain(gone).collect())
}

/// The paths that the lines of a source include.
fn paths(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.trim().strip_prefix("#[path = \"")?.strip_suffix("\"]")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_attributes_are_includes() {
        let text = "    #[path = \"a.rs\"]\nmod a;\n// #[path = \"b.rs\"]\nlet c = \"#[path = c.rs]\";";
        assert_eq!(paths(text), ["a.rs"]);
    }

    #[test]
    fn a_new_include_is_found_and_one_that_is_gone() {
        let folder = std::env::temp_dir().join(format!("xtask-included-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the test");
        std::fs::write(folder.join("new.rs"), "#[path = \"other.rs\"]\nmod other;\n").expect("a source");
        let found = unlisted(&folder).expect("it can be read");
        std::fs::remove_dir_all(&folder).expect("it goes");
        assert_eq!(found.len(), 1 + INCLUDED.len());
        assert!(found[0].starts_with("new.rs includes other.rs"), "{found:?}");
    }
}
