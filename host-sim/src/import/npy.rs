//! NumPy's `.npz` and `.npy`: one array a column, or a column for each column of a matrix.

use super::table::{Column, Log};
use crate::failure::Failure;
use ndarray::{ArrayD, Axis};
use ndarray_npy::{NpzReader, ReadNpyExt, ReadNpzError, ReadableElement};
use std::io::{Cursor, Read};

pub(super) fn read(file: &str, bytes: Vec<u8>) -> Result<Log, Failure> {
    let unusable = |cause: &dyn std::fmt::Display| {
        Failure::input(format_args!(
            "{file}: is no usable NumPy file ({cause}); write it again with np.savez"
        ))
    };
    let mut columns = Vec::new();
    let mut left_out = Vec::new();
    if bytes.starts_with(b"\x93NUMPY") {
        let array = any(&bytes).ok_or_else(|| unusable(&"its numbers are of a kind that is not read"))?;
        add("column", &array, &mut columns);
    } else {
        let mut archive = NpzReader::new(Cursor::new(&bytes)).map_err(|cause| unusable(&cause))?;
        for name in archive.names().map_err(|cause| unusable(&cause))? {
            let plain = name.trim_end_matches(".npy");
            match of_any_kind(&mut archive, &name) {
                Some(array) if array.ndim() > 0 && array.len() > 1 => add(plain, &array, &mut columns),
                _ => left_out.push(plain.to_owned()),
            }
        }
    }
    let mut notes = vec![format!("read as NumPy: {} columns", columns.len())];
    if !left_out.is_empty() {
        notes.push(format!("{} left out: no arrays of numbers", left_out.join(", ")));
    }
    let mut log = Log::of_columns(file, columns);
    log.notes = notes;
    Ok(log)
}

/// The columns of an array: rows are its longest side.
fn add(name: &str, array: &ArrayD<f64>, out: &mut Vec<Column>) {
    let long = (0..array.ndim()).max_by_key(|axis| (array.shape()[*axis], usize::MAX - axis)).unwrap_or(0);
    let rows = array.shape().get(long).copied().unwrap_or(0);
    let count = array.len() / rows.max(1);
    let mut values = vec![Vec::with_capacity(rows); count];
    for row in array.axis_iter(Axis(long)) {
        for (column, value) in values.iter_mut().zip(row.iter()) {
            column.push(*value);
        }
    }
    for (i, values) in values.into_iter().enumerate() {
        // Matrices count their columns from 0, as their users do.
        out.push(match array.ndim() {
            1 => Column::new(name, values),
            _ => Column::unnamed(format!("{name}.{i}"), values),
        });
    }
}

fn in_archive<T: ReadableElement + Copy>(
    archive: &mut NpzReader<Cursor<&Vec<u8>>>,
    name: &str,
    as_f64: fn(T) -> f64,
) -> Result<ArrayD<f64>, ReadNpzError> {
    let array: ArrayD<T> = archive.by_name(name)?;
    Ok(array.mapv(as_f64))
}

/// An array of whatever kind its numbers are.
fn of_any_kind(archive: &mut NpzReader<Cursor<&Vec<u8>>>, name: &str) -> Option<ArrayD<f64>> {
    in_archive::<f64>(archive, name, |x| x)
        .or_else(|_| in_archive::<f32>(archive, name, f64::from))
        .or_else(|_| in_archive::<i64>(archive, name, |x| x as f64))
        .or_else(|_| in_archive::<i32>(archive, name, f64::from))
        .or_else(|_| in_archive::<u64>(archive, name, |x| x as f64))
        .or_else(|_| in_archive::<u32>(archive, name, f64::from))
        .or_else(|_| in_archive::<i16>(archive, name, f64::from))
        .or_else(|_| in_archive::<u16>(archive, name, f64::from))
        .or_else(|_| in_archive::<u8>(archive, name, f64::from))
        .or_else(|_| in_archive::<bool>(archive, name, |x| f64::from(u8::from(x))))
        .ok()
}

fn one<T: ReadableElement + Copy>(bytes: &[u8], as_f64: fn(T) -> f64) -> Option<ArrayD<f64>> {
    let mut reader: &[u8] = bytes;
    let reader: &mut dyn Read = &mut reader;
    Some(ArrayD::<T>::read_npy(reader).ok()?.mapv(as_f64))
}

fn any(bytes: &[u8]) -> Option<ArrayD<f64>> {
    one::<f64>(bytes, |x| x)
        .or_else(|| one::<f32>(bytes, f64::from))
        .or_else(|| one::<i64>(bytes, |x| x as f64))
        .or_else(|| one::<i32>(bytes, f64::from))
}
