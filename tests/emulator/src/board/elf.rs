//! The symbols of a 32-bit little-endian ELF file, as far as the tests look.

/// A named function or object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Symbol {
    /// As the compiler mangled it.
    pub name: String,
    /// Its address; a function's without the Thumb bit.
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

/// Returns the addresses of the instructions whose first four bytes satisfy `is_it`.
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

/// The bytes of the code from `address` on.
#[must_use]
pub fn code(bytes: &[u8], address: u32) -> Option<&[u8]> {
    const PROGRAM: u32 = 1;
    let sections = sections(bytes)?;
    let holds = |section: &&[u32; 5]| {
        section[0] == PROGRAM && (section[1]..section[1] + section[3]).contains(&address)
    };
    let [_, begin, offset, size, _] = *sections.iter().find(holds)?;
    bytes.get((offset + address - begin) as usize..(offset + size) as usize)
}

/// Returns the first instruction of the handler of `exception`, by the vector table at the foot of
/// the flash.
#[must_use]
pub fn handler(bytes: &[u8], exception: u32) -> Option<u32> {
    const VECTORS: u32 = 0x0800_0000;
    // Bit 0 says that it is Thumb code.
    Some(word(code(bytes, VECTORS)?, 4 * exception as usize)? & !1)
}

/// The instructions by which the function at `address` may return, its own and those of functions
/// that it jumps to as its last act; none where there is no such function. ARMv7-M manual, A7.7:
/// `bx lr`, `pop {…, pc}`, `ldr pc, [sp], #4`, `b`.
#[must_use]
pub fn exits(bytes: &[u8], symbols: &[Symbol], address: u32) -> Vec<u32> {
    let (mut exits, mut seen, mut open) = (vec![], vec![], vec![address]);
    while let Some(entry) = open.pop() {
        let function = symbols.iter().find(|symbol| symbol.address == entry && symbol.size > 0);
        let (Some(function), false) = (function, seen.contains(&entry)) else { continue };
        seen.push(entry);
        for (place, first, second) in body(bytes, entry, function.size) {
            match (first, second) {
                (0x4770 | 0xBD00..=0xBDFF, _) => exits.push(place),
                (0xE8BD, 0x8000..) | (0xF85D, 0xFB04) => exits.push(place),
                (0xF000..=0xF7FF, _) if second & 0xD000 == 0x9000 => open.push(branch(place, first, second)),
                _ => {}
            }
        }
    }
    exits
}

/// Returns the addresses of the instructions that wait for an interrupt or an event, `wfi` and
/// `wfe` (ARMv7-M manual, A7.7: `bf30`, `bf20`; `f3af 8003`, `f3af 8002`).
#[must_use]
pub fn waits(bytes: &[u8], symbols: &[Symbol]) -> Vec<u32> {
    let functions = symbols.iter().filter(|symbol| symbol.size > 0);
    let all = functions.flat_map(|function| body(bytes, function.address, function.size));
    let waits = all.filter(|&(_, first, second)| {
        matches!((first, second), (0xBF30 | 0xBF20, _) | (0xF3AF, 0x8003 | 0x8002))
    });
    waits.map(|(place, ..)| place).collect()
}

/// Returns the instructions of the function at `address`, none where there is no code: the place of
/// each, its first half and the half after that.
fn body(bytes: &[u8], address: u32, size: u32) -> Vec<(u32, u16, u16)> {
    let Some(code) = code(bytes, address) else { return vec![] };
    let (mut body, mut at) = (vec![], 0);
    while let (true, Some(first)) = (at < size, half(code, at as usize)) {
        body.push((address + at, first, half(code, at as usize + 2).unwrap_or(0)));
        at += if first >= 0xE800 { 4 } else { 2 };
    }
    body
}

/// Returns the target of the long branch at `place`: `b.w`, encoding T4.
fn branch(place: u32, first: u16, second: u16) -> u32 {
    let bit = |half: u16, at: u16| u32::from(half >> at & 1);
    let sign = bit(first, 10);
    let (i1, i2) = (1 ^ bit(second, 13) ^ sign, 1 ^ bit(second, 11) ^ sign);
    let offset =
        sign << 24 | i1 << 23 | i2 << 22 | u32::from(first & 0x3FF) << 12 | u32::from(second & 0x7FF) << 1;
    let signed = (offset << 7) as i32 >> 7;
    place.wrapping_add(4).wrapping_add_signed(signed)
}

/// The entries of the table of symbols: the name of each and the entry itself.
fn entries(bytes: &[u8]) -> Option<Vec<(String, &[u8])>> {
    const SYMBOL_TABLE: u32 = 2;
    const ENTRY: usize = 16;
    let sections = sections(bytes)?;
    let table = sections.iter().find(|section| section[0] == SYMBOL_TABLE)?;
    let names = sections.get(table[4] as usize)?[2] as usize;
    let all = bytes.get(table[2] as usize..(table[2] + table[3]) as usize)?.chunks_exact(ENTRY);
    let entries = all.filter_map(|entry| {
        let name = bytes.get(names + word(entry, 0)? as usize..)?;
        let name = name.split(|&byte| byte == 0).next()?;
        Some((String::from_utf8_lossy(name).into_owned(), entry))
    });
    Some(entries.collect())
}

/// Every function and object of the file; none for a file that is no such ELF.
#[must_use]
pub fn symbols(bytes: &[u8]) -> Vec<Symbol> {
    let symbols = entries(bytes).unwrap_or_default().into_iter().filter_map(|(name, entry)| {
        let (kind, address) = (entry[12] & 0xF, word(entry, 4)?);
        // Objects are 1, functions 2.
        let address = if kind == 2 { address & !1 } else { address };
        let size = word(entry, 8).unwrap_or(0);
        matches!(kind, 1 | 2).then_some(Symbol { name, address, size })
    });
    symbols.collect()
}

/// Every object of the file with its bytes, in whatever section it is.
#[must_use]
pub fn objects(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let sections = sections(bytes).unwrap_or_default();
    let objects = entries(bytes).unwrap_or_default().into_iter().filter_map(|(name, entry)| {
        let [_, begin, offset, ..] = *sections.get(usize::from(half(entry, 14)?))?;
        let at = (offset + word(entry, 4)?.checked_sub(begin)?) as usize;
        let content = bytes.get(at..at + word(entry, 8)? as usize)?;
        (entry[12] & 0xF == 1).then(|| (name, content.to_vec()))
    });
    objects.collect()
}
