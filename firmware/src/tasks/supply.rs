//! The supply below 2.66 V: the last moment at which the core still surely runs. Its fall takes
//! torque away with the next tick, by interrupt; its level keeps the device from being started,
//! whether anybody saw it fall or not ([`super::supervisor`]).

use super::shared::Shared;
use control_core::event::Fault;

/// The voltage detector's interrupt; the board has cleared it.
pub fn fell(shared: &Shared) {
    shared.trips.raise(Fault::Brownout);
}
