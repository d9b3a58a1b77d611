//! Numbers as text: which sign separates decimals, and which thousands.

use super::stamps;
use device_sim::error::Error;

/// The sign before the decimals, as `--decimal` gives it; the other one separates thousands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decimal {
    /// `1.5` and `1,000`.
    Point,
    /// `1,5` and `1.000`.
    Comma,
    /// `1.5` and `1,5`, in a file that has both.
    Both,
}

/// Words for a value that is missing.
const MISSING: &str = "na n/a #n/a null none nil missing - -- --- ?";

/// True for an empty field and for words that say that there is no value.
pub(super) fn is_missing(field: &str) -> bool {
    let field = bare(field);
    field.is_empty() || MISSING.split(' ').any(|word| field.eq_ignore_ascii_case(word))
}

fn bare(field: &str) -> &str {
    field.trim().trim_matches('"').trim()
}

impl Decimal {
    /// A number, or a date as seconds; none where it is neither.
    pub(super) fn number(self, field: &str) -> Option<f64> {
        let field = bare(field);
        if !field.contains(',') && self != Self::Comma || !field.contains([',', '.']) {
            if let Ok(value) = field.parse() {
                return Some(value);
            }
        } else if let Some(value) = self.plain(field).and_then(|plain| plain.parse().ok()) {
            return Some(value);
        }
        match field {
            "true" | "True" | "TRUE" => Some(1.0),
            "false" | "False" | "FALSE" => Some(0.0),
            _ if field.contains(['\'', '\u{a0}', '\u{202f}', '\u{2009}', '_']) => {
                let digits = field.replace(['\'', '\u{a0}', '\u{202f}', '\u{2009}', '_'], "");
                self.number(&digits).filter(|_| digits.starts_with(|c: char| c.is_ascii_digit() || c == '-'))
            }
            _ => stamps::seconds(field),
        }
    }

    /// A number with its decimals after a point and without thousands.
    fn plain(self, field: &str) -> Option<String> {
        let (decimal, thousands) = match self {
            Self::Point => ('.', ','),
            Self::Comma => (',', '.'),
            Self::Both => {
                return (!(field.contains(',') && field.contains('.'))).then(|| field.replace(',', "."));
            }
        };
        let (whole, decimals) = match field.split_once(decimal) {
            Some((whole, decimals)) => (whole, Some(decimals)),
            None => (field, None),
        };
        if decimals.is_some_and(|decimals| decimals.contains(['.', ',']))
            || whole.contains(thousands) && !is_in_thousands(whole, thousands)
        {
            return None;
        }
        let whole = whole.replace(thousands, "");
        Some(decimals.map_or_else(|| whole.clone(), |decimals| format!("{whole}.{decimals}")))
    }
}

/// True for `1,234` and `12,345,678`.
fn is_in_thousands(whole: &str, mark: char) -> bool {
    let mut groups = whole.trim_start_matches(['+', '-']).split(mark);
    let digits = |group: &str| !group.is_empty() && group.bytes().all(|c| c.is_ascii_digit());
    groups.next().is_some_and(|first| digits(first) && first.len() <= 3 && !first.starts_with('0'))
        && groups.all(|group| digits(group) && group.len() == 3)
}

/// Fields that show which sign a file has before decimals.
#[derive(Default)]
struct Shown<'a> {
    point: Option<&'a str>,
    comma: Option<&'a str>,
    /// Commas that are before three digits every time.
    either: Option<&'a str>,
    /// The same of points.
    point_or_thousands: Option<&'a str>,
    /// Fields whose commas, and whose points, can be nothing but thousands.
    has_comma_thousands: bool,
    has_point_thousands: bool,
}

impl<'a> Shown<'a> {
    fn take(&mut self, field: &'a str) {
        let field = bare(field);
        let is_numeric = field.bytes().all(|c| c.is_ascii_digit() || b"+-.,eE".contains(&c))
            && field.bytes().any(|c| c.is_ascii_digit());
        if !is_numeric || !field.contains(['.', ',']) {
            return;
        }
        let marks = |mark: char| field.matches(mark).count();
        match (marks('.'), marks(',')) {
            (1, 0) if is_in_thousands(field, '.') => _ = self.point_or_thousands.get_or_insert(field),
            (1, 0) => _ = self.point.get_or_insert(field),
            (0, 1) if is_in_thousands(field, ',') => _ = self.either.get_or_insert(field),
            (0, 1) => _ = self.comma.get_or_insert(field),
            (0 | 1, _) if Decimal::Point.plain(field).is_some() => self.has_comma_thousands = true,
            (_, 0 | 1) if Decimal::Comma.plain(field).is_some() => self.has_point_thousands = true,
            _ => {}
        }
    }
}

/// The sign before the decimals of the fields of a file; an error where it could be either.
pub(super) fn decimal<'a>(file: &str, fields: impl Iterator<Item = &'a str>) -> Result<Decimal, Error> {
    let mut shown = Shown::default();
    fields.for_each(|field| shown.take(field));
    let (a, b) = match shown {
        Shown { point: Some(a), comma: Some(b), .. } => (a, b),
        Shown { comma: None, has_comma_thousands: true, has_point_thousands: false, .. } => {
            return Ok(Decimal::Point);
        }
        Shown { point: None, has_point_thousands: true, has_comma_thousands: false, .. } => {
            return Ok(Decimal::Comma);
        }
        Shown { point: Some(a), either: Some(b), .. } => (a, b),
        Shown { comma: Some(b), point_or_thousands: Some(a), .. } => (a, b),
        Shown { either: Some(b), point_or_thousands: Some(a), .. } => (a, b),
        Shown { comma: Some(_), .. } => return Ok(Decimal::Comma),
        Shown { either: Some(b), .. } => {
            return Err(Error::input(format_args!(
                "{file}: \"{b}\" could have a decimal comma or thousands; say which with --decimal comma or --decimal point"
            )));
        }
        _ => return Ok(Decimal::Point),
    };
    Err(Error::input(format_args!(
        "{file}: has points and commas in its numbers, as in \"{a}\" and \"{b}\"; say which is before the decimals with --decimal point (commas are thousands), --decimal comma, or --decimal both"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_of_decimals_are_seen_or_asked() {
        for (fields, wanted) in [
            (&["0.5", "12", "1.250"][..], Some(Decimal::Point)),
            (&["0,5", "12", "1,250"], Some(Decimal::Comma)),
            (&["1,234.5", "2,000.0"], Some(Decimal::Point)),
            (&["1.234,5", "0,5"], Some(Decimal::Comma)),
            (&["1,143,210", "143,210"], Some(Decimal::Point)),
            (&["0.5", "143,210"], None),
            (&["0.5", "0,5"], None),
            (&["143,210"], None),
            (&["25.01.2026", "12"], Some(Decimal::Point)),
        ] {
            assert_eq!(decimal("a.csv", fields.iter().copied()).ok(), wanted, "{fields:?}");
        }
        assert_eq!(Decimal::Point.number("143,210"), Some(143_210.0));
        assert_eq!(Decimal::Point.number("1,5"), None);
        assert_eq!(Decimal::Comma.number("-1.143,5"), Some(-1143.5));
        assert_eq!(Decimal::Comma.number("1e-3"), Some(1e-3));
        assert_eq!(Decimal::Both.number("1,5"), Some(1.5));
        assert_eq!(Decimal::Point.number("143'210"), Some(143_210.0));
    }
}
