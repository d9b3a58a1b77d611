//! Gives the linker the board's memory map and the scripts that lay the image out. Here and not in `.cargo/config.toml`,
//! where a `RUSTFLAGS` of the environment would silently replace them.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy("../memory.x", out.join("memory.x")).expect("memory.x lies at the top of the repository");
    println!("cargo::rustc-link-search={}", out.display());
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bins={argument}");
        println!("cargo::rustc-link-arg-tests={argument}");
    }
    println!("cargo::rustc-link-arg-tests=-Tembedded-test.x");
}
