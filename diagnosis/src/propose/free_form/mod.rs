//! A force of any form over given inputs, and its gain on left-out blocks: every name is checked
//! against it. It changes no model. The method: docs/design/free-form.md.

mod basis;
mod compare;
mod evaluate;
mod shape;

pub(crate) use basis::Inputs;
pub(crate) use compare::{Taken, is_told};
pub(crate) use evaluate::Evaluator;
pub(crate) use shape::Shape;
