//! The errors that a person meets: one sentence and an exit status.

use std::fmt;

/// One sentence that says what is wrong, where, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// Unusable input: exit status 2.
    Input(String),
    /// A request that could not be carried out: exit status 1.
    Failed(String),
}

impl Error {
    /// Unusable input.
    pub fn input(sentence: impl fmt::Display) -> Self {
        Self::Input(one_line(&sentence.to_string()))
    }

    /// Something that did not work out.
    pub fn failed(sentence: impl fmt::Display) -> Self {
        Self::Failed(one_line(&sentence.to_string()))
    }

    /// The process's exit status.
    pub fn status(&self) -> u8 {
        match self {
            Error::Failed(_) => 1,
            Error::Input(_) => 2,
        }
    }
}

/// Parsers like to draw; a log or a pipe wants one line.
fn one_line(sentence: &str) -> String {
    sentence.split_whitespace().collect::<Vec<_>>().join(" ")
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Error::Input(sentence) | Error::Failed(sentence)) = self;
        f.write_str(sentence)
    }
}

impl std::error::Error for Error {}
