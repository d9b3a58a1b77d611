//! One connection to a board, from the opening of its port to its end. A new connection is a new
//! session: nothing that was asked for in an earlier one is left.
//!
//! By itself a session says hello and stop, and nothing else. Everything beyond belongs to a work
//! that a person began, and that ends when the board starts anew; but for the clearing of a fault,
//! which a person asks for.

use crate::view::View;
use crate::work::{Task, Work};
use device_sim::error::Error;
use device_sim::page::guide::GuideAnswer;
use link::codec::MAX_FRAME;
use link::frames::{Command, CommandRefusal, DeviceFrame, PROTOCOL_VERSION};
use link::host::Commands;
use std::time::Duration;

/// Time between two attempts to greet a board that is silent.
const GREET_AGAIN: Duration = Duration::from_secs(1);
/// The reason why a work ended with the board's run.
const RESTARTED: &str = "the board started anew; begin again from the first step";

/// A connection.
#[derive(Default)]
pub struct Session {
    view: View,
    commands: Commands,
    greeted: Option<Duration>,
    /// The board speaks another version: it is not greeted again.
    refused: Option<String>,
    work: Option<Work>,
    /// A person has pressed Stop, or Clear fault, and nothing has been sent of it yet.
    pressed: Option<Press>,
    out: Vec<u8>,
}

/// A button that is there beside every guide.
#[derive(Clone, Copy, PartialEq)]
enum Press {
    Stop,
    Clear,
}

impl Session {
    /// Takes bytes of the port at the time `now` since it was opened. Returns the bytes to send.
    pub fn exchange(&mut self, now: Duration, bytes: &[u8]) -> &[u8] {
        self.out.clear();
        let refused = &mut self.refused;
        self.view.take(now, bytes, |frame| {
            if let DeviceFrame::Ack(ack) = frame
                && let Err(why @ CommandRefusal::Version) = ack.result
            {
                *refused = Some(why.to_string());
            }
        });
        if let Some(press) = self.pressed.take() {
            self.greet(now);
            if press == Press::Clear {
                self.send(Command::Clear);
            }
        }
        let has_restarted = self.view.take_restart();
        if let Some(work) = self.work.as_mut().filter(|work| work.is_running()) {
            if has_restarted {
                work.fail(RESTARTED);
            }
            work.exchange(now, bytes, self.view.reading(), &mut self.out);
            if work.is_running() {
                return &self.out;
            }
            // Whatever it ended with, the torque is off.
            self.greet(now);
        }
        let is_due = self.greeted.is_none_or(|last| now.saturating_sub(last) >= GREET_AGAIN);
        if is_due && !self.view.is_live(now) && self.refused.is_none() {
            self.greet(now);
        }
        &self.out
    }

    /// Begins a task; why not where it cannot be.
    pub fn begin(&mut self, task: Task) -> Result<(), Error> {
        if self.work.as_ref().is_some_and(Work::is_running) {
            return Err(Error::failed("another guide is open; end it first"));
        }
        self.work = Some(Work::new(task)?);
        Ok(())
    }

    /// Hands the guide what its page answers.
    pub fn answer(&mut self, answer: GuideAnswer) {
        match &mut self.work {
            Some(work) if work.is_running() => work.answer(answer),
            // The result has been read.
            _ => self.work = self.work.take().filter(|_| !matches!(answer, GuideAnswer::Leave)),
        }
    }

    /// A person has pressed Stop: the next bytes take the torque away, and an open guide is left.
    pub fn stop(&mut self) {
        self.pressed = Some(Press::Stop);
        if let Some(work) = self.work.as_mut().filter(|work| work.is_running()) {
            work.answer(GuideAnswer::Leave);
        }
    }

    /// A person has looked at the device and clears its fault. A guide that is open deals with
    /// those of its own.
    pub fn clear(&mut self) {
        if !self.work.as_ref().is_some_and(Work::is_running) {
            self.pressed = Some(Press::Clear);
        }
    }

    /// Returns the messages for the page, one JSON text a line.
    pub fn tell(&self, now: Duration) -> String {
        let mut lines = self.view.tell(now);
        if let Some(refused) = &self.refused {
            lines.push('\n');
            lines.push_str(&serde_json::json!({ "type": "refused", "why": refused }).to_string());
        }
        if let Some(work) = &self.work {
            lines.push('\n');
            lines.push_str(&work.tell());
        }
        lines
    }

    /// Returns the device's part as a file, once a work has ended well.
    pub fn file(&self) -> Option<&str> {
        self.work.as_ref().and_then(Work::file)
    }

    /// Hello, so that the board streams; stop, so that no torque of somebody else's is left on.
    fn greet(&mut self, now: Duration) {
        self.greeted = Some(now);
        for command in [Command::Hello { version: PROTOCOL_VERSION }, Command::Stop] {
            self.send(command);
        }
    }

    fn send(&mut self, command: Command) {
        let mut frame = [0; MAX_FRAME];
        // Every command fits MAX_FRAME: `link` tests the longest.
        if let Ok((_, length)) = self.commands.encode(command, &mut frame) {
            self.out.extend(&frame[..length]);
        }
    }
}
