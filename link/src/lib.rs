//! The frames between device and PC: what they say ([`frames`]), how they become bytes ([`codec`]),
//! and the two ends that keep count of them: [`device::Endpoint`] on the board and in the virtual
//! device, [`host::Reception`] on the PC. What makes a device commissioned is in [`commissioning`],
//! what a crash leaves behind in [`crash`].
//!
//! A frame is postcard, a CRC-32 behind it, the two in COBS, a zero byte at the end. Garbage,
//! truncation and a cable pulled in the middle of a frame cost that frame and no other; numbers in
//! the frames let the PC count what is missing.
//!
//! This crate may not touch hardware, allocate or block, and knows nothing of force laws beyond
//! their configuration.
#![no_std]
#![deny(clippy::panic, clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing)]

pub mod build;
pub mod codec;
pub mod commissioning;
pub mod crash;
pub mod device;
pub mod frames;
mod guard;
pub mod host;
mod record;

pub use frames::{Command, DeviceFrame, HostFrame, Numbered};
