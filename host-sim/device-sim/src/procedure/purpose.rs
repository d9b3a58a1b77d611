//! The purpose of a procedure, and what is done for it in addition to moving the needle
//! (tourniquet, catheter, plunger). The device has none of these: a page's button or the scripted
//! hand reports each. The steps of a purpose and their judgement are in the crate `training`.

use serde::{Deserialize, Serialize};

/// A task's name is at most this long.
const LONGEST_NAME: usize = 40;

/// The purpose of a procedure; without one, the needle is to come into the patient's target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// A catheter over the needle is left in a vein.
    Cannulation,
    /// Blood is drawn from a vein.
    BloodDraw,
    /// Something is injected into the target.
    Injection,
}

impl Purpose {
    /// Returns the names of the tasks that belong to it, in their order.
    pub fn tasks(self) -> &'static [&'static str] {
        match self {
            Self::Cannulation => &["tourniquet_on", "anchor", "catheter", "tourniquet_off"],
            Self::BloodDraw => &["tourniquet_on", "tourniquet_off"],
            Self::Injection => &["aspirate", "inject"],
        }
    }
}

/// True for the name of a task.
pub fn is_task_name(name: &str) -> bool {
    (1..=LONGEST_NAME).contains(&name.len())
        && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
}
