//! The error for a file that cannot be used.

use std::fmt;

/// Input that cannot be used: one sentence that says what is wrong, where, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputError(String);

impl InputError {
    pub(crate) fn new(sentence: impl Into<String>) -> Self {
        Self(sentence.into())
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // One line whatever a parser put into its message.
        let line: Vec<&str> = self.0.split_whitespace().collect();
        out.write_str(&line.join(" "))
    }
}

impl std::error::Error for InputError {}
