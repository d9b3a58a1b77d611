//! Dates and times of day as text, as programs, loggers and spreadsheets write them.

use jiff::civil;

/// Seconds since 1970 of a date with a time, or seconds of a time of day; none where it is neither.
///
/// Reads `2026-01-31 10:30:25.5` (with T, Z or a zone), `2026-01-31 10:30:25,500` of Python's
/// logging, `31.01.2026 10:30:25,500`, `1/31/2026 10:30:25 PM`, `10:30:25.5` and `30:25.5`.
pub(super) fn seconds(field: &str) -> Option<f64> {
    if !field.contains(':') || !field.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    if let Ok(stamp) = field.parse::<jiff::Timestamp>() {
        return Some(stamp.as_second() as f64 + f64::from(stamp.subsec_nanosecond()) * 1e-9);
    }
    let colon = field.find(':')?;
    match field[..colon].rfind([' ', 'T', '_', '-']) {
        Some(at) => Some(day(field[..at].trim_end_matches(','))? + time_of_day(&field[at + 1..])?),
        None => time_of_day(field),
    }
}

/// Seconds from 1970 to a day.
fn day(text: &str) -> Option<f64> {
    let mark = text.trim().chars().find(|c| !c.is_ascii_digit())?;
    let numbers: Vec<i16> = text.trim().split(mark).map(|n| n.parse().ok()).collect::<Option<_>>()?;
    let [a, b, c] = numbers[..] else { return None };
    let full = |year: i16| if year < 100 { 2000 + year } else { year };
    let (year, month, day) = match mark {
        _ if a > 31 => (a, b, c),
        // The month is first in the United States; days beyond twelve show the other order.
        '/' if a <= 12 => (full(c), a, b),
        _ => (full(c), b, a),
    };
    let date = civil::Date::new(year, i8::try_from(month).ok()?, i8::try_from(day).ok()?).ok()?;
    Some(date.duration_since(civil::date(1970, 1, 1)).as_secs_f64())
}

/// Seconds since midnight.
fn time_of_day(text: &str) -> Option<f64> {
    let text = text.trim().trim_end_matches(['Z', 'z']).trim_end();
    let half = |mark: &str| {
        let at = text.len().checked_sub(mark.len())?;
        text.get(at..).filter(|end| end.eq_ignore_ascii_case(mark)).map(|_| text[..at].trim_end())
    };
    let (clock, afternoon) = match (half("AM"), half("PM")) {
        (Some(clock), _) => (clock, Some(false)),
        (_, Some(clock)) => (clock, Some(true)),
        _ => (text, None),
    };
    let parts: Vec<f64> =
        clock.split(':').map(|part| part.trim().replace(',', ".").parse().ok()).collect::<Option<_>>()?;
    let (hours, minutes, seconds) = match parts[..] {
        [h, m, s] => (h, m, s),
        [h, m, s, ms] if clock.len() - clock.rfind(':')? == 4 => (h, m, s + 1e-3 * ms),
        // A spreadsheet's mm:ss.0.
        [m, s] if clock.contains(['.', ',']) => (0.0, m, s),
        [h, m] => (h, m, 0.0),
        _ => return None,
    };
    let in_range = hours >= 0.0 && (0.0..60.0).contains(&minutes) && (0.0..61.0).contains(&seconds);
    let hours = match afternoon {
        Some(_) if hours > 12.0 => return None,
        Some(is_after_noon) => hours % 12.0 + if is_after_noon { 12.0 } else { 0.0 },
        None => hours,
    };
    in_range.then_some(3600.0 * hours + 60.0 * minutes + seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_of_every_usual_program_are_read() {
        let noon = |hours: f64| 1_767_225_600.0 + 3600.0 * hours;
        for (text, wanted) in [
            ("2026-01-01T10:30:25.500Z", Some(noon(10.5) + 25.5)),
            ("2026-01-01 10:30:25.500", Some(noon(10.5) + 25.5)),
            ("2026-01-01 10:30:25,500", Some(noon(10.5) + 25.5)),
            ("2026/01/01 10:30:25.5", Some(noon(10.5) + 25.5)),
            ("01.01.2026 10:30:25,500", Some(noon(10.5) + 25.5)),
            ("1/1/2026 10:30:25.500 PM", Some(noon(22.5) + 25.5)),
            ("1/1/26 12:00:01 AM", Some(noon(0.0) + 1.0)),
            ("31/01/2026 00:00:00", Some(noon(30.0 * 24.0))),
            ("10:30:25.5", Some(10.5 * 3600.0 + 25.5)),
            ("10:30:25,5 am", Some(10.5 * 3600.0 + 25.5)),
            ("12:00:00 PM", Some(12.0 * 3600.0)),
            ("30:25.5", Some(30.0 * 60.0 + 25.5)),
            ("10:30:25:500", Some(10.5 * 3600.0 + 25.5)),
            ("13:00:00 PM", None),
            ("1:2:3:4", None),
            ("99.99.2026 10:30:25", None),
            ("1:x", None),
        ] {
            let found = seconds(text);
            let same = match (found, wanted) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-5,
                (None, None) => true,
                _ => false,
            };
            assert!(same, "{text}: {found:?}, not {wanted:?}");
        }
    }
}
