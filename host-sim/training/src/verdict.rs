//! The verdict on an attempt: each step of its [`Goal`] with its state, and the reasons why it did
//! not pass. A step that could not be done because an earlier one was not is no reason of its
//! own.

use crate::goal::{ADVANCED_MM, DRAWN_S, ENTRY_DEG, Goal, LOWERED_DEG, Step};
use crate::score::course::Course;
use crate::score::target::TargetOutcome;
use serde::{Deserialize, Serialize};

/// The state of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepState {
    /// Not done.
    #[default]
    Open,
    /// Done as it should be.
    Done,
    /// Not done in time, or wrongly.
    Wrong,
}

/// A step of the goal and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepResult {
    /// The step.
    pub step: Step,
    /// The step as a person reads it.
    pub words: String,
    /// The name of the task that a person reports for it; none where the needle tells.
    pub task: Option<String>,
    /// The range that it asks for, in the unit of its words; none where it asks for no number.
    #[serde(default)]
    pub range: Option<[f64; 2]>,
    /// Its state.
    pub state: StepState,
}

/// A reason why an attempt did not pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// Its name, such as `far_wall`.
    pub key: String,
    /// A clause.
    pub words: String,
    /// True if it would harm a patient.
    pub critical: bool,
}

/// The verdict on an attempt.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The goal in words.
    pub goal: String,
    /// True if every step was done and there is no reason against it.
    pub passed: bool,
    /// Each step, in order.
    pub steps: Vec<StepResult>,
    /// The reasons why it did not pass, in the order of the steps.
    pub reasons: Vec<Reason>,
}

/// A task that was done.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Done {
    pub(crate) name: String,
    pub(crate) tick: u64,
}

/// The facts of an attempt.
pub(crate) struct Facts<'a> {
    pub(crate) course: &'a Course,
    pub(crate) done: &'a [Done],
    /// The outcome for the target, and the visits of it.
    pub(crate) target: Option<(TargetOutcome, &'a [(u64, u64)])>,
}

enum Found {
    Open,
    Done,
    Wrong(Reason),
}

use Found::{Open, Wrong};

fn wrong(key: &str, critical: bool, words: impl Into<String>) -> Found {
    Wrong(Reason { key: key.into(), words: words.into(), critical })
}

/// Returns a goal of which nothing has been done.
pub(crate) fn open(goal: &Goal) -> Verdict {
    judge(goal, &Facts { course: &Course::default(), done: &[], target: None })
}

impl Verdict {
    /// Returns the verdict as a sentence.
    pub fn in_words(&self) -> String {
        let reasons: Vec<&str> = self.reasons.iter().map(|reason| reason.words.as_str()).collect();
        match (self.passed, &reasons[..]) {
            (true, _) => "Passed.".into(),
            (false, []) => "Not finished.".into(),
            (false, reasons) => format!("Not passed: {}.", reasons.join("; ")),
        }
    }

    /// Returns how many of the reasons against it are critical, or are not.
    pub fn errors(&self, critical: bool) -> usize {
        self.reasons.iter().filter(|reason| reason.critical == critical).count()
    }
}

/// Judges what is known by the goal.
pub(crate) fn judge(goal: &Goal, facts: &Facts<'_>) -> Verdict {
    let (mut steps, mut reasons) = (Vec::new(), Vec::new());
    for step in goal.steps {
        let mut state = StepState::Done;
        for found in facts.find(*step, goal) {
            match found {
                Found::Done => {}
                Open if state == StepState::Done => state = StepState::Open,
                Open => {}
                Wrong(reason) => {
                    state = StepState::Wrong;
                    reasons.push(reason);
                }
            }
        }
        let (words, task) = (goal.step_in_words(*step), step.task().map(str::to_owned));
        steps.push(StepResult { step: *step, words, task, range: step.range(), state });
    }
    let passed = reasons.is_empty() && steps.iter().all(|step| step.state == StepState::Done);
    Verdict { goal: goal.in_words(), passed, steps, reasons }
}

