//! The folders of the crate have an order, and each uses only those before it.

use diagnosis::laws::EffectName;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders from the bottom to the top. Folders are counted, not files as in the small crates of
/// host-sim: an arrow within a folder stays within its subject.
const FLOORS: [&str; 10] =
    ["laws", "data", "simulation", "repair", "fit", "propose", "evidence", "decide", "report", "pipeline"];

fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).expect("the folder is there") {
        let path = entry.expect("its entries can be read").path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|end| end == "rs") {
            out.push(path);
        }
    }
}

/// Folders of the crate that a line of code names: `crate::folder`, also in `use crate::{a::…,
/// b::…}`.
fn named(line: &str) -> Vec<usize> {
    let code = line.split("//").next().unwrap_or("");
    let mut out = Vec::new();
    for (place, _) in code.match_indices("crate::") {
        let rest = &code[place + "crate::".len()..];
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(group) => group.split(',').collect(),
            None => vec![rest],
        };
        for name in names {
            let word: String = name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            out.extend(FLOORS.iter().position(|floor| *floor == word));
        }
    }
    out
}

#[test]
fn each_folder_uses_only_those_before_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut upward = Vec::new();
    let mut arrows = 0;
    for (floor, folder) in FLOORS.iter().enumerate() {
        let mut files = Vec::new();
        sources(&root.join(folder), &mut files);
        assert!(!files.is_empty(), "{folder} holds no source");
        for file in files {
            let text = fs::read_to_string(&file).expect("a source can be read");
            for (number, line) in text.lines().enumerate() {
                for used in named(line) {
                    arrows += 1;
                    if used > floor {
                        let name = file.strip_prefix(&root).expect("it is below").display();
                        upward.push(format!("{name}:{}: {}", number + 1, line.trim()));
                    }
                }
            }
        }
    }
    assert!(arrows > 100, "only {arrows} uses were seen: the reader of sources is blind");
    assert!(upward.is_empty(), "folders use those above them:\n{}", upward.join("\n"));
}

#[test]
fn only_the_root_is_next_to_the_folders() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(&root).expect("the folder is there") {
        let name = entry.expect("its entries can be read").file_name();
        let name = name.to_string_lossy();
        assert!(name == "lib.rs" || FLOORS.contains(&&*name), "{name} is in no folder");
    }
}

/// The code outside `laws/` that may name effects, and why. Facts about an effect belong into
/// its file: ask its `Definition`.
const MAY_NAME: [(&str, &str); 0] = [];

/// The effects, as the code names them: `stribeck_friction` is `StribeckFriction`.
fn variants() -> Vec<String> {
    let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
    EffectName::ALL.iter().map(|name| name.as_str().split('_').map(capital).collect()).collect()
}

/// The part of a source that is compiled without its tests, and the files that are tests alone.
fn without_tests(text: &str) -> (Vec<&str>, Vec<String>) {
    let lines: Vec<&str> = text.lines().collect();
    let mut files = Vec::new();
    for (number, pair) in lines.windows(2).enumerate() {
        let module = pair[1].trim().strip_prefix("mod ").filter(|_| pair[0].trim() == "#[cfg(test)]");
        match module.and_then(|module| module.strip_suffix(';')) {
            Some(file) => files.push(format!("{file}.rs")),
            None if module.is_some() => return (lines[..number].to_vec(), files),
            None => {}
        }
    }
    (lines, files)
}

/// The file of a module that `file` declares.
fn below(file: &Path, module: &str) -> PathBuf {
    match file.file_stem().and_then(|stem| stem.to_str()) {
        Some("mod" | "lib") | None => file.with_file_name(module),
        Some(_) => file.with_extension("").join(module),
    }
}

/// True if a line of code names an effect, by `EffectName` or by its name in a file.
fn names_effect(line: &str, aliases: &[String], variants: &[String]) -> bool {
    let code = line.split("//").next().unwrap_or("");
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    code.match_indices("::").any(|(place, _)| {
        let before = code[..place].rsplit(|c| !is_word(c)).next().unwrap_or("");
        let after = code[place + 2..].split(|c| !is_word(c)).next().unwrap_or("");
        // A list or a star holds nothing but names.
        let is_effect = variants.iter().any(|variant| variant == after) || after.is_empty();
        aliases.iter().any(|alias| alias == before) && is_effect
    })
}

