//! Small numerical tools. They know nothing of machines, recordings or effects.

pub(crate) mod bootstrap;
pub(crate) mod digits;
pub(crate) mod even_grid;
pub(crate) mod golden_section;
pub(crate) mod linear;
pub(crate) mod parallel;
pub(crate) mod spread;
