//! Files that a person names: one of those that come with the program, by its name, or any file, by its path.

use crate::failure::Failure;
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

/// Finds `wanted` among `built_in` (name, text), else reads it as a path. `what` names the kind in errors.
pub fn find(what: &str, wanted: &str, built_in: &[(&str, &str)]) -> Result<Text, Failure> {
    if let Some((name, text)) = built_in.iter().find(|(name, _)| *name == wanted) {
        return Ok(Text { origin: format!("{what} {name}"), text: (*text).to_owned() });
    }
    let path = Path::new(wanted);
    let looks_like_a_path = wanted.contains(['/', '\\', '.']);
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(Text { origin: wanted.to_owned(), text }),
        Err(cause) if looks_like_a_path => Err(Failure::input(format_args!(
            "{wanted}: the {what} file cannot be read ({cause}); check its path"
        ))),
        Err(_) => {
            let names: Vec<&str> = built_in.iter().map(|(name, _)| *name).collect();
            Err(Failure::input(format_args!(
                "there is no {what} called \"{wanted}\"; use one of {} or the path of a TOML file",
                names.join(", ")
            )))
        }
    }
}

/// Parses TOML; an error names the file and the line.
pub fn parse<T: DeserializeOwned>(source: &Text) -> Result<T, Failure> {
    toml::from_str(&source.text).map_err(|cause| {
        let before = cause.span().map_or(0, |span| span.start.min(source.text.len()));
        let line = source.text.as_bytes()[..before].iter().filter(|byte| **byte == b'\n').count() + 1;
        // Whoever edits a form does not see lines: the key that stands there is named too.
        let key = source
            .text
            .lines()
            .nth(line - 1)
            .and_then(|text| text.split_once('='))
            .map(|(key, _)| key.trim());
        let key = key.map(|key| format!(" ({key})")).unwrap_or_default();
        Failure::input(format_args!(
            "{}, line {line}{key}: {}; correct the file",
            source.origin,
            cause.message()
        ))
    })
}
