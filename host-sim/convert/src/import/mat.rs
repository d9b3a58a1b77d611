//! MATLAB's `.mat` files of version 5 (what `save` writes without `-v7.3`, and SciPy's `savemat`):
//! arrays and structures of arrays. The layout is that of MathWorks' "MAT-File Format": tagged
//! elements, compressed ones within zlib.
//!
//! Read here, and not by a library: of those that were tried in November 2026, `matrw` 0.1.4
//! refuses every file of SciPy by its header, and `matfile` 0.5.0 reads no structures and does not
//! say which variables it leaves out.

use super::table::{Column, Log, join};
use device_sim::error::Error;
use std::io::Read;

const HEADER: usize = 128;
/// Deeper structures are nobody's recording.
const DEEPEST: usize = 12;
/// The largest size of a decompressed variable, bytes.
const LARGEST: u64 = 1 << 31;

const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;
const STRUCTURE: u8 = 2;
const OBJECT: u8 = 3;
const NUMBERS: std::ops::RangeInclusive<u8> = 6..=15;

pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Log, Error> {
    let unusable = |cause: &str| {
        Error::input(format_args!(
            "{file}: is not a usable MATLAB file ({cause}); save it again with save('FILE.mat', '-v7')"
        ))
    };
    let little = match bytes.get(126..HEADER) {
        Some(b"IM") => true,
        Some(b"MI") => false,
        _ => return Err(unusable("its header ends early")),
    };
    let mut found = Found::default();
    let mut rest = Bytes { left: &bytes[HEADER..], little };
    while let Some((kind, data)) = rest.element().map_err(unusable)? {
        match kind {
            COMPRESSED => {
                let mut plain = Vec::new();
                flate2::read::ZlibDecoder::new(data)
                    .take(LARGEST)
                    .read_to_end(&mut plain)
                    .map_err(|cause| unusable(&cause.to_string()))?;
                let mut inside = Bytes { left: &plain, little };
                if let Some((MATRIX, data)) = inside.element().map_err(unusable)? {
                    found.matrix("", Bytes { left: data, little }, 0).map_err(unusable)?;
                }
            }
            MATRIX => found.matrix("", Bytes { left: data, little }, 0).map_err(unusable)?,
            _ => {}
        }
    }
    Ok(Log::of_arrays(file, "MATLAB", found.columns, &found.left_out))
}

#[derive(Default)]
struct Found {
    columns: Vec<Column>,
    left_out: Vec<String>,
}

