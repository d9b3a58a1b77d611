//! Which column is what: given by `--column`, else from the names that people give.

use super::role::Role;
use super::suggestion::{Axes, is_error, suggested};
use super::table::{Column, Log};
use super::units::{self, Unit};
use crate::shell::quoted;
use device_sim::error::Error;
use std::path::Path;

/// One `--column ROLE=NAME[:UNIT]`; a minus before the name turns the sign.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Which role.
    pub role: Role,
    /// The column's name, its number from 1, either of them after `FILE/`, or `none`.
    pub name: String,
    /// Its unit, where given.
    pub unit: Option<Unit>,
}

impl Choice {
    /// The column that it names and the sign that it gives; `None` where it names no column of
    /// `logs`.
    pub(super) fn column(&self, logs: &[Log]) -> Option<(Place, f64)> {
        let turned = || Some((find(logs, self.name.strip_prefix('-')?)?, -1.0));
        find(logs, &self.name).map(|at| (at, 1.0)).or_else(turned)
    }

    /// True if the role is to stay empty: `none`, where no column is called so.
    fn is_none(&self, logs: &[Log]) -> bool {
        self.name == "none" && find(logs, "none").is_none()
    }

    /// True if the name says in which of several files its column is.
    pub(super) fn names_a_file(&self, logs: &[Log]) -> bool {
        let name = self.name.strip_prefix('-').unwrap_or(&self.name);
        find_in_any(logs, name).is_none() && find_in_file(logs, name).is_some()
    }
}

/// Advice where a log has no command.
const NO_COMMAND: &str = "a position or a speed is no command: where a position loop ran, --error-as-command takes reference − position as the command";

/// Reads one `--column`.
pub fn choice(text: &str) -> Result<Choice, Error> {
    let form = "give it as --column position=theta:deg";
    let Some((role, name)) = text.split_once('=') else {
        return Err(Error::input(format_args!("--column {text}: says no role; {form}")));
    };
    let Some(role) = Role::ALL.into_iter().find(|known| known.name() == role.trim()) else {
        let known: Vec<&str> = Role::ALL.iter().map(|r| r.name()).collect();
        return Err(Error::input(format_args!(
            "--column {text}: \"{role}\" is not a role; use one of {}",
            known.join(", ")
        )));
    };
    let (name, unit) = match name.rsplit_once(':') {
        Some((before, unit)) if !before.is_empty() => match units::parse(unit) {
            Some(unit) => (before, Some(unit)),
            // A name may hold a colon; `nowhere` says which units there are where it does not.
            None => (name, None),
        },
        _ => (name, None),
    };
    if let Some(unit) = unit
        && !role.takes(unit.quantity)
        && !(role == Role::Command && is_error(name))
    {
        return Err(Error::input(format_args!(
            "--column {text}: a {role} is not measured in {}; {}",
            unit.quantity.unit(),
            if role == Role::Command { NO_COMMAND } else { "correct the unit" }
        )));
    }
    Ok(Choice { role, name: name.to_owned(), unit })
}

/// Reads one `--clock ROLE=NAME[:UNIT]`.
pub fn clock_choice(text: &str) -> Result<Choice, Error> {
    let refused =
        |why: String| Error::input(format_args!("--clock {text}: {why}; give it as --clock command=t1:ms"));
    let said = choice(text).or_else(|cause| match text.rsplit_once(':') {
        Some((before, unit)) if units::parse(unit).is_some() => choice(before),
        _ => Err(cause),
    })?;
    let unit = text.rsplit_once(':').and_then(|(_, unit)| units::parse(unit));
    if unit.is_some_and(|unit| unit.quantity != units::Quantity::Time) || said.role == Role::Time {
        return Err(refused("a clock of a role other than time, in s, ms, us or ns, is wanted".into()));
    }
    Ok(Choice { unit, ..said })
}