impl Facts<'_> {
    fn find(&self, step: Step, goal: &Goal) -> Vec<Found> {
        match step {
            Step::Enter => self.enter(goal),
            Step::Reach => self.reach(goal),
            other => vec![self.find_one(other)],
        }
    }

    fn find_one(&self, step: Step) -> Found {
        match step {
            Step::TourniquetOn => {
                self.before_skin("tourniquet_on", "no_tourniquet", "the tourniquet was not put on first")
            }
            Step::Anchor => self.before_skin("anchor", "not_anchored", "the vein was not anchored first"),
            Step::Angle => self.angle(),
            Step::Flashback => self.flashback().map_or(Open, |_| Found::Done),
            Step::Lower => self.lower(),
            Step::Advance => self.advance(),
            Step::Catheter => self.catheter(),
            Step::Draw => self.draw(),
            Step::TourniquetOff => self.tourniquet_off(),
            Step::Pierce if self.course.skin.is_empty() && !self.course.is_out => Open,
            Step::Pierce if self.course.skin.is_empty() => {
                wrong("skin_not_pierced", false, "the skin was not pierced")
            }
            Step::Aspirate => self.aspirate(),
            Step::Inject => self.inject(),
            Step::NeedleOut if !self.course.is_out => Open,
            Step::Pierce | Step::NeedleOut | Step::Enter | Step::Reach => Found::Done,
        }
    }

    /// Returns when a task was done for the first time.
    fn first(&self, task: &str) -> Option<u64> {
        self.done.iter().find(|done| done.name == task).map(|done| done.tick)
    }

    fn flashback(&self) -> Option<u64> {
        self.course.lumen.first().map(|(from, _)| *from)
    }

    fn before_skin(&self, task: &str, key: &str, words: &str) -> Found {
        let pierced = self.course.skin.first().copied();
        match (self.first(task), pierced) {
            (Some(tick), pierced) if pierced.is_none_or(|pierced| tick < pierced) => Found::Done,
            (None, None) => Open,
            _ => wrong(key, false, words),
        }
    }

    fn angle(&self) -> Found {
        let Some(pierced) = self.course.skin.first() else { return Open };
        let degrees = self.course.place(*pierced).angle_rad.to_degrees().round();
        if ENTRY_DEG.contains(&degrees) {
            return Found::Done;
        }
        let (low, high) = (ENTRY_DEG.start(), ENTRY_DEG.end());
        wrong("angle", false, format!("the skin was pierced at {degrees}°, not at {low}–{high}°"))
    }

    /// Returns a reason for each structure to be spared that was entered or touched.
    fn spared(&self) -> Vec<Found> {
        let mut names: Vec<&str> = Vec::new();
        for hit in &self.course.hits {
            if !names.contains(&hit.name.as_str()) {
                names.push(&hit.name);
            }
        }
        let reason = |name: &str| match name {
            "artery" => wrong("artery", true, "the artery was entered: bright blood"),
            "nerve" => wrong("nerve", true, "the nerve was touched"),
            name => wrong("spared", true, format!("the {name} was touched, which is to be spared")),
        };
        names.into_iter().map(reason).collect()
    }

    fn enter(&self, goal: &Goal) -> Vec<Found> {
        let mut found = self.spared();
        if self.course.skin.len() > 1 {
            found.push(wrong("second_puncture", false, "the skin was pierced a second time"));
        }
        if self.course.far_wall.is_some() {
            found.push(wrong("far_wall", true, "it went through the far wall"));
        }
        match (self.flashback(), found.is_empty(), self.course.is_out) {
            (None, true, true) => {
                let target = goal.target.unwrap_or("vein");
                found.push(wrong("not_entered", false, format!("the {target} was not entered")));
            }
            (None, ..) => found.push(Open),
            (Some(_), ..) => {}
        }
        found
    }

    fn reach(&self, goal: &Goal) -> Vec<Found> {
        let mut found = self.spared();
        let name = goal.target.unwrap_or("target");
        match self.target.map(|(outcome, _)| outcome) {
            Some(TargetOutcome::Reached) => {}
            Some(TargetOutcome::Beyond) => {
                found.push(wrong("beyond", false, format!("it went through the {name}")));
            }
            _ if self.course.is_out && found.is_empty() => {
                found.push(wrong("not_reached", false, format!("the {name} was not reached")));
            }
            _ => found.push(Open),
        }
        found
    }

    /// Returns until when the needle is in the vein without its catheter.
    fn catheter_or_out(&self, flashback: u64) -> u64 {
        let left = self.course.lumen.last().map_or(self.course.end, |(_, to)| *to);
        self.first("catheter").filter(|tick| *tick > flashback).unwrap_or(left).min(left)
    }

    fn lower(&self) -> Found {
        let (Some(pierced), Some(flashback)) = (self.course.skin.first(), self.flashback()) else {
            return Open;
        };
        let degrees = |tick: u64| self.course.place(tick).angle_rad.to_degrees();
        let entered = degrees(flashback);
        if degrees(*pierced) - entered >= *LOWERED_DEG.start() {
            return wrong("lowered_early", false, "the needle was lowered before blood showed");
        }
        let until = self.catheter_or_out(flashback);
        let angles = self.course.between(flashback, until).map(|(_, place)| place.angle_rad.to_degrees());
        let lowered = (entered - angles.fold(entered, f64::min)).round();
        if LOWERED_DEG.contains(&lowered) {
            return Found::Done;
        }
        if lowered > *LOWERED_DEG.end() {
            return wrong("lowered_too_far", false, format!("the needle was lowered by {lowered}°"));
        }
        let is_over = self.course.is_out || self.first("catheter").is_some_and(|tick| tick > flashback);
        if is_over { wrong("not_lowered", false, "the needle was not lowered in the vein") } else { Open }
    }

    fn advance(&self) -> Found {
        let Some(flashback) = self.flashback() else { return Open };
        let until = self.catheter_or_out(flashback);
        let entered = self.course.place(flashback).angle_rad;
        let turns = |(_, place): &(u64, &_)| {
            let place: &crate::score::gesture::Place = place;
            (entered - place.angle_rad).to_degrees() > 1.0
        };
        let begin = self.course.between(flashback, until).find(turns).map_or(flashback, |(tick, _)| tick);
        let begin_mm = self.course.place(begin).depth_mm;
        let deepest =
            self.course.between(begin, until).map(|(_, place)| place.depth_mm).fold(begin_mm, f64::max);
        let advanced = ((deepest - begin_mm) * 10.0).round() / 10.0;
        if ADVANCED_MM.contains(&advanced) {
            return Found::Done;
        }
        let is_over = self.course.is_out || self.first("catheter").is_some_and(|tick| tick > flashback);
        if advanced > *ADVANCED_MM.end() || is_over {
            return wrong("advance", false, format!("it was advanced by {advanced} mm in the vein"));
        }
        Open
    }

    fn catheter(&self) -> Found {
        let Some(flashback) = self.flashback() else {
            return self.first("catheter").map_or(Open, |_| early_catheter());
        };
        match self.first("catheter") {
            Some(tick) if tick < flashback => early_catheter(),
            Some(tick) if self.course.is_in_lumen(tick) => Found::Done,
            None if !self.course.is_out => Open,
            _ => wrong("withdrawn_early", true, "the needle left the vein before the catheter was in"),
        }
    }

    fn draw(&self) -> Found {
        let seconds = self.course.in_lumen_s();
        match self.flashback() {
            Some(_) if seconds >= DRAWN_S => Found::Done,
            Some(_) if self.course.is_out => {
                wrong("short_draw", false, format!("it rested in the vein for {seconds:.1} s only"))
            }
            _ => Open,
        }
    }

    fn tourniquet_off(&self) -> Found {
        let last = self.done.iter().rfind(|done| done.name == "tourniquet_off").map(|done| done.tick);
        match (last, self.flashback()) {
            (Some(off), Some(flashback)) if off < flashback => {
                wrong("tourniquet_early", false, "the tourniquet was taken off before blood showed")
            }
            (Some(_), _) => Found::Done,
            (None, Some(_)) if self.course.is_out => {
                wrong("tourniquet_left_on", true, "the tourniquet was left on")
            }
            (None, _) => Open,
        }
    }

    fn is_in_target(&self, tick: u64) -> bool {
        self.target.is_some_and(|(_, visits)| visits.iter().any(|(from, to)| (*from..*to).contains(&tick)))
    }

    fn aspirate(&self) -> Found {
        let was_there = self.target.is_some_and(|(_, visits)| !visits.is_empty());
        let right = self.done.iter().any(|done| done.name == "aspirate" && self.is_in_target(done.tick));
        match self.first("aspirate") {
            Some(_) if right => Found::Done,
            Some(_) => wrong("aspirated_elsewhere", false, "it was aspirated outside the target"),
            None if was_there && self.course.is_out => wrong("not_aspirated", true, "it was not aspirated"),
            None => Open,
        }
    }

    /// An injection cannot be taken back: each one counts.
    fn inject(&self) -> Found {
        let was_there = self.target.is_some_and(|(_, visits)| !visits.is_empty());
        let mut injected = self.done.iter().filter(|done| done.name == "inject").peekable();
        if injected.peek().is_none() {
            let is_missed = was_there && self.course.is_out;
            return if is_missed { wrong("not_injected", false, "nothing was injected") } else { Open };
        }
        let aspirated = self.first("aspirate");
        for one in injected {
            if !self.is_in_target(one.tick) {
                return wrong("injected_elsewhere", true, "it was injected outside the target");
            }
            if aspirated.is_some_and(|aspirated| aspirated > one.tick) {
                return wrong("injected_early", true, "it was injected before it was aspirated");
            }
        }
        Found::Done
    }
}

fn early_catheter() -> Found {
    wrong("catheter_early", true, "the catheter was pushed before blood showed")
}
