//! The word check: phrases that `words/list.rs` replaces by plain ones, second words for a term of
//! `words/terms.rs`, names of files that say nothing, doc comments that open like a question, long
//! names of tests and wide comments.
//!
//! Comments and string literals of Rust are read, and the whole text of Markdown, HTML, CSS,
//! JavaScript, Python and TOML. A phrase is found in any case and across a line break, and never
//! across punctuation.

mod list;
mod prose;
mod terms;

use crate::shell::{self, Error};
use list::{OPENINGS, Phrase};
use prose::Word;
pub(crate) use prose::code;
use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::Path;
use terms::{FILE_NAMES, TERMS, Term};

/// Folders without prose of ours: what is built, and what git keeps.
const SKIPPED: [&str; 4] = ["target", ".git", ".venv", "node_modules"];
/// The longest name of a test, in characters.
const LONGEST_NAME: usize = 60;
/// The widest comment in Rust, in columns.
const WIDEST_COMMENT: usize = 100;
/// The lists name what they ban.
const LISTS: [&str; 2] = ["xtask/src/words/list.rs", "xtask/src/words/terms.rs"];

/// Checks every file of the repository, prints each finding, and fails if there is one.
pub(crate) fn check() -> Result<(), Error> {
    let mut findings = Vec::new();
    visit(&shell::top(), "", &mut findings)
        .map_err(|error| Error::new(format!("the sources could not be read: {error}")))?;
    findings.iter().for_each(|finding| eprintln!("{finding}"));
    if findings.is_empty() {
        return Ok(());
    }
    Err(Error::new(format!(
        "{} words to change, each printed above with what to write instead; {} list them with reasons",
        findings.len(),
        LISTS.join(" and ")
    )))
}

/// Appends the findings in every file below `folder`, whose path from the top of the repository is
/// `path`.
fn visit(folder: &Path, path: &str, findings: &mut Vec<String>) -> io::Result<()> {
    let mut entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let below = if path.is_empty() { name.to_string() } else { format!("{path}/{name}") };
        let kind = entry.file_type()?;
        if SKIPPED.contains(&name) {
            continue;
        }
        findings.extend(file_name(name).map(|plain| format!("{below}: name it {plain}")));
        if kind.is_dir() {
            visit(&entry.path(), &below, findings)?;
        } else if kind.is_file() && !LISTS.contains(&below.as_str()) {
            let Some(prose) = prose::reader(name) else { continue };
            let Ok(text) = fs::read_to_string(entry.path()) else { continue };
            check_text(&below, &text, &prose(&text), findings);
        }
    }
    Ok(())
}

/// Appends the findings in the text of one file, whose words are `words`.
fn check_text(path: &str, text: &str, words: &[Word], findings: &mut Vec<String>) {
    findings.extend(phrases(words, list::PHRASES).iter().map(|found| found.message(path)));
    findings.extend(synonyms(words, TERMS).iter().map(|found| found.message(path)));
    if path.ends_with(".rs") {
        findings.extend(long_names(text).into_iter().map(|(line, name)| {
            format!("{path}:{line}: {name}: say what holds in at most {LONGEST_NAME} characters")
        }));
        findings.extend(
            wide(text)
                .into_iter()
                .map(|line| format!("{path}:{line}: wrap this comment at {WIDEST_COMMENT} columns")),
        );
    }
    if [".rs", ".js"].iter().any(|end| path.ends_with(end)) {
        findings.extend(openings(text).into_iter().map(|(line, word)| {
            format!(
                "{path}:{line}: a doc comment opens with \"{word}\": write a sentence, such as \"Returns …\", \"True if …\" or \
                 \"The time constant of …, in s\""
            )
        }));
    }
}

/// Returns the name that replaces that of a file or folder, if it is one of [`FILE_NAMES`].
fn file_name(name: &str) -> Option<&'static str> {
    let stem = name.split('.').next()?;
    let is_code = !name.contains('.') || name.ends_with(".rs") || name.ends_with(".js");
    FILE_NAMES.iter().find(|(banned, _)| is_code && *banned == stem).map(|(_, plain)| *plain)
}

/// A phrase of the list in a text.
struct Found<'a> {
    line: usize,
    phrase: &'a Phrase,
}

impl Found<'_> {
    fn message(&self, path: &str) -> String {
        let Phrase { banned, plain, why } = self.phrase;
        format!("{path}:{}: \"{banned}\": write \"{plain}\" ({why})", self.line)
    }
}

/// Another word for a term in a text.
struct Synonym<'a> {
    line: usize,
    word: &'a str,
    term: &'a Term,
}

impl Synonym<'_> {
    fn message(&self, path: &str) -> String {
        let Term { term, meaning, .. } = self.term;
        format!("{path}:{}: \"{}\": the term is \"{term}\" ({meaning})", self.line, self.word)
    }
}

