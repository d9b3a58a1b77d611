//! `docs/design/papers.md`: no row of the audit is missing, and every test that a row names exists.

use std::path::Path;

/// Rows of each paper.
const ROWS: [(&str, usize); 3] = [("## Paper 000", 25), ("## Paper 001", 32), ("## Paper 002", 36)];

fn top() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
}

/// The rows of each paper's table, as number, feature, state and evidence.
fn tables() -> Vec<Vec<[String; 4]>> {
    let page = std::fs::read_to_string(top().join("docs/design/papers.md")).expect("it is there");
    let part = |heading: &str| {
        let from = page.find(heading).unwrap_or_else(|| panic!("{heading} is missing"));
        let rest = &page[from + heading.len()..];
        rest[..rest.find("\n## ").unwrap_or(rest.len())].to_owned()
    };
    let row = |line: &str| -> Option<[String; 4]> {
        let cells: Vec<&str> = line.trim_matches('|').splitn(4, " | ").map(str::trim).collect();
        cells[0].parse::<usize>().ok()?;
        cells.into_iter().map(str::to_owned).collect::<Vec<_>>().try_into().ok()
    };
    ROWS.iter().map(|(heading, _)| part(heading).lines().filter_map(row).collect()).collect()
}

/// `file: test` in backticks.
fn named(evidence: &str) -> Vec<(&str, &str)> {
    evidence.split('`').skip(1).step_by(2).filter_map(|name| name.split_once(": ")).collect()
}

#[test]
fn every_row_is_there_and_has_a_test_or_a_reason() {
    for (table, (heading, count)) in tables().iter().zip(ROWS) {
        let numbers: Vec<usize> = table.iter().map(|row| row[0].parse().expect("a number")).collect();
        assert_eq!(numbers, (1..=count).collect::<Vec<_>>(), "{heading}");
        for [number, feature, state, evidence] in table {
            let is_shown = !named(evidence).is_empty();
            let says_why = evidence.split('`').step_by(2).any(|text| text.len() > 12);
            let is_right = match state.as_str() {
                "yes" => is_shown,
                "partly" => says_why,
                "no" => says_why && !is_shown,
                _ => false,
            };
            assert!(is_right, "{heading}, row {number}, {feature}: {state}, {evidence}");
        }
    }
}

#[test]
fn the_rows_are_counted_right() {
    let page = std::fs::read_to_string(top().join("docs/design/papers.md")).expect("it is there");
    for (table, (heading, _)) in tables().iter().zip(ROWS) {
        let count = |wanted: &str| table.iter().filter(|row| row[2] == wanted).count();
        let paper = heading.trim_start_matches("## Paper ");
        let counted = format!("| {paper} | {} | {} | {} |", count("yes"), count("partly"), count("no"));
        assert!(page.lines().any(|line| line == counted), "{counted}");
    }
}

#[test]
fn every_test_that_a_row_names_exists() {
    let mut count = 0;
    for [number, feature, _, evidence] in tables().iter().flatten() {
        for (file, test) in named(evidence) {
            let text = std::fs::read_to_string(top().join(file));
            let text = text.unwrap_or_else(|why| panic!("row {number}, {feature}: {file}: {why}"));
            let wanted = if file.ends_with(".py") {
                format!("\ndef {test}(device, report):")
            } else {
                format!("#[test]\nfn {test}() {{")
            };
            // A test in a module is indented.
            let flat = text.lines().map(str::trim_start).collect::<Vec<_>>().join("\n");
            let is_property = flat.contains(&format!("fn {test}(\n"));
            assert!(
                text.contains(&wanted) || flat.contains(&wanted) || is_property,
                "row {number}, {feature}: {file} has no test {test}"
            );
            count += 1;
        }
    }
    assert!(count > 60, "{count} tests are named");
}
