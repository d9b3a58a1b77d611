//! Reads a file of any known format into tables.

use super::numbers::Decimal;
use super::table::{Column, Log};
use super::{json, log, mat, npy, text};
use device_sim::error::Error;
use std::path::Path;

/// Reads a file of any format that is known, recognised by its first bytes and its name's ending;
/// `decimal` is what a person said of numbers as text.
pub(super) fn read(path: &Path, decimal: Option<Decimal>) -> Result<Log, Error> {
    let file = path.display().to_string();
    let bytes = std::fs::read(path)
        .map_err(|cause| Error::input(format_args!("{file}: cannot be read ({cause}); check its path")))?;
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let first = bytes.iter().find(|b| !b.is_ascii_whitespace()).copied().unwrap_or(0);
    let mut log = if bytes.starts_with(mcap::MAGIC) {
        log::read(&file, &bytes)?
    } else if HDF5.iter().any(|magic| bytes.starts_with(magic)) {
        hdf5(&file, bytes)?
    } else if ending == "mat" && is_matlab_4(&bytes) {
        return Err(Error::input(format_args!(
            "{file}: is a MATLAB 4 file; save it again from MATLAB with save('FILE.mat', '-v7'), or with SciPy's savemat(…, format='5')"
        )));
    } else if let Some(advice) = unread(&bytes) {
        return Err(Error::input(format_args!("{file}: is {advice}")));
    } else if bytes.starts_with(ZIP) || bytes.starts_with(b"\x93NUMPY") {
        npy::read(&file, bytes)?
    } else if bytes.starts_with(b"MATLAB 5.0") {
        mat::read(&file, &bytes)?
    } else if bytes.starts_with(b"PAR1") {
        parquet(&file, bytes)?
    } else if matches!(first, b'{' | b'[')
        && (ending.contains("json") || text::decode(&bytes).trim_end().ends_with(['}', ']']))
    {
        json::read(&file, &text::decode(&bytes))?
    } else {
        text::read(&file, &bytes, decimal)?
    };
    // Columns without numbers stay, so that numbers count the file's columns.
    log.tables.retain(|table| table.columns.iter().any(Column::has_numbers));
    if log.tables.is_empty() {
        return Err(Error::input(format_args!("{file}: holds no column of numbers; is it the right file?")));
    }
    Ok(log)
}

const ZIP: &[u8] = b"PK\x03\x04";
/// The first bytes of MATLAB's files of `-v7.3`, and of other HDF5.
const HDF5: [&[u8]; 2] = [b"MATLAB 7.3", b"\x89HDF"];

/// The name of a known format that is not read, and how to convert it.
fn unread(bytes: &[u8]) -> Option<&'static str> {
    const WORKBOOK: &str = "an Excel workbook; save its sheet as CSV (File, Save As, CSV UTF-8), with one row of names above the numbers";
    let holds = |name: &[u8]| bytes.windows(name.len()).any(|window| window == name);
    if bytes.starts_with(ZIP) {
        return match () {
            () if holds(b"xl/workbook.") => Some(WORKBOOK),
            () if bytes[..bytes.len().min(200)].windows(11).any(|w| w == b"opendocumen") => {
                Some("an OpenDocument file; save its sheet as CSV (File, Save As, Text CSV)")
            }
            () if holds(b".npy") => None,
            () => Some("a zip archive without NumPy arrays; unpack it and give the files in it"),
        };
    }
    [
        (
            &b"#ROSBAG"[..],
            "a ROS 1 bag; make an MCAP file of it with rosbags-convert --src FILE --dst OUT --dst-storage mcap (pip install rosbags)",
        ),
        (
            b"SQLite format 3",
            "an SQLite file, as older ROS 2 bags are; make an MCAP file of it with rosbags-convert --src BAG --dst OUT --dst-storage mcap (pip install rosbags)",
        ),
        (b"\x1f\x8b", "compressed with gzip; unpack it with gunzip first"),
        (b"\xd0\xcf\x11\xe0", WORKBOOK),
        (b"ARROW1", "an Arrow or Feather file; write it as Parquet or CSV"),
    ]
    .into_iter()
    .find_map(|(magic, what)| bytes.starts_with(magic).then_some(what))
}

/// True for the header of a MATLAB 4 matrix: its type as four decimal digits MOPT, little-endian,
/// of which O is zero, P at most 5 and T at most 2 (MAT-File Format, chapter on level 4).
fn is_matlab_4(bytes: &[u8]) -> bool {
    let Some(kind) = bytes.first_chunk().map(|first| u32::from_le_bytes(*first)) else { return false };
    kind / 100 % 10 == 0 && kind / 10 % 10 <= 5 && kind % 10 <= 2 && kind < 5_000
}

#[cfg(feature = "parquet")]
fn parquet(file: &str, bytes: Vec<u8>) -> Result<Log, Error> {
    super::parquet::read(file, bytes)
}

#[cfg(not(feature = "parquet"))]
fn parquet(file: &str, _: Vec<u8>) -> Result<Log, Error> {
    Err(Error::input(format_args!(
        "{file}: is a Parquet file, which this build does not read; build with `--features parquet` (cargo run --release --features parquet -- import …)"
    )))
}

#[cfg(feature = "hdf5")]
fn hdf5(file: &str, bytes: Vec<u8>) -> Result<Log, Error> {
    super::hdf5::read(file, bytes)
}

#[cfg(not(feature = "hdf5"))]
fn hdf5(file: &str, _: Vec<u8>) -> Result<Log, Error> {
    Err(Error::input(format_args!(
        "{file}: is an HDF5 file, as MATLAB's -v7.3 is, which this build does not read; build with `--features hdf5` (cargo run --release --features hdf5 -- import …), or save it again from MATLAB with save('FILE.mat', '-v7')"
    )))
}
