//! JSON as programs write it: an object of arrays, an array of objects, lines of objects, pandas'
//! `to_json` in each of its orientations; nested objects give names with dots.

use super::table::{Column, Log, join};
use device_sim::error::Error;
use serde_json::Value;
use std::collections::BTreeMap;

/// Deeper nesting is nobody's recording.
const DEEPEST: usize = 12;
/// Elements of an array within a row that become columns.
const WIDEST: usize = 64;

pub(super) fn read(file: &str, text: &str) -> Result<Log, Error> {
    let value = match serde_json::from_str(text) {
        Ok(value) => value,
        // Lines of objects: one value after another.
        Err(cause) => {
            match serde_json::Deserializer::from_str(text).into_iter().collect::<Result<Vec<Value>, _>>() {
                Ok(rows) if rows.len() > 1 => Value::Array(rows),
                _ => {
                    return Err(Error::input(format_args!(
                        "{file}: this is not JSON ({cause}); write it again"
                    )));
                }
            }
        }
    };
    let mut columns = Vec::new();
    let mut left_out = 0;
    collect("", &value, 0, &mut columns, &mut left_out);
    let mut notes = vec![format!("read as JSON: {} columns", columns.len())];
    if left_out > 0 {
        notes.push(format!("{left_out} values that are no columns of numbers left out"));
    }
    let mut log = Log::of_columns(file, columns);
    log.notes = notes;
    Ok(log)
}

fn scalar(value: &Value) -> Option<f64> {
    match value {
        Value::Number(n) => n.as_f64(),
        Value::Bool(b) => Some(f64::from(u8::from(*b))),
        Value::Null => Some(f64::NAN),
        _ => None,
    }
}

fn collect(path: &str, value: &Value, depth: usize, out: &mut Vec<Column>, left_out: &mut usize) {
    if depth > DEEPEST {
        return;
    }
    match value {
        Value::Array(rows) if rows.len() > 1 => {
            if let Some(values) = rows.iter().map(scalar).collect::<Option<Vec<f64>>>() {
                out.push(Column::new(path, values));
            } else if let Some(channels) = channels(rows) {
                for (index, values) in channels.into_iter().enumerate() {
                    out.push(Column::unnamed(join(path, &index.to_string()), values));
                }
            } else if rows.iter().all(|row| row.is_object() || row.is_array()) {
                of_rows(path, rows, out);
            } else {
                *left_out += 1;
            }
        }
        Value::Object(map) => {
            // pandas: {"columns": […], "data": [[…], …]}.
            if let (Some(Value::Array(names)), Some(Value::Array(data))) =
                (map.get("columns"), map.get("data"))
            {
                let mut found = Vec::new();
                of_rows("", data, &mut found);
                for column in found {
                    let name =
                        column.name.parse::<usize>().ok().and_then(|i| names.get(i)).and_then(Value::as_str);
                    out.push(Column::new(join(path, name.unwrap_or(&column.name)), column.values));
                }
                return;
            }
            // pandas' default: {"time": {"0": 0.0, "1": 0.1}}.
            let numbered: Option<Vec<(u64, f64)>> =
                map.iter().map(|(key, value)| Some((key.parse().ok()?, scalar(value)?))).collect();
            match numbered {
                Some(mut rows) if rows.len() > 1 => {
                    rows.sort_by_key(|row| row.0);
                    out.push(Column::new(path, rows.into_iter().map(|row| row.1).collect()));
                }
                _ => {
                    for (key, value) in map {
                        collect(&join(path, key), value, depth + 1, out, left_out);
                    }
                }
            }
        }
        _ => *left_out += 1,
    }
}

/// The values of a matrix whose rows are its channels: few of them, each many values long.
fn channels(rows: &[Value]) -> Option<Vec<Vec<f64>>> {
    let length = rows.first()?.as_array()?.len();
    let row = |row: &Value| row.as_array()?.iter().map(scalar).collect::<Option<Vec<f64>>>();
    if length <= WIDEST || rows.len() >= length {
        return None;
    }
    let all = rows.iter().map(row).collect::<Option<Vec<_>>>()?;
    all.iter().all(|row| row.len() == length).then_some(all)
}

/// Columns of rows that are objects or arrays; what a row does not have is NaN there.
fn of_rows(path: &str, rows: &[Value], out: &mut Vec<Column>) {
    let mut columns: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        flatten("", row, 0, &mut |name, value| {
            let column = columns.entry(name).or_default();
            column.resize(index, f64::NAN);
            column.push(value);
        });
    }
    for (name, mut values) in columns {
        values.resize(rows.len(), f64::NAN);
        out.push(Column::new(join(path, &name), values));
    }
}

/// Every number of a value by its path.
pub(super) fn flatten(path: &str, value: &Value, depth: usize, give: &mut dyn FnMut(String, f64)) {
    if depth > DEEPEST {
        return;
    }
    match value {
        Value::Object(map) => {
            let part = |a: &str, b: &str| Some((map.get(a)?.as_f64()?, map.get(b)?.as_f64()?));
            // A stamp in two parts, as ROS has it.
            let stamp =
                part("sec", "nanosec").or_else(|| part("sec", "nsec")).or_else(|| part("secs", "nsecs"));
            if let Some((sec, nanosec)) = stamp {
                give(path.to_owned(), sec + nanosec * 1e-9);
                return;
            }
            for (key, value) in map {
                flatten(&join(path, key), value, depth + 1, give);
            }
        }
        Value::Array(items) => {
            for (index, value) in items.iter().enumerate().take(WIDEST) {
                flatten(&join(path, &index.to_string()), value, depth + 1, give);
            }
        }
        other => {
            if let Some(value) = scalar(other) {
                give(path.to_owned(), value);
            }
        }
    }
}
