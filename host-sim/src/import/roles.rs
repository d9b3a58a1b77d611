//! Which column is what: told by `--column`, else from the names that people give.

use super::table::{Column, Log};
use super::units::{self, Quantity, Unit};
use crate::failure::Failure;
use std::fmt;

/// What a column of a recording may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Time stamps.
    Time,
    /// What was sent to the drive.
    Command,
    /// The coordinate.
    Position,
    /// Its speed.
    Velocity,
    /// What a position loop was asked to follow.
    Reference,
    /// Inclination below the horizontal.
    Tilt,
    /// A measured external load.
    Force,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Time, Self::Command, Self::Position, Self::Velocity, Self::Reference, Self::Tilt, Self::Force];

    /// As `--column` has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Command => "command",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Reference => "reference",
            Self::Tilt => "tilt",
            Self::Force => "force",
        }
    }

    /// What its unit may measure.
    fn takes(self, quantity: Quantity) -> bool {
        use Quantity as Q;
        match self {
            Self::Time => quantity == Q::Time,
            Self::Command => !matches!(quantity, Q::Time | Q::Counts),
            Self::Position | Self::Reference => matches!(quantity, Q::Angle | Q::Length | Q::Counts),
            Self::Velocity => matches!(quantity, Q::AngularSpeed | Q::Speed),
            Self::Tilt => quantity == Q::Angle,
            Self::Force => matches!(quantity, Q::Torque | Q::Force),
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

/// One `--column ROLE=NAME[:UNIT]`; a minus before the name turns the sign.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Which role.
    pub role: Role,
    /// The column's name, or its number from 1.
    pub name: String,
    /// Its unit, where given.
    pub unit: Option<Unit>,
}

/// Reads one `--column`.
pub fn choice(text: &str) -> Result<Choice, Failure> {
    let form = "give it as --column position=theta:deg";
    let Some((role, name)) = text.split_once('=') else {
        return Err(Failure::input(format_args!("--column {text}: says no role; {form}")));
    };
    let Some(role) = Role::ALL.into_iter().find(|known| known.name() == role.trim()) else {
        let known: Vec<&str> = Role::ALL.iter().map(|r| r.name()).collect();
        return Err(Failure::input(format_args!(
            "--column {text}: \"{role}\" is no role; use one of {}",
            known.join(", ")
        )));
    };
    let (name, unit) = match name.rsplit_once(':') {
        Some((before, unit)) if !before.is_empty() => match units::parse(unit) {
            Some(unit) => (before, Some(unit)),
            None => {
                return Err(Failure::input(format_args!(
                    "--column {text}: \"{unit}\" is no unit that is known; use one of s, ms, us, ns, rad, deg, rev, counts, m, mm, rad/s, deg/s, rpm, m/s, mm/s, A, mA, V, Nm, mNm, N, dac"
                )));
            }
        },
        _ => (name, None),
    };
    if let Some(unit) = unit
        && !role.takes(unit.quantity)
    {
        return Err(Failure::input(format_args!(
            "--column {text}: a {role} is not measured in {}; correct the unit",
            unit.quantity.unit()
        )));
    }
    Ok(Choice { role, name: name.to_owned(), unit })
}

/// A column that was chosen, with what is to be done to it.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    /// Index of the log and of its table, and the column there.
    pub at: (usize, usize, usize),
    /// Its unit, where known.
    pub unit: Option<Unit>,
    /// −1 where the sign is to be turned.
    pub sign: f64,
}

/// A role that a name suggests, and how good a match it is: 0 is the best.
fn suggested(column: &Column) -> Option<(Role, u32)> {
    let words = units::words(&column.plain);
    let has = |list: &str| words.iter().any(|word| list.split(' ').any(|known| known == word));
    let is = |list: &str| words.len() == 1 && has(list);
    if has("error err std var variance acceleration acc accel ddot qdd ddq temperature temp index") {
        return None;
    }
    let effort = has("torque tau effort current iq strom voltage volt volts pwm duty moment") || is("i");
    let position =
        has("position pos angle theta phi q x enc encoder count counts ticks weg winkel travel displacement");
    let velocity = has("velocity vel speed omega rpm dot qd dq v w geschwindigkeit drehzahl");
    let wanted = has("reference ref setpoint set target desired des demand demanded goal soll");
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
    match of_motion {
        Some(Quantity::Angle | Quantity::Length | Quantity::Counts) => Some((Role::Position, 4)),
        Some(Quantity::Current | Quantity::Voltage) => Some((Role::Command, 4)),
        _ => None,
    }
}

