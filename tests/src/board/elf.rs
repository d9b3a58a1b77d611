//! The symbols of a 32-bit little-endian ELF file, as far as the tests look.

/// A named function or object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Symbol {
    /// As the compiler mangled it.
    pub name: String,
    /// Where it is; a function's without the Thumb bit.
    pub address: u32,
    /// Its size in bytes.
    pub size: u32,
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn half(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

/// The sections, each as its type, address, file offset, size and link.
fn sections(bytes: &[u8]) -> Option<Vec<[u32; 5]>> {
    let (table, size, count) = (word(bytes, 0x20)?, half(bytes, 0x2E)?, half(bytes, 0x30)?);
    (0..usize::from(count))
        .map(|n| {
            let at = table as usize + n * usize::from(size);
            Some([
                word(bytes, at + 4)?,
                word(bytes, at + 12)?,
                word(bytes, at + 16)?,
                word(bytes, at + 20)?,
                word(bytes, at + 24)?,
            ])
        })
        .collect()
}

/// Where the code holds an instruction whose first four bytes `is_it` knows, by address.
#[must_use]
pub fn instructions(bytes: &[u8], is_it: impl Fn([u8; 4]) -> bool) -> Vec<u32> {
    const PROGRAM: u32 = 1;
    let code = sections(bytes).unwrap_or_default().into_iter().filter(|section| section[0] == PROGRAM);
    code.flat_map(|[_, address, offset, size, _]| {
        let code = bytes.get(offset as usize..(offset + size) as usize).unwrap_or_default();
        let words = (address..).step_by(2).zip(code.windows(4).step_by(2));
        let is_it = &is_it;
        let found = words.filter(move |(_, word)| (*word).try_into().is_ok_and(is_it));
        found.map(|(address, _)| address).collect::<Vec<u32>>()
    })
    .collect()
}

/// Every function and object of the file; none for a file that is no such ELF.
#[must_use]
pub fn symbols(bytes: &[u8]) -> Vec<Symbol> {
    const SYMBOL_TABLE: u32 = 2;
    const ENTRY: usize = 16;
    let read = || {
        let sections = sections(bytes)?;
        let table = sections.iter().find(|section| section[0] == SYMBOL_TABLE)?;
        let names = sections.get(table[4] as usize)?[2] as usize;
        let entries = (0..table[3] as usize / ENTRY).map(|n| table[2] as usize + n * ENTRY);
        let symbols = entries.filter_map(|at| {
            let kind = bytes.get(at + 12)? & 0xF;
            let name = bytes.get(names + word(bytes, at)? as usize..)?;
            let name = name.split(|&byte| byte == 0).next()?;
            let address = word(bytes, at + 4)?;
            // Objects are 1, functions 2.
            let address = if kind == 2 { address & !1 } else { address };
            matches!(kind, 1 | 2).then(|| Symbol {
                name: String::from_utf8_lossy(name).into_owned(),
                address,
                size: word(bytes, at + 8).unwrap_or(0),
            })
        });
        Some(symbols.collect())
    };
    read().unwrap_or_default()
}
