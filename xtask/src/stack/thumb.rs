//! The part of the Thumb instruction set that shows stack use and calls (ARMv7-M Architecture
//! Reference Manual, chapter A7).

use crate::elf::{Elf, Symbol};
use crate::shell::Error;
use std::collections::{BTreeMap, BTreeSet};

/// The facts that a function's instructions show.
#[derive(Debug, Default)]
pub(crate) struct Body {
    /// Bytes that it takes from the stack, all branches together.
    pub(crate) frame: u32,
    /// Functions that it calls or jumps to.
    pub(crate) calls: Vec<u32>,
    /// Calls through a register.
    pub(crate) pointer_calls: usize,
    /// True if it takes an amount from a register.
    pub(crate) takes_unknown: bool,
    /// Constants that it builds, half by half.
    pub(crate) constants: Vec<u32>,
}

/// The image's memory, and what of it is code.
pub(crate) struct Code<'a> {
    memory: Vec<(u32, &'a [u8])>,
    /// From each address on: whether instructions follow.
    kinds: BTreeMap<u32, bool>,
}

/// An instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Instruction {
    Takes(u32),
    TakesUnknown,
    Calls(u32),
    JumpsTo(u32),
    CallsPointer,
    Low(u32, u32),
    High(u32, u32),
    Other,
}

impl<'a> Code<'a> {
    /// The image, with the linker's marks of code (`$t`) and data (`$d`).
    pub(crate) fn new(elf: &'a Elf, symbols: &[Symbol]) -> Result<Self, Error> {
        let mut memory = vec![];
        for segment in elf.segments()? {
            memory.push((segment.address, elf.contents(&segment)?));
        }
        let kinds = symbols
            .iter()
            .filter_map(|symbol| match symbol.name.get(..2) {
                Some("$t") => Some((symbol.value & !1, true)),
                Some("$d") => Some((symbol.value, false)),
                _ => None,
            })
            .collect();
        Ok(Self { memory, kinds })
    }

    fn half(&self, address: u32) -> Option<u16> {
        self.memory.iter().find_map(|(start, bytes)| {
            let at = address.checked_sub(*start)? as usize;
            bytes.get(at..at + 2)?.try_into().ok().map(u16::from_le_bytes)
        })
    }

    fn is_code(&self, address: u32) -> bool {
        self.kinds.range(..=address).next_back().is_none_or(|(_, is_code)| *is_code)
    }

    /// The first `count` entries of the vector table, as addresses of functions.
    pub(crate) fn vectors(&self, count: usize) -> Vec<u32> {
        let Some((_, bytes)) = self.memory.iter().min_by_key(|(start, _)| *start) else { return vec![] };
        let words =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        words.take(count).map(|word| word & !1).collect()
    }

    /// Reads the function at `start`.
    pub(crate) fn body(&self, start: u32, size: u32) -> Body {
        let mut body = Body::default();
        let mut low = BTreeMap::new();
        let mut at = start;
        while at < start + size {
            let Some(first) = self.half(at).filter(|_| self.is_code(at)) else {
                at += 2;
                continue;
            };
            let (instruction, length) = match wide(first) {
                true => (decode_wide(first, self.half(at + 2).unwrap_or(0), at), 4),
                false => (decode_narrow(first, at), 2),
            };
            at += length;
            match instruction {
                Instruction::Takes(bytes) => body.frame += bytes,
                Instruction::TakesUnknown => body.takes_unknown = true,
                Instruction::Calls(target) => body.calls.push(target),
                Instruction::JumpsTo(target) if !(start..start + size).contains(&target) => {
                    body.calls.push(target)
                }
                Instruction::CallsPointer => body.pointer_calls += 1,
                Instruction::Low(register, half) => {
                    low.insert(register, half);
                }
                Instruction::High(register, half) => {
                    body.constants.extend(low.get(&register).map(|low| half << 16 | low));
                }
                Instruction::JumpsTo(_) | Instruction::Other => {}
            }
        }
        body
    }

