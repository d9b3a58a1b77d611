//! Small numerical tools. They know nothing of machines, recordings or effects.

pub(crate) mod bootstrap;
pub(crate) mod digits;
pub(crate) mod golden;
pub(crate) mod linear;
