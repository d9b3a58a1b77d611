//! Sentences, pages and files of a finished diagnosis. Nothing here fits.

pub mod axes_page;
pub(crate) mod check;
mod decisive_plot;
pub mod exports;
mod faults;
mod form_in_words;
pub(crate) mod free_form;
mod frequency_plot;
mod html;
pub mod mjcf_patch;
pub mod motion_picture;
pub(crate) mod next_experiment;
mod notes;
pub(crate) mod outcome;
mod passive_motor;
mod remains;
mod residual_plots;
#[cfg(test)]
mod sentence_snapshots;
pub mod simulation_page;
mod summary;
pub(crate) mod text;
mod write;
mod xml;

pub use crate::data::schema::{
    Both, ByModel, Contending, DataFault, FaultKind, FitTable, FreeForm, Hypothesis, Named, Parameter, Place,
    Region, Report, Simulation, Stretch, Untested, Verdict, WindowsOff,
};
