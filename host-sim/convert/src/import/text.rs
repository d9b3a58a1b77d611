//! Tables as text: any separator, decimal point or comma, comments, preambles, a row of units,
//! dates, no header at all.

use super::table::{Column, ColumnTable, Log};
use super::units;
use device_sim::error::Error;

const SEPARATORS: [(char, &str); 5] =
    [(';', "semicolons"), ('\t', "tabs"), (',', "commas"), ('|', "bars"), (' ', "spaces")];
const COMMENTS: [&str; 4] = ["#", "%", "//", "!"];
/// The number of lines from which the layout is recognised.
const SAMPLE: usize = 200;

/// Text from bytes: UTF-8, UTF-16 with its mark, else Latin-1, which German and French instruments
/// write.
pub(super) fn decode(bytes: &[u8]) -> String {
    let wide = |from: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|b| from([b[0], b[1]])).collect();
        String::from_utf16_lossy(&units)
    };
    let text = match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.to_owned(),
            Err(_) => bytes.iter().map(|b| char::from(*b)).collect(),
        },
    };
    text.trim_start_matches('\u{feff}').to_owned()
}

/// A number, or a date as seconds; none where it is neither.
fn number(field: &str, separator: char) -> Option<f64> {
    let field = field.trim().trim_matches('"').trim();
    if let Ok(value) = field.parse() {
        return Some(value);
    }
    if separator != ',' && field.contains(',') && !field.contains('.') {
        return field.replace(',', ".").parse().ok();
    }
    match field {
        "true" | "True" | "TRUE" => Some(1.0),
        "false" | "False" | "FALSE" => Some(0.0),
        _ => date(field),
    }
}

/// Seconds of a date with a time, or of a time of day.
fn date(field: &str) -> Option<f64> {
    if !field.contains(':') || !field.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    if let Ok(stamp) = field.parse::<jiff::Timestamp>() {
        return Some(stamp.as_second() as f64 + f64::from(stamp.subsec_nanosecond()) * 1e-9);
    }
    let day = |d: jiff::civil::Date| d.duration_since(jiff::civil::date(1970, 1, 1)).as_secs_f64();
    let clock = |t: jiff::civil::Time| t.duration_since(jiff::civil::Time::midnight()).as_secs_f64();
    if let Ok(at) = field.parse::<jiff::civil::DateTime>() {
        return Some(day(at.date()) + clock(at.time()));
    }
    field.parse().ok().map(clock)
}

fn fields(line: &str, separator: char) -> Vec<&str> {
    if separator == ' ' {
        return line.split_whitespace().collect();
    }
    let mut out = Vec::new();
    let (mut from, mut quoted) = (0, false);
    for (at, c) in line.char_indices() {
        if c == '"' {
            quoted = !quoted;
        } else if c == separator && !quoted {
            out.push(&line[from..at]);
            from = at + c.len_utf8();
        }
    }
    out.push(&line[from..]);
    out
}

/// The layout of a text.
struct Layout {
    separator: char,
    count: usize,
}

/// The separator under which most fields of the sample are numbers, of as many columns as the most
/// lines have.
fn layout(lines: &[(usize, &str)]) -> Layout {
    let from = lines.len().saturating_sub(SAMPLE);
    let sample = &lines[from..];
    let mut best = (Layout { separator: ',', count: 1 }, 0.0);
    for (separator, _) in SEPARATORS {
        let split: Vec<Vec<&str>> = sample.iter().map(|(_, line)| fields(line, separator)).collect();
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
            good += row.iter().filter(|f| number(f, separator).is_some() || f.trim().is_empty()).count();
        }
        let share = good as f64 / (sample.len() * count).max(1) as f64 + 1e-9 * all as f64;
        if share > best.1 + 1e-6 {
            best = (Layout { separator, count }, share);
        }
    }
    best.0
}

/// Reads a text file.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Log, Error> {
    let text = decode(bytes);
    let (lines, comments) = lines_and_comments(&text);
    let Layout { separator, count } = layout(&lines);
    if let Some(log) = channels_in_rows(file, &lines, separator, count) {
        return Ok(log);
    }
    let numeric = |line: &str| {
        let row = fields(line, separator);
        let numbers = row.iter().filter(|f| number(f, separator).is_some()).count();
        row.len() == count && 2 * numbers >= count.max(1) && numbers > 0
    };
    let Some(first) = lines.iter().position(|(_, line)| numeric(line)) else {
        return Err(Error::input(format_args!(
            "{file}: no row of numbers was found; give a table as text, .npz, JSON, MCAP or Parquet"
        )));
    };
    let mut notes = Vec::new();
    let names = header(&lines[..first], &comments, first, separator, count, &mut notes);
    let named = SEPARATORS.iter().find(|s| s.0 == separator).map_or("", |s| s.1);
    notes.push(format!(
        "read as text: {count} columns between {named}{}{}",
        if decimal_comma(&lines[first..], separator) { ", decimal commas" } else { "" },
        if comments.is_empty() {
            String::new()
        } else {
            format!(", {} comment lines left out", comments.len())
        }
    ));
    let columns = names
        .into_iter()
        .zip(values(&lines[first..], separator, count, &mut notes))
        .enumerate()
        .map(|(i, ((name, unit), values))| {
            let mut column = match name {
                Some(name) => Column::new(name, values),
                None => Column::unnamed(format!("column{}", i + 1), values),
            };
            column.unit = unit.or(column.unit);
            column
        })
        .collect();
    Ok(Log { file: file.to_owned(), tables: vec![ColumnTable { name: file.to_owned(), columns }], notes })
}

/// Lines, each with a number.
type Lines<'a> = Vec<(usize, &'a str)>;

