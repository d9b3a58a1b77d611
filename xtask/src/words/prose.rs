//! The words of a file: all of a text, or the comments and string literals of Rust.

/// A word, in lower case.
pub(super) struct Word {
    pub(super) text: String,
    /// The line it is on, from 1.
    pub(super) line: usize,
    /// True if only blanks, a line break or a comment's marker stand between it and the word before.
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

/// Returns `source` with every character of code replaced by [`BREAK`]; line breaks and blanks stay.
fn comments_and_strings(source: &str) -> String {
    let mut prose = String::with_capacity(source.len());
    let mut rest = source;
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            let length = rest.find('\n').unwrap_or(rest.len());
            prose.push_str(rest[..length].trim_start_matches(['/', '!']));
            length
        } else if rest.starts_with("/*") {
            let length = block_comment(rest);
            prose.push_str(&rest[2..length]);
            length
        } else if let Some(length) = raw_string(rest) {
            prose.push(BREAK);
            prose.push_str(&rest[2..length]);
            prose.push(BREAK);
            length
        } else if first == '"' {
            let length = quoted(rest, '"');
            prose.push_str(&rest[..length]);
            length
        } else if first == '\'' {
            prose.push(BREAK);
            character(rest)
        } else if first.is_alphanumeric() || first == '_' {
            // A whole word, so that the `r` at the end of another does not open a raw string.
            prose.push(BREAK);
            rest.find(|letter: char| !letter.is_alphanumeric() && letter != '_').unwrap_or(rest.len())
        } else {
            prose.push(if first.is_whitespace() { first } else { BREAK });
            first.len_utf8()
        };
        rest = &rest[length..];
    }
    prose
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

/// The length of the literal that `text` begins with, from one `quote` to the next that no backslash precedes.
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

/// The length of the character literal that `text` begins with; of its apostrophe alone if that begins a lifetime.
fn character(text: &str) -> usize {
    let mut letters = text.char_indices().skip(1);
    let first = letters.next();
    let is_closed = letters.next().is_some_and(|(_, letter)| letter == '\'');
    if is_closed || first.is_some_and(|(_, letter)| letter == '\\') { quoted(text, '\'') } else { 1 }
}
