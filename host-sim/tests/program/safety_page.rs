//! docs/design/safety.md and docs/design/diagnosis.md name tests and CONTRIBUTING.md files: each is
//! where it says.

use std::path::{Path, PathBuf};

/// Returns the texts between backquotes in a line.
fn quoted(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

/// The names of tests in a line, each with its file: the one before it in the line, or else
/// `of_table`.
fn named<'a>(line: &'a str, of_table: Option<&'a str>) -> Vec<(&'a str, &'a str)> {
    let mut file = of_table;
    let mut out = Vec::new();
    for word in quoted(line) {
        if word.ends_with(".rs") {
            file = Some(word);
        } else if let Some(file) = file.filter(|_| word.chars().all(|c| c.is_ascii_lowercase() || c == '_')) {
            out.push((file, word));
        }
    }
    out
}

#[test]
fn every_test_that_the_page_names_is_there() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace");
    let page = std::fs::read_to_string(top.join("docs/design/safety.md")).expect("the page");
    // Within a table: the file that its head names, if it does.
    let (mut table, mut seen): (Option<Option<&str>>, u32) = (None, 0);
    for line in page.lines() {
        if !line.starts_with('|') {
            table = None;
            continue;
        }
        let Some(of_table) = table else {
            table = Some(quoted(line).find(|word| word.ends_with(".rs")));
            continue;
        };
        for (file, test) in named(line, of_table) {
            let source = std::fs::read_to_string(top.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
            let is_test = source.split("#[test]").skip(1).any(|after| {
                let head = after.split('{').next().unwrap_or_default();
                head.contains(&format!("fn {test}("))
            });
            assert!(is_test, "{file} has no test `{test}`");
            seen += 1;
        }
    }
    assert!(seen > 45, "only {seen} tests were seen: the reader of the page is blind");
}

/// The text of every Rust source below a folder.
fn sources(folder: PathBuf) -> String {
    let entries = std::fs::read_dir(folder).expect("it can be listed");
    let paths = entries.map(|entry| entry.expect("it can be listed").path());
    paths
        .map(|path| match path.extension() {
            _ if path.is_dir() => sources(path),
            Some(end) if end == "rs" => std::fs::read_to_string(path).expect("a source can be read"),
            _ => String::new(),
        })
        .collect()
}

#[test]
fn every_test_that_the_diagnosis_design_names_is_there() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace");
    let page = std::fs::read_to_string(top.join("docs/design/diagnosis.md")).expect("the page");
    let (_, table) = page.split_once("| fault | test |").expect("its table");
    let rows = table.split("\n\n").next().unwrap_or_default();
    let code = sources(top.join("diagnosis/src")) + &sources(top.join("diagnosis/tests"));
    let cells = rows.lines().filter_map(|row| row.split(" | ").nth(1));
    let tests: Vec<&str> = cells.flat_map(quoted).filter(|word| !word.contains('/')).collect();
    assert!(tests.len() >= 10, "only {tests:?}");
    for test in tests {
        assert!(code.contains(&format!("fn {test}()")), "diagnosis has no test `{test}`");
    }
}

#[test]
fn every_file_that_contributing_names_is_there() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace");
    let page = std::fs::read_to_string(top.join("CONTRIBUTING.md")).expect("the page");
    let (_, table) = page.split_once("## Where to look").expect("its table");
    let rows: Vec<&str> = table.split("\n## ").next().unwrap_or_default().lines().skip(4).collect();
    let files: Vec<&str> = rows.iter().flat_map(|row| quoted(row)).collect();
    assert!(files.len() >= 10, "only {files:?}");
    for file in files {
        assert!(top.join(file).is_file(), "CONTRIBUTING.md names {file}, which is not there");
    }
}