/// Lines with their numbers from 1, and comments with the count of lines before them; empty ones
/// are left out.
fn lines_and_comments(text: &str) -> (Lines<'_>, Lines<'_>) {
    let (mut lines, mut comments) = (Vec::new(), Vec::new());
    for (index, line) in text.lines().enumerate() {
        let line = line.trim_end_matches(['\r', '\0']);
        if line.trim().is_empty() {
            continue;
        }
        match COMMENTS.iter().find(|mark| line.trim_start().starts_with(**mark)) {
            Some(mark) => comments.push((lines.len(), line.trim_start().trim_start_matches(mark))),
            None => lines.push((index + 1, line)),
        }
    }
    (lines, comments)
}

/// The numbers of each column; lines of another number of fields or without a number are left out,
/// with a note.
fn values(lines: &[(usize, &str)], separator: char, count: usize, notes: &mut Vec<String>) -> Vec<Vec<f64>> {
    let mut columns: Vec<Vec<f64>> = vec![Vec::with_capacity(lines.len()); count];
    let (mut ragged, mut first_ragged) = (0, 0);
    for (at, line) in lines {
        let row = fields(line, separator);
        if row.len() != count || row.iter().all(|f| number(f, separator).is_none()) {
            if ragged == 0 {
                first_ragged = *at;
            }
            ragged += 1;
            continue;
        }
        for (column, field) in columns.iter_mut().zip(&row) {
            column.push(number(field, separator).unwrap_or(f64::NAN));
        }
    }
    if ragged > 0 {
        notes.push(format!(
            "{ragged} lines without {count} fields or without a number left out, the first at line {first_ragged}"
        ));
    }
    columns
}

/// More rows than this are rows.
const MOST_CHANNELS: usize = 64;
/// So many times as many values as rows make them channels.
const LONGER_THAN_MANY: usize = 8;

/// A table whose rows are the channels, each with its name, and perhaps its unit, before its
/// values.
fn channels_in_rows(file: &str, lines: &[(usize, &str)], separator: char, count: usize) -> Option<Log> {
    if lines.len() > MOST_CHANNELS || count < LONGER_THAN_MANY * lines.len().max(4) {
        return None;
    }
    let mut columns = Vec::new();
    for (_, line) in lines {
        let row: Vec<&str> =
            fields(line, separator).into_iter().map(|f| f.trim().trim_matches('"').trim()).collect();
        let words = row.iter().take_while(|f| number(f, separator).is_none()).count();
        let values: Vec<f64> =
            row[words..].iter().map(|f| number(f, separator).unwrap_or(f64::NAN)).collect();
        let numbers = values.iter().filter(|x| x.is_finite()).count();
        if words > 3 || 2 * numbers < count {
            continue;
        }
        let mut column = match row.first().filter(|_| words > 0) {
            Some(name) => Column::new(*name, values),
            None => Column::unnamed(format!("column{}", columns.len() + 1), values),
        };
        column.unit = row[..words].iter().skip(1).find_map(|f| units::parse(f)).or(column.unit);
        columns.push(column);
    }
    (columns.len() >= 2).then(|| {
        let note = format!(
            "read as text: channels are in rows, {} of {} values: taken as columns",
            columns.len(),
            columns[0].values.len()
        );
        Log { notes: vec![note], ..Log::of_columns(file, columns) }
    })
}

fn decimal_comma(lines: &[(usize, &str)], separator: char) -> bool {
    separator != ',' && lines.iter().take(SAMPLE).any(|(_, line)| line.contains(','))
}

/// Names, none where they are made up, and units of their own.
type Names = Vec<(Option<String>, Option<units::Unit>)>;

/// The names of the columns with the units of a row of their own: from the lines above the numbers,
/// else from the last comment of as many words, else made up.
fn header(
    above: &[(usize, &str)],
    comments: &[(usize, &str)],
    first: usize,
    separator: char,
    count: usize,
    notes: &mut Vec<String>,
) -> Names {
    let fitting = |line: &str| -> Option<Vec<String>> {
        let mut row: Vec<String> =
            fields(line, separator).iter().map(|f| f.trim().trim_matches('"').trim().to_owned()).collect();
        // A separator at the end of the rows of numbers only.
        if row.len() + 1 == count {
            row.push(String::new());
        }
        (row.len() == count).then_some(row)
    };
    let rows: Vec<Vec<String>> = above.iter().rev().map_while(|(_, line)| fitting(line)).collect();
    let is_units = |row: &[String]| {
        row.iter().any(|f| units::parse(f).is_some())
            && row.iter().all(|f| f.is_empty() || units::parse(f).is_some())
    };
    let (names, own_units, used) = match &rows[..] {
        [below, names, ..] if is_units(below) => (Some(names.clone()), Some(below.clone()), 2),
        [names, ..] => (Some(names.clone()), None, 1),
        [] => (None, None, 0),
    };
    if above.len() > used {
        notes.push(format!("{} lines above the header left out", above.len() - used));
    }
    let from_comment = || {
        let (_, comment) = comments.iter().rev().find(|(before, _)| *before <= first)?;
        let by_words: Vec<String> = comment.split_whitespace().map(str::to_owned).collect();
        fitting(comment).or_else(|| (by_words.len() == count).then_some(by_words))
    };
    let Some(names) = names.or_else(from_comment) else {
        notes.push(format!("no header: the columns are called column1 to column{count}"));
        return vec![(None, None); count];
    };
    let unit_of = |i: usize| own_units.as_ref().and_then(|u| units::parse(&u[i]));
    names.into_iter().enumerate().map(|(i, name)| (Some(name), unit_of(i))).collect()
}
