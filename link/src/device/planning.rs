//! The plan that a command asks for. A board makes it where it holds nothing up, and the command
//! waits for it; a virtual device makes it at once.

use super::plan_request::{PlanRequest, Planned};
use super::{Endpoint, Waiting};
use crate::commissioning::may_become;
use crate::frames::{Command, CommandRefusal, HostFrame};
use control_core::config::Device;
use control_core::{LargeOrder, Plan};
use core::borrow::BorrowMut;

/// The plan that is being made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Planning {
    /// The number of the latest request.
    number: u32,
    /// The id of its command, which has no answer yet.
    id: Option<u32>,
}

impl<W: BorrowMut<Waiting>> Endpoint<W> {
    /// Returns the plan that is to be made, once; [`Self::take_plan`] takes it. Until then a
    /// command that depends on it is refused as [`CommandRefusal::Full`].
    pub fn plan_asked(&mut self) -> Option<PlanRequest> {
        self.waiting.borrow_mut().plan.pop_front()
    }

    /// True if the command of this id waits for its plan.
    pub(super) fn plans_for(&self, id: u32) -> bool {
        self.planning.id == Some(id)
    }

    /// True if a plan is being made.
    pub(super) fn is_planning(&self) -> bool {
        self.planning.id.is_some()
    }

    /// The plan that is being made is not wanted any more.
    pub(super) fn forget_plan(&mut self) {
        self.planning.id = None;
        self.waiting.borrow_mut().plan.clear();
    }

    /// Has a plan made for a command that has passed its checks.
    #[inline(never)]
    pub(super) fn ask_for_plan(&mut self, frame: HostFrame) -> Result<(), CommandRefusal> {
        let before = self.plan.device();
        let mut config = self.plan.config().clone();
        let may_leave = !matches!(frame.command, Command::ConfigurePatient(_));
        let is_known = match frame.command {
            Command::ConfigurePatient(patient) => {
                config.patient = patient;
                true
            }
            Command::ConfigureDevice(device) => {
                config.device = device;
                false
            }
            Command::RestoreDevice(record) => {
                config.device = record.device;
                record.is_of(self.identity.serial)
            }
            _ => {
                config.device.commissioned = true;
                config.device.sensors = self.fitted.unwrap_or(before.sensors);
                self.proof.is_shown()
            }
        };
        if !is_known {
            may_become(before, &config.device)?;
        }
        if may_leave {
            self.identity.ceilings.check(&config.device).map_err(CommandRefusal::Config)?;
        }
        let number = self.planning.number.wrapping_add(1);
        self.planning = Planning { number, id: Some(frame.id) };
        let request = PlanRequest { number, config, may_leave };
        // There is room: a command that asks for a plan is refused while another waits.
        let _ = self.waiting.borrow_mut().plan.push_back(request);
        Ok(())
    }

    /// Takes a plan that was asked for, and answers its command; one that is not wanted any more
    /// changes nothing.
    #[inline(never)]
    pub fn take_plan(&mut self, planned: Planned) {
        if planned.number != self.planning.number {
            return;
        }
        let Some(id) = self.planning.id.take() else { return };
        let result = planned.plan.map_err(CommandRefusal::Config).and_then(|plan| self.configure(plan));
        self.answer(id, result);
    }

    fn configure(&mut self, plan: Plan) -> Result<(), CommandRefusal> {
        self.order(LargeOrder::Configure(plan.clone()))?;
        let (before, device) = (*self.plan.device(), *plan.device());
        self.plan = plan;
        self.proof.keep(&before, &device);
        let counts =
            |device: &Device| (device.encoder_reversed, device.counts_per_turn, device.roller_radius);
        // Otherwise the same counts are another depth.
        self.zeroed &= counts(&before) == counts(&device);
        self.line_due = None;
        self.upload.forget();
        self.hello_due = true;
        Ok(())
    }
}
