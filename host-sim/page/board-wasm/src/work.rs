//! Commissioning or compensation on the board, one step at a time, each begun by a press on the
//! guide's button.

use device_setup::bench::{Act, Line};
use device_setup::commission::weigh::{WeighWish, weigh};
use device_setup::commission::{self, Wish};
use device_setup::compensate;
use device_setup::pause::pause;
use device_sim::device::device_config;
use device_sim::error::Error;
use device_sim::page::guide::{GuideAnswer, GuideState, Reading};
use diagnosis::rig::Rig;
use serde::Deserialize;
use std::cell::RefCell;
use std::fmt::Display;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

/// The name of the device in the guide.
const DEVICE: &str = "the board on this computer's USB";
/// The first step of all that moves.
const NEEDLE_OUT: &str = "the roller will move on its own: take the needle out of the device, and keep hands off unless a step asks for them";
/// The reason why it ended.
const LEFT: &str = "ended before the last step; begin again from the first one";

/// The work that a person asks for.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Task {
    /// Find out how the board is wired and built.
    Commission {
        /// Turns of the roller by hand, 1 to 20.
        turns: u32,
        /// Length of the strip that is pulled through, 10 to 1,000 mm.
        pull_mm: f64,
        /// Counts a turn where the encoder's are known.
        counts_per_turn: Option<u16>,
    },
    /// Check with a weight on the needle that 1 N is 1 N.
    Weigh {
        /// The weight in g.
        grams: f64,
        /// Correct the torque at full scale if it is wrong.
        correct: bool,
    },
    /// Feed forward what a diagnosis found.
    Compensate {
        /// The text of the report's `patched-rig.toml`.
        rig: String,
        /// Share of the usual gains, 0 to 1.
        share: f64,
    },
}

/// The result of a work.
struct Finding {
    lines: Vec<String>,
    /// The device's part as a file.
    file: String,
}

type Dialogue = Pin<Box<dyn Future<Output = Result<Finding, Error>>>>;

/// A work that is being done.
pub struct Work {
    shared: Rc<RefCell<Shared>>,
    dialogue: Option<Dialogue>,
    file: Option<String>,
}

/// The state that the dialogue and the page share.
struct Shared {
    guide: GuideState,
    now: Duration,
    out: Vec<u8>,
    heard: Vec<u8>,
}

impl Work {
    /// Prepares a task; what is wrong with its numbers where something is. Nothing is sent before
    /// the first step is begun.
    pub fn new(task: Task) -> Result<Self, Error> {
        let title = match task {
            Task::Commission { .. } => "Commissioning",
            Task::Weigh { .. } => "Weighing",
            Task::Compensate { .. } => "Compensation",
        };
        let shared = Rc::new(RefCell::new(Shared {
            guide: GuideState::new(title, DEVICE),
            now: Duration::ZERO,
            out: Vec::new(),
            heard: Vec::new(),
        }));
        let dialogue = dialogue(task, Rc::clone(&shared))?;
        Ok(Self { shared, dialogue: Some(dialogue), file: None })
    }

    /// Takes what has come from the board, goes on as far as that allows, and adds what is to be
    /// sent to `out`.
    pub fn exchange(&mut self, now: Duration, heard: &[u8], reading: Option<Reading>, out: &mut Vec<u8>) {
        {
            let mut shared = self.shared.borrow_mut();
            shared.now = now;
            shared.heard.extend(heard);
            if let Some(reading) = reading {
                shared.guide.read(reading);
            }
        }
        let Some(dialogue) = &mut self.dialogue else { return };
        let poll = dialogue.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        if let Poll::Ready(outcome) = poll {
            self.end(outcome);
        }
        out.append(&mut self.shared.borrow_mut().out);
    }

    /// Does what the page answers.
    pub fn answer(&mut self, answer: GuideAnswer) {
        self.shared.borrow_mut().guide.answer(answer);
    }

    /// Ends it early, for this reason: nothing more is sent.
    pub fn fail(&mut self, why: &str) {
        if self.dialogue.is_some() {
            self.end(Err(Error::failed(why)));
            self.shared.borrow_mut().out.clear();
        }
    }

    /// True until it has ended, well or not.
    pub fn is_running(&self) -> bool {
        self.dialogue.is_some()
    }

    /// Returns the message for the page.
    pub fn tell(&self) -> String {
        serde_json::to_string(&self.shared.borrow().guide).unwrap_or_default()
    }

    /// Returns the device's part as a file, if the work ended well.
    pub fn file(&self) -> Option<&str> {
        self.file.as_deref()
    }

