//! The memory that a reset leaves alone.
#![allow(unsafe_code, reason = "only a section of its own is left alone by the start-up code")]

use firmware::reset::LastWords;

/// Memory that survives a reset: start-up code leaves this section alone, any bits are valid in it,
/// and it says itself which mean something.
#[unsafe(link_section = ".uninit.last_words")]
pub(crate) static LAST_WORDS: LastWords = LastWords::new();
