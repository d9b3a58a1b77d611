//! Between recordings and the rig and CSV files that the diagnosis reads: [`export`] writes ours
//! so, [`import`] reads those of other people, [`simulated`] puts a recording and its simulations
//! into one MCAP file.

pub mod export;
pub mod import;
pub mod shell;
pub mod simulated;
