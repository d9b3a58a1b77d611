//! Parquet, as pandas, Arrow and LeRobot write it; only where the program was built with the
//! feature `parquet`.

use super::table::{Column, Log};
use super::units::{self, Unit};
use device_sim::error::Error;
use parquet::basic::{LogicalType, TimeUnit};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::schema::types::TypePtr;
use serde_json::Value;
use std::path::Path;

/// Elements of a list that become columns.
const WIDEST: usize = 64;

pub(super) fn read(file: &str, bytes: Vec<u8>) -> Result<Log, Error> {
    let unusable = |cause: parquet::errors::ParquetError| {
        Error::input(format_args!(
            "{file}: is not a usable Parquet file ({cause}); write it again, with no compression or snappy"
        ))
    };
    let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).map_err(unusable)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let of: &[TypePtr] = schema.root_schema().get_fields();
    // A column, or one for each element of its lists.
    let mut columns: Vec<Vec<Vec<f64>>> = vec![Vec::new(); of.len()];
    for (index, row) in reader.get_row_iter(None).map_err(unusable)?.enumerate() {
        let row = row.map_err(unusable)?;
        for (parts, (_, field)) in columns.iter_mut().zip(row.get_column_iter()) {
            let one = std::slice::from_ref(field);
            let elements = match field {
                Field::ListInternal(list) => list.elements(),
                _ => one,
            };
            for (part, element) in elements.iter().take(WIDEST).enumerate() {
                if parts.len() <= part {
                    parts.push(Vec::new());
                }
                parts[part].resize(index, f64::NAN);
                parts[part].push(number(element));
            }
        }
    }
    let rows = usize::try_from(reader.metadata().file_metadata().num_rows()).unwrap_or(0);
    let names = Names::beside(Path::new(file));
    let mut out = Vec::new();
    for (parts, of) in columns.into_iter().zip(of) {
        let is_list = of.is_group();
        for (part, mut values) in parts.into_iter().enumerate() {
            values.resize(rows, f64::NAN);
            let mut column = match names.of(of.name(), part) {
                Some(name) => Column::new(format!("{}.{name}", of.name()), values),
                None if is_list => Column::unnamed(format!("{}.{part}", of.name()), values),
                None => Column::new(of.name(), values),
            };
            column.unit = unit(of).or(column.unit);
            out.push(column);
        }
    }
    let mut log = Log::of_columns(file, out);
    log.notes.push(names.note());
    Ok(log)
}

fn unit(of: &TypePtr) -> Option<Unit> {
    let unit = match of.get_basic_info().logical_type_ref() {
        Some(LogicalType::Timestamp { unit, .. } | LogicalType::Time { unit, .. }) => unit,
        _ => return None,
    };
    units::parse(match unit {
        TimeUnit::MILLIS => "ms",
        TimeUnit::MICROS => "us",
        TimeUnit::NANOS => "ns",
    })
}

/// The names that a LeRobot dataset gives the elements of its lists: `meta/info.json` in a folder
/// above the file.
struct Names(Option<Value>);

impl Names {
    fn beside(file: &Path) -> Self {
        let found = file.ancestors().skip(1).take(4).find_map(|folder| {
            let text = std::fs::read_to_string(folder.join("meta/info.json")).ok()?;
            serde_json::from_str(&text).ok()
        });
        Self(found)
    }

    /// Returns the name of an element of a list. The names are in a list, or in a list within an
    /// object of one key.
    fn of(&self, column: &str, element: usize) -> Option<&str> {
        let names = self.0.as_ref()?.get("features")?.get(column)?.get("names")?;
        let list = names.as_array().or_else(|| names.as_object()?.values().next()?.as_array())?;
        // A scalar has its own name for its only element.
        list.get(element)?.as_str().filter(|name| *name != column)
    }

    fn note(&self) -> String {
        match &self.0 {
            Some(_) => {
                "read as Parquet of a LeRobot dataset, its elements by the names of meta/info.json".into()
            }
            None => "read as Parquet".into(),
        }
    }
}

fn number(field: &Field) -> f64 {
    match field {
        Field::Bool(x) => f64::from(u8::from(*x)),
        Field::Byte(x) => f64::from(*x),
        Field::Short(x) => f64::from(*x),
        Field::Int(x) => f64::from(*x),
        Field::Long(x) | Field::TimestampMillis(x) | Field::TimestampMicros(x) => *x as f64,
        Field::UByte(x) => f64::from(*x),
        Field::UShort(x) => f64::from(*x),
        Field::UInt(x) => f64::from(*x),
        Field::ULong(x) => *x as f64,
        Field::Float(x) => f64::from(*x),
        Field::Double(x) => *x,
        _ => f64::NAN,
    }
}