    fn end(&mut self, outcome: Result<Finding, Error>) {
        self.dialogue = None;
        let lines = outcome.map(|finding| {
            self.file = Some(finding.file);
            finding.lines
        });
        self.shared.borrow_mut().guide.end(lines.map_err(|error| error.to_string()));
    }
}

/// The dialogue of a task.
fn dialogue(task: Task, shared: Rc<RefCell<Shared>>) -> Result<Dialogue, Error> {
    Ok(match task {
        Task::Commission { turns, pull_mm, counts_per_turn } => {
            within("the length of the pull in mm", pull_mm, 10.0, 1_000.0)?;
            within("the number of turns", f64::from(turns), 1.0, 20.0)?;
            if let Some(counts) = counts_per_turn {
                within("the counts per turn", f64::from(counts), 256.0, 65_535.0)?;
            }
            Box::pin(commission(Wish { turns, pull_mm, counts_per_turn }, shared))
        }
        Task::Weigh { grams, correct } => {
            within("the weight in g", grams, 1.0, 10_000.0)?;
            Box::pin(weighing(WeighWish { grams, correct }, shared))
        }
        Task::Compensate { rig, share } => {
            within("the share of the gains", share, 0.0, 1.0)?;
            let rig = Rig::parse(&rig, "patched-rig.toml").map_err(Error::input)?;
            Box::pin(compensation(rig, share, shared))
        }
    })
}

fn within(what: &str, value: f64, least: f64, most: f64) -> Result<(), Error> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(Error::input(format_args!("{what} is {value}; it must be from {least} to {most}")))
}

async fn commission(wish: Wish, shared: Rc<RefCell<Shared>>) -> Result<Finding, Error> {
    ask(&shared, &NEEDLE_OUT, false).await?;
    let mut line = BrowserLine::new(&shared);
    let asks = async |step: commission::CommissioningStep| ask(&shared, &step, step.moves()).await;
    let outcome = commission::commission(&mut line, &wish, asks).await?;
    Ok(Finding { lines: outcome.lines(), file: outcome.to_toml("board")? })
}

async fn weighing(wish: WeighWish, shared: Rc<RefCell<Shared>>) -> Result<Finding, Error> {
    let mut line = BrowserLine::new(&shared);
    let asks = async |step: commission::CommissioningStep| ask(&shared, &step, step.moves()).await;
    let outcome = weigh(&mut line, &wish, asks).await?;
    Ok(Finding { lines: outcome.lines(), file: outcome.to_toml("board")? })
}

async fn compensation(rig: Rig, share: f64, shared: Rc<RefCell<Shared>>) -> Result<Finding, Error> {
    ask(&shared, &NEEDLE_OUT, false).await?;
    let mut line = BrowserLine::new(&shared);
    let asks = async |step: compensate::CompensationStep| ask(&shared, &step, step.moves()).await;
    let wish = compensate::Wish { share, ..compensate::Wish::default() };
    let outcome = compensate::compensate(&mut line, &rig, wish, asks).await?;
    let finding = Finding { lines: outcome.lines(), file: device_config::to_toml("board", &outcome.record)? };
    outcome.refusal().map_or(Ok(finding), Err)
}

/// Shows a step and waits until a person begins it.
async fn ask(shared: &RefCell<Shared>, step: &dyn Display, moves: bool) -> Result<(), Error> {
    let number = shared.borrow_mut().guide.ask(step.to_string(), moves);
    loop {
        {
            let mut shared = shared.borrow_mut();
            // What came while a person read is old.
            shared.heard.clear();
            if shared.guide.is_left() {
                return Err(Error::failed(LEFT));
            }
            if shared.guide.is_agreed(number) {
                shared.guide.run_last();
                return Ok(());
            }
        }
        pause().await;
    }
}

/// The board behind the browser's serial port.
struct BrowserLine {
    shared: Rc<RefCell<Shared>>,
    /// The device gets back what it had, also after a person has left.
    is_restoring: bool,
}

impl BrowserLine {
    fn new(shared: &Rc<RefCell<Shared>>) -> Self {
        Self { shared: Rc::clone(shared), is_restoring: false }
    }
}

impl Line for BrowserLine {
    fn exchange(&mut self, out: &[u8], into: &mut Vec<u8>) -> Result<Duration, Error> {
        let mut shared = self.shared.borrow_mut();
        if shared.guide.is_left() && !self.is_restoring {
            return Err(Error::failed(LEFT));
        }
        shared.out.extend(out);
        into.append(&mut shared.heard);
        Ok(shared.now)
    }

    fn restores(&mut self) {
        self.is_restoring = true;
    }

    fn act(&mut self, _: Act) {}
}
