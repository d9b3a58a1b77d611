//! The layout of a text: what separates its fields, how many there are, and what is a number.

use super::numbers::{Decimal, is_missing};

/// Separators, and what notes call them.
pub(super) const SEPARATORS: [(char, &str); 5] =
    [(';', "semicolons"), ('\t', "tabs"), (',', "commas"), ('|', "bars"), (' ', "spaces")];
/// The number of lines from which the layout is recognised.
const SAMPLE: usize = 200;

/// The layout of a text: what separates fields and how many a row has.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    /// The separator.
    pub separator: char,
    /// Fields in a row.
    pub count: usize,
    /// The sign before decimals.
    pub decimal: Decimal,
    /// True if a comma before the milliseconds of a stamp separates no fields.
    joins_stamps: bool,
}

impl Layout {
    /// The fields of a line.
    pub(super) fn fields<'a>(&self, line: &'a str) -> Vec<&'a str> {
        if self.separator == ' ' {
            return line.split_whitespace().collect();
        }
        let mut out = Vec::with_capacity(self.count);
        let (mut from, mut quoted) = (0, false);
        for (at, c) in line.char_indices() {
            if c == '"' {
                quoted = !quoted;
            } else if c == self.separator && !quoted {
                if self.joins_stamps && is_before_milliseconds(&line[from..at], &line[at + 1..]) {
                    continue;
                }
                out.push(&line[from..at]);
                from = at + c.len_utf8();
            }
        }
        out.push(&line[from..]);
        out
    }

    /// A number, or a date as seconds; none where it is neither.
    pub(super) fn number(&self, field: &str) -> Option<f64> {
        self.decimal.number(field)
    }
}

/// True for the comma of `10:30:25,123`, as Python's logging writes it.
fn is_before_milliseconds(before: &str, after: &str) -> bool {
    let digits = after.bytes().take_while(u8::is_ascii_digit).count();
    matches!(digits, 3 | 6)
        && before.contains(':')
        && !before.contains('.')
        && before.ends_with(|c: char| c.is_ascii_digit())
        && after[digits..].chars().next().is_none_or(|c| c == ',' || c == ' ')
}

/// Lines spread over a text.
pub(super) fn sample<'a>(lines: &'a Lines<'a>) -> impl Iterator<Item = &'a str> {
    lines.iter().step_by(lines.len() / SAMPLE + 1).map(|(_, line)| *line)
}

/// The separator under which most fields of the sample are numbers, of as many columns as the most
/// lines have.
pub(super) fn layout(lines: &Lines) -> Layout {
    let of = |separator| Layout { separator, count: 1, decimal: Decimal::Both, joins_stamps: false };
    let mut best = (of(','), 0.0);
    for (separator, _) in SEPARATORS {
        let split: Vec<Vec<&str>> = sample(lines).map(|line| of(separator).fields(line)).collect();
        let mut counts: Vec<usize> = split.iter().map(Vec::len).collect();
        counts.sort_unstable();
        let count = counts.get(counts.len() / 2).copied().unwrap_or(1);
        if count < 2 {
            continue;
        }
        let alike = split.iter().filter(|f| f.len() == count);
        let (mut good, mut all) = (0, 0);
        for row in alike {
            all += count;
            good += row.iter().filter(|f| Decimal::Both.number(f).is_some() || is_missing(f)).count();
        }
        let share = good as f64 / (split.len() * count).max(1) as f64 + 1e-9 * all as f64;
        if share > best.1 + 1e-6 {
            best = (Layout { count, ..of(separator) }, share);
        }
    }
    best.0
}

/// Lines, each with a number.
pub(super) type Lines<'a> = Vec<(usize, &'a str)>;

impl Layout {
    /// Joins the milliseconds of stamps where a header shows that they are no column, or where they
    /// have leading zeros.
    pub(super) fn join_stamps(&mut self, lines: &Lines) {
        let joined = Self { joins_stamps: true, ..*self };
        let is_joined = |line: &str| joined.fields(line).len() + 1 == self.fields(line).len();
        let rows: Vec<&str> = sample(lines).filter(|line| self.fields(line).len() == self.count).collect();
        let header = lines
            .iter()
            .map(|(_, line)| self.fields(line))
            .find(|row| row.len() > 1 && row.iter().all(|field| self.number(field).is_none()));
        let is_shorter = header.map(|row| row.len() + 1 == self.count);
        let has_zeros = || {
            rows.iter()
                .any(|line| self.fields(line).iter().skip(1).any(|f| f.len() == 3 && f.starts_with('0')))
        };
        if rows.iter().filter(|line| is_joined(line)).count() * 2 > rows.len()
            && is_shorter.unwrap_or_else(has_zeros)
        {
            *self = Self { count: self.count - 1, ..joined };
        }
    }
}
