//! The work of the tasks. None of them knows a pin; only the tick may give torque, and it alone
//! touches the drive.

mod latest_line;
pub mod planner;
pub mod queues;
pub mod shared;
pub mod supervisor;
pub mod supply;
pub mod telemetry;
pub mod tick;
pub mod tilt;
pub mod usb;

#[cfg(test)]
mod tests;
