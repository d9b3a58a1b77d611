//! Commissioning and compensation as dialogues with a device. They are `async` because a browser
//! may not block: each exchange with the device ends in a pause, after which the browser's timer
//! continues. A program that may block runs them with [`pause::block_on`].

pub mod bench;
pub mod commission;
pub mod compensate;
pub mod pause;
pub mod servo;
