//! A force of any form over given inputs, and how much it takes on blocks that were left out: the opponent of every name.
//! It changes no model. The method: docs/free-form.md.

mod basis;
mod compare;
mod evaluate;
mod shape;

pub(crate) use basis::Inputs;
pub(crate) use compare::{Taken, is_told};
pub(crate) use evaluate::Evaluator;
pub(crate) use shape::Shape;
