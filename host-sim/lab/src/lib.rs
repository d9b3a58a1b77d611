//! The work of a lab before a trainee uses a device: commissioning, characterisation, compensation,
//! force laws from tests, and diagnoses that a device settles itself.

pub mod characterise;
pub mod commission;
pub mod compensate;
pub mod force_fit;
pub mod friction_fit;
pub mod settle;
