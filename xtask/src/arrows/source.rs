//! Reads what a source file declares and names: its code without comments, literals and tests, its
//! `use` declarations, and its paths.

/// A path of a `use` declaration, groups written out.
pub(super) struct Use {
    /// Its segments; `*` is the last of a glob.
    pub(super) path: Vec<String>,
    /// The name that it brings into the module.
    pub(super) name: String,
    /// True if it hands the name on.
    pub(super) is_public: bool,
}

/// The code of a file, with everything else cut away.
pub(super) struct Source {
    words: Vec<String>,
    /// Modules in files of their own that only tests have.
    for_tests: Vec<String>,
}

impl Source {
    pub(super) fn new(text: &str) -> Self {
        let all = words(text);
        let words = without_tests(&all);
        let kept: Vec<String> = modules(&words).collect();
        let for_tests = modules(&all).filter(|name| !kept.contains(name)).collect();
        Self { words, for_tests }
    }

    /// True if only tests have the module, which is a file of its own.
    pub(super) fn is_for_tests(&self, module: &str) -> bool {
        self.for_tests.iter().any(|name| name == module)
    }

    /// True if the file defines an item of this name.
    pub(super) fn defines(&self, name: &str) -> bool {
        const ITEMS: [&str; 9] =
            ["fn", "struct", "enum", "trait", "type", "const", "static", "union", "macro_rules"];
        self.words.windows(2).any(|w| ITEMS.contains(&w[0].as_str()) && w[1] == name)
            || self.words.windows(3).any(|w| w[0] == "macro_rules" && w[2] == name)
    }

    pub(super) fn uses(&self) -> Vec<Use> {
        let mut all = Vec::new();
        let mut at = 0;
        while at < self.words.len() {
            if self.words[at] == "use" {
                let length = self.words[at..].iter().position(|word| word == ";").unwrap_or(0);
                let is_public = at > 0 && matches!(self.words[at - 1].as_str(), "pub" | ")");
                tree(&self.words[at + 1..at + length.max(1)], &[], is_public, &mut all);
                at += length;
            }
            at += 1;
        }
        all
    }

    /// Paths of more than one segment in code that is no `use` declaration.
    pub(super) fn paths(&self) -> Vec<Vec<String>> {
        let mut all = Vec::new();
        let mut at = 0;
        while at < self.words.len() {
            if self.words[at] == "use" {
                at += self.words[at..].iter().position(|word| word == ";").unwrap_or(0);
            } else if is_name(&self.words[at]) && (at == 0 || self.words[at - 1] != "::") {
                let mut path = vec![self.words[at].clone()];
                while self.words.get(at + 1).is_some_and(|word| word == "::")
                    && self.words.get(at + 2).is_some_and(|word| is_name(word))
                {
                    path.push(self.words[at + 2].clone());
                    at += 2;
                }
                if path.len() > 1 {
                    all.push(path);
                }
            }
            at += 1;
        }
        all
    }
}

/// Modules that are declared as files of their own.
fn modules(words: &[String]) -> impl Iterator<Item = String> {
    words.windows(3).filter(|w| w[0] == "mod" && w[2] == ";").map(|w| w[1].clone())
}

fn is_name(word: &str) -> bool {
    word.starts_with(|first: char| first.is_alphabetic() || first == '_')
}

/// Appends the paths of a `use` tree.
fn tree(words: &[String], before: &[String], is_public: bool, all: &mut Vec<Use>) {
    let mut path = before.to_vec();
    let mut at = 0;
    while at < words.len() {
        match words[at].as_str() {
            "::" => {}
            "{" => {
                for part in parts(&words[at + 1..words.len() - 1]) {
                    tree(part, &path, is_public, all);
                }
                return;
            }
            "as" => {
                let name = words.get(at + 1).cloned().unwrap_or_default();
                all.push(Use { path, name, is_public });
                return;
            }
            // The module itself, in a group.
            "self" if !path.is_empty() => {}
            word => path.push(word.to_owned()),
        }
        at += 1;
    }
    if let Some(name) = path.last().cloned() {
        all.push(Use { path, name, is_public });
    }
}

/// The parts of a group, between commas outside of inner groups.
fn parts(words: &[String]) -> Vec<&[String]> {
    let mut depth = 0_usize;
    let mut parts = Vec::new();
    let mut from = 0;
    for (at, word) in words.iter().enumerate() {
        match word.as_str() {
            "{" => depth += 1,
            "}" => depth = depth.saturating_sub(1),
            "," if depth == 0 => {
                parts.push(&words[from..at]);
                from = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&words[from..]);
    parts.retain(|part| !part.is_empty());
    parts
}

/// Cuts every item that is compiled for tests only.
fn without_tests(words: &[String]) -> Vec<String> {
    const TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut at = 0;
    while at < words.len() {
        if words[at..].iter().zip(TEST).filter(|(word, test)| word == test).count() == TEST.len() {
            at += TEST.len() + item(&words[at + TEST.len()..]);
        } else {
            kept.push(words[at].clone());
            at += 1;
        }
    }
    kept
}

/// The number of words of the item that these begin with.
fn item(words: &[String]) -> usize {
    let mut depth = 0_usize;
    for (at, word) in words.iter().enumerate() {
        match word.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => {
                depth = depth.saturating_sub(1);
                if depth == 0 && word == "}" {
                    return at + 1;
                }
            }
            ";" if depth == 0 => return at + 1,
            _ => {}
        }
    }
    words.len()
}

/// Names, `::`, and every other character of code as a word of its own.
fn words(text: &str) -> Vec<String> {
    let code = crate::words::code(text);
    let mut words = Vec::new();
    let mut rest = code.as_str();
    while let Some(first) = rest.chars().next() {
        let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
        let length = if is_part(first) {
            rest.find(|letter| !is_part(letter)).unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            first.len_utf8()
        };
        if !first.is_whitespace() {
            words.push(rest[..length].to_owned());
        }
        rest = &rest[length..];
    }
    words
}
