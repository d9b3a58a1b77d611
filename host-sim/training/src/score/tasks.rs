//! The results of a procedure's tasks (tourniquet, plunger, catheter): done, missed, at the wrong
//! place or in the wrong order, and how many of the mistakes are critical.
//!
//! The rule. A task is done when it was done with the tip where the procedure wants it, and no task
//! that comes before it in the procedure was left for later. A task before it that was never done
//! is one mistake, not two. A mistake that is repaired does not count, unless it is critical: an
//! injection cannot be taken back. Between two insertions, what was done before the first task of
//! the procedure counts for neither: it came too late for the one, and the other has not begun.

use super::{Judge, Span};
use device_sim::procedure::task::{Mistake, Task, TipPlace};
use device_sim::profile::Profile;
use link::frames::{Event, EventKind};
use serde::{Deserialize, Serialize};

/// The results of the tasks of one insertion.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tasks {
    /// Mistakes that are critical.
    pub critical: u32,
    /// The other mistakes.
    pub non_critical: u32,
    /// Each task, in the order of the procedure.
    pub list: Vec<TaskResult>,
}

/// The result of one task.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TaskResult {
    /// Its name.
    pub name: String,
    /// The mistake; none where it was done as it should be.
    pub mistake: Option<Mistake>,
    /// True if the mistake is critical.
    pub is_critical: bool,
    /// The tip's place when the task was done: `outside`, `target`, or the name of what it was in;
    /// none where it was missed.
    pub tip: Option<String>,
}

/// A task as it was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Done {
    /// Its number in the procedure.
    pub(super) number: usize,
    /// The tip's place.
    pub(super) tip: Tip,
}

/// The tip's place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Tip {
    /// Outside the skin.
    Outside,
    /// In the target.
    Target,
    /// In something else, by its name.
    In(String),
}

/// A layer as a person reads it.
#[derive(Clone, Debug)]
pub struct LayerName {
    name: String,
    has_wall: bool,
}

impl Tip {
    fn is_at(&self, place: TipPlace) -> bool {
        match place {
            TipPlace::Any => true,
            TipPlace::Target => *self == Tip::Target,
            TipPlace::Outside => *self == Tip::Outside,
        }
    }

    fn in_words(&self) -> String {
        match self {
            Tip::Outside => "outside".into(),
            Tip::Target => "target".into(),
            Tip::In(name) => name.clone(),
        }
    }
}

impl TaskResult {
    /// Returns the result as a clause, such as `inject: wrong place, tip in fat (critical)`.
    pub fn in_words(&self) -> String {
        let name = self.name.replace('_', " ");
        let tip = match self.tip.as_deref() {
            Some(place @ ("outside" | "target")) => {
                format!(", tip {}", place.replace("target", "in the target"))
            }
            Some(place) => format!(", tip in {place}"),
            None => String::new(),
        };
        let said = match self.mistake {
            None => format!("{name}: done"),
            Some(Mistake::Missed) => format!("{name}: missed"),
            Some(Mistake::WrongPlace) => format!("{name}: wrong place{tip}"),
            Some(Mistake::WrongOrder) => format!("{name}: wrong order"),
        };
        said + if self.is_critical { " (critical)" } else { "" }
    }
}

/// Judges what was `done`, in its order in time, against the `tasks` of the procedure.
pub(super) fn judge(tasks: &[Task], done: &[Done]) -> Tasks {
    let list: Vec<TaskResult> = (0..tasks.len()).map(|number| result(tasks, number, done)).collect();
    let count =
        |critical| list.iter().filter(|one| one.mistake.is_some() && one.is_critical == critical).count();
    Tasks { critical: count(true) as u32, non_critical: count(false) as u32, list }
}

/// The result of one task: its first critical mistake, else that it was done, else its first
/// mistake.
fn result(tasks: &[Task], number: usize, done: &[Done]) -> TaskResult {
    let task = &tasks[number];
    let is_critical = |mistake: &Mistake| task.critical.contains(mistake);
    let attempts: Vec<(Option<Mistake>, &Tip)> = done
        .iter()
        .enumerate()
        .filter(|(_, one)| one.number == number)
        .map(|(at, one)| (mistake(tasks, done, at), &one.tip))
        .collect();
    let critical = attempts.iter().find(|(mistake, _)| mistake.as_ref().is_some_and(is_critical));
    let right = attempts.iter().find(|(mistake, _)| mistake.is_none());
    let (mistake, tip) = match critical.or(right).or(attempts.first()) {
        Some((mistake, tip)) => (*mistake, Some(tip.in_words())),
        None => (Some(Mistake::Missed), None),
    };
    TaskResult {
        name: task.name.clone(),
        mistake,
        is_critical: mistake.as_ref().is_some_and(is_critical),
        tip,
    }
}