/// Returns every occurrence of the phrases of `list`, in the order of the text.
fn phrases<'a>(words: &[Word], list: &'a [Phrase]) -> Vec<Found<'a>> {
    let banned = list.iter().map(|phrase| (phrase.banned, phrase));
    occurrences(words, banned).into_iter().map(|(line, _, phrase)| Found { line, phrase }).collect()
}

/// Returns every occurrence of another word for a term of `list`, in the order of the text.
fn synonyms<'a>(words: &[Word], list: &'a [Term]) -> Vec<Synonym<'a>> {
    let banned = list.iter().flat_map(|term| term.not.iter().map(move |word| (*word, term)));
    occurrences(words, banned).into_iter().map(|(line, word, term)| Synonym { line, word, term }).collect()
}

/// Returns every occurrence of the banned texts with its line, the text and its entry of a list.
fn occurrences<'a, T>(
    words: &[Word],
    banned: impl Iterator<Item = (&'a str, &'a T)>,
) -> Vec<(usize, &'a str, &'a T)> {
    let mut by_first: HashMap<&str, Vec<(&str, &T)>> = HashMap::new();
    for (text, entry) in banned {
        by_first.entry(text.split(' ').next().unwrap_or_default()).or_default().push((text, entry));
    }
    let mut found = Vec::new();
    for (at, first) in words.iter().enumerate() {
        for (text, entry) in by_first.get(first.text.as_str()).into_iter().flatten() {
            let rest: Vec<_> = text.split(' ').skip(1).collect();
            let follows = words[at + 1..].iter().take(rest.len()).filter(|word| word.follows);
            let same = follows.zip(&rest).filter(|(word, banned)| is_same(&word.text, banned));
            if same.count() == rest.len() {
                found.push((first.line, *text, *entry));
            }
        }
    }
    found
}

/// True if a word is the one of a phrase; `*'s` is any word that ends in 's.
fn is_same(word: &str, banned: &str) -> bool {
    word == banned || banned == "*'s" && ["'s", "’s"].iter().any(|end| word.ends_with(end))
}

/// Returns the lines of Rust in `text` that hold nothing but a comment and are too long. A row of a
/// table is as long as it is.
fn wide(text: &str) -> Vec<usize> {
    let is_wide = |line: &str| {
        let comment = line.trim_start();
        let is_row = comment.trim_start_matches(['/', '!']).starts_with(" | ") && comment.ends_with('|');
        comment.starts_with("//") && !is_row && line.chars().count() > WIDEST_COMMENT
    };
    text.lines().enumerate().filter(|(_, line)| is_wide(line)).map(|(number, _)| number + 1).collect()
}

/// Returns the lines of Rust in `text` with the name of a test that is too long, each with the
/// name.
fn long_names(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut is_test = false;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if let Some((_, rest)) = line.split_once("fn ").filter(|_| is_test) {
            let name = rest.split('(').next().unwrap_or(rest);
            if name.len() > LONGEST_NAME {
                found.push((number + 1, name));
            }
        }
        is_test = line == "#[test]" || is_test && line.starts_with("#[");
    }
    found
}

