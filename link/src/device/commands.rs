//! The PC's commands: each is carried out or refused, and answered.

use super::{Endpoint, Waiting};
use crate::commissioning::Proof;
use crate::frames::{Ack, Command, CommandRefusal, EventKind, HostFrame, PROTOCOL_VERSION};
use control_core::compensation::check::check;
use control_core::config::Sensors;
use control_core::excitation::Excitation;
use control_core::interlock::Interlock;
use control_core::units::Counts;
use control_core::{LargeOrder, Order, TICK_HZ};
use core::borrow::BorrowMut;

/// True if the command is only for a device whose torque is off.
fn needs_torque_off(command: &Command) -> bool {
    makes_plan(command)
        || matches!(
            command,
            Command::Zero
                | Command::Excite(_)
                | Command::Index(_)
                | Command::Segment { .. }
                | Command::Play { .. }
                | Command::GuardSupply { .. }
        )
}

/// True if the command makes another plan, which takes long.
fn makes_plan(command: &Command) -> bool {
    matches!(
        command,
        Command::ConfigurePatient(_)
            | Command::ConfigureDevice(_)
            | Command::RestoreDevice(_)
            | Command::Commission
    )
}

/// True if the command may mean another thing under another plan.
fn depends_on_plan(command: &Command) -> bool {
    !matches!(command, Command::Hello { .. } | Command::Heartbeat | Command::Stop | Command::Clear)
}

/// True if the command turns the amplifier on.
fn gives_torque(command: &Command) -> bool {
    matches!(command, Command::Start | Command::Excite(_) | Command::Play { .. })
}

impl<W: BorrowMut<Waiting>> Endpoint<W> {
    /// Sets the optional sensors that are there. A device whose record names one that is not does
    /// not start; where nobody looks, as on a virtual device, it does.
    pub fn set_fitted(&mut self, fitted: Sensors) {
        self.fitted = Some(fitted);
    }

    /// Says if the motor's heat is known. Where it is not, each hello is followed by the time for
    /// which torque is held to the continuous one.
    pub fn set_knows_heat(&mut self, is_known: bool) {
        self.knows_heat = is_known;
    }

    pub(super) fn command(&mut self, frame: HostFrame) {
        if matches!(frame.command, Command::Hello { .. }) {
            // A PC that starts anew may use old ids again.
            self.answered.clear();
            self.last_stop = None;
            self.forget_plan();
        } else if self.plans_for(frame.id) {
            return;
        } else if let Some(ack) = self.answered.oldest_ordered().find(|ack| ack.id == frame.id) {
            let _ = self.waiting.borrow_mut().acks.push_back(*ack);
            return;
        }
        if let Command::GuardSupply { set } = frame.command
            && !self.is_planning()
            && self.defer_guard(frame.id, set)
        {
            return;
        }
        let id = frame.id;
        let result = match self.check_turn(id, &frame.command) {
            Ok(()) if makes_plan(&frame.command) => match self.ask_for_plan(frame) {
                Ok(()) => return,
                refused => refused,
            },
            Ok(()) => self.carry_out(id, frame.command),
            refused => refused,
        };
        self.answer(id, result);
    }

    pub(super) fn answer(&mut self, id: u32, result: Result<(), CommandRefusal>) {
        let ack = Ack { id, result };
        if result != Err(CommandRefusal::Full) {
            self.answered.write(ack);
        }
        // Where the PC floods faster than it reads, the oldest ack is lost: it asks again and is
        // answered again.
        let acks = &mut self.waiting.borrow_mut().acks;
        if acks.is_full() {
            acks.pop_front();
        }
        let _ = acks.push_back(ack);
    }

    /// Checks what can be known of a command before it is looked at.
    fn check_turn(&self, id: u32, command: &Command) -> Result<(), CommandRefusal> {
        if self.has_torque() && needs_torque_off(command) {
            return Err(CommandRefusal::Powered);
        }
        let is_busy = if makes_plan(command) { self.waiting.borrow().orders.is_full() } else { false };
        if is_busy || self.is_planning() && depends_on_plan(command) {
            return Err(CommandRefusal::Full);
        }
        if gives_torque(command) { self.is_later_than_stop(id) } else { Ok(()) }
    }