/// Every column, as errors list it.
fn listed(logs: &[Log]) -> String {
    let mut names: Vec<&str> = logs
        .iter()
        .flat_map(|l| &l.tables)
        .flat_map(|t| &t.columns)
        .map(|c| c.name.as_str())
        .filter(|n| !n.is_empty())
        .collect();
    names.dedup();
    let more = names.len().saturating_sub(24);
    names.truncate(24);
    format!("{}{}", names.join(", "), if more > 0 { format!(" and {more} more") } else { String::new() })
}

fn columns(logs: &[Log]) -> impl Iterator<Item = ((usize, usize, usize), &Column)> {
    logs.iter().enumerate().flat_map(|(l, log)| {
        log.tables.iter().enumerate().flat_map(move |(t, table)| {
            table.columns.iter().enumerate().map(move |(c, column)| ((l, t, c), column))
        })
    })
}

fn find(logs: &[Log], wanted: &str) -> Option<(usize, usize, usize)> {
    let by = |same: &dyn Fn(&Column) -> bool| columns(logs).find(|(_, c)| same(c)).map(|(at, _)| at);
    by(&|c| c.name == wanted)
        .or_else(|| by(&|c| c.name.eq_ignore_ascii_case(wanted) || c.plain == wanted))
        .or_else(|| by(&|c| c.name.rsplit('.').next() == Some(wanted)))
        .or_else(|| {
            let number: usize = wanted.parse().ok()?;
            columns(logs).nth(number.checked_sub(1)?).map(|(at, _)| at)
        })
}

/// The column of a role: the one that was said, else the one whose name fits best; an error where two fit alike.
pub(super) fn choose(logs: &[Log], role: Role, choices: &[Choice]) -> Result<Option<Chosen>, Failure> {
    let files: Vec<&str> = logs.iter().map(|l| l.file.as_str()).collect();
    let unit_of = |at: (usize, usize, usize)| logs[at.0].tables[at.1].columns[at.2].unit;
    if let Some(said) = choices.iter().find(|c| c.role == role) {
        let turned = said.name.strip_prefix('-');
        let (at, sign) = match (find(logs, &said.name), turned) {
            (Some(at), _) => (at, 1.0),
            (None, Some(name)) => (find(logs, name).ok_or_else(|| nowhere(&files, name, logs))?, -1.0),
            (None, None) => return Err(nowhere(&files, &said.name, logs)),
        };
        let unit = said.unit.or(unit_of(at).filter(|u| role.takes(u.quantity)));
        return Ok(Some(Chosen { at, unit, sign }));
    }
    let taken: Vec<_> = choices.iter().filter_map(|c| find(logs, c.name.trim_start_matches('-'))).collect();
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
            Err(Failure::input(format_args!(
                "{}: {} and {} could both be the {role}; say which with --column {role}={}",
                files.join(", "),
                a.2.name,
                b.2.name,
                a.2.name
            )))
        }
        [first, ..] => {
            Ok(Some(Chosen { at: first.1, unit: first.2.unit.filter(|u| role.takes(u.quantity)), sign: 1.0 }))
        }
    }
}

fn nowhere(files: &[&str], name: &str, logs: &[Log]) -> Failure {
    Failure::input(format_args!(
        "{}: has no column \"{name}\"; its columns are {}",
        files.join(", "),
        listed(logs)
    ))
}

/// Which role could not be filled, with what there is.
pub(super) fn missing(logs: &[Log], role: Role) -> Failure {
    let files: Vec<&str> = logs.iter().map(|l| l.file.as_str()).collect();
    Failure::input(format_args!(
        "{}: none of its columns is known as the {role}; say which with --column {role}=NAME[:UNIT]; its columns are {}",
        files.join(", "),
        listed(logs)
    ))
}