/// Returns the lines of Rust or JavaScript in `text` that begin a doc comment with a word of
/// [`OPENINGS`], each with the word.
fn openings(text: &str) -> Vec<(usize, &'static str)> {
    let mut found = Vec::new();
    let mut is_inside = false;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim_start();
        let doc = ["///", "//!", "/**"].iter().find_map(|marker| line.strip_prefix(marker));
        if let (Some(doc), false) = (doc, is_inside) {
            let first = doc.trim_start().split(|letter: char| !letter.is_alphabetic()).next();
            found
                .extend(OPENINGS.iter().filter(|word| Some(**word) == first).map(|word| (number + 1, *word)));
        }
        is_inside = doc.is_some() && !line.ends_with("*/");
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: [Phrase; 2] = [
        Phrase { banned: "quite so", plain: "so", why: "shorter" },
        Phrase { banned: "verily", plain: "indeed", why: "younger" },
    ];

    /// The lines of `text`, a file named `name`, on which a phrase of the list begins.
    fn lines(name: &str, text: &str) -> Vec<usize> {
        let prose = prose::reader(name).expect("a kind of file with prose");
        phrases(&prose(text), &LIST).iter().map(|found| found.line).collect()
    }

    #[test]
    fn a_phrase_is_found_in_any_case_and_across_lines() {
        assert_eq!(lines("a.md", "one\nQuite so, verily"), [2, 2]);
        assert_eq!(lines("a.rs", "/// It is quite\n    /// so.\nfn f() {}"), [1]);
        assert_eq!(lines("a.rs", "f(\"is quite \\\n   so\");"), [1]);
        assert_eq!(lines("a.js", "/** is quite\n * so */"), [1]);
    }

    #[test]
    fn punctuation_and_longer_words_separate() {
        assert!(lines("a.md", "quite, so; quite (so) quite sore, unverily").is_empty());
        assert!(lines("a.md", "quite\n\nso").is_empty(), "a paragraph ends");
    }

    #[test]
    fn code_is_not_read_as_prose() {
        assert!(lines("a.rs", "for verily in verily { let c = '\"'; quite(so) }").is_empty());
        assert_eq!(lines("a.rs", "let c = '\"'; // verily\nlet r = r#\"a \"verily\" \"#;"), [1, 2]);
        assert_eq!(lines("a.rs", "fn f<'a>(x: &'a str) {} /* verily /* so */ verily */"), [1, 1]);
        assert_eq!(lines("a.rs", "let s = b\"verily\\\\\"; verily(); let t = \"\\\"verily\";"), [1, 1]);
    }

    #[test]
    fn other_files_are_not_read() {
        assert!(prose::reader("picture.png").is_none() && prose::reader("Cargo.lock").is_none());
    }

    #[test]
    fn a_message_says_where_what_and_what_instead() {
        let words = prose::reader("a.md").expect("a kind of file with prose")("x\nverily");
        let found = phrases(&words, &LIST);
        assert_eq!(found[0].message("docs/a.md"), "docs/a.md:2: \"verily\": write \"indeed\" (younger)");
    }

    #[test]
    fn a_second_word_for_a_term_is_found_with_the_term() {
        let list = [Term { term: "rotor", meaning: "it turns", not: &["turning part", "spinner"] }];
        let words =
            prose::reader("a.md").expect("a kind of file with prose")("a rotor\na turning\npart, a spinner");
        let found: Vec<_> = synonyms(&words, &list).iter().map(|found| found.message("a.md")).collect();
        assert_eq!(
            found,
            [
                "a.md:2: \"turning part\": the term is \"rotor\" (it turns)",
                "a.md:3: \"spinner\": the term is \"rotor\" (it turns)"
            ]
        );
    }

    #[test]
    fn a_file_has_the_name_of_its_content() {
        assert_eq!(file_name("written.rs"), Some("writer"));
        assert_eq!(file_name("bedside"), Some("patient_manager"), "a folder");
        assert_eq!(file_name("rewritten.rs"), None);
        assert_eq!(file_name("sheet.xlsx"), None, "a recording has the name that it came with");
    }

    #[test]
    fn a_term_is_not_a_second_word_for_another() {
        let words = |term: &Term| term.not.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let banned: Vec<String> = TERMS.iter().flat_map(words).collect();
        for (at, word) in banned.iter().enumerate() {
            assert_eq!(*word, word.to_lowercase());
            assert!(!banned[..at].contains(word), "{word} is listed twice");
        }
        for Term { term, meaning, .. } in TERMS {
            assert!(!banned.iter().any(|word| word == term) && !meaning.is_empty(), "{term}");
        }
    }

    #[test]
    fn only_the_first_line_of_a_doc_comment_is_an_opening() {
        let text = "//! What it is.\n\n/// Returns it.\n/// What follows.\nfn f() {}\n    /// Whether so.\n/// Whatever.";
        assert_eq!(openings(text), [(1, "What"), (6, "Whether")]);
        assert_eq!(openings("/** What it is. */\n  /** How it is. */"), [(1, "What"), (2, "How")]);
        assert_eq!(openings("// What is it?\n/// Whatever it is, it is returned."), []);
    }

    #[test]
    fn one_phrase_covers_every_owner() {
        let list = [Phrase { banned: "quite *'s", plain: "of", why: "shorter" }];
        let words = prose::reader("a.md").expect("a kind of file with prose");
        let lines =
            |text: &str| phrases(&words(text), &list).iter().map(|found| found.line).collect::<Vec<_>>();
        assert_eq!(lines("It is quite one's.\nIt is quite another’s.\nIt is quite one."), [1, 2]);
    }

    #[test]
    fn a_comment_has_at_most_a_hundred_columns() {
        let (fits, wide_one) = (format!("// {}", "a".repeat(97)), format!("    /// {}", "b".repeat(93)));
        let row = format!("//! | {} |", "c".repeat(100));
        assert_eq!(
            wide(&format!("{fits}\n{wide_one}\n{row}\nlet long = \"{}\"; // d", "d".repeat(100))),
            [2]
        );
    }

    #[test]
    fn a_test_has_a_name_of_at_most_sixty_characters() {
        let (short, long) = ("a".repeat(60), "b".repeat(61));
        let text = format!(
            "#[test]\n#[ignore = \"slow\"]\nfn {long}() {{}}\n#[test]\nfn {short}() {{}}\nfn {long}() {{}}"
        );
        assert_eq!(long_names(&text), [(3, long.as_str())], "other functions may have any name");
    }

    #[test]
    fn the_list_is_lower_case_and_holds_no_phrase_twice() {
        for (at, phrase) in list::PHRASES.iter().enumerate() {
            assert_eq!(phrase.banned, phrase.banned.to_lowercase());
            assert!(!phrase.plain.is_empty() && !phrase.why.is_empty(), "{}", phrase.banned);
            assert!(
                list::PHRASES[..at].iter().all(|other| other.banned != phrase.banned),
                "{}",
                phrase.banned
            );
        }
    }
}