/// The column with the clock that a person gave a role, with its unit.
pub(super) fn clock_of(
    logs: &[Log],
    clocks: &[Choice],
    role: Role,
) -> Result<Option<(Place, Option<Unit>)>, Error> {
    let Some(said) = clocks.iter().find(|c| c.role == role) else { return Ok(None) };
    let (at, _) = said.column(logs).ok_or_else(|| nowhere(said, logs))?;
    Ok(Some((at, said.unit.or(logs[at.0].tables[at.1].columns[at.2].unit))))
}

/// Index of a log, of a table in it and of a column there.
pub(super) type Place = (usize, usize, usize);

/// A column that was chosen, with what is to be done to it.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    /// Which column.
    pub at: Place,
    /// Its unit, where known.
    pub unit: Option<Unit>,
    /// −1 where the sign is to be turned.
    pub sign: f64,
}

impl Chosen {
    /// The column itself.
    pub(super) fn column<'a>(&self, logs: &'a [Log]) -> &'a Column {
        &logs[self.at.0].tables[self.at.1].columns[self.at.2]
    }
}

/// Every column, as errors list it: those that the file does not name with their first values,
/// those of several files by file.
fn listed(logs: &[Log]) -> String {
    let in_words = |place: Place, c: &Column| match c.is_named {
        false => format!("{} ({})", c.name, sample(&c.values)),
        true if is_repeated(logs, place) => format!("{} (column {})", c.name, number(logs, place)),
        true => c.name.clone(),
    };
    let of_log = |l: usize| {
        let mut names: Vec<String> = columns(logs)
            .filter(|((log, ..), c)| *log == l && !c.name.is_empty() && c.has_numbers())
            .map(|(place, c)| in_words(place, c))
            .collect();
        names.dedup();
        let more = names.len().saturating_sub(24);
        names.truncate(24);
        format!("{}{}", names.join(", "), if more > 0 { format!(" and {more} more") } else { String::new() })
    };
    if logs.len() == 1 {
        return of_log(0);
    }
    let each = logs.iter().enumerate().map(|(l, log)| format!("{} in {}", of_log(l), log.file));
    each.collect::<Vec<_>>().join(", ")
}

/// True if the table of a column has another of its name.
fn is_repeated(logs: &[Log], (log, table, column): Place) -> bool {
    let columns = &logs[log].tables[table].columns;
    columns.iter().filter(|c| c.name == columns[column].name).count() > 1
}

/// The name or, where the table has several of that name, the number by which `--column` finds a
/// column.
pub(super) fn handle(logs: &[Log], place: Place) -> String {
    let name = || logs[place.0].tables[place.1].columns[place.2].name.clone();
    if is_repeated(logs, place) { number(logs, place).to_string() } else { name() }
}

/// The number of a column from 1, by which `--column` may name it.
fn number(logs: &[Log], place: Place) -> usize {
    columns(logs).take_while(|(other, _)| *other != place).count() + 1
}

/// The first values of a column, as a person would know it by.
fn sample(values: &[f64]) -> String {
    let first: Vec<String> = values
        .iter()
        .filter(|x| x.is_finite())
        .take(3)
        .map(|x| format!("{}", (x * 1e6).round() / 1e6))
        .collect();
    format!("{}, …", first.join(", "))
}

pub(super) fn columns(logs: &[Log]) -> impl Iterator<Item = (Place, &Column)> {
    logs.iter().enumerate().flat_map(|(l, log)| {
        log.tables.iter().enumerate().flat_map(move |(t, table)| {
            table.columns.iter().enumerate().map(move |(c, column)| ((l, t, c), column))
        })
    })
}

fn find(logs: &[Log], wanted: &str) -> Option<Place> {
    find_in_any(logs, wanted).or_else(|| find_in_file(logs, wanted))
}

fn find_in_any(logs: &[Log], wanted: &str) -> Option<Place> {
    let by = |same: &dyn Fn(&Column) -> bool| columns(logs).find(|(_, c)| same(c)).map(|(at, _)| at);
    by(&|c| c.name == wanted)
        .or_else(|| by(&|c| c.name.eq_ignore_ascii_case(wanted) || c.plain == wanted))
        .or_else(|| by(&|c| c.name.rsplit('.').next() == Some(wanted)))
        .or_else(|| {
            let number: usize = wanted.parse().ok()?;
            columns(logs).nth(number.checked_sub(1)?).map(|(at, _)| at)
        })
}

