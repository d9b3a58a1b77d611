//! The program's version, with the commit it was built from where that is known.

use link::build::Build;
use std::sync::LazyLock;

static VERSION: LazyLock<String> = LazyLock::new(|| {
    let number = env!("CARGO_PKG_VERSION");
    match Build::CURRENT {
        Build { commit: 0, .. } => number.to_string(),
        build => format!("{number} ({build})"),
    }
});

/// The version, such as `0.1.0` or `0.1.0 (1a2b3c4d)`.
pub fn version() -> &'static str {
    &VERSION
}

/// The program with its version, as recordings name it.
pub fn program() -> String {
    format!("host-sim {}", version())
}
