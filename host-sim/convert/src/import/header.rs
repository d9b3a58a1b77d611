//! The names and units of a text's columns: from the lines above the numbers, a comment, or pairs
//! of keys and values as scopes export them.

use super::layout::{Layout, Lines};
use super::units::{self, Written};

/// The text above the rows of numbers.
#[derive(Clone, Copy)]
pub(super) struct Above<'a> {
    /// Lines with their numbers.
    pub lines: &'a [(usize, &'a str)],
    /// Comments with the count of lines before each.
    pub comments: &'a Lines<'a>,
}

/// Names, none where they are made up, and units of their own.
type Names = Vec<(Option<String>, Option<Written>)>;

/// The names of the columns with the units of a row of their own: from the lines above the numbers,
/// else from the last comment of as many words, else made up.
pub(super) fn names(above: Above, layout: Layout, notes: &mut Vec<String>) -> Names {
    let count = layout.count;
    if let Some(names) = keys_and_values(above, layout) {
        notes.push(format!(
            "{} lines above the numbers: names and units were taken from them",
            above.lines.len()
        ));
        return names;
    }
    let fitting = |line: &str| -> Option<Vec<String>> {
        let mut row: Vec<String> = trimmed(&layout.fields(line));
        // A separator at the end of the rows of numbers only.
        if row.len() + 1 == count {
            row.push(String::new());
        }
        (row.len() == count).then_some(row)
    };
    let rows: Vec<Vec<String>> = above.lines.iter().rev().map_while(|(_, line)| fitting(line)).collect();
    let is_units = |row: &[String]| {
        row.iter().any(|f| units::written(f).is_some())
            && row.iter().all(|f| f.is_empty() || units::written(f).is_some())
    };
    let (names, own_units, used) = match &rows[..] {
        [below, names, ..] if is_units(below) => (Some(names.clone()), Some(below.clone()), 2),
        [names, ..] => (Some(names.clone()), None, 1),
        [] => (None, None, 0),
    };
    if above.lines.len() > used {
        notes.push(format!("{} lines above the header left out", above.lines.len() - used));
    }
    let from_comment = || {
        let (_, comment) = above.comments.iter().rev().find(|(before, _)| *before <= above.lines.len())?;
        let by_words: Vec<String> = comment.split_whitespace().map(str::to_owned).collect();
        fitting(comment).or_else(|| (by_words.len() == count).then_some(by_words))
    };
    let Some(names) = names.or_else(from_comment) else {
        notes.push(format!("no header: the columns are called column1 to column{count}"));
        return vec![(None, None); count];
    };
    let unit_of = |i: usize| own_units.as_ref().and_then(|u| units::written(&u[i]));
    names.into_iter().enumerate().map(|(i, name)| (Some(name), unit_of(i))).collect()
}

fn trimmed(row: &[&str]) -> Vec<String> {
    row.iter().map(|f| f.trim().trim_matches('"').trim().to_owned()).collect()
}

/// Names and units from lines such as `Name;torque;Name;angle` above pairs of a clock and a
/// channel.
fn keys_and_values(above: Above, layout: Layout) -> Option<Names> {
    if !layout.count.is_multiple_of(2) || layout.count < 2 {
        return None;
    }
    let rows: Vec<Vec<String>> = above.lines.iter().map(|(_, line)| trimmed(&layout.fields(line))).collect();
    let is_keyed = |row: &&Vec<String>| {
        row.len() == layout.count && row.iter().step_by(2).all(|key| !key.is_empty() && *key == row[0])
    };
    let keyed: Vec<&Vec<String>> = rows.iter().filter(is_keyed).collect();
    let by_key = |wanted: &[&str]| {
        keyed.iter().find(|row| wanted.iter().any(|key| row[0].to_lowercase().starts_with(key)))
    };
    let names = by_key(&["name", "channel", "signal"]).filter(|_| layout.count > 2 && keyed.len() > 1)?;
    let units = by_key(&["unit"]);
    // `SampleTime[ms]` has the unit of the clocks.
    let clock = by_key(&["sampletime", "sample time", "time"]).and_then(|row| units::split_name(&row[0]).1);
    let channel = |i: usize| {
        if i.is_multiple_of(2) {
            return (Some(format!("time of {}", names[i + 1])), clock.clone());
        }
        (Some(names[i].clone()), units.and_then(|row| units::written(&row[i])))
    };
    Some((0..layout.count).map(channel).collect())
}
