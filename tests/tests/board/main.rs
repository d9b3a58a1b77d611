//! The properties of the flash image, on the emulated boards. One program, because each further one
//! would generate the emulator's code again.

mod cold_cache;
mod commissioning;
mod compensation;
mod control;
mod crash;
mod edges;
mod excitations;
mod faults;
mod fitted;
mod holding;
mod instructions;
mod lamps;
mod line;
mod log;
mod option_bytes;
mod own_test;
mod rate;
mod repeated;
mod runaway;
mod second_board;
mod settled;
mod silicon;
mod start_up;
mod stop;
mod store;
mod sustained;
mod usb;
mod wiring;
