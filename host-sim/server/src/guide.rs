//! A guide through work that a person and a device do in turns (commissioning, compensation): what comes next, an agreement before
//! each step, what the device reads meanwhile, what came of it. It shows and waits; it knows no device and moves nothing.

use crate::visualizer::{Said, Watch, Watches};
use device_sim::failure::Failure;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Between two looks whether the program is to end.
const PAUSE: Duration = Duration::from_millis(100);

/// A guide; its clones are the same guide.
#[derive(Clone)]
pub struct Guide {
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Set to end, from outside (Ctrl-C) or by a person who leaves before the end.
    stop: Arc<AtomicBool>,
}

/// Server to page.
#[derive(Clone, Debug, Serialize)]
struct State {
    #[serde(rename = "type")]
    kind: &'static str,
    title: String,
    device: String,
    steps: Vec<Step>,
    reading: Option<Reading>,
    end: Option<End>,
    /// The number of steps that the page has agreed to.
    #[serde(skip)]
    agreed: usize,
    #[serde(skip)]
    left: bool,
}

/// One step, from the moment in which it is asked for.
#[derive(Clone, Debug, Serialize)]
struct Step {
    text: String,
    /// True if the motor moves in it.
    moves: bool,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Stage {
    Asked,
    Running,
    Done,
}

/// The device's readings, for a person who turns or tilts it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reading {
    /// Encoder's counts since the device was switched on.
    pub counts: i32,
    /// Tilt of the needle below the horizontal, degrees.
    pub tilt_deg: f64,
}

#[derive(Clone, Debug, Serialize)]
struct End {
    well: bool,
    lines: Vec<String>,
}

/// Page to server.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
enum FromPage {
    /// Begin the step of this number, counted from 1. One that was asked before, or never, is nothing.
    Begin { step: usize },
    /// The result has been read, or nothing more is wanted.
    Leave,
}

impl Guide {
    /// Nothing has been asked yet; `stop` ends every wait.
    pub fn new(title: &str, device: &str, stop: Arc<AtomicBool>) -> Self {
        let state = State {
            kind: "guide",
            title: title.into(),
            device: device.into(),
            steps: Vec::new(),
            reading: None,
            end: None,
            agreed: 0,
            left: false,
        };
        Self { shared: Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new(), stop }) }
    }

    /// Shows the next step and waits until a person begins it in the page.
    pub fn ask(&self, step: &dyn Display, moves: bool) -> Result<(), Failure> {
        let mut state = self.lock();
        state.finish_last();
        state.steps.push(Step { text: step.to_string(), moves, stage: Stage::Asked });
        let number = state.steps.len();
        let mut state = self.wait(state, |state| state.agreed >= number || state.left);
        if state.agreed < number {
            return Err(Failure::failed("ended before the last step; begin again from the first one"));
        }
        if let Some(step) = state.steps.last_mut() {
            step.stage = Stage::Running;
        }
        Ok(())
    }

    /// Sets the device's present readings.
    pub fn read(&self, reading: Reading) {
        self.lock().reading = Some(reading);
    }

    /// Shows what came of it and waits until a person has read it.
    pub fn end(&self, outcome: Result<Vec<String>, &Failure>) {
        let mut state = self.lock();
        let (well, lines) = match outcome {
            Ok(lines) => {
                state.finish_last();
                (true, lines)
            }
            Err(failure) => (false, vec![failure.to_string()]),
        };
        state.end = Some(End { well, lines });
        drop(self.wait(state, |state| state.left));
    }

    /// Returns the messages for a page: the whole state, each time it looks.
    pub fn watches(&self) -> Watches {
        let guide = self.clone();
        Arc::new(move || -> Watch {
            let guide = guide.clone();
            Box::new(move || serde_json::to_string(&*guide.lock()).ok())
        })
    }

    /// Returns the handler of a page's messages; malformed ones are refused.
    pub fn said(&self) -> Said {
        let guide = self.clone();
        Arc::new(move |text| {
            let Ok(message) = serde_json::from_str(text) else { return false };
            guide.obey(&message);
            true
        })
    }

    fn obey(&self, message: &FromPage) {
        let mut state = self.lock();
        match *message {
            FromPage::Begin { step } if step == state.steps.len() => state.agreed = step,
            FromPage::Begin { .. } => {}
            FromPage::Leave => {
                state.left = true;
                // In the middle of a step: whoever talks to the device ends, and its torque with the heartbeat.
                self.shared.stop.fetch_or(state.end.is_none(), Ordering::Relaxed);
            }
        }
        self.shared.changed.notify_all();
    }

    fn wait<'a>(
        &self,
        mut state: MutexGuard<'a, State>,
        is_over: impl Fn(&State) -> bool,
    ) -> MutexGuard<'a, State> {
        while !is_over(&state) && !self.shared.stop.load(Ordering::Relaxed) {
            let waited = self.shared.changed.wait_timeout(state, PAUSE);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state
    }

    /// A thread that panicked must not take the guide with it: the state is still whole.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn finish_last(&mut self) {
        if let Some(step) = self.steps.last_mut() {
            step.stage = Stage::Done;
        }
    }
}
