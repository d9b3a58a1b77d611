//! What the tasks do. None of them knows a pin; only the tick may give torque, and it alone touches the drive.

pub(crate) mod queues;
pub(crate) mod shared;
pub(crate) mod supervisor;
pub(crate) mod supply;
pub(crate) mod telemetry;
pub(crate) mod tick;
pub(crate) mod tilt;
pub(crate) mod usb;
