//! Gives the linker the board's memory map and the scripts that lay the image out. Here and not in
//! `.cargo/config.toml`, where a `RUSTFLAGS` of the environment would silently replace them.
//! Refuses an image for no board or for two, as the HAL does in its own words. Gives every image
//! the commit that it is built from, however it is built.

use std::path::PathBuf;
use std::process::Command;
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
    println!("cargo::rustc-env=NEEDLE_BUILD={}", commit());
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy(memory, out.join("memory.x")).expect("a board has a memory map");
    println!("cargo::rustc-link-search={}", out.display());
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bins={argument}");
        println!("cargo::rustc-link-arg-tests={argument}");
    }
    println!("cargo::rustc-link-arg-tests=-Tembedded-test.x");
}

/// The commit as `link::build::Build` reads it: eight digits of its hash, with a `+` if what the
/// image is made of differs from it; nothing outside a git checkout. The variable of the
/// environment counts before the checkout.
fn commit() -> String {
    const SOURCES: [&str; 10] = [
        "../control-core/src",
        "../control-core/Cargo.toml",
        "../link/src",
        "../link/Cargo.toml",
        "src",
        "Cargo.toml",
        "build.rs",
        "../memory.x",
        "../Cargo.toml",
        "../Cargo.lock",
    ];
    println!("cargo::rerun-if-env-changed=NEEDLE_BUILD");
    if let Ok(build) = env::var("NEEDLE_BUILD") {
        return build;
    }
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok().filter(|o| o.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    // An amended commit, or a reset to another, may change neither HEAD nor the index.
    let watched = ["logs/HEAD", "index"].iter().filter_map(|file| git(&["rev-parse", "--git-path", file]));
    for path in SOURCES.iter().map(ToString::to_string).chain(watched) {
        println!("cargo::rerun-if-changed={path}");
    }
    let hash = git(&["rev-parse", "HEAD"]).unwrap_or_default();
    let changed = git(&[&["status", "--porcelain", "--"], &SOURCES[..]].concat()).unwrap_or_default();
    format!("{}{}", hash.get(..8).unwrap_or_default(), if changed.is_empty() { "" } else { "+" })
}