#[test]
fn the_definition_of_an_effect_is_in_its_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let variants = variants();
    let mut files = Vec::new();
    sources(&root, &mut files);
    let texts: Vec<(PathBuf, String)> = files
        .into_iter()
        .map(|file| (file.clone(), fs::read_to_string(file).expect("a source can be read")))
        .collect();
    let tests: Vec<PathBuf> = texts
        .iter()
        .flat_map(|(file, text)| without_tests(text).1.into_iter().map(|test| below(file, &test)))
        .collect();
    let mut naming: Vec<(String, String)> = Vec::new();
    let mut in_effects = 0;
    for (file, text) in texts.iter().filter(|(file, _)| !tests.contains(file)) {
        let mut aliases = vec!["EffectName".to_owned()];
        let calls = text.match_indices("EffectName as ").map(|(place, found)| &text[place + found.len()..]);
        aliases
            .extend(calls.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric()).collect::<String>()));
        let name = file.strip_prefix(&root).expect("it is below").display().to_string();
        for line in without_tests(text).0 {
            if !names_effect(line, &aliases, &variants) {
                continue;
            }
            if name.starts_with("laws") {
                in_effects += 1;
            } else {
                naming.push((name.clone(), line.trim().to_owned()));
            }
        }
    }
    assert!(in_effects > 10, "only {in_effects} names were seen in laws/: the reader of sources is blind");
    let may = |file: &str| MAY_NAME.iter().any(|(may, _)| *may == file);
    let wrong: Vec<String> =
        naming.iter().filter(|(file, _)| !may(file)).map(|(file, line)| format!("{file}: {line}")).collect();
    assert!(wrong.is_empty(), "code outside laws/ names effects:\n{}", wrong.join("\n"));
    for (file, why) in MAY_NAME {
        assert!(naming.iter().any(|(name, _)| name == file), "{file} names no effect, and need not ({why})");
    }
}

/// The numbers in the code of a folder that are not 0, 1/2, 1 or 2: how many it holds, which may
/// only fall, and how many are wanted (issue 69).
const NUMBERS: [(&str, usize, Option<usize>); 3] =
    [("propose", 116, Some(30)), ("evidence", 56, None), ("decide", 86, Some(15))];

/// The numbers that a line of code spells, without those within words and strings.
fn numbers(line: &str) -> Vec<f64> {
    let code = line.split("//").next().unwrap_or("");
    let outside: String = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = Vec::new();
    let mut before = ' ';
    let mut rest = outside.as_str();
    while let Some(first) = rest.chars().next() {
        let length = if first.is_ascii_digit() && !is_word(before) {
            let word = |(i, c): (usize, char)| {
                let is_point = c == '.' && rest[i + 1..].starts_with(|c: char| c.is_ascii_digit());
                let is_sign = c == '-' && rest[..i].ends_with('e');
                !(is_word(c) || is_point || is_sign)
            };
            let end = rest.char_indices().find(|at| word(*at)).map_or(rest.len(), |(i, _)| i);
            let digits = rest[..end].replace('_', "");
            let digits = digits.trim_end_matches("f64").trim_end_matches("usize").trim_end_matches("u64");
            out.extend(digits.parse::<f64>());
            end
        } else {
            first.len_utf8()
        };
        before = rest[..length].chars().next_back().unwrap_or(' ');
        rest = &rest[length..];
    }
    out
}

#[test]
fn a_number_in_code_is_seen() {
    assert_eq!(numbers("a.0 < 0.35 * x1[3] + 1e-3 // 7"), [0.0, 0.35, 3.0, 1e-3]);
    assert_eq!(numbers("(0..24).map(f64::sqrt, \"8\") + 1_000_u64"), [0.0, 24.0, 1000.0]);
}

#[test]
fn no_folder_holds_more_numbers_than_before() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for (folder, most, wanted) in NUMBERS {
        let mut files = Vec::new();
        sources(&root.join(folder), &mut files);
        let text = |file: &PathBuf| fs::read_to_string(file).expect("a source can be read");
        let tests: Vec<PathBuf> = files
            .iter()
            .flat_map(|file| without_tests(&text(file)).1.into_iter().map(|test| below(file, &test)))
            .collect();
        let count = |file: &PathBuf| -> usize {
            let is_free = |number: &f64| [0.0, 0.5, 1.0, 2.0].contains(number);
            without_tests(&text(file)).0.iter().flat_map(|line| numbers(line)).filter(|n| !is_free(n)).count()
        };
        let all: usize = files.iter().filter(|file| !tests.contains(file)).map(count).sum();
        let note = "a number more needs one less elsewhere; one less is written here";
        assert_eq!(all, most, "{folder} holds {all} numbers, not {most} ({wanted:?} are wanted): {note}");
    }
}

