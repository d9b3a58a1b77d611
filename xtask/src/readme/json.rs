//! Reads JSON. `serde_json` would be 9 s of every first `cargo xtask`, which takes 14 s in all.

/// Lists and objects in one another that are read; more is no file of ours.
const DEEPEST: usize = 64;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Json {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Json>),
    Object(Vec<(String, Json)>),
}

impl Json {
    /// Returns the value under a key; `Null` if there is none.
    pub(super) fn get(&self, key: &str) -> &Json {
        let Json::Object(pairs) = self else { return &Json::Null };
        pairs.iter().find(|(name, _)| name == key).map_or(&Json::Null, |(_, value)| value)
    }

    pub(super) fn bool(&self) -> Option<bool> {
        if let Json::Bool(value) = self { Some(*value) } else { None }
    }

    pub(super) fn number(&self) -> Option<f64> {
        if let Json::Number(value) = self { Some(*value) } else { None }
    }

    pub(super) fn text(&self) -> Option<&str> {
        if let Json::Text(text) = self { Some(text) } else { None }
    }

    pub(super) fn list(&self) -> Option<&[Json]> {
        if let Json::List(items) = self { Some(items) } else { None }
    }
}

/// Reads a text.
///
/// # Errors
/// The number of the line that is no JSON.
pub(super) fn parse(text: &str) -> Result<Json, usize> {
    let mut reader = Reader { rest: text };
    let value = reader.value(DEEPEST);
    reader.blanks();
    let read = text.len() - reader.rest.len();
    value.filter(|_| reader.rest.is_empty()).ok_or_else(|| 1 + text[..read].matches('\n').count())
}

/// The part of a text that is not read yet.
struct Reader<'a> {
    rest: &'a str,
}

impl Reader<'_> {
    fn blanks(&mut self) {
        self.rest = self.rest.trim_start();
    }

    /// Passes `expected` if it follows.
    fn passes(&mut self, expected: &str) -> bool {
        let after = self.rest.strip_prefix(expected);
        self.rest = after.unwrap_or(self.rest);
        after.is_some()
    }

    fn value(&mut self, depth: usize) -> Option<Json> {
        let depth = depth.checked_sub(1)?;
        self.blanks();
        if self.passes("{") {
            return self.items("}", |reader| reader.pair(depth)).map(Json::Object);
        }
        if self.passes("[") {
            return self.items("]", |reader| reader.value(depth)).map(Json::List);
        }
        if self.rest.starts_with('"') {
            return self.string().map(Json::Text);
        }
        let words = [("null", Json::Null), ("true", Json::Bool(true)), ("false", Json::Bool(false))];
        let word = words.into_iter().find(|(word, _)| self.passes(word));
        word.map(|(_, value)| value).or_else(|| self.number().map(Json::Number))
    }

    /// The items up to `end`, with commas between them.
    fn items<T>(&mut self, end: &str, item: impl Fn(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let mut items = Vec::new();
        self.blanks();
        if self.passes(end) {
            return Some(items);
        }
        loop {
            items.push(item(self)?);
            self.blanks();
            if self.passes(end) {
                return Some(items);
            }
            if !self.passes(",") {
                return None;
            }
        }
    }

    fn pair(&mut self, depth: usize) -> Option<(String, Json)> {
        self.blanks();
        let key = self.string()?;
        self.blanks();
        if !self.passes(":") {
            return None;
        }
        Some((key, self.value(depth)?))
    }

    fn number(&mut self) -> Option<f64> {
        let length = self.rest.find(|c: char| !c.is_ascii_digit() && !"+-.eE".contains(c));
        let (digits, rest) = self.rest.split_at(length.unwrap_or(self.rest.len()));
        let number = digits.parse().ok()?;
        self.rest = rest;
        Some(number)
    }

    fn string(&mut self) -> Option<String> {
        let mut letters = self.rest.strip_prefix('"')?.chars();
        let mut text = String::new();
        loop {
            match letters.next()? {
                '"' => break,
                '\\' => text.push(match letters.next()? {
                    'n' => '\n',
                    't' => '\t',
                    'r' => '\r',
                    'b' => '\u{8}',
                    'f' => '\u{c}',
                    'u' => {
                        let code = letters.as_str().get(..4)?;
                        letters = letters.as_str()[4..].chars();
                        // Half of a pair has no letter of its own.
                        char::from_u32(u32::from_str_radix(code, 16).ok()?).unwrap_or('\u{fffd}')
                    }
                    letter @ ('"' | '\\' | '/') => letter,
                    _ => return None,
                }),
                letter => text.push(letter),
            }
        }
        self.rest = letters.as_str();
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_they_are_written() {
        let read = parse(" { \"a\": [1, -2.5e-3, true, null, []],\n\"b\\u00e9\\\"\": \"×\\n\" } ").unwrap();
        let list =
            [Json::Number(1.0), Json::Number(-0.0025), Json::Bool(true), Json::Null, Json::List(vec![])];
        assert_eq!(read.get("a").list(), Some(&list[..]));
        assert_eq!(read.get("bé\"").text(), Some("×\n"));
        assert_eq!((read.get("c"), list[0].get("c")), (&Json::Null, &Json::Null));
    }

    #[test]
    fn damaged_text_is_refused_with_its_line() {
        let text = "{ \"a\": [1, 2],\n \"b\": { \"c\": \"d\\u0041\" } }";
        for length in 0..text.len() {
            assert!(parse(&text[..length]).is_err(), "{}", &text[..length]);
        }
        assert_eq!(parse("{ \"a\":\n 1,,\n 2 }"), Err(2));
        assert_eq!(parse("1 2"), Err(1));
        assert_eq!(parse("\"\\u12é\""), Err(1));
        assert_eq!(parse(&"[".repeat(1_000_000)), Err(1), "no stack is deep enough for that");
    }
}
