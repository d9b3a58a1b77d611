//! The computation that the device repeats ten thousand times a second: encoder count in, DAC code
//! out.
//!
//! A tick, as data: count → [`kinematics`] (depth, speed) → [`anatomy`] (which layers, given the
//! angle) → `law` (the force law) → torque, plus the torque that [`compensation`] feeds forward →
//! [`safety`] (limit, fade-in, slew) → DAC code. [`controller::Controller`] strings them together
//! and holds the operating mode; [`config`] is what a person writes, and [`plan`] is what may run,
//! or the reason why it may not.
//!
//! This crate may not touch hardware, allocate, block, use floating point or `unsafe`. The board
//! and the simulator run the very same code.
#![no_std]
// The tick has no floating point and cannot panic: lints hold the crate to it.
#![deny(
    clippy::float_arithmetic,
    clippy::panic,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing
)]

pub mod anatomy;
mod anchor;
pub mod ceilings;
pub mod compensation;
pub mod config;
pub mod controller;
pub mod event;
pub mod excitation;
pub mod friction;
pub mod interlock;
mod interpolator;
pub mod kinematics;
mod law;
mod math;
mod passivity;
pub mod plan;
mod refusal;
mod runaway;
pub mod safety;
mod sine;
mod stability;
mod stillness;
mod thermal;
mod tissue;
pub mod units;
mod wall;

pub use anatomy::NeedleLine;
pub use config::{Config, Device, Patient};
pub use controller::{AnyOrder, Controller, LargeOrder, Order, TickInput, TickOutput};
pub use plan::{Plan, Refusal};
pub use stability::stiffest;

/// Ticks of the control law in a second.
pub const TICK_HZ: u32 = 10_000;
