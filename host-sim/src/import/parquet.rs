//! Parquet, as pandas and Arrow write it; only where the program was built with the feature `parquet`.

use super::table::{Column, Log};
use super::units;
use crate::failure::Failure;
use parquet::basic::{LogicalType, TimeUnit};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;

pub(super) fn read(file: &str, bytes: Vec<u8>) -> Result<Log, Failure> {
    let unusable = |cause: parquet::errors::ParquetError| {
        Failure::input(format_args!(
            "{file}: is no usable Parquet file ({cause}); write it again, with no compression or snappy"
        ))
    };
    let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).map_err(unusable)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut columns: Vec<Column> =
        schema.columns().iter().map(|c| Column::new(c.path().string(), Vec::new())).collect();
    for row in reader.get_row_iter(None).map_err(unusable)? {
        let row = row.map_err(unusable)?;
        for (column, (_, field)) in columns.iter_mut().zip(row.get_column_iter()) {
            column.values.push(number(field));
        }
    }
    for (column, of) in columns.iter_mut().zip(schema.columns()) {
        let unit = match of.logical_type_ref() {
            Some(LogicalType::Timestamp { unit, .. } | LogicalType::Time { unit, .. }) => match unit {
                TimeUnit::MILLIS => "ms",
                TimeUnit::MICROS => "us",
                TimeUnit::NANOS => "ns",
            },
            _ => continue,
        };
        column.unit = units::parse(unit);
    }
    let mut log = Log::of_columns(file, columns);
    log.notes.push("read as Parquet".to_owned());
    Ok(log)
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
