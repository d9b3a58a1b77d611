//! Functions that are longer than a reader holds in mind. The sources are formatted, so that a
//! function ends at the first brace as far to the left as its own line.

/// Most lines of a function, its signature and its last brace included.
const MOST: usize = 60;

/// A function with its first line, from 1, and its number of lines.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Function {
    pub(super) name: String,
    pub(super) line: usize,
    pub(super) lines: usize,
}

/// The functions of a source that are too long.
pub(super) fn too_long(text: &str) -> Vec<Function> {
    let lines: Vec<&str> = text.lines().collect();
    let one = |(i, line): (usize, &&str)| {
        let name = name_of(line)?;
        let lines = length(&lines[i..])?;
        (lines > MOST).then(|| Function { name: name.to_owned(), line: i + 1, lines })
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

/// The number of lines of the function that begins with the first one; none if it has no body.
fn length(lines: &[&str]) -> Option<usize> {
    let indent = |line: &str| line.len() - line.trim_start().len();
    let first = indent(lines.first()?);
    let signature = lines.iter().position(|line| line.ends_with(['{', ';', '}']))?;
    if !lines[signature].ends_with('{') {
        return None;
    }
    let is_end = |line: &&str| indent(line) == first && line.trim() == "}";
    Some(signature + 2 + lines[signature + 1..].iter().position(is_end)?)
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
}
