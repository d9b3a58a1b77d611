//! As much of a 32-bit little-endian ELF file as flashing and measuring need.

use crate::shell::Error;
use std::fs;
use std::path::{Path, PathBuf};

/// A flash image.
pub(crate) struct Elf {
    path: PathBuf,
    bytes: Vec<u8>,
}

/// A piece of the image that is loaded.
pub(crate) struct Segment {
    /// Its address in flash.
    pub(crate) load_address: u32,
    /// Its address at run time.
    pub(crate) address: u32,
    /// Bytes in the file.
    pub(crate) file_size: u32,
    /// Bytes in memory.
    pub(crate) memory_size: u32,
    offset: u32,
}

/// A symbol.
pub(crate) struct Symbol {
    pub(crate) name: String,
    pub(crate) value: u32,
    pub(crate) size: u32,
    /// A function, and not a name for a place.
    pub(crate) is_function: bool,
}

const LOAD: u32 = 1;
const SYMBOL_TABLE: u32 = 2;
const FUNCTION: u8 = 2;

impl Elf {
    /// Reads `path`.
    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        let bytes = fs::read(path).map_err(|error| {
            Error::new(format!(
                "{} cannot be read: {error}; `cargo xtask firmware` builds it",
                path.display()
            ))
        })?;
        let elf = Self { path: path.to_path_buf(), bytes };
        // Class 1 is 32 bits, data 1 little-endian.
        if elf.bytes.get(..6) == Some(&[0x7F, b'E', b'L', b'F', 1, 1]) { Ok(elf) } else { Err(elf.broken()) }
    }

    fn broken(&self) -> Error {
        Error::new(format!("{} is not an image for the board; build it again", self.path.display()))
    }

    fn slice(&self, offset: u32, size: u32) -> Result<&[u8], Error> {
        let (offset, size) = (offset as usize, size as usize);
        self.bytes.get(offset..offset.saturating_add(size)).ok_or_else(|| self.broken())
    }

    fn word(&self, offset: u32) -> Result<u32, Error> {
        let bytes = self.slice(offset, 4)?;
        bytes.try_into().map(u32::from_le_bytes).map_err(|_| self.broken())
    }

    fn half(&self, offset: u32) -> Result<u32, Error> {
        let bytes = self.slice(offset, 2)?;
        bytes.try_into().map(|bytes| u16::from_le_bytes(bytes).into()).map_err(|_| self.broken())
    }

    /// Returns the segments that are loaded.
    pub(crate) fn segments(&self) -> Result<Vec<Segment>, Error> {
        let (table, size, count) = (self.word(28)?, self.half(42)?, self.half(44)?);
        let mut segments = vec![];
        for index in 0..count {
            let at = table + index * size;
            if self.word(at)? == LOAD {
                segments.push(Segment {
                    offset: self.word(at + 4)?,
                    address: self.word(at + 8)?,
                    load_address: self.word(at + 12)?,
                    file_size: self.word(at + 16)?,
                    memory_size: self.word(at + 20)?,
                });
            }
        }
        Ok(segments)
    }

    /// Returns the bytes of `segment`.
    pub(crate) fn contents(&self, segment: &Segment) -> Result<&[u8], Error> {
        self.slice(segment.offset, segment.file_size)
    }

    /// Every symbol that has a name.
    pub(crate) fn symbols(&self) -> Result<Vec<Symbol>, Error> {
        let (table, size, count) = (self.word(32)?, self.half(46)?, self.half(48)?);
        let mut symbols = vec![];
        for index in 0..count {
            let at = table + index * size;
            if self.word(at + 4)? != SYMBOL_TABLE {
                continue;
            }
            let (offset, length) = (self.word(at + 16)?, self.word(at + 20)?);
            let names = self.word(table + self.word(at + 24)? * size + 16)?;
            const ENTRY: u32 = 16;
            for entry in 0..length / ENTRY {
                let at = offset + entry * ENTRY;
                let name = self.text(names + self.word(at)?)?;
                if !name.is_empty() {
                    let is_function =
                        self.slice(at + 12, 1)?.first().is_some_and(|info| info & 0xF == FUNCTION);
                    symbols.push(Symbol {
                        name,
                        value: self.word(at + 4)?,
                        size: self.word(at + 8)?,
                        is_function,
                    });
                }
            }
        }
        Ok(symbols)
    }

    fn text(&self, offset: u32) -> Result<String, Error> {
        let rest = self.bytes.get(offset as usize..).ok_or_else(|| self.broken())?;
        let text = rest.split(|&byte| byte == 0).next().unwrap_or_default();
        Ok(String::from_utf8_lossy(text).into_owned())
    }

    /// The image as it is in flash, from its first byte to its last; gaps are as erased flash.
    pub(crate) fn flash_image(&self) -> Result<(u32, Vec<u8>), Error> {
        let segments: Vec<Segment> =
            self.segments()?.into_iter().filter(|segment| segment.file_size > 0).collect();
        let start = segments.iter().map(|segment| segment.load_address).min().ok_or_else(|| self.broken())?;
        let mut image = vec![];
        for segment in &segments {
            let contents = self.contents(segment)?;
            let from = (segment.load_address - start) as usize;
            // The largest flash there is holds 2 MiB: more is no image of ours.
            if from + contents.len() > 2 << 20 {
                return Err(self.broken());
            }
            if image.len() < from + contents.len() {
                image.resize(from + contents.len(), 0xFF);
            }
            image[from..from + contents.len()].copy_from_slice(contents);
        }
        Ok((start, image))
    }
}
