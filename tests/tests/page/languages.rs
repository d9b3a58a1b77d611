//! The page in German and French: one file of texts for each language, chosen by the browser's
//! languages or by the person, with room for the longer words.

use crate::needle::{LIVE, SIZES, Size, complaints, open, resize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use tests::browser::{Chromium, Error, Page, Places, Program, check};

const LANGUAGES: [&str; 3] = ["en", "de", "fr"];
/// The namespaces of keys that are put together by the page: `state.` and what the device says,
/// `figure.` and the key of a patient, or `said.` and the name of a sentence; `debrief.` is read by
/// the program.
const PUT_TOGETHER: [&str; 7] = ["figure.", "state.", "tissue.", "task.", "said.", "unit.", "debrief."];

fn page_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/page/js")
}

/// The texts of a language by their keys.
fn texts(language: &str) -> BTreeMap<String, String> {
    let file = page_folder().join("strings").join(format!("{language}.js"));
    let source = fs::read_to_string(&file).expect("a file for each language");
    let lines = source.lines().filter(|line| line.starts_with("  \""));
    let fields: Vec<&str> = lines.map(|line| line.trim().trim_end_matches(',')).collect();
    serde_json::from_str(&format!("{{{}}}", fields.join(","))).expect("a text for each key")
}

/// The names in braces that values replace.
fn places(text: &str) -> BTreeSet<&str> {
    text.split('{').skip(1).filter_map(|rest| rest.split_once('}')).map(|(name, _)| name).collect()
}

#[test]
fn each_language_has_the_same_keys_and_values() {
    let english = texts("en");
    assert!(english.len() > 200, "{} texts", english.len());
    for language in LANGUAGES {
        let others = texts(language);
        let (keys, wanted) =
            (others.keys().collect::<BTreeSet<_>>(), english.keys().collect::<BTreeSet<_>>());
        let apart: Vec<_> = keys.symmetric_difference(&wanted).collect();
        assert!(apart.is_empty(), "keys of {language} or English only: {apart:?}");
        for (key, text) in &others {
            // A verdict may leave out where the tip was, and German what the vessel is called.
            assert!(places(text).is_subset(&places(&english[key])), "{language} {key}: {text}");
            assert_eq!(text.is_empty(), english[key].is_empty(), "{language} {key}");
        }
    }
}

#[test]
fn each_key_of_the_page_has_a_text_and_each_text_a_use() {
    let english = texts("en");
    let mut sources = String::new();
    for entry in fs::read_dir(page_folder()).expect("the page").flatten() {
        if entry.path().extension().is_some_and(|end| end == "js" || end == "html") {
            let source = fs::read_to_string(entry.path()).expect("a file of the page");
            sources.extend(source.lines().filter(is_code));
        }
    }
    let spaces: BTreeSet<&str> =
        english.keys().filter_map(|key| key.split_once('.')).map(|(s, _)| s).collect();
    // Whatever is quoted and begins like a key is one, but for names of files.
    let used: BTreeSet<&str> = sources
        .split(['"', '`', '\''])
        .filter(|text| {
            text.split_once('.').is_some_and(|(space, rest)| spaces.contains(space) && is_name(rest))
        })
        .collect();
    let missing: Vec<_> = used.iter().filter(|key| !english.contains_key(**key)).collect();
    assert!(missing.is_empty(), "keys without a text: {missing:?}");
    let idle = |key: &&String| {
        !used.contains(key.as_str()) && !PUT_TOGETHER.iter().any(|space| key.starts_with(space))
    };
    let idle: Vec<_> = english.keys().filter(idle).collect();
    assert!(idle.is_empty(), "texts that no part of the page shows: {idle:?}");
}

/// True for the rest of a key: not the ending of a file's name.
fn is_name(text: &str) -> bool {
    let is_ending = ["js", "css", "svg", "wasm"].contains(&text);
    !is_ending && !text.is_empty() && text.bytes().all(|b| b.is_ascii_lowercase() || b == b'_')
}

/// True for a line of code, which may name a key; a comment may name a function in the same way.
fn is_code(line: &&str) -> bool {
    !["//", "/*", "*"].iter().any(|begin| line.trim_start().starts_with(begin))
}

