//! What the flash image promises, on the emulated boards. One program: each program more generates the emulator's code again.

mod commissioning;
mod compensation;
mod control;
mod faults;
mod fitted;
mod holding;
mod instructions;
mod log;
mod rate;
mod runaway;
mod second_board;
mod silicon;
mod store;
mod sustained;
mod usb;
