//! Files that a person names: one of those that come with the program, by its name, or any file, by
//! its path.

use crate::error::Error;
use serde::de::DeserializeOwned;
use std::path::Path;

/// A text and what errors call it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// The file, or the built-in name.
    pub origin: String,
    /// Its text.
    pub text: String,
}

/// Finds `wanted` among `built_in` (name, text), else reads it as a path. `what` names the kind in
/// errors.
pub fn find(what: &str, wanted: &str, built_in: &[(&str, &str)]) -> Result<Text, Error> {
    if let Some((name, text)) = built_in.iter().find(|(name, _)| *name == wanted) {
        return Ok(Text { origin: format!("{what} {name}"), text: (*text).to_owned() });
    }
    let path = Path::new(wanted);
    let looks_like_a_path = wanted.contains(['/', '\\', '.']);
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(Text { origin: wanted.to_owned(), text }),
        Err(cause) if looks_like_a_path => Err(Error::input(format_args!(
            "{wanted}: the {what} file cannot be read ({cause}); check its path"
        ))),
        Err(_) => {
            let names: Vec<&str> = built_in.iter().map(|(name, _)| *name).collect();
            Err(Error::input(format_args!(
                "there is no {what} called \"{wanted}\"; use one of {} or the path of a TOML file",
                names.join(", ")
            )))
        }
    }
}

/// Parses TOML; an error names the file and the line.
pub fn parse<T: DeserializeOwned>(source: &Text) -> Result<T, Error> {
    toml::from_str(&source.text).map_err(|cause| {
        let before = cause.span().map_or(0, |span| span.start.min(source.text.len()));
        let line = source.text.as_bytes()[..before].iter().filter(|byte| **byte == b'\n').count() + 1;
        // Whoever edits a form does not see lines: the key there is named too.
        let key = source
            .text
            .lines()
            .nth(line - 1)
            .and_then(|text| text.split_once('='))
            .map(|(key, _)| key.trim());
        let key = key.map(|key| format!(" ({key})")).unwrap_or_default();
        Error::input(format_args!(
            "{}, line {line}{key}: {}; correct the file",
            source.origin,
            in_words(cause.message())
        ))
    })
}

/// A parser's message; of a key that is not known, with the nearest that is.
fn in_words(message: &str) -> String {
    let Some((key, known)) =
        message.strip_prefix("unknown field `").and_then(|rest| rest.split_once("`, expected "))
    else {
        return message.to_owned();
    };
    let known: Vec<&str> = known.split('`').skip(1).step_by(2).collect();
    let near = known.iter().map(|name| (strsim::damerau_levenshtein(key, name), *name)).min();
    match near.filter(|(changes, name)| 2 * changes <= name.len()) {
        Some((_, name)) => format!("{key} is not a key here; do you mean {name}"),
        None => format!("{key} is not a key here; known are {}", known.join(", ")),
    }
}

/// Returns true for a plain name that leads to no other folder.
pub fn is_file_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_alphanumeric() || " ._-".contains(c);
    (1..=60).contains(&name.chars().count())
        && name.chars().all(is_plain)
        && name.starts_with(|c: char| c.is_alphanumeric())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_is_misspelt_is_named_with_the_nearest() {
        let message = "unknown field `thicknes_mm`, expected one of `name`, `thickness_mm`";
        assert_eq!(in_words(message), "thicknes_mm is not a key here; do you mean thickness_mm");
        let message = "unknown field `colour`, expected `name` or `thickness_mm`";
        assert_eq!(in_words(message), "colour is not a key here; known are name, thickness_mm");
        assert_eq!(in_words("missing field `name`"), "missing field `name`");
    }
}