/// The column that `FILE/NAME` means; the file by its name, with or without its folder and ending.
fn find_in_file(logs: &[Log], wanted: &str) -> Option<Place> {
    wanted.match_indices('/').find_map(|(slash, _)| {
        let (file, name) = (Path::new(&wanted[..slash]), &wanted[slash + 1..]);
        let log = logs.iter().position(|log| {
            let path = Path::new(&log.file);
            path.ends_with(file) || path.file_stem() == Some(file.as_os_str())
        })?;
        find_in_any(&logs[log..=log], name).map(|(_, table, column)| (log, table, column))
    })
}

/// Refuses choices that cannot all hold: a role given twice, or a column given two roles.
pub(super) fn check(logs: &[Log], choices: &[Choice]) -> Result<(), Error> {
    for (i, choice) in choices.iter().enumerate() {
        for before in &choices[..i] {
            let (role, name) = (choice.role, &choice.name);
            if before.role == role {
                return Err(Error::input(format_args!(
                    "--column gives the {role} twice, {} and {name}; leave one of them out",
                    before.name
                )));
            }
            let at = choice.column(logs).map(|c| c.0);
            if at.is_some() && at == before.column(logs).map(|c| c.0) {
                return Err(Error::input(format_args!(
                    "--column gives {name} two roles, {} and {role}; a column has one, and where files have columns of one name, say whose it is: {}",
                    before.role,
                    option(role, &format!("FILE/{name}"), None)
                )));
            }
        }
    }
    Ok(())
}

/// The column of a role: the one that was said, else the one whose name fits best; an error where
/// several fit alike. A column of another axis than that at `motion` does not fit.
pub(super) fn choose(
    logs: &[Log],
    role: Role,
    choices: &[Choice],
    motion: Option<Place>,
) -> Result<Option<Chosen>, Error> {
    if let Some(said) = choices.iter().find(|c| c.role == role) {
        return chosen(logs, said);
    }
    let taken: Vec<_> = choices.iter().filter_map(|c| Some(c.column(logs)?.0)).collect();
    let mut fitting: Vec<_> = columns(logs)
        .filter(|(at, c)| !taken.contains(at) && c.has_numbers())
        .filter_map(|(at, c)| suggested(c).filter(|s| s.0 == role).map(|s| (s.1, at, c)))
        .filter(|(_, _, c)| role != Role::Enabled || c.is_a_switch())
        .collect();
    if let Some((l, t, c)) = motion.filter(|_| fitting.len() > 1 || role != Role::Time) {
        let axes = Axes::new(columns(logs).map(|(_, c)| c));
        let moved = &logs[l].tables[t].columns[c];
        fitting.retain(|(_, _, c)| !axes.differ(c, moved));
    }
    // A cycle's length is no clock.
    fitting.sort_by_key(|f| (role == Role::Time && !f.2.rises(), f.0));
    let best = fitting.partition_point(|f| f.0 == fitting[0].0);
    match &fitting[..] {
        [] => Ok(None),
        [_, _, ..] if best > 1 && role != Role::Time && role != Role::Velocity => {
            // What may be left out is not worth a question.
            if !matches!(role, Role::Command | Role::Position) {
                return Ok(None);
            }
            let names: Vec<&str> = fitting[..best].iter().map(|f| f.2.name.as_str()).collect();
            let (last, others) = names.split_last().unwrap_or((&"", &[]));
            Err(Error::input(format_args!(
                "{}: {} and {last} could {} be the {role}; say which with {}",
                files(logs),
                others.join(", "),
                if best > 2 { "all" } else { "both" },
                option(role, &handle(logs, fitting[0].1), None)
            )))
        }
        [first, ..] => Ok(Some(Chosen { at: first.1, unit: first.2.unit, sign: 1.0 })),
    }
}

