//! A plan between the device's end of the link and whoever makes it.

use control_core::{Config, Patient, Plan, Refusal};

/// A plan that is to be made.
#[derive(Clone, Debug)]
pub struct PlanRequest {
    pub(super) number: u32,
    pub(super) config: Config,
    /// A patient for another device leaves.
    pub(super) may_leave: bool,
}

/// A plan that has been made, or why there is none.
pub struct Planned {
    pub(super) number: u32,
    pub(super) plan: Result<Plan, Refusal>,
}

impl PlanRequest {
    /// Makes the plan, which takes long. A patient for another device leaves; what is wrong with
    /// the device itself is wrong without a patient too.
    pub fn make(&self) -> Planned {
        let plan = match self.config.plan() {
            Err(_) if self.may_leave => Plan::new(&self.config.device, &Patient::nobody()),
            plan => plan,
        };
        Planned { number: self.number, plan }
    }
}
