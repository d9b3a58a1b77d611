//! `cargo xtask wasm`: builds what the page computes in the browser and puts it next to the page's
//! files, with a note of the sources that it was built from. `cargo xtask test wasm` checks that it
//! was built from the present ones.

use crate::setup;
use crate::shell::{self, Error};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The browser's target.
pub(crate) const TARGET: &str = "wasm32-unknown-unknown";
/// The crates that it is built from: the sources and manifests in their folders.
const CRATES: [&str; 4] = [
    "host-sim/picture/anatomy",
    "host-sim/picture/tissue",
    "host-sim/picture/ultrasound",
    "host-sim/page/picture-wasm",
];
/// The product and its note.
const PRODUCT: &str = "host-sim/page/js/picture.wasm";
const NOTE: &str = "host-sim/page/js/picture.wasm.from";
/// Four numbers at once: every browser of the last years has it.
const FEATURES: &str = "-Ctarget-feature=+simd128";

/// Builds a crate for the browser; the file.
pub(crate) fn build_crate(package: &str) -> Result<PathBuf, Error> {
    let toolchain = setup::toolchain_for(TARGET, "the page's own computing")?;
    let mut cargo = setup::cargo_with(toolchain, "build", "std,panic_abort");
    cargo.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS", FEATURES);
    shell::run(cargo.args(["--profile", "wasm", "-p", package, "--target", TARGET]))?;
    let file = format!("{}.wasm", package.replace('-', "_"));
    Ok(shell::target().join(TARGET).join("wasm").join(file))
}

/// Builds the product anew and writes it with its note.
pub(crate) fn run() -> Result<(), Error> {
    let built = read(&build_crate("picture-wasm")?)?;
    let top = shell::top();
    write(&top.join(PRODUCT), &built)?;
    write(&top.join(NOTE), note(&built)?.as_bytes())?;
    println!("{PRODUCT} {} bytes", built.len());
    Ok(())
}

/// Checks that the product is built from the sources: by its note everywhere, byte for byte where
/// the same compiler is at hand.
///
/// Returns what was checked.
pub(crate) fn check() -> Result<&'static str, Error> {
    let top = shell::top();
    let product = read(&top.join(PRODUCT))?;
    let said = String::from_utf8_lossy(&read(&top.join(NOTE))?).into_owned();
    let line = |name: &str| said.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
    if line("sources") != Some(&sources()?) || line("wasm") != Some(&hex(digest([product.as_slice()]))) {
        return Err(Error::new(format!(
            "{PRODUCT} is not built from the sources as they are; run `cargo xtask wasm` and commit what it writes"
        )));
    }
    if line("compiler") != Some(&compiler()?) || !setup::has_target(TARGET) {
        return Ok("by the hashes of its sources; there is no compiler of the same version here");
    }
    if read(&build_crate("picture-wasm")?)? != product {
        return Err(Error::new(format!(
            "{PRODUCT} differs from what its sources give here; run `cargo xtask wasm` and commit what it writes"
        )));
    }
    Ok("byte for byte")
}

fn note(built: &[u8]) -> Result<String, Error> {
    Ok(format!("sources {}\nwasm {}\ncompiler {}\n", sources()?, hex(digest([built])), compiler()?))
}

fn compiler() -> Result<String, Error> {
    let said = shell::output(Command::new("rustc").current_dir(shell::top()).arg("--version"))?;
    Ok(said.trim().to_string())
}

/// A hash of all that is built from, the same on every machine.
fn sources() -> Result<String, Error> {
    let top = shell::top();
    let mut files = vec![];
    for package in CRATES {
        files.push(top.join(package).join("Cargo.toml"));
        collect(&top.join(package).join("src"), &mut files)
            .map_err(|error| Error::new(format!("the sources of {package} cannot be read: {error}")))?;
    }
    files.sort();
    let mut texts = vec![];
    for file in files {
        // A checkout may end its lines otherwise.
        texts.push(String::from_utf8_lossy(&read(&file)?).replace('\r', ""));
    }
    Ok(hex(digest(texts.iter().map(String::as_bytes))))
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}

/// FNV-1a, 64 bits: it shows that a build was forgotten; it does not prevent forgery.
fn digest<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> u64 {
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    for part in parts {
        for byte in part.iter().chain(&[0]) {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }
    hash
}

fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    fs::read(path).map_err(|error| Error::new(format!("{} cannot be read: {error}", path.display())))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(path, bytes)
        .map_err(|error| Error::new(format!("{} cannot be written: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_the_published_one_and_sees_a_change() {
        // FNV-1a of "a" and its closing zero: by hand from the published constants.
        let a = (0xCBF2_9CE4_8422_2325_u64 ^ 0x61).wrapping_mul(0x0100_0000_01B3);
        assert_eq!(a, 0xAF63_DC4C_8601_EC8C);
        assert_eq!(digest([b"a".as_slice()]), a.wrapping_mul(0x0100_0000_01B3));
        assert_ne!(digest([b"ab".as_slice(), b"c"]), digest([b"a".as_slice(), b"bc"]));
    }
}
