//! Where a simulation and a recording differ, which physics was left out, how sure that is, and the proof.
//!
//! Given a rig (the nominal simulation) and recordings, [`diagnose`] refits the nominal values, looks for the effects of
//! [`effects::EffectName`] in what remains, judges them on recordings that were not used for fitting, and reports.
//! This crate knows rigs and recordings; it may not know devices, links or plots of other crates.
//!
//! Order of the stages, one module each: [`recording`] and [`rig`] (read and check), `track` (blocks), `kalman` and
//! `noise` (innovations, smoother), `model` and `solve` (the linear fit), `screen` and `select` (name), `judge`
//! (held-out recordings), `locate` (where), `outcome` and `html` (what people read).

pub mod effects;
mod error;
mod estimate;
mod fit;
mod judge;
mod kalman;
mod library;
mod model;
mod noise;
mod null;
mod periodic;
mod pipeline;
pub mod recording;
pub mod report;
pub mod rig;
mod screen;
mod select;
mod solve;
mod track;

pub use error::InputError;
