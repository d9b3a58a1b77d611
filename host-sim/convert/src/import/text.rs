//! Tables as text: any separator, decimal point or comma, comments, preambles, a row of units,
//! dates, no header at all.

use super::header::{self, Above};
use super::layout::{self, Layout, Lines, SEPARATORS, sample};
use super::numbers::{self, Decimal, is_missing};
use super::stamps;
use super::table::{Column, ColumnTable, Log};
use super::units;
use device_sim::error::Error;

const COMMENTS: [&str; 4] = ["#", "%", "//", "!"];
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

/// Fields that are looked at for the sign before decimals.
const MOST_FIELDS: usize = 200_000;

/// Reads a text file; `decimal` is what a person said of the sign before decimals.
pub(super) fn read(file: &str, bytes: &[u8], decimal: Option<Decimal>) -> Result<Log, Error> {
    let text = decode(bytes);
    let (lines, comments) = lines_and_comments(&text);
    let mut layout = layout::layout(&lines);
    if layout.separator == ',' {
        layout.join_stamps(&lines);
    }
    let every = lines.len() * layout.count / MOST_FIELDS + 1;
    let fields = lines.iter().step_by(every).flat_map(|(_, line)| layout.fields(line));
    layout.decimal = match decimal {
        Some(decimal) => decimal,
        None => numbers::decimal(file, fields)?,
    };
    if let Some(log) = channels_in_rows(file, &lines, layout) {
        return Ok(log);
    }
    let Some(first) = first_row(&lines, layout) else {
        return Err(Error::input(format_args!(
            "{file}: no row of numbers was found; give a table as text, .npz, JSON, MCAP or Parquet"
        )));
    };
    let mut notes = Vec::new();
    let above = Above { lines: &lines[..first], comments: &comments };
    let names = header::names(above, layout, &mut notes);
    let named = SEPARATORS.iter().find(|s| s.0 == layout.separator).map_or("", |s| s.1);
    notes.push(format!(
        "read as text: {} columns between {named}{}{}",
        layout.count,
        if layout.decimal == Decimal::Comma { ", decimal commas" } else { "" },
        if comments.is_empty() {
            String::new()
        } else {
            format!(", {} comment lines left out", comments.len())
        }
    ));
    let row = layout.fields(lines[first].1);
    let is_stamp = |i: usize| stamps::seconds(row[i].trim().trim_matches('"')).is_some();
    let columns = names
        .into_iter()
        .zip(values(&lines[first..], layout, &mut notes))
        .enumerate()
        .map(|(i, ((name, unit), (values, unread)))| {
            let mut column = match name {
                Some(name) => Column::new(name, values),
                None => Column::unnamed(format!("column{}", i + 1), values),
            };
            column.set_unit(unit);
            if is_stamp(i) {
                column.set_unit(units::written("s"));
            }
            column.unread = unread;
            column
        })
        .collect();
    Ok(Log { file: file.to_owned(), tables: vec![ColumnTable { name: file.to_owned(), columns }], notes })
}

/// The first line of numbers: each field is a number where most of its column are numbers.
fn first_row(lines: &Lines, layout: Layout) -> Option<usize> {
    let mut numbers = vec![(0, 0); layout.count];
    for row in sample(lines).map(|line| layout.fields(line)).filter(|row| row.len() == layout.count) {
        for (field, (good, all)) in row.iter().zip(&mut numbers).filter(|(field, _)| !is_missing(field)) {
            *good += usize::from(layout.number(field).is_some());
            *all += 1;
        }
    }
    let is_row = |(_, line): &(usize, &str)| {
        let row = layout.fields(line);
        let fits = |(field, (good, all)): (&&str, &(usize, usize))| {
            is_missing(field) || layout.number(field).is_some() || 5 * good < 4 * all
        };
        row.len() == layout.count
            && row.iter().any(|field| layout.number(field).is_some())
            && row.iter().zip(&numbers).all(fits)
    };
    lines.iter().position(is_row)
}

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

/// The numbers of a column, and the first value that is not a number, its line, and how many there
/// are.
type Values = (Vec<f64>, Option<(String, usize, usize)>);

/// The values of each column; lines of another number of fields or without a number are left out,
/// with a note.
fn values(lines: &[(usize, &str)], layout: Layout, notes: &mut Vec<String>) -> Vec<Values> {
    let mut columns: Vec<Values> = vec![(Vec::with_capacity(lines.len()), None); layout.count];
    let (mut ragged, mut first_ragged) = (0, (0, ""));
    for (at, line) in lines {
        let row = layout.fields(line);
        if row.len() != layout.count || row.iter().all(|f| layout.number(f).is_none()) {
            if ragged == 0 {
                first_ragged = (*at, *line);
            }
            ragged += 1;
            continue;
        }
        for ((values, unread), field) in columns.iter_mut().zip(&row) {
            let number = layout.number(field);
            if number.is_none() && !is_missing(field) {
                unread.get_or_insert_with(|| (field.trim().chars().take(40).collect(), *at, 0)).2 += 1;
            }
            values.push(number.unwrap_or(f64::NAN));
        }
    }
    if ragged > 0 {
        let shown: String = first_ragged.1.chars().take(40).collect();
        notes.push(format!(
            "{ragged} lines without {} fields or without a number left out, the first at line {} (\"{shown}\")",
            layout.count, first_ragged.0
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
fn channels_in_rows(file: &str, lines: &Lines, layout: Layout) -> Option<Log> {
    let count = layout.count;
    if lines.len() > MOST_CHANNELS || count < LONGER_THAN_MANY * lines.len().max(4) {
        return None;
    }
    let mut columns = Vec::new();
    for (_, line) in lines {
        let row: Vec<&str> =
            layout.fields(line).into_iter().map(|f| f.trim().trim_matches('"').trim()).collect();
        let words = row.iter().take_while(|f| layout.number(f).is_none()).count();
        let values: Vec<f64> = row[words..].iter().map(|f| layout.number(f).unwrap_or(f64::NAN)).collect();
        let numbers = values.iter().filter(|x| x.is_finite()).count();
        if words > 3 || 2 * numbers < count {
            continue;
        }
        let mut column = match row.first().filter(|_| words > 0) {
            Some(name) => Column::new(*name, values),
            None => Column::unnamed(format!("column{}", columns.len() + 1), values),
        };
        column.set_unit(row[..words].iter().skip(1).find_map(|f| units::written(f)));
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
