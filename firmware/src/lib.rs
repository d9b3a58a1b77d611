//! The parts of the firmware that need no hardware: the order in which torque is given and taken
//! away ([`drive`]), the tilt sensors ([`tilt`]), who has to report before the watchdog is fed
//! ([`supervision`]), what a reset means ([`reset`]), the configuration in flash ([`store`]), and
//! every timing constant with its reason ([`timing`]).
//!
//! Nothing here may name a register, a pin or an interrupt: those stay in the binary's `board` and
//! `chip` folders. All of it is tested on the host.
#![no_std]
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod drive;
mod log;
pub mod monitor;
pub mod port;
pub mod reset;
pub(crate) mod stage_timing;
pub mod store;
pub mod supervision;
pub mod tasks;
pub mod tilt;
pub mod timing;
pub mod wire_check;
