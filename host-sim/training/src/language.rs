//! The pages of this crate in the languages of the trainee's page. They are written in English, and
//! each text between two tags is then looked up in the page's own files of texts
//! (`host-sim/page/js/strings`): as it is, or as a pattern with places for values.

use device_sim::error::Error;
use html_report::safe;
use serde_json::Value;
use std::collections::BTreeMap;

const FILES: [(&str, &str); 3] = [
    ("en", include_str!("../../page/js/strings/en.js")),
    ("de", include_str!("../../page/js/strings/de.js")),
    ("fr", include_str!("../../page/js/strings/fr.js")),
];

/// A language that a page may be in.
#[derive(Clone, Debug, Default)]
pub struct Language {
    /// Its tag; none for English.
    tag: Option<&'static str>,
    /// English texts and what they are here.
    exact: BTreeMap<String, String>,
    /// English texts with places for values, those with most letters first.
    patterns: Vec<(String, String)>,
}

impl Language {
    /// The language of a tag: `en`, `de` or `fr`.
    pub fn find(wanted: &str) -> Result<Self, Error> {
        let texts = |wanted: &str| {
            FILES.iter().find(|(tag, _)| *tag == wanted).map(|(tag, file)| (*tag, texts(file)))
        };
        let Some(((tag, own), (_, english))) = texts(wanted).zip(texts("en")) else {
            return Err(Error::input(format_args!("--language is \"{wanted}\"; use en, de or fr")));
        };
        if tag == "en" {
            return Ok(Self::default());
        }
        let mut language = Self { tag: Some(tag), ..Self::default() };
        for (key, text) in own {
            let Some(said) = english.get(&key) else { continue };
            match key.split_once('.') {
                Some(("tissue", name)) => drop(language.exact.insert(name.replace('_', " "), text)),
                Some(("debrief" | "said", _)) if said.contains('{') => {
                    language.patterns.push((said.clone(), text))
                }
                Some(("debrief" | "said", _)) => drop(language.exact.insert(said.clone(), text)),
                _ => {}
            }
        }
        language.patterns.sort_by_key(|(english, _)| std::cmp::Reverse(letters(english)));
        Ok(language)
    }

    /// Returns an English page in this language; what has no text stays as it is.
    pub fn page(&self, english: &str) -> String {
        let Some(language) = self.tag else { return english.to_owned() };
        let (mut page, mut rest, mut is_style) = (String::with_capacity(english.len()), english, false);
        while let Some((text, (tag, after))) =
            rest.split_once('<').and_then(|(text, tail)| Some((text, tail.split_once('>')?)))
        {
            page.push_str(&if is_style { text.to_owned() } else { safe(&self.say(&plain(text))) });
            is_style = tag == "style";
            page.push_str(&match tag {
                "html lang=en" => format!("<html lang={language}>"),
                tag => format!("<{tag}>"),
            });
            rest = after;
        }
        page + rest
    }

    /// Returns an English text in this language.
    fn say(&self, english: &str) -> String {
        if english.contains('.') && english.replace('−', "-").parse::<f64>().is_ok() {
            return english.replace('.', ",");
        }
        if let Some(text) = self.exact.get(english) {
            return text.clone();
        }
        let found = self.patterns.iter().find_map(|(pattern, text)| Some((values(pattern, english)?, text)));
        let Some((values, text)) = found else { return english.to_owned() };
        values.iter().fold(text.clone(), |text, (name, value)| {
            let said = match *name {
                "file" => (*value).to_owned(),
                "tissues" => self.say_each(value, ", "),
                _ => self.say_each(value, "; "),
            };
            text.replace(&format!("{{{name}}}"), &said)
        })
    }

    fn say_each(&self, list: &str, between: &str) -> String {
        list.split(between).map(|one| self.say(one)).collect::<Vec<_>>().join(between)
    }
}

/// The texts of a file by their keys: each stands on a line of its own, as in JSON.
fn texts(file: &str) -> BTreeMap<String, String> {
    let fields: Vec<&str> = file
        .lines()
        .filter(|line| line.starts_with("  \""))
        .map(|line| line.trim().trim_end_matches(','))
        .collect();
    let all: BTreeMap<String, Value> =
        serde_json::from_str(&format!("{{{}}}", fields.join(","))).unwrap_or_default();
    all.into_iter().filter_map(|(key, text)| Some((key, text.as_str()?.to_owned()))).collect()
}

/// The number of letters of a pattern outside its places.
fn letters(pattern: &str) -> usize {
    pattern.split('{').map(|part| part.split_once('}').map_or(part, |(_, after)| after).len()).sum()
}

/// The values in the places of a pattern; none where the text is another.
fn values<'a>(pattern: &'a str, text: &'a str) -> Option<Vec<(&'a str, &'a str)>> {
    let (begin, mut places) = pattern.split_once('{')?;
    let mut text = text.strip_prefix(begin)?;
    let mut found = Vec::new();
    loop {
        let (name, after) = places.split_once('}')?;
        let next = after.split_once('{');
        let (value, tail) = match next {
            Some((between, _)) => text.split_once(between)?,
            None => (text.strip_suffix(after)?, ""),
        };
        if value.is_empty() {
            return None;
        }
        found.push((name, value));
        let Some((_, others)) = next else { return Some(found) };
        (text, places) = (tail, others);
    }
}

fn plain(text: &str) -> String {
    text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_in_the_language_but_for_names_and_style() {
        let german = Language::find("de").expect("it is known");
        let english = "<html lang=en><style>p>b{margin:1.5em}</style><p>a.mcap, insertion 2: Put a catheter into the vein.</p>\
             <p>Not passed: it went through the far wall; the skin was pierced at 45°, not at 10–30°.</p>\
             <text>fat, 2.5 mm</text><td>−1.25</td><td>the expert's &lt;b&gt;</td></html>";
        let wanted = "<html lang=de><style>p>b{margin:1.5em}</style><p>a.mcap, Punktion 2: Einen Katheter in die Vene legen.</p>\
             <p>Nicht bestanden: die Hinterwand wurde durchstochen; die Haut wurde unter 45° durchstochen, nicht unter 10–30°.</p>\
             <text>Fett, 2,5 mm</text><td>−1,25</td><td>the expert's &lt;b&gt;</td></html>";
        assert_eq!(german.page(english), wanted);
        let said = german.say("The needle was in the bursa for 0.7 s. The needle passed beside it twice.");
        assert_eq!(said, "Die Nadel war 0,7 s im Ziel (Schleimbeutel). Sie ging zweimal daran vorbei.");
    }

    #[test]
    fn english_stays_and_no_other_language_is_taken() {
        let english = Language::find("en").expect("it is known");
        assert_eq!(english.page("<p>Passed. 1.5</p>"), "<p>Passed. 1.5</p>");
        assert!(Language::find("pl").expect_err("no Polish").to_string().contains("--language"));
    }
}
