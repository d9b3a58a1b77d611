//! Gives the linker the board's memory map and the scripts that lay the image out. Here and not in
//! `.cargo/config.toml`, where a `RUSTFLAGS` of the environment would silently replace them.
//! Refuses an image for no board or for two, as the HAL does in its own words.

use std::path::PathBuf;
use std::{env, fs};

/// The boards: the feature of each, as cargo hands it to this script, and the place of its memory
/// map.
const BOARDS: [(&str, &str); 2] =
    [("DISCOVERY", "../memory.x"), ("NUCLEO_F429ZI", "src/board/nucleo_f429zi/memory.x")];

fn main() {
    for (_, memory) in BOARDS {
        println!("cargo::rerun-if-changed={memory}");
    }
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let mut chosen =
        BOARDS.iter().filter(|(feature, _)| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some());
    let (Some((_, memory)), None) = (chosen.next(), chosen.next()) else {
        println!(
            "cargo::error=an image is for exactly one board; build it with `cargo xtask firmware --board NAME`, \
             which chooses one of the features in firmware/Cargo.toml"
        );
        return;
    };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy(memory, out.join("memory.x")).expect("a board has a memory map");
    println!("cargo::rustc-link-search={}", out.display());
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bins={argument}");
        println!("cargo::rustc-link-arg-tests={argument}");
    }
    println!("cargo::rustc-link-arg-tests=-Tembedded-test.x");
}