    /// Functions whose address the image holds: in its data, in its code's constants.
    pub(crate) fn addresses_taken(&self, bodies: &BTreeMap<u32, Body>) -> BTreeSet<u32> {
        let vectors = self.memory.iter().map(|(start, _)| *start).min();
        let mut words: Vec<u32> = bodies.values().flat_map(|body| body.constants.iter().copied()).collect();
        for (start, bytes) in self.memory.iter().filter(|(start, _)| Some(*start) != vectors) {
            for (index, word) in bytes.chunks_exact(4).enumerate() {
                let address = start + 4 * index as u32;
                let in_function = bodies.range(..=address).next_back().is_some();
                if !in_function
                    || !self.kinds.range(..=address).next_back().is_some_and(|(_, is_code)| *is_code)
                {
                    words.push(u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
                }
            }
        }
        // The address of Thumb code is odd.
        words
            .into_iter()
            .filter(|word| word & 1 == 1)
            .map(|word| word & !1)
            .filter(|w| bodies.contains_key(w))
            .collect()
    }
}

/// True if `first` begins an instruction of two halves.
fn wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

fn decode_narrow(code: u16, at: u32) -> Instruction {
    let code = u32::from(code);
    if code & 0xFE00 == 0xB400 {
        // PUSH
        Instruction::Takes(4 * (code & 0x1FF).count_ones())
    } else if code & 0xFF80 == 0xB080 {
        // SUB SP, #imm
        Instruction::Takes(4 * (code & 0x7F))
    } else if code & 0xFF87 == 0x4780 || (code & 0xFF87 == 0x4700 && code >> 3 & 0xF != 14) {
        // BLX and BX with a register; BX LR returns.
        Instruction::CallsPointer
    } else if code & 0xF800 == 0xE000 {
        // B
        Instruction::JumpsTo(offset(at, code & 0x7FF, 11))
    } else {
        Instruction::Other
    }
}

fn decode_wide(first: u16, second: u16, at: u32) -> Instruction {
    let (first, second) = (u32::from(first), u32::from(second));
    let immediate_16 =
        || (first & 0xF) << 12 | (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF;
    let immediate_12 = (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF;
    if first == 0xE92D {
        // PUSH.W
        Instruction::Takes(4 * second.count_ones())
    } else if first == 0xF84D && second & 0x0F00 == 0x0D00 {
        // STR to the stack with pre-decrement
        Instruction::Takes(second & 0xFF)
    } else if first & 0xFFBF == 0xED2D {
        // VPUSH
        Instruction::Takes(4 * (second & 0xFF))
    } else if first == 0xE96D {
        // STRD to the stack with pre-decrement
        Instruction::Takes(4 * (second & 0xFF))
    } else if first & 0xFBEF == 0xF1AD && second & 0x8F00 == 0x0D00 {
        // SUB.W SP, SP, #constant
        Instruction::Takes(expand(immediate_12))
    } else if first & 0xFBFF == 0xF2AD && second & 0x8F00 == 0x0D00 {
        // SUBW SP, SP, #imm
        Instruction::Takes(immediate_12)
    } else if first & 0xFFEF == 0xEBAD && second & 0x0F00 == 0x0D00 {
        // SUB.W SP, SP, register
        Instruction::TakesUnknown
    } else if first & 0xFBF0 == 0xF240 && second & 0x8000 == 0 {
        // MOVW
        Instruction::Low(second >> 8 & 0xF, immediate_16())
    } else if first & 0xFBF0 == 0xF2C0 && second & 0x8000 == 0 {
        // MOVT
        Instruction::High(second >> 8 & 0xF, immediate_16())
    } else if first & 0xF800 == 0xF000 && second & 0x9000 == 0x9000 {
        // BL, B.W
        let sign = first >> 10 & 1;
        let (i1, i2) = (!(second >> 13 ^ sign) & 1, !(second >> 11 ^ sign) & 1);
        let value = sign << 23 | i1 << 22 | i2 << 21 | (first & 0x3FF) << 11 | second & 0x7FF;
        let target = offset(at, value, 24);
        if second & 0x4000 != 0 { Instruction::Calls(target) } else { Instruction::JumpsTo(target) }
    } else if first & 0xF800 == 0xF000 && second & 0xD000 == 0x8000 && first >> 7 & 7 != 7 {
        // B<condition>.W
        let (sign, j1, j2) = (first >> 10 & 1, second >> 13 & 1, second >> 11 & 1);
        let value = sign << 19 | j2 << 18 | j1 << 17 | (first & 0x3F) << 11 | second & 0x7FF;
        Instruction::JumpsTo(offset(at, value, 20))
    } else {
        Instruction::Other
    }
}

/// The target of a branch at `at` by `halves` half-words, a signed number of `bits` bits.
fn offset(at: u32, halves: u32, bits: u32) -> u32 {
    let signed = (halves << (32 - bits)).cast_signed() >> (32 - bits);
    at.wrapping_add(4).wrapping_add_signed(2 * signed)
}

/// A constant as instructions of two halves code it (ThumbExpandImm).
fn expand(immediate: u32) -> u32 {
    let byte = immediate & 0xFF;
    match immediate >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (0x80 | immediate & 0x7F).rotate_right(immediate >> 7),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes as GNU `as` gives them.
    #[test]
    fn what_takes_stack_is_recognised() {
        assert_eq!(decode_narrow(0xB5F0, 0), Instruction::Takes(20));
        assert_eq!(decode_narrow(0xB082, 0), Instruction::Takes(8));
        assert_eq!(decode_wide(0xE92D, 0x4FF0, 0), Instruction::Takes(36));
        assert_eq!(decode_wide(0xED2D, 0x8B02, 0), Instruction::Takes(8));
        assert_eq!(decode_wide(0xF5AD, 0x7D00, 0), Instruction::Takes(512));
        assert_eq!(decode_wide(0xF6AD, 0x5D34, 0), Instruction::Takes(0xD34));
        assert_eq!(decode_wide(0xF84D, 0x8D04, 0), Instruction::Takes(4));
        assert_eq!(decode_narrow(0xB002, 0), Instruction::Other);
    }

    #[test]
    fn calls_and_jumps_are_followed() {
        assert_eq!(decode_wide(0xF000, 0xF800, 0x100), Instruction::Calls(0x104));
        assert_eq!(decode_wide(0xF7FF, 0xFFFE, 0x100), Instruction::Calls(0x100));
        assert_eq!(decode_wide(0xF000, 0xB808, 0x100), Instruction::JumpsTo(0x114));
        assert_eq!(decode_narrow(0xE7FE, 0x100), Instruction::JumpsTo(0x100));
        assert_eq!(decode_narrow(0x4798, 0), Instruction::CallsPointer);
        assert_eq!(decode_narrow(0x4770, 0), Instruction::Other);
    }

    #[test]
    fn constants_are_put_together() {
        assert_eq!(decode_wide(0xF241, 0x2034, 0), Instruction::Low(0, 0x1234));
        assert_eq!(decode_wide(0xF6C0, 0x0000, 0), Instruction::High(0, 0x0800));
    }
}
