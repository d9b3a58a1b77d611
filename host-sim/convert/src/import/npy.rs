//! NumPy's `.npz` and `.npy`: one array a column, or a column for each column of a matrix.

use super::npy_array::Array;
use super::table::{Column, Log};
use device_sim::error::Error;
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// Matrices count their columns from 0, as their users do.
const FIRST: usize = 0;

pub(super) fn read(file: &str, bytes: Vec<u8>) -> Result<Log, Error> {
    let unusable = |cause: &dyn std::fmt::Display| {
        Error::input(format_args!(
            "{file}: is not a usable NumPy file ({cause}); write it again with np.savez"
        ))
    };
    let mut columns = Vec::new();
    let mut left_out = Vec::new();
    if Array::is_here(&bytes) {
        let array = Array::read(&bytes);
        let array = array.ok_or_else(|| unusable(&"its numbers are of a kind that is not read"))?;
        add("column", &array, FIRST, &mut columns);
    } else {
        let mut archive = ZipArchive::new(Cursor::new(&bytes)).map_err(|cause| unusable(&cause))?;
        for i in 0..archive.len() {
            let mut file = archive.by_index(i).map_err(|cause| unusable(&cause))?;
            let plain = file.name().trim_end_matches(".npy").to_owned();
            let mut inside = Vec::new();
            file.read_to_end(&mut inside).map_err(|cause| unusable(&cause))?;
            match Array::read(&inside) {
                Some(array) if array.axes() > 0 && array.len() > 1 => {
                    add(&plain, &array, FIRST, &mut columns)
                }
                _ => left_out.push(plain),
            }
        }
    }
    Ok(Log::of_arrays(file, "NumPy", columns, &left_out))
}

/// The columns of an array, which count from `first`: rows are its longest side.
pub(super) fn add(name: &str, array: &Array, first: usize, out: &mut Vec<Column>) {
    for (i, values) in array.columns().into_iter().enumerate() {
        out.push(match array.axes() {
            1 => Column::new(name, values),
            _ => Column::unnamed(format!("{name}.{}", i + first), values),
        });
    }
}
