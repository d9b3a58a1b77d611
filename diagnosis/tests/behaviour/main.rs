//! The tests of the diagnosis from outside, in one program: one link instead of ten.

mod axis;
mod common;
mod estimation;
mod formulas;
mod free_form;
mod held;
mod input_files;
mod layout;
mod naming;
mod other_physics;
mod real_recordings;
mod simulated;
mod skew;
mod user_mistakes;
