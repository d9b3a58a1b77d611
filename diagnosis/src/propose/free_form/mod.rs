//! A force of any form over given inputs, and its gain on left-out blocks: every name is checked
//! against it. It changes no model. The method: docs/design/free-form.md.

mod basis;
mod compare;
mod evaluate;
mod shape;

pub(crate) use basis::Inputs;
#[cfg(test)]
pub(crate) use compare::Density;
pub(crate) use compare::{Densities, Gain, Taken};
pub(crate) use evaluate::Evaluator;
pub(crate) use shape::Shape;
