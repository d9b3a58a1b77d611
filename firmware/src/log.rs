//! The log of the tasks: over the debug probe on a board, nowhere in a test.

#[cfg(target_os = "none")]
pub(crate) use defmt::{error, info, warn};

#[cfg(not(target_os = "none"))]
macro_rules! nowhere {
    ($($said:tt)*) => {
        // What is said is used, so that a test finds no fewer names than a board.
        {
            let _ = core::format_args!($($said)*);
        }
    };
}
#[cfg(not(target_os = "none"))]
pub(crate) use {nowhere as error, nowhere as info, nowhere as warn};
