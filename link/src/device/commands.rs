//! The PC's commands: each is carried out or refused, and answered.

use super::{Endpoint, Waiting};
use crate::commissioning::{Proof, may_become};
use crate::frames::{Ack, Command, CommandRefusal, HostFrame, PROTOCOL_VERSION};
use control_core::compensation::check::check;
use control_core::config::Device;
use control_core::excitation::Excitation;
use control_core::interlock::Interlock;
use control_core::units::Counts;
use control_core::{LargeOrder, Order, Patient, Plan};
use core::borrow::BorrowMut;

/// True if the command is only for a device whose torque is off.
fn needs_torque_off(command: &Command) -> bool {
    matches!(
        command,
        Command::ConfigurePatient(_)
            | Command::ConfigureDevice(_)
            | Command::RestoreDevice(_)
            | Command::Commission
            | Command::Zero
            | Command::Excite(_)
            | Command::Index(_)
            | Command::Segment { .. }
            | Command::Play { .. }
            | Command::GuardSupply { .. }
    )
}

impl<W: BorrowMut<Waiting>> Endpoint<W> {
    pub(super) fn command(&mut self, frame: HostFrame) {
        if matches!(frame.command, Command::Hello { .. }) {
            // A PC that starts anew may use old ids again.
            self.answered.clear();
        } else if let Some(ack) = self.answered.oldest_ordered().find(|ack| ack.id == frame.id) {
            let _ = self.waiting.borrow_mut().acks.push_back(*ack);
            return;
        }
        if let Command::GuardSupply { set } = frame.command
            && self.defer_guard(frame.id, set)
        {
            return;
        }
        let result = self.carry_out(frame.command);
        let ack = Ack { id: frame.id, result };
        if result != Err(CommandRefusal::Full) {
            self.answered.write(ack);
        }
        // Where the PC floods faster than it reads, an ack is lost: it asks again and is answered
        // again.
        let _ = self.waiting.borrow_mut().acks.push_back(ack);
    }

    fn carry_out(&mut self, command: Command) -> Result<(), CommandRefusal> {
        if (self.powered || self.start_ordered) && needs_torque_off(&command) {
            return Err(CommandRefusal::Powered);
        }
        match command {
            Command::Hello { version } => self.hello_to(version),
            Command::Heartbeat => self.order(Order::Heartbeat),
            Command::Stop => self.stop(),
            Command::Start => self.start(),
            Command::Zero => {
                self.order(Order::Zero)?;
                self.zeroed = true;
                Ok(())
            }
            Command::Excite(excitation) => self.excite(excitation),
            Command::ConfigurePatient(patient) => {
                self.configure(Plan::new(self.plan.device(), &patient).map_err(CommandRefusal::Config)?)
            }
            Command::ConfigureDevice(device) => {
                may_become(self.plan.device(), &device)?;
                self.configure_device(&device)
            }
            Command::RestoreDevice(record) => {
                if !record.is_of(self.identity.serial) {
                    may_become(self.plan.device(), &record.device)?;
                }
                self.configure_device(&record.device)
            }
            Command::Commission => {
                let device = Device { commissioned: true, ..*self.plan.device() };
                if !self.proof.is_shown() {
                    may_become(self.plan.device(), &device)?;
                }
                self.configure_device(&device)
            }
            Command::ReportDevice => {
                self.device_due = true;
                Ok(())
            }
            Command::Compensate(gains) => {
                check(self.plan.device(), gains).map_err(CommandRefusal::Config)?;
                self.order(Order::Compensate(gains))
            }
            Command::Index(index) => self.order(LargeOrder::Index(index.map(Counts))),
            Command::Segment { index, excitation } => self.upload(index, excitation),
            Command::Play { count, checksum } => self.play(count, checksum),
            // Nothing to guard: a board would have deferred it.
            Command::GuardSupply { .. } => Ok(()),
        }
    }

    fn hello_to(&mut self, version: u16) -> Result<(), CommandRefusal> {
        if version != PROTOCOL_VERSION {
            return Err(CommandRefusal::Version);
        }
        self.forget_waiting();
        self.upload.forget();
        self.in_session = true;
        self.hello_due = true;
        self.crash_due = true;
        self.sequence = 0;
        self.order(Order::Heartbeat)
    }

    fn stop(&mut self) -> Result<(), CommandRefusal> {
        self.start_ordered = false;
        self.proof.interrupt();
        self.upload.forget();
        // A stop must not wait behind other orders.
        self.waiting.borrow_mut().orders.clear();
        self.order(Order::Stop)
    }

    fn start(&mut self) -> Result<(), CommandRefusal> {
        self.may_give_torque()?;
        self.is_commissioned()?;
        if !self.zeroed {
            return Err(CommandRefusal::Interlocked(Interlock::NotZeroed));
        }
        self.order(Order::Start)?;
        self.will_power_up();
        Ok(())
    }

    fn excite(&mut self, excitation: Excitation) -> Result<(), CommandRefusal> {
        excitation.check(&self.plan).map_err(CommandRefusal::Config)?;
        self.may_give_torque()?;
        let is_gentle = excitation.is_gentle();
        if !is_gentle {
            self.is_commissioned()?;
        }
        self.order(LargeOrder::Excite(excitation))?;
        self.proof = if is_gentle { Proof::Ordered } else { Proof::None };
        self.will_power_up();
        Ok(())
    }

    /// A person has started the device, and has been told what ended its last run. A sequence that
    /// still waits is not what was wanted.
    pub(super) fn will_power_up(&mut self) {
        self.start_ordered = true;
        self.fault = None;
        self.crash = None;
        self.upload.forget();
    }

    pub(super) fn is_commissioned(&self) -> Result<(), CommandRefusal> {
        let is = self.plan.device().commissioned;
        if is { Ok(()) } else { Err(CommandRefusal::Interlocked(Interlock::NotCommissioned)) }
    }

    /// Torque is given to a PC that listens, and under no interlock.
    pub(super) fn may_give_torque(&self) -> Result<(), CommandRefusal> {
        if !self.in_session {
            return Err(CommandRefusal::NoSession);
        }
        self.interlocks.first().map_or(Ok(()), |interlock| Err(CommandRefusal::Interlocked(interlock)))
    }

    /// A patient for another device leaves; what is wrong with the device itself is wrong without a
    /// patient too.
    fn configure_device(&mut self, device: &Device) -> Result<(), CommandRefusal> {
        self.identity.ceilings.check(device).map_err(CommandRefusal::Config)?;
        let plan = Plan::new(device, self.plan.patient())
            .or_else(|_| Plan::new(device, &Patient::nobody()))
            .map_err(CommandRefusal::Config)?;
        let before = *self.plan.device();
        self.configure(plan)?;
        self.proof.keep(&before, device);
        let counts =
            |device: &Device| (device.encoder_reversed, device.counts_per_turn, device.roller_radius);
        // Otherwise the same counts are another depth.
        self.zeroed &= counts(&before) == counts(device);
        Ok(())
    }

    fn configure(&mut self, plan: Plan) -> Result<(), CommandRefusal> {
        self.order(LargeOrder::Configure(plan.clone()))?;
        self.plan = plan;
        self.upload.forget();
        self.hello_due = true;
        Ok(())
    }
}
