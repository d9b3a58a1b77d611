//! One array of NumPy's `.npy` format, read by its specification (NumPy enhancement proposal 1,
//! versions 1 to 3).

/// An array of numbers, read as `f64` whatever they were.
pub(super) struct Array {
    /// Length of each axis.
    shape: Vec<usize>,
    /// Distance between neighbours along each axis, in elements.
    strides: Vec<usize>,
    values: Vec<f64>,
}

/// The bytes before the header's length: a magic string and two of version.
const MAGIC: &[u8] = b"\x93NUMPY";

impl Array {
    /// True if the bytes claim to be of this format.
    pub(super) fn is_here(bytes: &[u8]) -> bool {
        bytes.starts_with(MAGIC)
    }

    /// `None` if the bytes are not of this format, are too few, or hold no plain numbers.
    pub(super) fn read(bytes: &[u8]) -> Option<Array> {
        let after = bytes.strip_prefix(MAGIC)?;
        let (length, from) = match after.first()? {
            1 => (usize::from(u16::from_le_bytes(after.get(2..4)?.try_into().ok()?)), 4),
            2 | 3 => (usize::try_from(u32::from_le_bytes(after.get(2..6)?.try_into().ok()?)).ok()?, 6),
            _ => return None,
        };
        let data = after.get(from..)?;
        let header = std::str::from_utf8(data.get(..length)?).ok()?;
        let shape = shape(header)?;
        let count = shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side))?;
        let values = numbers(quoted(header, "descr")?, data.get(length..)?, count)?;
        let is_fortran = value(header, "fortran_order")?.starts_with("True");
        let strides = strides(&shape, is_fortran);
        Some(Array { shape, strides, values })
    }

    /// An array whose last axis is the nearest.
    #[cfg(feature = "hdf5")]
    pub(super) fn of(shape: Vec<usize>, values: Vec<f64>) -> Array {
        Array { strides: strides(&shape, false), shape, values }
    }

    /// Number of axes.
    pub(super) fn axes(&self) -> usize {
        self.shape.len()
    }

    /// Number of elements.
    pub(super) fn len(&self) -> usize {
        self.values.len()
    }

    /// The columns of the array, whose rows run along its longest side; the first of several that
    /// are as long.
    pub(super) fn columns(&self) -> Vec<Vec<f64>> {
        let long = (0..self.axes()).max_by_key(|axis| (self.shape[*axis], usize::MAX - axis));
        let (rows, stride) = long.map_or((1, 1), |axis| (self.shape[axis], self.strides[axis]));
        let mut starts = vec![0];
        for axis in (0..self.axes()).filter(|axis| Some(*axis) != long) {
            let places = (0..self.shape[axis]).map(|i| i * self.strides[axis]);
            starts = starts.iter().flat_map(|start| places.clone().map(move |place| start + place)).collect();
        }
        let column = |start: usize| (0..rows).map(|row| self.values[start + row * stride]).collect();
        if self.values.is_empty() { Vec::new() } else { starts.into_iter().map(column).collect() }
    }
}

/// The distance between neighbours on each axis: the last axis is the nearest in C's order, the
/// first in Fortran's.
fn strides(shape: &[usize], is_fortran: bool) -> Vec<usize> {
    let mut strides = vec![1; shape.len()];
    let mut stride = 1;
    for i in 0..shape.len() {
        let axis = if is_fortran { i } else { shape.len() - 1 - i };
        strides[axis] = stride;
        stride *= shape[axis];
    }
    strides
}

/// Returns the text after a key of the header, which is the text of a Python dictionary.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, after) = header.split_once(key)?;
    Some(after.strip_prefix(['\'', '"'])?.trim_start().strip_prefix(':')?.trim_start())
}

fn quoted<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let text = value(header, key)?;
    let quote = text.chars().next().filter(|quote| "'\"".contains(*quote))?;
    text[1..].split_once(quote).map(|(inside, _)| inside)
}

fn shape(header: &str) -> Option<Vec<usize>> {
    let (inside, _) = value(header, "shape")?.strip_prefix('(')?.split_once(')')?;
    let sides = inside.split(',').map(str::trim).filter(|side| !side.is_empty());
    sides.map(|side| side.parse().ok()).collect()
}

