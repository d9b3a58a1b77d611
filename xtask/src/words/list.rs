//! The phrases that the project does not use, what it writes instead, and why.
//!
//! A phrase is added once it is gone from the repository, and only where it is wrong in every sentence.

/// A phrase: words in lower case, one blank apart.
pub(super) struct Phrase {
    pub(super) banned: &'static str,
    pub(super) plain: &'static str,
    pub(super) why: &'static str,
}

const fn phrase(banned: &'static str, plain: &'static str, why: &'static str) -> Phrase {
    Phrase { banned, plain, why }
}

const WORD_ORDER: &str = "the number follows it: at least 3";
const NO_NUMBER: &str = "say what the thing is not: not finite, not a record, does not exist";

pub(super) const PHRASES: &[Phrase] = &[
    phrase("at the least", "at least", WORD_ORDER),
    phrase("at the most", "at most", WORD_ORDER),
    phrase("is for good", "is permanent", "it also reads as praise"),
    phrase("gone for good", "permanently gone", "it also reads as praise"),
    phrase("low for good", "always low", "it also reads as praise"),
    phrase("nought", "zero", "one word for one number"),
    phrase("tells apart", "distinguishes", "the verb is distinguish"),
    phrase("that is none", "that does not exist", NO_NUMBER),
    phrase("that are none", "that are not", NO_NUMBER),
    phrase("comes near", "is close to, fits nearly as well", "say how close"),
    phrase("of which it is", "of which … is", "subject, verb, object"),
    phrase("must lie", "must be", "a value is in a range"),
    phrase("made where there is none", "created if missing", "shorter"),
    phrase("from which on", "the smallest … at which, above which", "the thing first, then its condition"),
    phrase("in its place", "instead, replaces it", "shorter, and not a place"),
    phrase("seed 000", "Paper 000", "a seed is the start of a random generator"),
    phrase("seed 001", "Paper 001", "a seed is the start of a random generator"),
    phrase("seed 002", "Paper 002", "a seed is the start of a random generator"),
    phrase("in their place", "instead, replaces them", "shorter, and not a place"),
];

/// Words that do not open the first sentence of a doc comment: it says what is returned, true or stored.
pub(super) const OPENINGS: &[&str] = &["What", "Whether", "How", "Where", "Of"];
