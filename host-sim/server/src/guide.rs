//! A guide through work that a person and a device do in turns (commissioning, compensation): what
//! comes next, an agreement before each step, what the device reads meanwhile, what came of it. It
//! shows and waits; it knows no device and moves nothing.

use crate::visualizer::{Said, Watch, Watches};
use device_sim::error::Error;
pub use device_sim::page::guide::Reading;
use device_sim::page::guide::{GuideAnswer, GuideState};
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
    state: Mutex<GuideState>,
    changed: Condvar,
    /// Set to end, from outside (Ctrl-C) or by a person who leaves before the end.
    stop: Arc<AtomicBool>,
}

impl Guide {
    /// Nothing has been asked yet; `stop` ends every wait.
    pub fn new(title: &str, device: &str, stop: Arc<AtomicBool>) -> Self {
        let state = Mutex::new(GuideState::new(title, device));
        Self { shared: Arc::new(Shared { state, changed: Condvar::new(), stop }) }
    }

    /// Shows the next step and waits until a person begins it in the page.
    pub fn ask(&self, step: &dyn Display, moves: bool) -> Result<(), Error> {
        let mut state = self.lock();
        let number = state.ask(step.to_string(), moves);
        let mut state = self.wait(state, |state| state.is_agreed(number) || state.is_left());
        if !state.is_agreed(number) {
            return Err(Error::failed("ended before the last step; begin again from the first one"));
        }
        state.run_last();
        Ok(())
    }

    /// Shows what goes on in the last step, or what came of it.
    pub fn tell(&self, news: &str) {
        self.lock().tell(news);
    }

    /// Sets the device's present readings.
    pub fn read(&self, reading: Reading) {
        self.lock().read(reading);
    }

    /// Shows what came of it and waits until a person has read it.
    pub fn end(&self, outcome: Result<Vec<String>, &Error>) {
        let mut state = self.lock();
        state.end(outcome.map_err(ToString::to_string));
        drop(self.wait(state, GuideState::is_left));
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
            let Ok(answer) = serde_json::from_str(text) else { return false };
            guide.obey(answer);
            true
        })
    }

    fn obey(&self, answer: GuideAnswer) {
        let mut state = self.lock();
        state.answer(answer);
        if state.is_left() {
            // In the middle of a step: whoever talks to the device ends, and its torque with the
            // heartbeat.
            self.shared.stop.fetch_or(!state.is_ended(), Ordering::Relaxed);
        }
        self.shared.changed.notify_all();
    }

    fn wait<'a>(
        &self,
        mut state: MutexGuard<'a, GuideState>,
        is_over: impl Fn(&GuideState) -> bool,
    ) -> MutexGuard<'a, GuideState> {
        while !is_over(&state) && !self.shared.stop.load(Ordering::Relaxed) {
            let waited = self.shared.changed.wait_timeout(state, PAUSE);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state
    }

    /// A thread that panicked must not take the guide with it: the state is still whole.
    fn lock(&self) -> MutexGuard<'_, GuideState> {
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
