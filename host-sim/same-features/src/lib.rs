//! Nothing but a list of features, in `Cargo.toml`: those that some package of the workspace asks
//! of a crate that others use with fewer. With them, the first command, the Python package and the
//! tests are built of the same crates, each compiled once.
