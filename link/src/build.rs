//! The commit that a program was built from, so that a recording or a report says which one made
//! it.
//!
//! It is named in the variable `NEEDLE_BUILD`: eight hexadecimal digits, with a `+` behind them if
//! the sources had been changed since. `firmware/build.rs` sets it for every image, `cargo xtask
//! dist` for the programs that it makes; elsewhere the commit is unknown, and nothing is built anew
//! for each commit.

use core::fmt;
use serde::{Deserialize, Serialize};

/// A commit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Build {
    /// The first eight digits of the commit's hash; 0 if unknown.
    pub commit: u32,
    /// True if the sources differed from the commit.
    pub is_changed: bool,
}

impl Build {
    /// The commit that this program was built from.
    pub const CURRENT: Self = match option_env!("NEEDLE_BUILD") {
        Some(text) => Self::parse(text),
        None => Self { commit: 0, is_changed: false },
    };

    /// Reads `text`; anything but eight hexadecimal digits and a `+` is an unknown commit.
    pub const fn parse(text: &str) -> Self {
        const UNKNOWN: Build = Build { commit: 0, is_changed: false };
        let (mut commit, mut digits, mut is_changed) = (0_u32, 0, false);
        let mut rest = text.as_bytes();
        while let [byte, after @ ..] = rest {
            rest = after;
            let digit = match *byte {
                b'0'..=b'9' => *byte - b'0',
                b'a'..=b'f' => *byte - b'a' + 10,
                b'+' if digits == 8 && after.is_empty() => {
                    is_changed = true;
                    break;
                }
                _ => return UNKNOWN,
            };
            if digits == 8 {
                return UNKNOWN;
            }
            commit = commit << 4 | digit as u32;
            digits += 1;
        }
        if digits == 8 { Self { commit, is_changed } } else { UNKNOWN }
    }
}

/// As text: `1a2b3c4d`, `1a2b3c4d, changed`, or `unknown build`.
impl fmt::Display for Build {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self { commit: 0, .. } => f.write_str("unknown build"),
            Self { commit, is_changed: false } => write!(f, "{commit:08x}"),
            Self { commit, is_changed: true } => write!(f, "{commit:08x}, changed"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_commit_is_eight_digits_and_a_plus() {
        let commit = 0x1a2b_3c4d;
        assert_eq!(Build::parse("1a2b3c4d"), Build { commit, is_changed: false });
        assert_eq!(Build::parse("1a2b3c4d+"), Build { commit, is_changed: true });
        for wrong in ["", "+", "1a2b3c4", "1a2b3c4d5", "1a2b3c4d++", "1A2B3C4D", "1a2b3c4+"] {
            assert_eq!(Build::parse(wrong), Build::default(), "{wrong}");
        }
    }
}