/// The mistake of what was done as number `at`.
fn mistake(tasks: &[Task], done: &[Done], at: usize) -> Option<Mistake> {
    let one = &done[at];
    if !one.tip.is_at(tasks[one.number].tip) {
        return Some(Mistake::WrongPlace);
    }
    let is_late = |before: usize| {
        let is_it = |other: &Done| other.number == before;
        !done[..at].iter().any(is_it) && done[at..].iter().any(is_it)
    };
    (0..one.number).any(is_late).then_some(Mistake::WrongOrder)
}

/// Drops what was done outside before the insertion and before the first task of the procedure.
fn from_first(done: Vec<Done>) -> Vec<Done> {
    let inside = done.iter().position(|one| one.tip != Tip::Outside).unwrap_or(done.len());
    let from = done[..inside].iter().position(|one| one.number == 0).unwrap_or(inside);
    done.into_iter().skip(from).collect()
}

/// Returns the names of a patient's layers, outermost first.
pub(super) fn layer_names(profile: &Profile) -> Vec<LayerName> {
    let name = |(number, has_wall): (u8, bool)| {
        let name = profile.layer_name(number).unwrap_or_else(|| "tissue".into());
        LayerName { name, has_wall }
    };
    (0_u8..).zip(profile.walls()).map(name).collect()
}

/// Returns the deepest layer that the tip was in at `tick`.
fn layer_at(events: &[Event], (begin, tick): (u64, u64), layers: &[LayerName]) -> Option<usize> {
    let mut inside = vec![false; layers.len()];
    for event in events.iter().filter(|event| (begin..=tick).contains(&event.tick)) {
        let (layer, enters) = match event.kind {
            EventKind::Contact { layer } if layers.get(usize::from(layer)).is_some_and(|l| !l.has_wall) => {
                (layer, true)
            }
            EventKind::Puncture { layer } | EventKind::InTrack { layer } => (layer, true),
            EventKind::Exit { layer } => (layer, false),
            _ => continue,
        };
        inside.get_mut(usize::from(layer)).into_iter().for_each(|is_in| *is_in = enters);
    }
    inside.iter().rposition(|is_in| *is_in)
}

impl Judge {
    /// Returns the results of the tasks of an insertion; `visits` are those of the target.
    pub(super) fn tasks(&self, span: Span<'_>, visits: &[(u64, u64)]) -> Option<Tasks> {
        if self.tasks.is_empty() {
            return None;
        }
        let is_end = |event: &&Event| event.tick < span.begin && event.kind == EventKind::Exit { layer: 0 };
        let since = span.stretch.events.iter().rfind(is_end).map_or(0, |event| event.tick + 1);
        let told = span.stretch.tasks.iter().filter(|task| (since..=span.end).contains(&task.tick));
        let done = told.filter_map(|task| {
            let number = self.tasks.iter().position(|listed| listed.name == task.name)?;
            Some(Done { number, tip: self.tip(span, task.tick, visits) })
        });
        Some(judge(&self.tasks, &from_first(done.collect())))
    }

    /// Returns the tip's place at `tick`.
    fn tip(&self, span: Span<'_>, tick: u64, visits: &[(u64, u64)]) -> Tip {
        if !(span.begin..span.end).contains(&tick) {
            return Tip::Outside;
        }
        if let Some(structure) = self.beside_at(span, tick) {
            return Tip::In(structure);
        }
        if visits.iter().any(|(from, to)| (*from..*to).contains(&tick)) {
            return Tip::Target;
        }
        let layer = layer_at(&span.stretch.events, (span.begin, tick), &self.layers);
        Tip::In(
            layer.map_or_else(|| "the skin, not pierced".into(), |number| self.layers[number].name.clone()),
        )
    }