    fn carry_out(&mut self, id: u32, command: Command) -> Result<(), CommandRefusal> {
        match command {
            Command::Hello { version } => self.hello_to(version),
            Command::Heartbeat => self.order(Order::Heartbeat),
            Command::Stop => {
                self.last_stop = Some(id);
                self.stop();
                Ok(())
            }
            Command::Clear => self.clear(),
            Command::Start => self.start(),
            Command::Zero => {
                self.order(Order::Zero)?;
                self.zeroed = true;
                Ok(())
            }
            Command::Excite(excitation) => self.excite(excitation),
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
            // Nothing to guard: a board would have deferred it. A line has gone its own way, and so
            // has what asks for a plan.
            Command::GuardSupply { .. }
            | Command::Line(_)
            | Command::ConfigurePatient(_)
            | Command::ConfigureDevice(_)
            | Command::RestoreDevice(_)
            | Command::Commission => Ok(()),
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
        self.tell_heat();
        self.order(Order::Heartbeat)
    }

    /// Says how long the torque is held to the continuous one, if it is: since power-up, for the
    /// winding's time constant.
    fn tell_heat(&mut self) {
        let limits = &self.plan.device().limits;
        let passed = u16::try_from(self.now / u64::from(TICK_HZ)).unwrap_or(u16::MAX);
        let seconds = limits.winding_time_s.saturating_sub(passed);
        if !self.knows_heat && seconds > 0 && limits.continuous_torque < limits.torque {
            self.event(self.now, EventKind::HeatUnknown { seconds });
        }
    }

    fn stop(&mut self) {
        self.stopped_since_fault = true;
        self.stop_due = true;
        self.drop_starts();
    }

    /// Nothing that was asked for so far gives torque; the rest is still carried out.
    pub(super) fn drop_starts(&mut self) {
        self.start_ordered = false;
        self.proof.interrupt();
        self.upload.forget();
        let orders = &mut self.waiting.borrow_mut().orders;
        for _ in 0..orders.len() {
            if let Some(order) = orders.pop_front()
                && !order.gives_torque()
            {
                let _ = orders.push_back(order);
            }
        }
    }

    /// True if torque is on or on its way.
    pub(super) fn has_torque(&self) -> bool {
        self.powered || self.start_ordered || self.ahead.is_on || self.ahead.start_waits
    }

    /// Ids wrap.
    fn is_later_than_stop(&self, id: u32) -> Result<(), CommandRefusal> {
        let is_overtaken = self.last_stop.is_some_and(|stop| id.wrapping_sub(stop).cast_signed() <= 0);
        if is_overtaken { Err(CommandRefusal::Overtaken) } else { Ok(()) }
    }

    /// A person has seen the fault, and has been told what ended the last run.
    fn clear(&mut self) -> Result<(), CommandRefusal> {
        if self.fault.is_none() {
            return Ok(());
        }
        if !self.stopped_since_fault {
            return Err(CommandRefusal::NotStopped);
        }
        self.order(Order::Clear)?;
        self.fault = None;
        self.crash = None;
        self.event(self.now, EventKind::Cleared);
        Ok(())
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

    /// A sequence that still waits is not what was wanted.
    pub(super) fn will_power_up(&mut self) {
        self.start_ordered = true;
        self.upload.forget();
    }

    pub(super) fn is_commissioned(&self) -> Result<(), CommandRefusal> {
        let is = self.plan.device().commissioned;
        if is { Ok(()) } else { Err(CommandRefusal::Interlocked(Interlock::NotCommissioned)) }
    }

    /// Torque is given to a PC that listens, under no interlock and without a latched fault.
    pub(super) fn may_give_torque(&self) -> Result<(), CommandRefusal> {
        if !self.in_session {
            return Err(CommandRefusal::NoSession);
        }
        let missing = self.fitted.and_then(|fitted| self.plan.device().sensors.missing_in(fitted));
        if let Some(interlock) = self.interlocks.first().or(missing) {
            return Err(CommandRefusal::Interlocked(interlock));
        }
        self.fault.map_or(Ok(()), |fault| Err(CommandRefusal::Faulted(fault)))
    }
}
