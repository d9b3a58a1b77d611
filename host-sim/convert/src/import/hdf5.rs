//! HDF5, as MATLAB's `save` with `-v7.3` and h5py write it; only where the program was built with
//! the feature `hdf5`.

use super::npy;
use super::npy_array::Array;
use super::table::{Column, Log, join};
use device_sim::error::Error;
use hdf5_pure::{AttrValue, DType, Dataset, File, Group};

/// Groups within each other that are read.
const DEEPEST: usize = 8;
/// Most numbers that a byte of a file may hold: what deflate makes of equal ones.
const MOST_PER_BYTE: u64 = 1032;

/// Reads every dataset of numbers; one of two sides gives a column for each place of the shorter
/// one.
pub(super) fn read(file: &str, bytes: Vec<u8>) -> Result<Log, Error> {
    let unusable = |cause: &dyn std::fmt::Display| {
        Error::input(format_args!("{file}: is not a usable HDF5 file ({cause}); write it again"))
    };
    let is_matlab = bytes.starts_with(b"MATLAB");
    let most = bytes.len() as u64 * MOST_PER_BYTE;
    let opened = File::from_bytes(bytes).map_err(|cause| unusable(&cause))?;
    let mut found = Found { is_matlab, most, columns: Vec::new(), left_out: Vec::new() };
    found.group("", &opened.root(), 0).map_err(|cause| unusable(&cause))?;
    let Found { columns, left_out, .. } = found;
    let format = if is_matlab { "MATLAB -v7.3" } else { "HDF5" };
    Ok(Log::of_arrays(file, format, columns, &left_out))
}

/// The columns of a file, and the datasets that hold none.
struct Found {
    is_matlab: bool,
    most: u64,
    columns: Vec<Column>,
    left_out: Vec<String>,
}

impl Found {
    /// Takes the datasets of a group and of those within it; MATLAB keeps what cells refer to in
    /// groups that begin with `#`.
    fn group(&mut self, path: &str, group: &Group, depth: usize) -> Result<(), hdf5_pure::Error> {
        for name in group.datasets()? {
            self.dataset(join(path, &name), &group.dataset(&name)?)?;
        }
        for name in group.groups()? {
            let path = join(path, &name);
            if self.is_matlab && name.starts_with('#') {
                continue;
            }
            if depth < DEEPEST {
                self.group(&path, &group.group(&name)?, depth + 1)?;
            } else {
                self.left_out.push(path);
            }
        }
        Ok(())
    }

    fn dataset(&mut self, path: String, dataset: &Dataset) -> Result<(), hdf5_pure::Error> {
        let shape = dataset.shape()?;
        let count = shape.iter().try_fold(1_u64, |count, side| count.checked_mul(*side));
        let is_possible = count.is_some_and(|count| count > 1 && count <= self.most);
        if !is_possible || !is_of_numbers(dataset)? {
            self.left_out.push(path);
            return Ok(());
        }
        let shape: Vec<usize> = shape.iter().map(|side| *side as usize).filter(|side| *side != 1).collect();
        let array = Array::of(shape, dataset.read_f64()?);
        // Columns count as those who write such files count them.
        npy::add(&path, &array, usize::from(self.is_matlab), &mut self.columns);
        Ok(())
    }
}

/// True for numbers; MATLAB also stores text as numbers, and an empty array as its sides.
fn is_of_numbers(dataset: &Dataset) -> Result<bool, hdf5_pure::Error> {
    let is_number = matches!(
        dataset.dtype()?,
        DType::F32
            | DType::F64
            | DType::I8
            | DType::I16
            | DType::I32
            | DType::I64
            | DType::U8
            | DType::U16
            | DType::U32
            | DType::U64
    );
    let attributes = dataset.attrs()?;
    let is_text = attributes.get("MATLAB_class").is_some_and(|class| match class {
        AttrValue::String(class) | AttrValue::AsciiString(class) => class.starts_with("char"),
        _ => false,
    });
    Ok(is_number && !is_text && !attributes.contains_key("MATLAB_empty"))
}