#[test]
fn german_fits_at_every_size_and_french_is_chosen() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-languages")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    speaks(&mut page, "pl-PL,pl", "en", "Stop")?;
    for (tags, language, stop) in [("de-CH,de", "de", "Stopp"), ("pl,fr-BE", "fr", "Arrêt")] {
        speaks(&mut page, tags, language, stop)?;
        for size in SIZES {
            resize(&mut page, size)?;
            for state in ["section", "body", "practice", "patient"] {
                show(&mut page, state)?;
                fits(&mut page, language, state, size)?;
                page.photograph(&scratch.join(format!("{language}-{state}-{}.png", size.0)))?;
                page.evaluate("document.querySelector('dialog[open]')?.close()")?;
            }
        }
        resize(&mut page, SIZES[0])?;
    }
    page.evaluate(
        "(() => { const s = document.getElementById('language'); s.value = 'de'; s.dispatchEvent(new Event('change')); })()",
    )?;
    page.wait("the chosen language", &format!("{LIVE} && document.documentElement.lang === 'de'"))?;
    numbers_and_sentences(&mut page)?;
    complaints(&mut page)
}

/// Opens the page anew in a browser that prefers these languages.
fn speaks(page: &mut Page, tags: &str, language: &str, stop: &str) -> Result<(), Error> {
    page.languages(tags)?;
    page.evaluate("window.__old = true, location.reload()")?;
    page.wait("the page anew", &format!("!window.__old && {LIVE}"))?;
    let found = page.evaluate(
        "[document.documentElement.lang, document.getElementById('language').value, document.getElementById('stop').firstChild.data]",
    )?;
    check(
        &format!("{language} where the browser prefers {tags}"),
        found == json!([language, language, stop]),
        &found,
    )?;
    let english = page.evaluate("import('/strings/en.js').then(en => en.default['picture.title'])")?;
    let title = page.evaluate("document.getElementById('picture-title').firstChild.data")?;
    check("headings are in the language", (title == english) == (language == "en"), &title)
}

fn show(page: &mut Page, state: &str) -> Result<(), Error> {
    let clicks: &[&str] = match state {
        "body" => &["view-body", "view-events"],
        "practice" => &["view-section", "view-practice"],
        "patient" => &["view-section", "view-events", "patient"],
        _ => &["view-section", "view-events"],
    };
    for id in clicks {
        page.evaluate(&format!("document.getElementById('{id}').click()"))?;
    }
    std::thread::sleep(std::time::Duration::from_millis(300));
    Ok(())
}

/// No word is wider than its place, and Stop is on top.
fn fits(page: &mut Page, language: &str, state: &str, size: Size) -> Result<(), Error> {
    let wide = page.evaluate(TOO_WIDE)?;
    check(&format!("{language}, {state}: words fit"), wide == json!([]), (size, &wide))?;
    let hit: Value = page.evaluate(
        "(() => { const r = document.getElementById('stop').getBoundingClientRect(); \
         return document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2)?.closest('button')?.id ?? null; })()",
    )?;
    check(&format!("{language}, {state}: Stop on top"), hit == json!("stop"), (size, &hit))
}

/// Elements that are wider inside than outside, without those that end in … by intent: names of
/// files and profiles.
const TOO_WIDE: &str = "(() => {
    const shortened = ['subtitle', 'device', 'recording', 'tick'];
    const wide = [...document.querySelectorAll('body *')].filter(e => e.checkVisibility() && e.clientWidth > 0
        && e.scrollWidth > e.clientWidth + 1 && !e.closest('.unseen') && !shortened.includes(e.id));
    const beyond = document.documentElement.scrollWidth > innerWidth ? ['the page'] : [];
    return beyond.concat(wide.map(e => `${e.tagName} ${e.id || e.className} ${e.textContent.trim().slice(0, 40)} ${e.scrollWidth} > ${e.clientWidth}`));
})()";

/// A decimal comma, and sentences of the program, in German.
fn numbers_and_sentences(page: &mut Page) -> Result<(), Error> {
    page.wait("a decimal comma", "/^−?\\d+,\\d\\d$/.test(document.getElementById('depth').textContent)")?;
    let goal = page.text("document.getElementById('goal').textContent")?;
    check("the goal in German", goal == "Blut aus der Vene entnehmen.", goal)?;
    page.wait(
        "a puncture in German",
        "[...document.querySelectorAll('#events [data-kind=puncture] span')].some(e => /^Haut durchstochen bei \\d,\\d\\smm; \\d,\\d\\d\\sN$/.test(e.textContent))",
    )
}
