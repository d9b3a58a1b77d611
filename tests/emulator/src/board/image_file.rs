//! The file of an image, read once for all boards of a program that run it.

use super::Refused;
use super::elf;
use super::warm_core::ImageKey;
use rigless::image::Image;
use rigless::symbols::Symbols;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

/// The file as it was when it was written last.
#[derive(Debug)]
pub(super) struct ImageFile {
    written: Option<SystemTime>,
    pub(super) key: ImageKey,
    pub(super) symbols: Vec<elf::Symbol>,
    /// The linker's own names, which have no type.
    pub(super) places: Symbols,
    /// As the emulator takes it.
    pub(super) images: [Image; 1],
}

static READ: Mutex<BTreeMap<PathBuf, Arc<ImageFile>>> = Mutex::new(BTreeMap::new());

impl ImageFile {
    /// Reads the file at `path`, unless it was read since it was written last.
    ///
    /// # Errors
    ///
    /// If there is no such file, or it is no image.
    pub(super) fn read(path: &Path) -> Result<Arc<Self>, Refused> {
        let written = fs::metadata(path).and_then(|about| about.modified()).ok();
        let mut read = READ.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = read.get(path).filter(|known| known.written == written) {
            return Ok(known.clone());
        }
        let refuse = |why: String| Refused(format!("{}: {why}", path.display()));
        let bytes = fs::read(path)
            .map_err(|error| refuse(format!("{error}; `cargo xtask firmware` builds the image")))?;
        let file = Arc::new(Self {
            written,
            key: ImageKey::of(&bytes),
            symbols: elf::symbols(&bytes),
            places: Symbols::read(&bytes, |address| address).map_err(|error| refuse(error.to_string()))?,
            images: [Image::new(path, bytes, None).map_err(|error| refuse(error.to_string()))?],
        });
        read.insert(path.to_owned(), file.clone());
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF file for an ARM core without sections.
    fn empty_image() -> Vec<u8> {
        let mut bytes = vec![0; 52];
        bytes[..7].copy_from_slice(b"\x7FELF\x01\x01\x01");
        // An executable, for ARM, of version 1, with a header of 52 bytes.
        for (at, value) in [(16, 2), (18, 40), (20, 1), (40, 52), (42, 32), (46, 40)] {
            bytes[at] = value;
        }
        bytes
    }

    #[test]
    fn a_file_is_read_again_once_it_was_written_again() {
        let path = std::env::temp_dir().join(format!("image-file-{}", std::process::id()));
        let read = || ImageFile::read(&path).map_err(|why| why.to_string());
        assert!(read().expect_err("there is none").contains("cargo xtask firmware"));
        fs::write(&path, "no image").expect("it is written");
        assert!(read().expect_err("no ELF file").contains("image-file-"));
        fs::write(&path, empty_image()).expect("it is written");
        let first = read().expect("an image");
        assert!(Arc::ptr_eq(&first, &read().expect("the same")));
        let file = fs::File::options().append(true).open(&path);
        file.and_then(|file| file.set_modified(SystemTime::UNIX_EPOCH)).expect("its time is set");
        assert!(!Arc::ptr_eq(&first, &read().expect("another")));
        fs::remove_file(&path).expect("it is removed");
    }
}
