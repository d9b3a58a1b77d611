//! Which column is what: given by `--column`, else from the names that people give.

use super::role::Role;
use super::table::{Column, Log};
use super::units::{self, Quantity, Unit};
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
    fn column(&self, logs: &[Log]) -> Option<(Place, f64)> {
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
    {
        return Err(Error::input(format_args!(
            "--column {text}: a {role} is not measured in {}; correct the unit",
            unit.quantity.unit()
        )));
    }
    Ok(Choice { role, name: name.to_owned(), unit })
}

/// Index of a log, of a table in it and of a column there.
type Place = (usize, usize, usize);

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

/// The words of a column's own name: of a path, as structures and topics have them, the last part.
fn own_words(column: &Column) -> Vec<String> {
    column.plain.rsplit(['.', '/']).next().map(units::words).unwrap_or_default()
}

/// A role that a name suggests, and how good a match it is: 0 is the best.
fn suggested(column: &Column) -> Option<(Role, u32)> {
    let words = units::words(&column.plain);
    let has = |list: &str| words.iter().any(|word| list.split(' ').any(|known| known == word));
    let own = own_words(column);
    let is = |list: &str| own.len() == 1 && list.split(' ').any(|known| known == own[0]);
    if has("error err std var variance acceleration acc accel ddot qdd ddq temperature temp index") {
        return None;
    }
    let effort = has("torque tau effort current iq strom voltage volt volts pwm duty moment") || is("i");
    let position =
        has("position pos angle theta phi q x enc encoder count counts ticks weg winkel travel displacement");
    let velocity = has("velocity vel speed omega rpm dot qd dq v w geschwindigkeit drehzahl");
    let wanted = has("reference ref setpoint set target desired des demand demanded goal action soll");
    let ordered = has("command cmd commanded ctrl control input u");
    let measured = u32::from(has("measured meas actual act feedback fbk ist estimated est"));
    if column.unit.is_some_and(|u| u.quantity == Quantity::Time) && !position && !effort {
        return Some((Role::Time, if is("log_time") || words == ["log", "time"] { 3 } else { 0 }));
    }
    if is("t time timestamp stamp zeit seconds sec millis micros elapsed") || words == ["time", "s"] {
        return Some((Role::Time, 0));
    }
    if words.last().is_some_and(|w| ["time", "timestamp", "stamp"].contains(&w.as_str())) {
        return Some((Role::Time, 1));
    }
    let of_motion = column.unit.map(|u| u.quantity);
    if (wanted || ordered) && velocity && !position && !effort {
        return None;
    }
    if effort && (wanted || ordered) {
        return Some((Role::Command, 1));
    }
    if (wanted || (ordered && !is("u")))
        && (position || matches!(of_motion, Some(Quantity::Angle | Quantity::Length | Quantity::Counts)))
    {
        return Some((Role::Reference, 1));
    }
    if wanted && !effort {
        return Some((Role::Reference, 2));
    }
    if velocity && !effort || matches!(of_motion, Some(Quantity::AngularSpeed | Quantity::Speed)) {
        return Some((Role::Velocity, 1 + measured));
    }
    if has("tilt inclination incline neigung") {
        return Some((Role::Tilt, 1));
    }
    if ordered {
        return Some((Role::Command, 0));
    }
    if has("force load external ext loadcell kraft last") {
        return Some((Role::Force, 1));
    }
    if effort {
        return Some((Role::Command, 2 + measured));
    }
    if position {
        let exact = u32::from(!has("position pos"));
        return Some((Role::Position, 1 + exact));
    }
    by_unit(of_motion?)
}

