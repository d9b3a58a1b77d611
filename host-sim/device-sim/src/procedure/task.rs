//! The tasks that a person does in addition to moving the needle (tourniquet, plunger, catheter):
//! those that a procedure asks for, their order, where the tip has to be, and which mistakes are
//! critical. The device has no plunger: a page's button or the scripted hand reports each task.

use serde::{Deserialize, Serialize};

/// A task's name is at most this long.
const LONGEST_NAME: usize = 40;
/// A procedure asks for at most so many tasks.
const MOST_TASKS: usize = 12;

/// A task of a procedure. Tasks are to be done in the order of the file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Its name, such as `tourniquet_on`.
    pub name: String,
    /// The place in which the tip has to be.
    pub tip: TipPlace,
    /// The mistakes that are critical; the others are not.
    #[serde(default)]
    pub critical: Vec<Mistake>,
    /// The guideline that the rule is from, or that it is an assumption.
    pub source: String,
}

/// The place in which the tip has to be when a task is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TipPlace {
    /// Anywhere.
    Any,
    /// In the patient's target: the lumen, the bursa.
    Target,
    /// Outside the skin, before the insertion.
    Outside,
}

/// A mistake with a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mistake {
    /// It was not done.
    Missed,
    /// It was done with the tip at another place.
    WrongPlace,
    /// It was done before a task that comes first.
    WrongOrder,
}

/// Checks the tasks of a procedure.
pub(super) fn check(tasks: &[Task]) -> Result<(), String> {
    if tasks.len() > MOST_TASKS {
        return Err(format!("it has {} [[task]] entries; at most {MOST_TASKS} are allowed", tasks.len()));
    }
    for (index, task) in tasks.iter().enumerate() {
        let name = &task.name;
        if !is_name(name) {
            return Err(format!(
                "task name \"{name}\" must have 1 to {LONGEST_NAME} lower-case letters, digits or _; rename it"
            ));
        }
        if tasks[..index].iter().any(|other| other.name == *name) {
            return Err(format!("task \"{name}\" is listed twice; remove one of them"));
        }
        if task.source.trim().is_empty() {
            return Err(format!(
                "source of task \"{name}\" is empty; name the guideline, or write \"assumption\""
            ));
        }
    }
    Ok(())
}

/// True for the name of a task.
pub fn is_name(name: &str) -> bool {
    (1..=LONGEST_NAME).contains(&name.len())
        && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
}