/// The numbers of a type such as `<f8`: byte order, kind and width in bytes.
fn numbers(kind: &str, data: &[u8], count: usize) -> Option<Vec<f64>> {
    let is_big = kind.starts_with('>');
    let kind = kind.trim_start_matches(['<', '>', '=', '|']);
    let width = kind.get(1..)?.parse().ok()?;
    let number = number_of(kind)?;
    let data = data.get(..count.checked_mul(width)?)?;
    let read = |bytes: &[u8]| {
        let mut wide = [0; 8];
        wide[..width].copy_from_slice(bytes);
        if is_big {
            wide[..width].reverse();
        }
        number(wide)
    };
    Some(data.chunks_exact(width).map(read).collect())
}

/// Returns the function that reads a kind of number from its bytes, the least significant first and
/// filled up with zeros.
fn number_of(kind: &str) -> Option<fn([u8; 8]) -> f64> {
    /// The first bytes.
    fn first<const N: usize>(wide: [u8; 8]) -> [u8; N] {
        std::array::from_fn(|i| wide[i])
    }
    Some(match kind {
        "f8" => f64::from_le_bytes,
        "f4" => |wide| f64::from(f32::from_le_bytes(first(wide))),
        "i8" => |wide| i64::from_le_bytes(wide) as f64,
        "i4" => |wide| f64::from(i32::from_le_bytes(first(wide))),
        "i2" => |wide| f64::from(i16::from_le_bytes(first(wide))),
        "i1" => |wide| f64::from(i8::from_le_bytes(first(wide))),
        "u1" | "u2" | "u4" | "u8" => |wide| u64::from_le_bytes(wide) as f64,
        "b1" => |wide| f64::from(u8::from(wide[0] != 0)),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `numpy.save` of NumPy 2.4.6 writes these bytes before the numbers.
    fn saved(kind: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let length = u16::try_from(header.len()).unwrap_or(0).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
    }

    fn columns(bytes: &[u8]) -> Option<Vec<Vec<f64>>> {
        Array::read(bytes).map(|array| array.columns())
    }

    #[test]
    fn a_matrix_of_either_order_has_rows_along_its_longest_side() {
        let by_rows = saved("|u1", "False", "(3, 2)", &[1, 2, 3, 4, 5, 6]);
        assert_eq!(columns(&by_rows), Some(vec![vec![1.0, 3.0, 5.0], vec![2.0, 4.0, 6.0]]));
        let by_columns = saved("|u1", "True", "(3, 2)", &[1, 2, 3, 4, 5, 6]);
        assert_eq!(columns(&by_columns), Some(vec![vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]]));
        let lying = saved("|u1", "False", "(2, 3)", &[1, 2, 3, 4, 5, 6]);
        assert_eq!(columns(&lying), Some(vec![vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]]));
    }

    #[test]
    fn numbers_of_every_byte_order_and_width_are_read() {
        let one =
            |kind, data: &[u8]| columns(&saved(kind, "False", "(1,)", data)).map(|columns| columns[0][0]);
        assert_eq!(one("<f8", &(-2.5_f64).to_le_bytes()), Some(-2.5));
        assert_eq!(one(">f8", &(-2.5_f64).to_be_bytes()), Some(-2.5));
        assert_eq!(one("<f4", &(-2.5_f32).to_le_bytes()), Some(-2.5));
        assert_eq!(one(">i4", &(-70_000_i32).to_be_bytes()), Some(-70_000.0));
        assert_eq!(one("<i2", &(-300_i16).to_le_bytes()), Some(-300.0));
        assert_eq!(one("|i1", &[0xff]), Some(-1.0));
        assert_eq!(one("<u4", &4_000_000_000_u32.to_le_bytes()), Some(4e9));
        assert_eq!(one("|b1", &[1]), Some(1.0));
        assert_eq!(one("<c16", &[0; 16]), None);
    }

    #[test]
    fn damaged_files_are_refused() {
        let whole = saved("<f8", "False", "(2,)", &[0; 16]);
        assert!(columns(&whole).is_some());
        for end in 0..whole.len() {
            assert_eq!(columns(&whole[..end]), None, "the first {end} bytes");
        }
        assert_eq!(columns(&saved("<f8", "False", "(99999999999, 99999999999)", &[])), None);
        assert_eq!(columns(&saved("<f8", "False", "(0,)", &[])), Some(Vec::new()));
    }
}
