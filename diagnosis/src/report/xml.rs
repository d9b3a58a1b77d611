//! The opening tags of an XML text, with their places in it, so that values can be changed and
//! every other byte stays.

use std::ops::Range;

/// An opening tag.
#[derive(Debug, Clone)]
pub(super) struct Tag<'a> {
    pub(super) name: &'a str,
    /// From `<` to behind `>`.
    pub(super) at: Range<usize>,
    /// Names with the places of their values.
    pub(super) attributes: Vec<(&'a str, Range<usize>)>,
    /// Index of the tag that this one is in.
    pub(super) parent: Option<usize>,
    /// Place of its closing tag; none where it closes itself.
    pub(super) closing: Option<Range<usize>>,
}

impl<'a> Tag<'a> {
    /// The value of an attribute, as the text has it.
    pub(super) fn get(&self, text: &'a str, key: &str) -> Option<&'a str> {
        self.attributes.iter().find(|(name, _)| *name == key).map(|(_, at)| &text[at.clone()])
    }

    /// The change that gives an attribute a value.
    pub(super) fn set(&self, key: &str, value: &str) -> (Range<usize>, String) {
        if let Some((_, at)) = self.attributes.iter().find(|(name, _)| *name == key) {
            return (at.clone(), value.to_owned());
        }
        let end = self.attributes.last().map_or(self.at.start + 1 + self.name.len(), |(_, at)| at.end + 1);
        (end..end, format!(" {key}=\"{value}\""))
    }
}

/// Finds all opening tags; an error is the place, in bytes, where the text is no XML.
pub(super) fn tags(text: &str) -> Result<Vec<Tag<'_>>, usize> {
    let mut out: Vec<Tag> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    let mut from = 0;
    while let Some(start) = text[from..].find('<').map(|k| from + k) {
        let rest = &text[start..];
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">")];
        if let Some((_, end)) = skipped.iter().find(|(begin, _)| rest.starts_with(begin)) {
            from = start + rest.find(end).ok_or(start)? + end.len();
        } else if let Some(inner) = rest.strip_prefix("</") {
            let length = inner.find('>').ok_or(start)?;
            let tag = open.pop().ok_or(start)?;
            if out[tag].name != inner[..length].trim_end() {
                return Err(start);
            }
            from = start + 2 + length + 1;
            out[tag].closing = Some(start..from);
        } else {
            let (tag, closes) = opening(text, start, open.last().copied()).ok_or(start)?;
            from = tag.at.end;
            if !closes {
                open.push(out.len());
            }
            out.push(tag);
        }
    }
    open.last().map_or(Ok(()), |tag| Err(out[*tag].at.start))?;
    Ok(out)
}

/// Reads an opening tag, and if it closes itself.
fn opening(text: &str, start: usize, parent: Option<usize>) -> Option<(Tag<'_>, bool)> {
    let blanks = |from: usize| from + text[from..].len() - text[from..].trim_start().len();
    let is_end = |c: char| c.is_whitespace() || matches!(c, '/' | '>' | '=');
    let length = text[start + 1..].find(is_end).filter(|length| *length > 0)?;
    let name = &text[start + 1..start + 1 + length];
    let mut attributes = Vec::new();
    let mut at = blanks(start + 1 + length);
    loop {
        let rest = &text[at..];
        if let Some(length) =
            [("/>", 2), (">", 1)].iter().find_map(|(end, n)| rest.starts_with(end).then_some(*n))
        {
            let tag = Tag { name, at: start..at + length, attributes, parent, closing: None };
            return Some((tag, length == 2));
        }
        let key = &rest[..rest.find(is_end).filter(|length| *length > 0)?];
        let equals = blanks(at + key.len());
        let quote = blanks(equals + text[equals..].starts_with('=').then_some(1)?);
        let mark = text[quote..].chars().next().filter(|c| matches!(c, '"' | '\''))?;
        let end = quote + 1 + text[quote + 1..].find(mark)?;
        attributes.push((key, quote + 1..end));
        at = blanks(end + 1);
    }
}

/// Makes changes that do not overlap; those at one place in the order in which they are given.
pub(super) fn changed(text: &str, mut changes: Vec<(Range<usize>, String)>) -> String {
    changes.sort_by_key(|(at, _)| at.start);
    let mut out = String::with_capacity(text.len() + 1024);
    let mut from = 0;
    for (at, new) in changes {
        out.push_str(&text[from..at.start]);
        out.push_str(&new);
        from = at.end;
    }
    out.push_str(&text[from..]);
    out
}

/// A number as an attribute has it: seven digits.
pub(super) fn number(x: f64) -> String {
    format!("{x:.6e}").parse::<f64>().map_or_else(|_| x.to_string(), |x| x.to_string())
}
