//! The retriggerable monostable in the amplifier's enable path: it lets the enable line through
//! only while edges come from the board (`docs/guide/hardware.md`).

use serde::{Deserialize, Serialize};

use super::plant::Nanos;

/// One half of a 74HC123 with 100 nF and 110 kΩ: its output is high for this long after each rising
/// edge (data sheet, t_W = 0.45·R·C).
const HOLDS: Nanos = 4_950_000;

/// The monostable.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Monostable {
    input: bool,
    triggered: Option<Nanos>,
}

impl Monostable {
    /// Its input has this level at `at`.
    pub(super) fn see(&mut self, input: bool, at: Nanos) {
        if input && !self.input {
            self.triggered = Some(at);
        }
        self.input = input;
    }

    /// True if its output is high at `at`.
    pub(super) fn holds(self, at: Nanos) -> bool {
        self.triggered.is_some_and(|since| at < since + HOLDS)
    }
}