/// Words of other things that are spelled like a key of a shape, by file, and why. A value of an
/// effect is asked of the effect: `Effect::turn`, or a method of its `Definition`.
const OTHER_WORDS: [(&str, &[&str], &str); 10] = [
    ("src/data/known_keys.rs", &["viscous", "weight", "limit", "turn"], "keys of a rig beside its effects"),
    ("src/report/exports.rs", &["damping", "limit"], "keys of an exported joint"),
    ("src/report/residual_plots.rs", &["speed"], "a variable of the motion"),
    ("src/report/decisive_plot.rs", &["speed"], "a variable of the motion"),
    ("src/report/mjcf_patch.rs", &["damping", "delay", "gap"], "attributes of MuJoCo and values of a joint"),
    ("src/report/outcome.rs", &["speed", "viscous", "weight"], "a variable, and keys of a rig's model"),
    ("src/evidence/residual_maps.rs", &["speed"], "a variable of the motion"),
    ("experiment/src/case.rs", &["speed"], "a limit of the input"),
    ("experiment/src/write.rs", &["damping"], "a value of the servo"),
    ("device-setup/src/compensate/coefficients.rs", &["viscous", "weight"], "coefficients"),
];

/// The keys of shapes, as the files of the effects declare them: by `shape!`, or by
/// `ShapeKey::new`.
fn shape_keys(text: &str) -> Vec<String> {
    let mut keys = Vec::new();
    let mut is_declaration = false;
    for line in without_tests(text).0 {
        let line = line.trim();
        is_declaration = line == "shape! {" || is_declaration && line != "}" && !line.starts_with("impl");
        let declared = line.split_once(": ").filter(|(_, rest)| is_declaration && rest.ends_with(','));
        keys.extend(declared.map(|(key, _)| key.to_owned()));
        let numbered = line.split_once("ShapeKey::new(\"").and_then(|(_, rest)| rest.split_once('"'));
        keys.extend(numbered.map(|(key, _)| key.to_owned()));
    }
    keys
}

/// The keys that a line of code spells: a string that is one, or that begins with one of numbered
/// ones.
fn spelled<'a>(line: &str, keys: &'a [String]) -> Vec<&'a str> {
    let code = line.split("//").next().unwrap_or("");
    let strings: Vec<&str> = code.split('"').skip(1).step_by(2).collect();
    let is = |key: &&String| {
        strings.iter().any(|text| match text.strip_prefix(key.as_str()) {
            Some("") => true,
            Some(rest) => key.ends_with('_') && rest.starts_with(|c: char| c == '{' || c.is_ascii_digit()),
            None => false,
        })
    };
    keys.iter().filter(is).map(String::as_str).collect()
}

#[test]
fn a_key_of_a_shape_is_spelled_in_effects_alone() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&top.join("src"), &mut files);
    for below in ["experiment/src", "../host-sim/device-setup/src", "../host-sim/lab/src"] {
        sources(&top.join(below), &mut files);
    }
    let text = |file: &PathBuf| fs::read_to_string(file).expect("a source can be read");
    let tests: Vec<PathBuf> = files
        .iter()
        .flat_map(|file| without_tests(&text(file)).1.into_iter().map(|test| below(file, &test)))
        .collect();
    let texts: Vec<(String, String)> = files
        .iter()
        .filter(|file| !tests.contains(file))
        .map(|file| (file.strip_prefix(top).unwrap_or(file).display().to_string(), text(file)))
        .collect();
    let is_of_effects = |name: &str| name.starts_with("src/laws");
    let mut keys: Vec<String> =
        texts.iter().filter(|(name, _)| is_of_effects(name)).flat_map(|(_, text)| shape_keys(text)).collect();
    keys.sort();
    keys.dedup();
    for known in ["turn", "order_", "per_command", "mean_square", "degree", "speed"] {
        assert!(keys.iter().any(|key| key == known), "{known} was not seen: the reader of sources is blind");
    }
    let mut found = Vec::new();
    for (name, text) in texts.iter().filter(|(name, _)| !is_of_effects(name)) {
        for line in without_tests(text).0 {
            found.extend(spelled(line, &keys).into_iter().map(|key| (name.as_str(), key, line.trim())));
        }
    }
    let is_other = |file: &str, key: &str| {
        OTHER_WORDS.iter().any(|(other, words, _)| file.ends_with(other) && words.contains(&key))
    };
    let wrong: Vec<String> = found
        .iter()
        .filter(|(file, key, _)| !is_other(file, key))
        .map(|(file, key, line)| format!("{file}: {key}: {line}"))
        .collect();
    assert!(wrong.is_empty(), "code outside laws/ spells keys of shapes:\n{}", wrong.join("\n"));
    for (file, words, why) in OTHER_WORDS {
        for word in words {
            let is_there = found.iter().any(|(name, key, _)| name.ends_with(file) && key == word);
            assert!(is_there, "{file} does not spell {word} any more ({why})");
        }
    }
}

#[test]
fn a_spelled_key_is_seen() {
    let keys = ["turn".to_owned(), "order_".to_owned()];
    assert_eq!(spelled("effect.shape.get(\"turn\")", &keys), ["turn"]);
    assert_eq!(spelled("format!(\"order_{i}\") // \"turn\"", &keys), ["order_"]);
    assert!(spelled("let turn = effect.turn(); f(\"turned\", \"order_s\")", &keys).is_empty());
}