/// The column that a person named.
fn chosen(logs: &[Log], said: &Choice) -> Result<Option<Chosen>, Error> {
    let role = said.role;
    if said.is_none(logs) {
        return Ok(None);
    }
    let (at, sign) = said.column(logs).ok_or_else(|| nowhere(said, logs))?;
    let column = &logs[at.0].tables[at.1].columns[at.2];
    if said.name.trim_start_matches('-') == column.name && is_repeated(logs, at) {
        return Err(Error::input(format_args!(
            "{}: has several columns \"{}\"; say which by its number, as in --column {role}={}; its columns are {}",
            logs[at.0].file,
            column.name,
            number(logs, at),
            listed(logs)
        )));
    }
    if !column.has_numbers() {
        let (first, line, _) = column.unread.clone().unwrap_or_default();
        return Err(Error::input(format_args!(
            "{}: {} has no number (\"{first}\" in line {line}); choose another column for the {role}",
            logs[at.0].file, column.name
        )));
    }
    let is_of_motion = matches!(
        suggested(column),
        Some((Role::Position | Role::Reference | Role::Velocity | Role::Time, _))
    );
    if role == Role::Command && said.unit.is_none() && is_of_motion && column.is_named {
        return Err(Error::input(format_args!(
            "{}: {} seems to be a position, a speed or a time; {NO_COMMAND}, and {} takes it as it is",
            logs[at.0].file,
            column.name,
            option(role, &said.name, Some("A"))
        )));
    }
    let fits = |unit: &Unit| role.takes(unit.quantity) || role == Role::Command && is_error(&column.name);
    let unit = said.unit.or(column.unit.filter(fits));
    Ok(Some(Chosen { at, unit, sign }))
}

/// An error that a command follows the position as its target does.
pub(super) fn is_a_target(logs: &[Log], command: &Chosen) -> Error {
    let name = &command.column(logs).name;
    Error::input(format_args!(
        "{name} follows the position as its target does, so that it is hardly the command; give {} --error-as-command where a position loop ran, or {} if it is right",
        option(Role::Reference, name, None),
        option(Role::Command, name, Some("A"))
    ))
}

fn files(logs: &[Log]) -> String {
    logs.iter().map(|l| l.file.as_str()).collect::<Vec<_>>().join(", ")
}

/// `--column ROLE=NAME[:UNIT]`, quoted for a shell where it has to be.
pub(super) fn option(role: Role, name: &str, unit: Option<&str>) -> String {
    let unit = unit.map_or(String::new(), |unit| format!(":{unit}"));
    option_of("--column", role, &format!("{name}{unit}"))
}

/// `OPTION ROLE=VALUE`, quoted for a shell where it has to be.
pub(super) fn option_of(name: &str, role: Role, value: &str) -> String {
    format!("{name} {}", quoted(&format!("{role}={value}")))
}

fn nowhere(choice: &Choice, logs: &[Log]) -> Error {
    let name = choice.name.trim_start_matches('-');
    let unit = match name.rsplit_once(':') {
        Some((_, unit)) => format!(
            ", or {unit} is not a unit (units are s, ms, us, ns, rad, deg, rev, counts, m, mm, rad/s, deg/s, rpm, m/s, mm/s, A, mA, V, Nm, mNm, N, dac)"
        ),
        None => String::new(),
    };
    Error::input(format_args!(
        "{}: has no column \"{name}\"; its columns are {}{unit}",
        files(logs),
        listed(logs)
    ))
}

/// Which role could not be filled, with what there is.
pub(super) fn missing(logs: &[Log], role: Role) -> Error {
    let unread = columns(logs).find(|(_, c)| !c.has_numbers() && suggested(c).is_some_and(|s| s.0 == role));
    let unread = unread.and_then(|(_, c)| {
        let (first, line, _) = c.unread.as_ref()?;
        Some(format!(" ({} is not read as numbers: \"{first}\" in line {line})", c.name))
    });
    Error::input(format_args!(
        "{}: no column is known to be the {role}{}; say which with --column {role}=NAME[:UNIT]; its columns are {}",
        files(logs),
        unread.unwrap_or_default(),
        listed(logs)
    ))
}
