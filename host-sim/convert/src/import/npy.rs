//! NumPy's `.npz` and `.npy`: one array a column, or a column for each column of a matrix.

use super::npy_array::Array;
use super::table::{Column, Log};
use device_sim::error::Error;
use std::io::{Cursor, Read};
use zip::ZipArchive;

pub(super) fn read(file: &str, bytes: Vec<u8>) -> Result<Log, Error> {
    let unusable = |cause: &dyn std::fmt::Display| {
        Error::input(format_args!("{file}: is no usable NumPy file ({cause}); write it again with np.savez"))
    };
    let mut columns = Vec::new();
    let mut left_out = Vec::new();
    if Array::is_here(&bytes) {
        let array = Array::read(&bytes);
        let array = array.ok_or_else(|| unusable(&"its numbers are of a kind that is not read"))?;
        add("column", &array, &mut columns);
    } else {
        let mut archive = ZipArchive::new(Cursor::new(&bytes)).map_err(|cause| unusable(&cause))?;
        for i in 0..archive.len() {
            let mut file = archive.by_index(i).map_err(|cause| unusable(&cause))?;
            let plain = file.name().trim_end_matches(".npy").to_owned();
            let mut inside = Vec::new();
            file.read_to_end(&mut inside).map_err(|cause| unusable(&cause))?;
            match Array::read(&inside) {
                Some(array) if array.axes() > 0 && array.len() > 1 => add(&plain, &array, &mut columns),
                _ => left_out.push(plain),
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
fn add(name: &str, array: &Array, out: &mut Vec<Column>) {
    for (i, values) in array.columns().into_iter().enumerate() {
        // Matrices count their columns from 0, as their users do.
        out.push(match array.axes() {
            1 => Column::new(name, values),
            _ => Column::unnamed(format!("{name}.{i}"), values),
        });
    }
}
