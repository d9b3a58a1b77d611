//! An STM32F4 that runs an unmodified flash image, with what is at its pins and on its cable.
//!
//! [`board`] runs the image with a plant on its pins; [`usb_host`] is the PC's end of its cable;
//! [`bootloader`] is the one in ROM. Nothing here is part of the product, and nothing of it reaches
//! into the firmware: one image, no feature flag for tests.

pub mod board;
pub mod bootloader;
pub mod usb_host;
