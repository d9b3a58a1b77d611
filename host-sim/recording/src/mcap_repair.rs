//! As much of a damaged recording as can be handed to `mcap`: version 0.26 subtracts without
//! looking where a record runs out of its chunk, and panics.

/// Opcode and length of a record.
const HEAD: usize = 9;
const CHUNK: u8 = 0x06;
/// The bytes of a chunk before the name of its compression: times, size, checksum.
const BEFORE_COMPRESSION: usize = 28;

/// The beginning of an MCAP file, up to the first record that runs out of an uncompressed chunk.
/// Anything else that is wrong with it stays in.
pub(super) fn intact(bytes: &[u8]) -> &[u8] {
    let mut at = mcap::MAGIC.len();
    while let Some((opcode, length)) = head(bytes, at) {
        let begin = at + HEAD;
        let end = usize::try_from(length).ok().and_then(|length| begin.checked_add(length));
        let content = bytes.get(begin..end.unwrap_or(usize::MAX).min(bytes.len())).unwrap_or_default();
        if let Some(bad) = (opcode == CHUNK).then(|| runs_out(content)).flatten() {
            return bytes.get(..begin + bad).unwrap_or(bytes);
        }
        match end {
            Some(end) if end <= bytes.len() => at = end,
            // It was cut here.
            _ => break,
        }
    }
    bytes
}

/// Returns the offset in an uncompressed chunk, whole or cut, of a record that begins but does not
/// end in it.
fn runs_out(chunk: &[u8]) -> Option<usize> {
    let compression = u32_at(chunk, BEFORE_COMPRESSION)?;
    let begin = BEFORE_COMPRESSION + 4 + 8;
    let mut left = u64_at(chunk, BEFORE_COMPRESSION + 4)?;
    if compression != 0 {
        return None;
    }
    let mut at = begin;
    while left > 0 {
        let length = (HEAD as u64).checked_add(head(chunk, at).map_or(0, |(_, length)| length));
        match length.and_then(|length| left.checked_sub(length)) {
            None => return Some(at),
            // The rest was cut.
            Some(_) if head(chunk, at).is_none() => return None,
            Some(rest) => {
                at = usize::try_from(length?).ok().and_then(|length| at.checked_add(length))?;
                left = rest;
            }
        }
    }
    None
}

/// Opcode and length of the record at `at`.
fn head(bytes: &[u8], at: usize) -> Option<(u8, u64)> {
    Some((*bytes.get(at)?, u64_at(bytes, at.checked_add(1)?)?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    let number = bytes.get(at..at.checked_add(8)?)?;
    number.try_into().ok().map(u64::from_le_bytes)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let number = bytes.get(at..at.checked_add(4)?)?;
    number.try_into().ok().map(u32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(opcode: u8, length: u64, content: &[u8]) -> Vec<u8> {
        [&[opcode][..], &length.to_le_bytes(), content].concat()
    }

    /// A file with a chunk of two records, the second of which says that it is `length` long and
    /// has 5 bytes.
    fn file(compression: &str, length: u64) -> Vec<u8> {
        let records = [record(5, 3, b"abc"), record(5, length, b"abcde")].concat();
        let chunk = [
            &[0; BEFORE_COMPRESSION][..],
            &(compression.len() as u32).to_le_bytes(),
            compression.as_bytes(),
            &(records.len() as u64).to_le_bytes(),
            &records,
        ]
        .concat();
        [mcap::MAGIC, &record(CHUNK, chunk.len() as u64, &chunk), &record(15, 4, b"more")].concat()
    }

    #[test]
    fn a_file_ends_before_a_record_that_runs_out_of_its_chunk() {
        let whole = file("", 5);
        assert_eq!(intact(&whole), whole);
        let second = mcap::MAGIC.len() + HEAD + BEFORE_COMPRESSION + 12 + HEAD + 3;
        for length in [6, 1 << 40, u64::MAX] {
            assert_eq!(intact(&file("", length)).len(), second, "{length}");
            assert_eq!(intact(&file("zstd", length)), file("zstd", length), "another reader's");
        }
        // A record that ends too early leaves bytes that are not a record.
        assert_eq!(intact(&file("", 1)).len(), second + HEAD + 1);
        for cut in 0..whole.len() {
            assert_eq!(intact(&whole[..cut]).len(), cut, "a file that was cut is not damaged");
        }
    }
}
