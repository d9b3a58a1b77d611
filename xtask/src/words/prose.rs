//! The words of a file: all of a text, or the comments and string literals of Rust.

/// A word, in lower case.
pub(super) struct Word {
    pub(super) text: String,
    /// The line it is on, from 1.
    pub(super) line: usize,
    /// True if only blanks, a line break or a comment's marker stand between it and the word
    /// before.
    pub(super) follows: bool,
}

/// Separates what belongs to different sentences.
const BREAK: char = '.';

/// Returns the function that reads the words of a file of this name; `None` if it holds no prose.
pub(super) fn reader(name: &str) -> Option<fn(&str) -> Vec<Word>> {
    let (_, extension) = name.rsplit_once('.')?;
    match extension {
        "rs" => Some(|text| words(&comments_and_strings(text))),
        "md" | "html" | "css" | "js" | "cjs" | "mjs" | "py" | "toml" => Some(words),
        _ => None,
    }
}

fn words(text: &str) -> Vec<Word> {
    let mut words = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let mut follows = true;
        let is_empty = line.trim().is_empty();
        let body = line.trim_start().trim_start_matches(['/', '*', '#', '!', '>']);
        let mut rest = body;
        while let Some(begin) = rest.find(is_letter) {
            follows &= rest[..begin].trim().is_empty();
            let length = rest[begin..].find(|letter| !is_letter(letter)).unwrap_or(rest.len() - begin);
            words.push(Word { text: rest[begin..begin + length].to_lowercase(), line: number + 1, follows });
            rest = &rest[begin + length..];
            follows = true;
        }
        let ends_open = rest.trim_end_matches('\\').trim().is_empty();
        if is_empty || !ends_open {
            // Nothing on a later line continues this one: a word that matches no phrase.
            words.push(Word { text: String::new(), line: number + 1, follows: false });
        }
    }
    words
}

fn is_letter(letter: char) -> bool {
    letter.is_alphanumeric() || matches!(letter, '_' | '-' | '\'' | '’')
}

/// Returns `source` with every character of code replaced by [`BREAK`]; line breaks and blanks
/// stay.
fn comments_and_strings(source: &str) -> String {
    let mut prose = String::with_capacity(source.len());
    for (kind, piece) in Pieces(source) {
        match kind {
            Kind::LineComment => prose.push_str(piece.trim_start_matches(['/', '!'])),
            Kind::BlockComment => prose.push_str(&piece[2..]),
            Kind::RawString => {
                prose.push(BREAK);
                prose.push_str(&piece[2..]);
                prose.push(BREAK);
            }
            Kind::String => prose.push_str(piece),
            Kind::Character | Kind::Word => prose.push(BREAK),
            Kind::Other => prose.push(if piece.trim().is_empty() { ' ' } else { BREAK }),
            Kind::LineBreak => prose.push('\n'),
        }
    }
    prose
}

/// Returns `source` without comments, and with every literal as a blank.
pub(crate) fn code(source: &str) -> String {
    let is_code = |kind| matches!(kind, Kind::Word | Kind::Other | Kind::LineBreak);
    Pieces(source).map(|(kind, piece)| if is_code(kind) { piece } else { " " }).collect()
}

/// A kind of piece of a Rust source.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    LineComment,
    BlockComment,
    RawString,
    String,
    /// A character literal, or the apostrophe of a lifetime.
    Character,
    /// A whole word, so that the `r` at the end of another does not open a raw string.
    Word,
    LineBreak,
    /// One character of anything else.
    Other,
}

/// The pieces of the rest of a source, in its order.
struct Pieces<'a>(&'a str);

impl<'a> Iterator for Pieces<'a> {
    type Item = (Kind, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.0;
        let first = rest.chars().next()?;
        let (kind, length) = if rest.starts_with("//") {
            (Kind::LineComment, rest.find('\n').unwrap_or(rest.len()))
        } else if rest.starts_with("/*") {
            (Kind::BlockComment, block_comment(rest))
        } else if let Some(length) = raw_string(rest) {
            (Kind::RawString, length)
        } else if first == '"' {
            (Kind::String, quoted(rest, '"'))
        } else if first == '\'' {
            (Kind::Character, character(rest))
        } else if first.is_alphanumeric() || first == '_' {
            let is_end = |letter: char| !letter.is_alphanumeric() && letter != '_';
            (Kind::Word, rest.find(is_end).unwrap_or(rest.len()))
        } else {
            (if first == '\n' { Kind::LineBreak } else { Kind::Other }, first.len_utf8())
        };
        let (piece, after) = rest.split_at(length);
        self.0 = after;
        Some((kind, piece))
    }
}

/// The length of the block comment that `text` begins with; such comments nest.
fn block_comment(text: &str) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while at < text.len() {
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    text.len()
}

/// The length of the raw string that `text` begins with.
fn raw_string(text: &str) -> Option<usize> {
    let body = text.strip_prefix("br").or_else(|| text.strip_prefix('r'))?;
    let hashes = body.len() - body.trim_start_matches('#').len();
    let inside = body[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    let length = inside.find(&end).map_or(inside.len(), |at| at + end.len());
    Some(text.len() - inside.len() + length)
}

/// The length of the literal that `text` begins with, from one `quote` to the next that no
/// backslash precedes.
fn quoted(text: &str, quote: char) -> usize {
    let mut is_escaped = false;
    for (at, letter) in text.char_indices().skip(1) {
        if letter == quote && !is_escaped {
            return at + letter.len_utf8();
        }
        is_escaped = letter == '\\' && !is_escaped;
    }
    text.len()
}

/// The length of the character literal that `text` begins with; of its apostrophe alone if that
/// begins a lifetime.
fn character(text: &str) -> usize {
    let mut letters = text.char_indices().skip(1);
    let first = letters.next();
    let is_closed = letters.next().is_some_and(|(_, letter)| letter == '\'');
    if is_closed || first.is_some_and(|(_, letter)| letter == '\\') { quoted(text, '\'') } else { 1 }
}
