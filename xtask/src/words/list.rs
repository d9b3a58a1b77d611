//! The phrases that the project does not use, what it writes instead, and why.
//!
//! A phrase is added once it is gone from the repository, and only where it is wrong in every
//! sentence: a needle stands upright, a vein lies in fat and a device is told what to do, so that
//! these words are not listed by themselves.

/// A phrase: words in lower case, one blank apart. `*'s` is any word that ends in 's.
pub(super) struct Phrase {
    pub(super) banned: &'static str,
    pub(super) plain: &'static str,
    pub(super) why: &'static str,
}

const fn phrase(banned: &'static str, plain: &'static str, why: &'static str) -> Phrase {
    Phrase { banned, plain, why }
}

const WORD_ORDER: &str = "the number follows it: at least 3";
const PRAISE: &str = "it also reads as praise";
const DISTINGUISH: &str = "the verb is distinguish";
const TOLD: &str = "nobody tells it: it is reported, given, found or recognised";
const NOT_STANDING: &str = "a value, text or file is somewhere; it does not stand";
const NOT_LYING: &str = "a value, text or file is somewhere; it does not lie";
const REST: &str = "name it";
const NO_NUMBER: &str = "say what the thing is not: not finite, not a record, does not exist";

pub(super) const PHRASES: &[Phrase] = &[
    phrase("at the least", "at least", WORD_ORDER),
    phrase("at the most", "at most", WORD_ORDER),
    phrase("nought", "zero", "one word for one number"),
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
    phrase("for good", "permanently, always", PRAISE),
    phrase("tells apart", "distinguishes", DISTINGUISH),
    phrase("told apart", "distinguished", DISTINGUISH),
    phrase("tell apart", "distinguish", DISTINGUISH),
    phrase("told from", "distinguished from, found from", TOLD),
    phrase("told by", "reported by, given by", TOLD),
    phrase("told as", "reported as", TOLD),
    phrase("told again", "reported again", TOLD),
    phrase("come near", "are close to, approach", "say how close"),
    phrase("what is left", "the residual, the rest", REST),
    phrase("is no *'s", "does not belong to", NO_NUMBER),
    phrase("are no *'s", "do not belong to", NO_NUMBER),
    phrase("is none of the", "is not one of the, is outside the", NO_NUMBER),
    phrase("are none of the", "are not among the, do not pass to the", NO_NUMBER),
    phrase("zero is none", "zero does not count", NO_NUMBER),
    phrase("noise is none", "noise does not matter", NO_NUMBER),
    phrase("this are none", "this do not count", NO_NUMBER),
    phrase("as it stands", "as it is, unchanged", NOT_STANDING),
    phrase("what stands", "what is", NOT_STANDING),
    phrase("stands beside", "is next to", NOT_STANDING),
    phrase("stands here", "is here", NOT_STANDING),
    phrase("stands there", "is there", NOT_STANDING),
    phrase("stands first", "comes first", NOT_STANDING),
    phrase("stands last", "comes last", NOT_STANDING),
    phrase("stands alone", "is alone", NOT_STANDING),
    phrase("stands at a", "is at a", NOT_STANDING),
    phrase("stands at its", "is at its", NOT_STANDING),
    phrase("stands in a", "is in a", NOT_STANDING),
    phrase("stands in its", "is in its", NOT_STANDING),
    phrase("stands in no", "is in no", NOT_STANDING),
    phrase("stands in the", "is in the", NOT_STANDING),
    phrase("stands with", "is with", NOT_STANDING),
    phrase("lies outside", "is outside", NOT_LYING),
    phrase("lies past", "is past", NOT_LYING),
    phrase("lies beyond", "is beyond", NOT_LYING),
    phrase("lies within", "is within", NOT_LYING),
    phrase("lies between", "is between", NOT_LYING),
    phrase("lies beside them", "is next to them", NOT_LYING),
    phrase("lies in flash", "is in flash", NOT_LYING),
    phrase("beside each other", "side by side", "the usual words"),
    phrase("beside this page", "next to this page", "the usual words"),
    phrase("in their place", "instead, replaces them", "shorter, and not a place"),
];

/// Words that do not open the first sentence of a doc comment: it says what is returned, true or
/// stored.
pub(super) const OPENINGS: &[&str] = &["What", "Whether", "How", "Where", "Of"];
