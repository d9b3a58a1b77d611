//! Draws each board's wiring from the pin table in `docs/guide/hardware.md`: what the table says is
//! what the picture shows.
//!
//! `tests/tests/board/wiring.rs` compares the same table with the pins that the emulated board
//! drives, and so with the image.

use crate::shell::{self, Error};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

const PAGE: &str = "docs/guide/hardware.md";
/// A board's section of the page, its title, and its picture.
const PICTURES: [(&str, &str, &str); 2] = [
    ("## Wiring", "STM32F4DISCOVERY", "docs/guide/wiring-discovery.svg"),
    ("## The second board: NUCLEO-F429ZI", "NUCLEO-F429ZI", "docs/guide/wiring-nucleo-f429zi.svg"),
];

/// Pixels of the picture: its width, a row's height, the board's left and right edge, where the
/// words begin.
const WIDTH: usize = 1000;
const ROW: usize = 44;
const BOARD: (usize, usize) = (20, 330);
const WORDS: usize = 400;
/// Characters of a line of words.
const LINE: usize = 88;

/// `cargo xtask wiring`.
pub(crate) fn run() -> Result<(), Error> {
    for (path, svg) in drawn()? {
        fs::write(&path, svg)
            .map_err(|error| Error::new(format!("{} cannot be written: {error}", path.display())))?;
        println!("{}", path.display());
    }
    Ok(())
}

/// The pictures with their paths.
fn drawn() -> Result<Vec<(PathBuf, String)>, Error> {
    let page = shell::top().join(PAGE);
    let text = fs::read_to_string(&page)
        .map_err(|error| Error::new(format!("{} cannot be read: {error}", page.display())))?;
    PICTURES
        .iter()
        .map(|(section, title, path)| {
            let rows = table(&text, section);
            if rows.is_empty() {
                return Err(Error::new(format!("{PAGE} has no table of pins under \"{section}\"")));
            }
            Ok((shell::top().join(path), draw(title, &rows)))
        })
        .collect()
}

/// A row of a table of pins: the pins and their description.
#[derive(Debug, PartialEq, Eq)]
struct Row {
    pins: String,
    words: String,
}

/// Returns the rows of the first table under `section`: pins, connector and words, or pins, words
/// and a remark.
fn table(text: &str, section: &str) -> Vec<Row> {
    let Some((_, after)) = text.split_once(section) else { return Vec::new() };
    let lines =
        after.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    let mut rows = lines.map(|line| line.trim_matches('|').split('|').map(plain).collect::<Vec<_>>());
    let has_connectors = rows.next().is_some_and(|head| head.get(1).is_some_and(|cell| cell == "connector"));
    rows.skip(1)
        .filter_map(|cells| match (&cells[..], has_connectors) {
            ([pins, connector, words, ..], true) if !connector.is_empty() => {
                Some(Row { pins: format!("{pins} ({connector})"), words: words.clone() })
            }
            ([pins, _, words, ..], true) => Some(Row { pins: pins.clone(), words: words.clone() }),
            ([pins, words, remark, ..], false) => {
                Some(Row { pins: pins.clone(), words: format!("{words}; {remark}") })
            }
            _ => None,
        })
        .collect()
}

/// Returns a cell without Markdown's emphasis and links.
fn plain(cell: &str) -> String {
    let mut words = cell.replace("**", "");
    while let (Some(begin), Some(middle)) = (words.find('['), words.find("](")) {
        let Some(end) = words[middle..].find(')') else { break };
        let name = words[begin + 1..middle].to_string();
        words.replace_range(begin..=middle + end, &name);
    }
    words.trim().to_string()
}

fn draw(title: &str, rows: &[Row]) -> String {
    let height = ROW * rows.len() + 70;
    let (left, right) = BOARD;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <title>Wiring of the {title}</title>\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n\
         <rect x=\"{left}\" y=\"40\" width=\"{}\" height=\"{}\" rx=\"8\" fill=\"#eef2f6\" stroke=\"#345\"/>\n\
         <text x=\"{left}\" y=\"26\" font-weight=\"bold\">{title}</text>\n",
        right - left,
        height - 60,
    );
    for (index, row) in rows.iter().enumerate() {
        let y = 40 + ROW * index + ROW / 2;
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            right - 12,
            y + 4,
            escaped(&row.pins)
        );
        let _ = writeln!(svg, "<path d=\"M{right} {y}H{}\" stroke=\"#345\" stroke-width=\"2\"/>", WORDS - 10);
        let _ = writeln!(svg, "<circle cx=\"{right}\" cy=\"{y}\" r=\"4\" fill=\"#345\"/>");
        let lines = wrapped(&row.words);
        for (line, words) in lines.iter().enumerate() {
            let y = y + 4 + 16 * line - 8 * (lines.len() - 1);
            let _ = writeln!(svg, "<text x=\"{WORDS}\" y=\"{y}\">{}</text>", escaped(words));
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// Breaks words into lines of at most [`LINE`] characters.
fn wrapped(words: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split_whitespace() {
        let line = lines.last().map_or(0, |line| line.chars().count());
        if line > 0 && line + 1 + word.chars().count() > LINE {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_becomes_rows_without_markdown() {
        let text = "## A\n\nwords\n\n| pin | does | remark |\n| --- | --- | --- |\n| PA4 | **set** value, [below](#b) | x |\n\n## B\n";
        assert_eq!(table(text, "## A"), [Row { pins: "PA4".into(), words: "set value, below; x".into() }]);
        let text = "## A\n| pin | connector | does |\n| --- | --- | --- |\n| PA4 | CN7 17 | set value |\n| CN13 | | USB |\n";
        assert_eq!(
            table(text, "## A"),
            [
                Row { pins: "PA4 (CN7 17)".into(), words: "set value".into() },
                Row { pins: "CN13".into(), words: "USB".into() }
            ]
        );
    }

    #[test]
    fn the_pictures_are_those_of_the_tables() {
        for (path, svg) in drawn().expect("tables of pins") {
            let kept = fs::read_to_string(&path).unwrap_or_default();
            assert!(kept == svg, "{}: run `cargo xtask wiring`", path.display());
        }
    }
}