/// The role of a column whose name says nothing.
fn by_unit(quantity: Quantity) -> Option<(Role, u32)> {
    match quantity {
        Quantity::Angle | Quantity::Length | Quantity::Counts => Some((Role::Position, 4)),
        Quantity::Current | Quantity::Voltage => Some((Role::Command, 4)),
        _ => None,
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
            .filter(|((log, ..), c)| *log == l && !c.name.is_empty())
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
fn handle(logs: &[Log], place: Place) -> String {
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

fn columns(logs: &[Log]) -> impl Iterator<Item = (Place, &Column)> {
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
/// two fit alike.
pub(super) fn choose(logs: &[Log], role: Role, choices: &[Choice]) -> Result<Option<Chosen>, Error> {
    let files: Vec<&str> = logs.iter().map(|l| l.file.as_str()).collect();
    let unit_of = |at: Place| logs[at.0].tables[at.1].columns[at.2].unit;
    if let Some(said) = choices.iter().find(|c| c.role == role) {
        if said.is_none(logs) {
            return Ok(None);
        }
        let (at, sign) = said.column(logs).ok_or_else(|| nowhere(&files, said, logs))?;
        let named = &logs[at.0].tables[at.1].columns[at.2].name;
        if said.name.trim_start_matches('-') == named && is_repeated(logs, at) {
            return Err(Error::input(format_args!(
                "{}: has several columns \"{named}\"; say which by its number, as in --column {role}={}; its columns are {}",
                logs[at.0].file,
                number(logs, at),
                listed(logs)
            )));
        }
        let unit = said.unit.or(unit_of(at).filter(|u| role.takes(u.quantity)));
        return Ok(Some(Chosen { at, unit, sign }));
    }
    let taken: Vec<_> = choices.iter().filter_map(|c| Some(c.column(logs)?.0)).collect();
    let mut fitting: Vec<_> = columns(logs)
        .filter(|(at, _)| !taken.contains(at))
        .filter_map(|(at, c)| suggested(c).filter(|s| s.0 == role).map(|s| (s.1, at, c)))
        .collect();
    fitting.sort_by_key(|f| f.0);
    match &fitting[..] {
        [] => Ok(None),
        [a, b, ..] if a.0 == b.0 && role != Role::Time && role != Role::Velocity => {
            // What may be left out is not worth a question.
            if matches!(role, Role::Reference | Role::Tilt | Role::Force) {
                return Ok(None);
            }
            Err(Error::input(format_args!(
                "{}: {} and {} could both be the {role}; say which with {}",
                files.join(", "),
                a.2.name,
                b.2.name,
                option(role, &handle(logs, a.1), None)
            )))
        }
        [first, ..] => {
            Ok(Some(Chosen { at: first.1, unit: first.2.unit.filter(|u| role.takes(u.quantity)), sign: 1.0 }))
        }
    }
}

/// `--column ROLE=NAME[:UNIT]`, quoted for a shell where it has to be.
pub(super) fn option(role: Role, name: &str, unit: Option<&str>) -> String {
    let unit = unit.map_or(String::new(), |unit| format!(":{unit}"));
    format!("--column {}", quoted(&format!("{role}={name}{unit}")))
}

fn nowhere(files: &[&str], choice: &Choice, logs: &[Log]) -> Error {
    let name = choice.name.trim_start_matches('-');
    let unit = match name.rsplit_once(':') {
        Some((_, unit)) => format!(
            ", or {unit} is not a unit (units are s, ms, us, ns, rad, deg, rev, counts, m, mm, rad/s, deg/s, rpm, m/s, mm/s, A, mA, V, Nm, mNm, N, dac)"
        ),
        None => String::new(),
    };
    Error::input(format_args!(
        "{}: has no column \"{name}\"; its columns are {}{unit}",
        files.join(", "),
        listed(logs)
    ))
}

/// Which role could not be filled, with what there is.
pub(super) fn missing(logs: &[Log], role: Role) -> Error {
    let files: Vec<&str> = logs.iter().map(|l| l.file.as_str()).collect();
    Error::input(format_args!(
        "{}: no column is known to be the {role}; say which with --column {role}=NAME[:UNIT]; its columns are {}",
        files.join(", "),
        listed(logs)
    ))
}
