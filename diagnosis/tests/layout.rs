//! The folders of the crate stand in an order, and each uses only those before it: no circle, no arrow upward.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders from the bottom to the top.
const FLOORS: [&str; 8] =
    ["numerics", "effects", "io", "simulation", "estimation", "selection", "validation", "report"];

fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).expect("the folder is there") {
        let path = entry.expect("its entries can be read").path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|end| end == "rs") {
            out.push(path);
        }
    }
}

/// Folders of the crate that a line of code names: `crate::folder`, also in `use crate::{a::…, b::…}`.
fn named(line: &str) -> Vec<usize> {
    let code = line.split("//").next().unwrap_or("");
    let mut out = Vec::new();
    for (place, _) in code.match_indices("crate::") {
        let rest = &code[place + "crate::".len()..];
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(group) => group.split(',').collect(),
            None => vec![rest],
        };
        for name in names {
            let word: String = name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            out.extend(FLOORS.iter().position(|floor| *floor == word));
        }
    }
    out
}

#[test]
fn each_folder_uses_only_those_before_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut upward = Vec::new();
    let mut arrows = 0;
    for (floor, folder) in FLOORS.iter().enumerate() {
        let mut files = Vec::new();
        sources(&root.join(folder), &mut files);
        assert!(!files.is_empty(), "{folder} holds no source");
        for file in files {
            let text = fs::read_to_string(&file).expect("a source can be read");
            for (number, line) in text.lines().enumerate() {
                for used in named(line) {
                    arrows += 1;
                    if used > floor {
                        let name = file.strip_prefix(&root).expect("it is below").display();
                        upward.push(format!("{name}:{}: {}", number + 1, line.trim()));
                    }
                }
            }
        }
    }
    assert!(arrows > 100, "only {arrows} uses were seen: the reader of sources is blind");
    assert!(upward.is_empty(), "folders use what stands above them:\n{}", upward.join("\n"));
}

/// What stands beside the folders: the crate's root, and the numbers that decide, which every folder may read and which use none.
const BESIDE: [&str; 2] = ["lib.rs", "thresholds.rs"];

#[test]
fn the_sources_hold_no_file_beside_the_folders_but_the_numbers_that_decide() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(&root).expect("the folder is there") {
        let name = entry.expect("its entries can be read").file_name();
        let name = name.to_string_lossy();
        assert!(BESIDE.contains(&&*name) || FLOORS.contains(&&*name), "{name} stands in no folder");
    }
    let thresholds = fs::read_to_string(root.join("thresholds.rs")).expect("a source can be read");
    assert!(thresholds.lines().all(|line| named(line).is_empty()), "the numbers that decide use a folder");
}
