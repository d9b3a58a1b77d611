//! The firmware's log: `defmt` frames of its terminal, read with the format strings that its image
//! holds.
//!
//! The official decoder gives `serde_json` a feature that changes how numbers in tagged messages
//! are read, for every crate that is built with it, so the tests would need a second build of
//! everything. The parser of the format strings and the framing are the official crates; frames
//! hold an index, then the arguments (the defmt book, "Encoding").

use std::collections::BTreeMap;

use defmt_parser::{Fragment, ParserMode, Type};

use super::elf;

/// The format strings of an image.
#[derive(Debug)]
pub struct Log {
    /// By index: the kind of line (`defmt_info`, `defmt_prim`, …) and the format string.
    formats: BTreeMap<u16, (String, String)>,
    /// The format string of the time stamp.
    stamp: Option<String>,
}

impl Log {
    /// Reads the format strings out of the ELF file `image`.
    #[must_use]
    pub fn of(image: &[u8]) -> Self {
        let formats = elf::symbols(image).into_iter().filter_map(|symbol| {
            let entry: serde_json::Value = serde_json::from_str(&symbol.name).ok()?;
            let text = |key: &str| entry.get(key)?.as_str().map(str::to_string);
            Some((symbol.address.try_into().ok()?, (text("tag")?, text("data")?)))
        });
        let formats: BTreeMap<u16, (String, String)> = formats.collect();
        let stamp =
            formats.values().find(|(tag, _)| tag == "defmt_timestamp").map(|(_, format)| format.clone());
        Self { formats, stamp }
    }

    /// The lines of `terminal`, each after its time stamp, with its level before it.
    ///
    /// # Panics
    ///
    /// When the terminal holds anything that is not a frame of this image.
    #[must_use]
    pub fn lines(&self, terminal: &[u8]) -> Vec<(String, String)> {
        let frames = terminal.split(|&byte| byte == 0).filter(|frame| !frame.is_empty());
        let lines = frames.map(|frame| {
            let bytes = rzcobs::decode(frame).unwrap_or_else(|why| panic!("{frame:02x?}: {why:?}"));
            let mut rest = bytes.as_slice();
            let (tag, format) = self.format(&mut rest);
            // The time stamp comes before the arguments (the defmt book, "Encoding").
            let time = self.stamp.as_ref().map(|stamp| self.text(stamp, &mut rest));
            let level = tag.trim_start_matches("defmt_");
            (time.unwrap_or_default(), format!("{level}: {}", self.text(format, &mut rest)))
        });
        lines.collect()
    }

    fn format(&self, rest: &mut &[u8]) -> (&str, &str) {
        let index = u16::from_le_bytes(take(rest));
        let (tag, format) = self.formats.get(&index).unwrap_or_else(|| panic!("no format has index {index}"));
        (tag, format)
    }

    /// `format` with its arguments, which `rest` begins with in the order of their numbers.
    fn text(&self, format: &str, rest: &mut &[u8]) -> String {
        let fragments = defmt_parser::parse(format, ParserMode::ForwardsCompatible).expect("a format string");
        let mut arguments: BTreeMap<usize, Type> = BTreeMap::new();
        for fragment in &fragments {
            if let Fragment::Parameter(parameter) = fragment {
                arguments.insert(parameter.index, parameter.ty.clone());
            }
        }
        let values: BTreeMap<usize, String> =
            arguments.into_iter().map(|(index, kind)| (index, self.value(&kind, rest))).collect();
        let shown = fragments.iter().map(|fragment| match fragment {
            Fragment::Literal(text) => text.to_string(),
            Fragment::Parameter(parameter) => values[&parameter.index].clone(),
        });
        shown.collect()
    }

    fn value(&self, kind: &Type, rest: &mut &[u8]) -> String {
        match kind {
            Type::U8 => u8::from_le_bytes(take(rest)).to_string(),
            Type::U16 => u16::from_le_bytes(take(rest)).to_string(),
            Type::U32 | Type::Usize => u32::from_le_bytes(take(rest)).to_string(),
            Type::U64 => u64::from_le_bytes(take(rest)).to_string(),
            Type::Str => {
                let length = u32::from_le_bytes(take(rest)) as usize;
                let (text, others) = rest.split_at(length);
                *rest = others;
                String::from_utf8_lossy(text).into_owned()
            }
            // Text that was written piece by piece, and the byte that no text has.
            Type::Display | Type::Debug => {
                let end = rest.iter().position(|&byte| byte == 0xFF).expect("an end of the text");
                let (text, others) = (&rest[..end], &rest[end + 1..]);
                *rest = others;
                String::from_utf8_lossy(text).into_owned()
            }
            Type::Format => {
                let (_, format) = self.format(rest);
                self.text(format, rest)
            }
            other => panic!("the firmware logs a {other:?}, which this does not read yet"),
        }
    }
}

/// The next `N` bytes.
fn take<const N: usize>(rest: &mut &[u8]) -> [u8; N] {
    let (first, others) = rest.split_at_checked(N).unwrap_or_else(|| panic!("{rest:02x?} ends too early"));
    *rest = others;
    first.try_into().expect("as many as were split off")
}
