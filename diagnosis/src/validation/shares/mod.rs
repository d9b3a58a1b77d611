//! Shares of the force error: a regression of the drive's force on the motion, as an engineer
//! writes it, over the laws of the library.
//!
//! On a machine most of what a model leaves is other physics and not noise. Likelihoods under the
//! noise then reject true laws, and a share of the force error means the same on every machine.
//! What counts is the smaller of an effect's shares on stretches left out of the fit and on the
//! held-out recordings. Laws of the command act on the command that the motion asks for, never on
//! the recorded one, which holds the very disturbance that is to be explained.

pub(crate) mod design;
pub(crate) mod forms;
pub(crate) mod laws;
pub(crate) mod material;
pub(crate) mod select;
pub(crate) mod share;
pub(crate) mod sight;
mod state;
mod waves;
