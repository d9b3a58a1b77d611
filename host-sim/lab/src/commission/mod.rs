//! `commission`: finds out how a device is wired and built before anybody holds its needle, and
//! gives it its part of the configuration (`device-setup`), on a serial port or a virtual device.

pub mod bench;
pub mod mechanism;

pub use device_setup::commission::weigh::{WeighOutcome, WeighWish};
pub use device_setup::commission::{CommissioningOutcome, CommissioningStep, Wish, findings};

use bench::Line;
use device_setup::pause::block_on;
use device_sim::error::Error;

/// Commissions the device behind `line`; `ask` is called with each step before it is done, and may
/// end it.
pub fn commission(
    line: &mut dyn Line,
    wish: &Wish,
    mut ask: impl FnMut(CommissioningStep) -> Result<(), Error>,
) -> Result<CommissioningOutcome, Error> {
    block_on(device_setup::commission::commission(line, wish, async |step| ask(step)))
}

/// Weighs with the commissioned device behind `line`; `ask` as for [`commission`].
pub fn weigh(
    line: &mut dyn Line,
    wish: &WeighWish,
    mut ask: impl FnMut(CommissioningStep) -> Result<(), Error>,
) -> Result<WeighOutcome, Error> {
    block_on(device_setup::commission::weigh::weigh(line, wish, async |step| ask(step)))
}
