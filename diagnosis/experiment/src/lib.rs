//! The experiment that best distinguishes the rivals of a diagnosis.
//!
//! A report of the diagnosis names the models that still contend for a name, each with its
//! probability and its whole rig. Every input of a library is simulated with every contender. The
//! chosen input is the one for which the innovations that the others would predict differ most from
//! those of the truth, after each has been refitted to the truth's response (T-optimality: Atkinson
//! and Fedorov 1975; the sequential use and the weight of each rival by its probability: Box and
//! Hill 1967). Effects are those of the diagnosis itself. Lengths are in rad or m, forces in N·m or
//! N, times in s.

mod candidates;
mod case;
mod choose;
mod innovation;
mod input;
mod page;
mod predict;
mod write;

pub use candidates::random_multisine;
pub use case::{Case, Limits, Rival};
pub use choose::{Alternative, Design, Pair, design};
pub use input::{Input, Segment, Servo, Signal};
pub use predict::Prediction;