    /// Returns the name of the structure next to the way that the tip was in.
    fn beside_at(&self, span: Span<'_>, tick: u64) -> Option<String> {
        let sample = span.stretch.samples.get(span.at(tick))?;
        let place = super::gesture::Place {
            depth_mm: f64::from(sample.count) * span.stretch.hello.mm_per_count,
            angle_rad: f64::from(sample.tilt_mrad) * 1e-3 - self.skin_tilt_rad,
        };
        let inside = self.beside.iter().find(|structure| structure.contains(place.in_section()))?;
        Some(inside.name.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use device_sim::procedure::Procedure;

    fn tasks_of(procedure: &str, patient: &str) -> Vec<Task> {
        let profile = Profile::find(patient).expect("it is built in");
        Procedure::find(procedure, &profile).expect("it is built in").tasks
    }

    /// Reads `on@outside advance@target`: what was done, and where the tip was.
    fn done(tasks: &[Task], sequence: &str) -> Vec<Done> {
        let one = |word: &str| {
            let (name, tip) = word.split_once('@').expect("task@place");
            let number = tasks.iter().position(|task| task.name == name).expect("a task of the procedure");
            let tip = match tip {
                "outside" => Tip::Outside,
                "target" => Tip::Target,
                other => Tip::In(other.into()),
            };
            Done { number, tip }
        };
        sequence.split_whitespace().map(one).collect()
    }

    /// Judges each sequence and compares critical, non-critical and the mistakes in the order of
    /// the procedure: `-` where it was done, else missed, place or order.
    fn check(tasks: &[Task], table: &[(&str, u32, u32, &str)]) {
        for (sequence, critical, non_critical, mistakes) in table {
            let found = judge(tasks, &from_first(done(tasks, sequence)));
            let words = found.list.iter().map(|one| match one.mistake {
                None => "-",
                Some(Mistake::Missed) => "missed",
                Some(Mistake::WrongPlace) => "place",
                Some(Mistake::WrongOrder) => "order",
            });
            let words: Vec<&str> = words.collect();
            assert_eq!(
                (found.critical, found.non_critical, words.join(" ").as_str()),
                (*critical, *non_critical, *mistakes),
                "{sequence}"
            );
        }
    }

    /// Tests each task as the guideline has it: on before the puncture, catheter in the lumen, off
    /// before the needle is out.
    #[test]
    fn mistakes_of_a_venepuncture_are_counted() {
        let on = "tourniquet_on@outside ";
        let with = |rest: &str| format!("{on}{rest}");
        let right = with("advance_catheter@target tourniquet_off@target");
        let in_fat = with("advance_catheter@fat tourniquet_off@target");
        let early_off = with("tourniquet_off@target advance_catheter@target");
        let repaired = with("tourniquet_off@fat advance_catheter@target tourniquet_off@target");
        let not_undone = with("advance_catheter@fat advance_catheter@target tourniquet_off@target");
        let left_on = with("advance_catheter@target");
        let off_before = with("tourniquet_off@outside advance_catheter@target");
        let from_last_time = format!("tourniquet_off@outside {right}");
        check(
            &tasks_of("venepuncture", "adult"),
            &[
                (&right, 0, 0, "- - -"),
                (&from_last_time, 0, 0, "- - -"),
                (&in_fat, 1, 0, "- place -"),
                (&left_on, 1, 0, "- - missed"),
                (&early_off, 0, 1, "- - order"),
                (&repaired, 0, 0, "- - -"),
                (&not_undone, 1, 0, "- place -"),
                (&off_before, 0, 1, "- - place"),
                ("advance_catheter@target tourniquet_off@target", 0, 1, "missed - -"),
                ("tourniquet_on@skin advance_catheter@target tourniquet_off@target", 0, 1, "place - -"),
                (on, 1, 1, "- missed missed"),
                ("", 1, 2, "missed missed missed"),
            ],
        );
    }

    /// Aspirate, then inject, both in the bursa; an injection cannot be taken back.
    #[test]
    fn mistakes_of_an_injection_are_counted() {
        check(
            &tasks_of("bursa", "shoulder-joint"),
            &[
                ("aspirate@target inject@target", 0, 0, "- -"),
                ("aspirate@target aspirate@target inject@target", 0, 0, "- -"),
                ("inject@target aspirate@target", 1, 0, "- order"),
                ("inject@target", 1, 0, "missed -"),
                ("aspirate@target inject@vein", 1, 0, "- place"),
                ("aspirate@target inject@vein inject@target", 1, 0, "- place"),
                ("aspirate@muscle inject@target", 0, 1, "place -"),
                ("aspirate@muscle aspirate@target inject@target", 0, 0, "- -"),
                ("aspirate@target", 0, 1, "- missed"),
                ("", 1, 1, "missed missed"),
            ],
        );
    }

    #[test]
    fn the_tip_is_in_the_deepest_layer_entered() {
        let layer = |name: &str, has_wall| LayerName { name: name.into(), has_wall };
        let layers = [layer("skin", true), layer("fat", false), layer("vein", true)];
        let kinds = [
            EventKind::Contact { layer: 0 },
            EventKind::Puncture { layer: 0 },
            EventKind::Contact { layer: 1 },
            EventKind::Contact { layer: 2 },
            EventKind::Puncture { layer: 2 },
            EventKind::Exit { layer: 2 },
            EventKind::Exit { layer: 1 },
            EventKind::Exit { layer: 0 },
        ];
        let events: Vec<Event> = (0..).zip(kinds).map(|(at, kind)| Event { tick: 10 * at, kind }).collect();
        let at: Vec<Option<usize>> = (0..8).map(|n| layer_at(&events, (0, 10 * n + 5), &layers)).collect();
        // Pressing on a wall is not being in it.
        let expected = [None, Some(0), Some(1), Some(1), Some(2), Some(1), Some(0), None];
        assert_eq!(at, expected);
    }
}