impl Found {
    /// Takes a matrix: its flags, dimensions, name and content.
    fn matrix(&mut self, path: &str, mut bytes: Bytes, depth: usize) -> Result<(), &'static str> {
        const SHORT: &str = "a variable ends early";
        let Some((_, flags)) = bytes.element()? else { return Ok(()) };
        let class = *flags.get(if bytes.little { 0 } else { 3 }).ok_or(SHORT)?;
        let (_, dimensions) = bytes.element()?.ok_or(SHORT)?;
        let dimensions: Vec<usize> =
            bytes.numbers(5, dimensions).unwrap_or_default().iter().map(|n| n.max(0.0) as usize).collect();
        let (_, name) = bytes.element()?.ok_or(SHORT)?;
        let name = String::from_utf8_lossy(name);
        let path = if name.is_empty() { path.to_owned() } else { join(path, &name) };
        match class {
            _ if depth > DEEPEST => self.left_out.push(path),
            STRUCTURE | OBJECT => {
                if class == OBJECT {
                    bytes.element()?.ok_or(SHORT)?;
                }
                let (_, length) = bytes.element()?.ok_or(SHORT)?;
                let length =
                    bytes.numbers(5, length).and_then(|n| n.first().copied()).unwrap_or(0.0) as usize;
                let (_, names) = bytes.element()?.ok_or(SHORT)?;
                let names: Vec<String> = names
                    .chunks(length.max(1))
                    .map(|name| String::from_utf8_lossy(name).trim_end_matches('\0').to_owned())
                    .collect();
                let several = dimensions.iter().product::<usize>() > 1;
                // One after another: every field of the first structure, of the second, …
                for index in 0.. {
                    let Some((kind, data)) = bytes.element()? else { break };
                    let Some(field) = names.get(index % names.len().max(1)) else { break };
                    let of =
                        if several { join(&path, &(index / names.len()).to_string()) } else { path.clone() };
                    if kind == MATRIX {
                        self.matrix(&join(&of, field), Bytes { left: data, ..bytes }, depth + 1)?;
                    }
                }
            }
            class if NUMBERS.contains(&class) => {
                let (kind, data) = bytes.element()?.ok_or(SHORT)?;
                match bytes.numbers(kind, data) {
                    Some(values) => self.array(path, &dimensions, &values),
                    None => self.left_out.push(path),
                }
            }
            _ => self.left_out.push(path),
        }
        Ok(())
    }

    /// The columns of an array, which is stored column by column; its longer side are the rows.
    fn array(&mut self, path: String, dimensions: &[usize], values: &[f64]) {
        let sides: Vec<usize> = dimensions.iter().copied().filter(|n| *n != 1).collect();
        match sides[..] {
            [n] if n == values.len() && n > 1 => self.columns.push(Column::new(path, values.to_vec())),
            [n, k] if n.checked_mul(k) == Some(values.len()) && n.min(k) > 0 => {
                for i in 0..n.min(k) {
                    let column = if n >= k {
                        values[i * n..(i + 1) * n].to_vec()
                    } else {
                        values.iter().skip(i).step_by(n).copied().collect()
                    };
                    // As MATLAB counts its columns.
                    self.columns.push(Column::unnamed(join(&path, &(i + 1).to_string()), column));
                }
            }
            _ => self.left_out.push(path),
        }
    }
}

/// The part that is left to read.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    left: &'a [u8],
    little: bool,
}

impl<'a> Bytes<'a> {
    fn u32(&self, at: usize) -> Option<u32> {
        let four: [u8; 4] = self.left.get(at..at + 4)?.try_into().ok()?;
        Some(if self.little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) })
    }

    /// The next element's kind and data; none at the end.
    fn element(&mut self) -> Result<Option<(u32, &'a [u8])>, &'static str> {
        const SHORT: &str = "it ends within a variable";
        let Some(first) = self.u32(0) else { return Ok(None) };
        let (kind, from, size) = match first >> 16 {
            0 => (first, 8, self.u32(4).ok_or(SHORT)? as usize),
            // Data of at most four bytes is in the tag itself.
            size => (first & 0xffff, 4, size as usize),
        };
        let data = self.left.get(from..from + size).ok_or(SHORT)?;
        let end = match (from, kind) {
            (4, _) => 8,
            (_, COMPRESSED) => from + size,
            _ => from + size.next_multiple_of(8),
        };
        self.left = self.left.get(end..).unwrap_or(&[]);
        Ok(Some((kind, data)))
    }

    /// The numbers of an element; none where it holds no numbers.
    fn numbers(&self, kind: u32, data: &[u8]) -> Option<Vec<f64>> {
        macro_rules! all {
            ($of:ty) => {{
                let one = |bytes: &[u8]| {
                    let mut array = [0; size_of::<$of>()];
                    array.copy_from_slice(bytes);
                    if self.little { <$of>::from_le_bytes(array) } else { <$of>::from_be_bytes(array) }
                };
                Some(data.chunks_exact(size_of::<$of>()).map(|bytes| one(bytes) as f64).collect())
            }};
        }
        match kind {
            1 => all!(i8),
            2 => all!(u8),
            3 => all!(i16),
            4 => all!(u16),
            5 => all!(i32),
            6 => all!(u32),
            7 => all!(f32),
            9 => all!(f64),
            12 => all!(i64),
            13 => all!(u64),
            _ => None,
        }
    }
}
