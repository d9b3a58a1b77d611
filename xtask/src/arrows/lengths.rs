//! Functions that are longer than a reader holds in mind, in Rust and in JavaScript. The sources
//! are formatted, so that a function ends at the first brace as far to the left as its own line.

/// Most lines of a function, its signature and its last brace included.
const MOST_LINES: usize = 60;

/// A function with its first line, from 1, and its number of lines.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Function {
    pub(super) name: String,
    pub(super) line: usize,
    pub(super) lines: usize,
}

impl Function {
    /// Returns what to do, for the function of a file.
    pub(super) fn message(&self, file: &str) -> String {
        let Self { name, line, lines } = self;
        format!("{file}:{line}: {name} has {lines} lines: split it")
    }
}

/// The functions of a Rust source that are too long.
pub(super) fn too_long(text: &str) -> Vec<Function> {
    longer(text, name_of, length)
}

/// The functions of a JavaScript source that are too long, also those without a name.
pub(super) fn too_long_in_script(text: &str) -> Vec<Function> {
    longer(text, name_in_script, |lines| end(lines, 1, |line| line.starts_with('}')))
}

/// The functions whose first line has a name by `name_of` and whose length is too much.
fn longer<'a>(
    text: &'a str,
    name_of: impl Fn(&'a str) -> Option<&'a str>,
    length: impl Fn(&[&str]) -> Option<usize>,
) -> Vec<Function> {
    let lines: Vec<&str> = text.lines().collect();
    let one = |(i, line): (usize, &&'a str)| {
        let name = name_of(line)?;
        let lines = length(&lines[i..])?;
        (lines > MOST_LINES).then(|| Function { name: name.to_owned(), line: i + 1, lines })
    };
    lines.iter().enumerate().filter_map(one).collect()
}

/// The name of the function that a line begins; none if it begins none.
fn name_of(line: &str) -> Option<&str> {
    let is_qualifier = |word: &str| {
        matches!(word, "pub" | "const" | "async" | "unsafe" | "extern") || word.starts_with("pub(")
    };
    let mut words = line.split_whitespace().skip_while(|word| is_qualifier(word) || word.starts_with('"'));
    let name = words.next().filter(|word| *word == "fn").and_then(|_| words.next())?;
    name.split(['(', '<']).next()
}

/// The name of the function that a line of JavaScript begins, or the line itself where it has none;
/// none if it begins none. The body of an arrow function without braces is one expression, which is
/// not counted.
fn name_in_script(line: &str) -> Option<&str> {
    const BLOCKS: [&str; 7] = ["if", "for", "while", "switch", "catch", "with", "else"];
    const QUALIFIERS: [&str; 7] = ["export", "default", "async", "static", "get", "set", "function"];
    let line = line.trim();
    let head = line.strip_suffix('{')?.trim_end();
    if let Some(head) = head.strip_suffix("=>") {
        let is_named = |word: &str| ["const", "let", "var"].contains(&word);
        let mut words = head.split_whitespace().skip_while(|word| *word == "export");
        return words.next().filter(|word| is_named(word)).and_then(|_| words.next()).or(Some(line));
    }
    let (before, _) = head.strip_suffix(')')?.split_once('(')?;
    let mut words = before.split_whitespace().skip_while(|word| QUALIFIERS.contains(word));
    let name = words.next().map_or(line, |name| name.trim_start_matches('*'));
    let is_name = |letter: char| letter.is_alphanumeric() || matches!(letter, '_' | '$' | '#');
    (words.next().is_none() && !BLOCKS.contains(&name) && (name == line || name.chars().all(is_name)))
        .then_some(name)
}

/// The number of lines of the function that begins with the first one; none if it has no body.
fn length(lines: &[&str]) -> Option<usize> {
    let signature = lines.iter().position(|line| line.ends_with(['{', ';', '}']))?;
    if !lines[signature].ends_with('{') {
        return None;
    }
    end(lines, signature + 1, |line| line == "}")
}

/// The number of lines to the first one from `from` on that is as far to the left as the first line
/// and ends it.
fn end(lines: &[&str], from: usize, is_end: impl Fn(&str) -> bool) -> Option<usize> {
    let indent = |line: &str| line.len() - line.trim_start().len();
    let first = indent(lines.first()?);
    let rest = lines.get(from..)?;
    Some(from + 1 + rest.iter().position(|line| indent(line) == first && is_end(line.trim()))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn function(rows: usize) -> String {
        format!(
            "impl A {{\n    pub(crate) async fn long<T>(\n        of: T,\n    ) -> u8 {{\n{}    }}\n}}\n",
            "        step();\n".repeat(rows)
        )
    }

    #[test]
    fn a_function_is_counted_from_its_name_to_its_brace() {
        assert_eq!(too_long(&function(56)), []);
        let found = too_long(&function(57));
        assert_eq!(found, [Function { name: "long".into(), line: 2, lines: 61 }]);
    }

    #[test]
    fn declarations_and_short_bodies_have_no_length() {
        let many = "    fn declared(&self) -> u8;\n    fn short() {}\n".repeat(40);
        assert_eq!(too_long(&format!("trait A {{\n{many}}}\n")), []);
    }

    fn names_in_script(text: &str) -> Vec<String> {
        too_long_in_script(text).into_iter().map(|function| function.name).collect()
    }

    #[test]
    fn functions_of_a_script_are_counted_with_and_without_a_name() {
        let body = "  step();\n".repeat(59);
        let long = [
            ("function one(a) {", "}", "one"),
            ("export async function two() {", "}", "two"),
            ("export const three = (a) => {", "};", "three"),
            ("  async four(a, b) {", "  }", "four"),
            ("  get #five() {", "  }", "#five"),
            ("list.forEach((a) => {", "});", "list.forEach((a) => {"),
            ("(() => {", "})();", "(() => {"),
        ];
        for (first, last, name) in long {
            assert_eq!(names_in_script(&format!("{first}\n{body}{last}\n")), [name], "{first}");
            let shorter = body.replacen("  step();\n", "", 1);
            assert!(names_in_script(&format!("{first}\n{shorter}{last}\n")).is_empty(), "{first}");
        }
    }

    #[test]
    fn blocks_of_a_script_are_no_functions() {
        let body = "  step();\n".repeat(80);
        for first in ["if (a(b)) {", "for (const a of b()) {", "} else if (a) {", "const a = {", "class A {"]
        {
            assert!(names_in_script(&format!("{first}\n{body}}}\n")).is_empty(), "{first}");
        }
    }
}
