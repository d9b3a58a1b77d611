//! Small numerical tools. They know nothing of machines, recordings or effects.

// Matrices are read by row and column.
#![allow(clippy::needless_range_loop)]

pub mod bootstrap;
pub mod digits;
pub mod even_grid;
pub mod golden_section;
pub mod linear;
pub mod parallel;
pub mod spectrum;
pub mod spread;
