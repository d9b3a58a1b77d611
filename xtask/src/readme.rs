//! `cargo xtask readme --from target/inject.json` writes the README's table of the diagnosis; the
//! word check fails if somebody else did.

mod json;
mod rates;

use crate::dist;
use crate::shell::{self, Error};
use json::Json;
use rates::Believed;
use std::fs;
use std::path::{Path, PathBuf};

/// The table's first line is this, what it was measured with and a checksum; [`FIRST_END`] ends it.
const FIRST: &str = "<!-- table: ";
const FIRST_END: &str = "; cargo xtask readme writes it -->\n";
const LAST: &str = "<!-- end of the table -->";
/// Stands for commit and checksum where nothing has been measured yet.
const EMPTY: &str = "none";

/// Renders the table from the file after `--from` and writes it into the README.
pub(crate) fn run(arguments: &[String]) -> Result<(), Error> {
    let [flag, file] = arguments else { return Err(usage()) };
    if flag != "--from" {
        return Err(usage());
    }
    let table = table(Path::new(file))?;
    let path = path();
    let page = read(&path)?;
    let written = with_table(&page, &dist::commit()?, &table).ok_or_else(no_markers)?;
    fs::write(&path, written)
        .map_err(|error| Error::new(format!("{} cannot be written: {error}", path.display())))?;
    print!("{table}");
    Ok(())
}

/// Fails if the table in the README is not as `cargo xtask readme` wrote it.
pub(crate) fn check() -> Result<(), Error> {
    match is_as_written(&read(&path())?) {
        Some(true) => Ok(()),
        None => Err(no_markers()),
        Some(false) => Err(Error::new(
            "the table in README.md was edited by hand; `git checkout README.md` brings it back, `cargo xtask readme --from \
             target/inject.json` writes another",
        )),
    }
}

/// True if the page's table has the checksum of its marker, or is empty as its marker says; `None`
/// without markers.
fn is_as_written(page: &str) -> Option<bool> {
    let [_, marker, table, _] = parts(page)?;
    Some(match marker.split_once(' ') {
        Some((commit, sum)) => checksum(commit, table) == sum,
        None => marker == EMPTY && table.trim().is_empty(),
    })
}

fn usage() -> Error {
    Error::usage(
        "`cargo xtask readme` takes `--from FILE`, the inject.json that `cargo xtask prove --inject` wrote",
    )
}

fn no_markers() -> Error {
    Error::new(format!(
        "README.md needs the line `{FIRST}{EMPTY}{}` and, below it, `{LAST}`",
        FIRST_END.trim_end()
    ))
}

fn path() -> PathBuf {
    shell::top().join("README.md")
}

fn read(path: &Path) -> Result<String, Error> {
    fs::read_to_string(path)
        .map_err(|error| Error::new(format!("{} cannot be read: {error}", path.display())))
}

/// Returns a page in four parts: before the table, its marker, the table, and all after it.
fn parts(page: &str) -> Option<[&str; 4]> {
    let (before, rest) = page.split_once(FIRST)?;
    let (marker, rest) = rest.split_once(FIRST_END)?;
    let (table, _) = rest.split_once(LAST)?;
    Some([before, marker, table, &rest[table.len()..]])
}

/// Returns the page with another table, measured by `commit`.
fn with_table(page: &str, commit: &str, table: &str) -> Option<String> {
    let [before, _, _, after] = parts(page)?;
    // Markdown reads a table after an empty line only.
    let table = format!("\n{table}\n");
    Some(format!("{before}{FIRST}{commit} {}{FIRST_END}{table}{after}", checksum(commit, &table)))
}

/// FNV-1a of commit and table: finds a slip, and nobody who means to forge it.
fn checksum(commit: &str, table: &str) -> String {
    let step = |sum: u64, byte: u8| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    format!("{:016x}", commit.bytes().chain(table.bytes()).fold(0xcbf2_9ce4_8422_2325, step))
}

/// Reads what `prove --inject` wrote, and what is believed of the machines in the folders that it
/// names.
fn table(file: &Path) -> Result<String, Error> {
    let name = file.display();
    let all = json::parse(&read(file)?).map_err(|line| {
        Error::usage(format!("{name}, line {line}: this is no JSON; run `cargo xtask prove --inject` again"))
    })?;
    let cases = all.get("cases").list().filter(|cases| !cases.is_empty());
    let (Some(cases), Some(folders)) = (cases, folders(&all)) else {
        return Err(Error::usage(format!(
            "{name} has no cases; `cargo xtask prove --inject` writes inject.json"
        )));
    };
    let mut believed = Believed::new();
    for folder in folders {
        if !Path::new(folder).is_dir() {
            return Err(Error::usage(format!(
                "{name} was measured on {folder}, which is not there; run this where `cargo xtask prove` was run"
            )));
        }
        // As in the benchmark, a folder without this file believes nothing.
        let text = fs::read_to_string(Path::new(folder).join("believed.tsv")).unwrap_or_default();
        rates::add_believed(&text, &mut believed);
    }
    rates::table(cases, &believed).map_err(|id| {
        Error::usage(format!(
            "{name}, case {id}: a value is missing; write the file again with this commit's `prove`"
        ))
    })
}

/// The folders in "12 cases of A, B, seed 3, …".
fn folders(all: &Json) -> Option<impl Iterator<Item = &str>> {
    let (_, rest) = all.get("source").text()?.split_once(" cases of ")?;
    Some(rest.split_once(", seed ")?.0.split(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str =
        "# A page\n\n<!-- table: none; cargo xtask readme writes it -->\n<!-- end of the table -->\n\nmore\n";

    #[test]
    fn a_table_replaces_the_one_before_and_nothing_else() {
        let first = with_table(PAGE, "12345678", "| a |\n").expect("markers");
        assert!(first.starts_with("# A page\n\n<!-- table: 12345678 "), "{first}");
        assert!(first.ends_with(" -->\n\n| a |\n\n<!-- end of the table -->\n\nmore\n"), "{first}");
        let second = with_table(&first, "12345678", "| b |\n").expect("markers");
        assert_eq!(second, with_table(PAGE, "12345678", "| b |\n").expect("markers"));
        assert_eq!(with_table("# A page\n", "1", ""), None);
    }

    #[test]
    fn a_change_by_hand_is_noticed() {
        let page = with_table(PAGE, "12345678", "| 82 % (45 of 55) |\n").expect("markers");
        assert_eq!(is_as_written(&page), Some(true));
        for (from, to) in [("82", "92"), ("12345678 ", "12345679 "), ("|\n", "|\n| more |\n")] {
            assert_eq!(is_as_written(&page.replacen(from, to, 1)), Some(false), "{from}");
        }
    }

    #[test]
    fn only_an_empty_table_needs_no_measurement() {
        assert_eq!(is_as_written(PAGE), Some(true));
        assert_eq!(is_as_written(&PAGE.replace(LAST, "| 99 % |\n<!-- end of the table -->")), Some(false));
        assert_eq!(is_as_written("# A page\n"), None);
    }

    #[test]
    fn folders_are_read_from_the_files_first_sentence() {
        let of = |text: &str| {
            json::parse(text).ok().and_then(|all| Some(folders(&all)?.map(String::from).collect::<Vec<_>>()))
        };
        let source = r#"{ "source": "3 cases of ../a, b c, seed 5, of 9 planned (1 that no carrier holds); 2 carriers" }"#;
        assert_eq!(of(source), Some(vec!["../a".to_string(), "b c".to_string()]));
        assert_eq!(of("{}"), None);
    }
}
