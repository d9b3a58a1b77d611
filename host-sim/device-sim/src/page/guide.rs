//! The state that a guide shows and the answers of its page: the steps of work that a person and a
//! device do in turns.

use serde::{Deserialize, Serialize};

/// Everything that the page of a guide shows, sent whole.
#[derive(Clone, Debug, Serialize)]
pub struct GuideState {
    #[serde(rename = "type")]
    kind: &'static str,
    title: String,
    device: String,
    steps: Vec<GuideStep>,
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
struct GuideStep {
    text: String,
    /// True if the motor moves in it.
    moves: bool,
    stage: Stage,
    /// The news of it: what goes on, or what came of it; empty where nobody says.
    news: String,
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

/// The page's answers.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum GuideAnswer {
    /// Begin the step of this number, counted from 1. One that was asked before, or never, is
    /// ignored.
    Begin {
        /// The step's number.
        step: usize,
    },
    /// The result has been read, or nothing more is wanted.
    Leave,
}

impl GuideState {
    /// Nothing has been asked yet.
    pub fn new(title: &str, device: &str) -> Self {
        Self {
            kind: "guide",
            title: title.into(),
            device: device.into(),
            steps: Vec::new(),
            reading: None,
            end: None,
            agreed: 0,
            left: false,
        }
    }

    /// Shows the next step. Returns its number, counted from 1.
    pub fn ask(&mut self, text: String, moves: bool) -> usize {
        self.finish_last();
        self.steps.push(GuideStep { text, moves, stage: Stage::Asked, news: String::new() });
        self.steps.len()
    }

    /// True if a person has begun the step of this number.
    pub fn is_agreed(&self, number: usize) -> bool {
        self.agreed >= number
    }

    /// True if the page was left.
    pub fn is_left(&self) -> bool {
        self.left
    }

    /// Shows that the last step is being done.
    pub fn run_last(&mut self) {
        if let Some(step) = self.steps.last_mut() {
            step.stage = Stage::Running;
        }
    }

    /// Shows what goes on in the last step, or what came of it.
    pub fn tell(&mut self, news: &str) {
        if let Some(step) = self.steps.last_mut() {
            news.clone_into(&mut step.news);
        }
    }

    /// Sets the device's present readings.
    pub fn read(&mut self, reading: Reading) {
        self.reading = Some(reading);
    }

    /// Shows the result.
    pub fn end(&mut self, outcome: Result<Vec<String>, String>) {
        if outcome.is_ok() {
            self.finish_last();
        }
        let well = outcome.is_ok();
        let lines = outcome.unwrap_or_else(|error| vec![error]);
        self.end = Some(End { well, lines });
    }

    /// True if the result is shown.
    pub fn is_ended(&self) -> bool {
        self.end.is_some()
    }

    /// Does what a page answers.
    pub fn answer(&mut self, answer: GuideAnswer) {
        match answer {
            GuideAnswer::Begin { step } if step == self.steps.len() => self.agreed = step,
            GuideAnswer::Begin { .. } => {}
            GuideAnswer::Leave => self.left = true,
        }
    }

    fn finish_last(&mut self) {
        if let Some(step) = self.steps.last_mut() {
            step.stage = Stage::Done;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_step_that_is_asked_for_can_be_begun() {
        let mut state = GuideState::new("Commissioning", "a board");
        let begin = |state: &mut GuideState, step| state.answer(GuideAnswer::Begin { step });
        begin(&mut state, 1);
        assert_eq!(state.ask("one".into(), false), 1);
        assert!(!state.is_agreed(1), "it was begun before it was asked for");
        begin(&mut state, 2);
        assert!(!state.is_agreed(1));
        begin(&mut state, 1);
        assert!(state.is_agreed(1));
        assert_eq!(state.ask("two".into(), true), 2);
        begin(&mut state, 1);
        assert!(!state.is_agreed(2), "a second press on the step before");
    }

    #[test]
    fn the_news_of_a_step_stay_with_it() {
        let mut state = GuideState::new("Settling", "a board");
        state.tell("nothing was asked yet");
        state.ask("one".into(), true);
        state.tell("12 of 24 s played");
        state.tell("nothing is named");
        state.ask("two".into(), true);
        let shown = serde_json::to_value(&state).expect("JSON");
        assert_eq!(shown["steps"][0]["news"], "nothing is named");
        assert_eq!(shown["steps"][1]["news"], "");
    }
}
