//! The axes of a machine that one log holds.

use super::role::Role;
use super::roles::{Choice, Place, columns, handle};
use super::suggestion::{Axes, numbered, suggested};
use super::table::{Column, Log};
use device_sim::error::Error;

/// One axis: the name of its folder, and the choices that give its columns.
pub(super) struct Axis {
    pub name: String,
    pub columns: Vec<Choice>,
}

/// Returns the axes of the first of `logs`: one for each position that `choices` give, else for
/// each column that could be the position. A choice of a column of another axis is left out.
pub(super) fn axes(logs: &[Log], choices: &[Choice]) -> Result<Vec<Axis>, Error> {
    let logs = &logs[..logs.len().min(1)];
    let labels = Axes::new(columns(logs).map(|(_, column)| column));
    let positions = positions(logs, choices);
    if positions.len() < 2 {
        return Err(Error::input(format_args!(
            "{}: --axes finds {} axis by its columns' names; leave it out, or give each axis with --column position=NAME",
            logs.first().map_or("", |log| log.file.as_str()),
            if positions.is_empty() { "no" } else { "one" }
        )));
    }
    let column = |at: Place| &logs[at.0].tables[at.1].columns[at.2];
    let names: Vec<String> = positions.iter().map(|(at, _)| name(&labels, column(*at))).collect();
    if let Some((i, k)) =
        (0..names.len()).flat_map(|k| (0..k).map(move |i| (i, k))).find(|(i, k)| names[*i] == names[*k])
    {
        let [a, b] = [i, k].map(|i| handle(logs, positions[i].0));
        return Err(Error::input(format_args!(
            "{}: {a} and {b} could both be the position of axis {}; give each axis with --column position=NAME",
            logs[0].file, names[i]
        )));
    }
    let of_axis = |at: Place, choice: &&Choice| {
        choice.role != Role::Position
            && choice.column(logs).is_none_or(|(other, _)| !labels.differ(column(other), column(at)))
    };
    let axis = |((at, position), name): ((Place, Choice), String)| {
        let mut columns = vec![position];
        columns.extend(choices.iter().filter(|choice| of_axis(at, choice)).cloned());
        if columns.iter().all(|choice| choice.role != Role::Command) {
            columns.extend(numbered_command(logs, &labels, at));
        }
        Axis { name, columns }
    };
    Ok(positions.into_iter().zip(names).map(axis).collect())
}

/// The positions of the axes, with the choices that give them.
fn positions(logs: &[Log], choices: &[Choice]) -> Vec<(Place, Choice)> {
    let given = choices.iter().filter(|choice| choice.role == Role::Position);
    let given: Vec<_> = given.filter_map(|choice| Some((choice.column(logs)?.0, choice.clone()))).collect();
    if !given.is_empty() {
        return given;
    }
    let fitting: Vec<(u32, Place)> = columns(logs)
        .filter(|(_, column)| column.has_numbers())
        .filter_map(|(at, column)| numbered(column).filter(|s| s.0 == Role::Position).map(|s| (s.1, at)))
        .collect();
    let best = fitting.iter().map(|(rank, _)| *rank).min();
    let choice = |at| Choice { role: Role::Position, name: handle(logs, at), unit: None };
    fitting.iter().filter(|(rank, _)| Some(*rank) == best).map(|(_, at)| (*at, choice(*at))).collect()
}

/// The one command of the axis at a place whose name says so but for its number, as `tau1` does.
fn numbered_command(logs: &[Log], labels: &Axes, at: Place) -> Option<Choice> {
    let position = &logs[at.0].tables[at.1].columns[at.2];
    let is_command = |column: &Column| {
        let role = |found: Option<(Role, u32)>| found.map(|(role, _)| role);
        role(numbered(column)) == Some(Role::Command) && role(suggested(column)).is_none()
    };
    let mut found =
        columns(logs).filter(|(_, column)| is_command(column) && !labels.differ(column, position));
    let (command, _) = found.next()?;
    let choice = Choice { role: Role::Command, name: handle(logs, command), unit: None };
    found.next().is_none().then_some(choice)
}

/// The name of a column's axis, for a folder.
fn name(labels: &Axes, column: &Column) -> String {
    let label = labels.name(column);
    if label.is_empty() {
        return column.plain.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
    }
    if label.bytes().all(|c| c.is_ascii_digit()) { format!("axis-{label}") } else { label }
}
