//! From chosen columns to rows on one clock, in the contract's units.

use super::role::Role;
use super::roles::{self, Choice, Chosen};
use super::table::{ColumnTable, Log};
use super::units::{Quantity, Unit};
use device_sim::error::Error;
use std::collections::{BTreeMap, BTreeSet};

/// A recording in SI units; the position is in `position_unit`. All columns have the same length.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// s since `origin`, in any order yet.
    pub time: Vec<f64>,
    /// Zero of the time, s: a date since 1970, or 0 where the clock begins with the recording.
    pub origin: f64,
    /// Every other column that was found; NaN where the file has nothing.
    pub columns: BTreeMap<Role, Vec<f64>>,
    /// The quantity of position and reference.
    pub position: Quantity,
    /// The quantity of the command, and that of the reference.
    pub command: Quantity,
    /// The quantity of the reference.
    pub reference: Quantity,
}

/// The caller's knowledge in addition to the columns.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known {
    /// Rows per second, if no column gives the time.
    pub rate_hz: Option<f64>,
    /// True if nothing drives the axis: the command is zero.
    pub undriven: bool,
}

/// Median of the steps of a clock that are above zero.
pub(super) fn median_step(time: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
}

/// The unit of a clock that does not say it, from its usual step; an error where that could be two.
fn unit_of_clock(name: &str, time: &[f64], notes: &mut Vec<String>) -> Result<f64, Error> {
    let Some(step) = median_step(time) else {
        return Err(Error::input(format_args!(
            "the time column {name} never increases; choose another with --column time=NAME:s"
        )));
    };
    let (factor, unit) = match step {
        d if d < 0.2 => (1.0, "s"),
        d if d < 20.0 => (1e-3, "ms"),
        d if d < 100.0 => {
            return Err(Error::input(format_args!(
                "the time column {name} has steps of {d}, which could be ms or µs; say which with {} or {}",
                roles::option(Role::Time, name, Some("ms")),
                roles::option(Role::Time, name, Some("us"))
            )));
        }
        d if d < 1e5 => (1e-6, "us"),
        _ => (1e-9, "ns"),
    };
    if unit != "s" {
        notes.push(format!(
            "time {name} taken as {unit}, for its steps of {step}; {} says another",
            roles::option(Role::Time, name, Some("UNIT"))
        ));
    }
    Ok(factor)
}

/// The clock of a table, in s, and its zero.
fn clock(
    table: &ColumnTable,
    choices: &[Choice],
    several: bool,
    known: Known,
    notes: &mut Vec<String>,
) -> Result<(Vec<f64>, f64), Error> {
    let said = choices.iter().find(|c| c.role == Role::Time);
    let alone = [Log { file: table.name.clone(), tables: vec![table.clone()], notes: Vec::new() }];
    let logged = table.columns.iter().position(|c| c.name == "log_time");
    let chosen = match (said, logged) {
        // Topics stamp their messages by clocks of their own; the log has one.
        (None, Some(at)) if several => {
            Some(Chosen { at: (0, 0, at), unit: table.columns[at].unit, sign: 1.0 })
        }
        _ => roles::choose(&alone, Role::Time, choices)?,
    };
    let Some(chosen) = chosen else {
        let Some(rate) = known.rate_hz else {
            return Err(Error::input(format_args!(
                "{}; or give --rate HZ where its rows are evenly spaced",
                roles::missing(&alone, Role::Time)
            )));
        };
        notes.push(format!("no column for the time: {rate} rows a second, as --rate says"));
        return Ok(((0..table.rows()).map(|row| row as f64 / rate).collect(), 0.0));
    };
    let column = &table.columns[chosen.at.2];
    // Before scaling: digits of a date since 1970 are scarce.
    let first = column.values.iter().copied().find(|t| t.is_finite()).unwrap_or(0.0);
    let origin = if first.abs() > 1e8 { first } else { 0.0 };
    let time: Vec<f64> = column.values.iter().map(|t| t - origin).collect();
    let factor = match chosen.unit {
        Some(Unit { factor, .. }) => factor,
        None => unit_of_clock(&column.name, &time, notes)?,
    };
    Ok((time.into_iter().map(|t| t * factor).collect(), origin * factor))
}

fn find_all(logs: &[Log], choices: &[Choice]) -> Result<BTreeMap<Role, Chosen>, Error> {
    let mut found = BTreeMap::new();
    for role in Role::ALL.into_iter().filter(|r| *r != Role::Time) {
        if let Some(chosen) = roles::choose(logs, role, choices)? {
            found.insert(role, chosen);
        }
    }
    Ok(found)
}

/// True if these files alone have what a recording needs.
pub(super) fn is_whole(logs: &[Log], choices: &[Choice], known: Known) -> bool {
    find_all(logs, choices).is_ok_and(|found| {
        (found.contains_key(&Role::Position) || found.contains_key(&Role::Velocity))
            && (found.contains_key(&Role::Command) || known.undriven)
    })
}

/// Returns the rows of a recording whose columns are in `logs`.
pub(super) fn gather(
    logs: &[Log],
    choices: &[Choice],
    known: Known,
    notes: &mut Vec<String>,
) -> Result<Rows, Error> {
    let mut found = find_all(logs, choices)?;
    let said = |role: Role| choices.iter().any(|c| c.role == role);
    // Everything that only a person can know is asked at once.
    let mut questions = missing(logs, &found, known);
    if !said(Role::Velocity) {
        leave_out_velocity(logs, &mut found, notes);
    }
    let units = units(logs, &mut found, &said, &mut questions, notes);
    if !questions.is_empty() {
        return Err(Error::input(questions.join("; and ")));
    }
    let base = if found.contains_key(&Role::Position) { Role::Position } else { Role::Velocity };
    let base = found[&base].clone();
    let tables = found.values().map(|chosen| (chosen.at.0, chosen.at.1)).collect();
    let clocks = clocks(logs, &tables, choices, known, notes)?;
    if clocks.len() > 1 {
        notes.push(format!(
            "columns of {} tables put on the clock of {}: each holds until its next value",
            clocks.len(),
            logs[base.at.0].tables[base.at.1].name
        ));
    }
    let (time, origin) = clocks[&(base.at.0, base.at.1)].clone();
    let mut rows = Rows {
        time,
        origin,
        columns: BTreeMap::new(),
        position: Quantity::Counts,
        command: Quantity::Plain,
        reference: Quantity::Counts,
    };
    for (role, chosen) in &found {
        let column = column(logs, chosen);
        let unit = units[role];
        rows.set_quantity(*role, unit.quantity, found.contains_key(&Role::Position));
        let scaled: Vec<f64> = column.values.iter().map(|x| chosen.sign * unit.factor * x).collect();
        let at = (chosen.at.0, chosen.at.1);
        let values = if at == (base.at.0, base.at.1) {
            scaled
        } else {
            held(&since(&clocks[&at], origin), &scaled, &rows.time)
        };
        let turned = if chosen.sign < 0.0 { ", its sign turned" } else { "" };
        notes.push(format!("{role} is {}, in {}{turned}", column.name, said_unit(*role, unit)));
        rows.columns.insert(*role, values);
    }
    if known.undriven && !rows.columns.contains_key(&Role::Command) {
        rows.columns.insert(Role::Command, vec![0.0; rows.time.len()]);
        notes.push("the command is zero throughout, as --undriven says".into());
    }
    Ok(rows)
}

/// Leaves out a velocity if there is a position: most velocities are differences of the position,
/// not measurements.
fn leave_out_velocity(logs: &[Log], found: &mut BTreeMap<Role, Chosen>, notes: &mut Vec<String>) {
    if found.contains_key(&Role::Position)
        && let Some(left) = found.remove(&Role::Velocity)
    {
        let name = &column(logs, &left).name;
        notes.push(format!(
            "{name} left out: give {} only where a sensor of its own measured it",
            roles::option(Role::Velocity, name, None)
        ));
    }
}

/// The clock of each table, by the places of file and table, and its zero.
type Clocks = BTreeMap<(usize, usize), (Vec<f64>, f64)>;

fn clocks(
    logs: &[Log],
    tables: &BTreeSet<(usize, usize)>,
    choices: &[Choice],
    known: Known,
    notes: &mut Vec<String>,
) -> Result<Clocks, Error> {
    let several = tables.len() > 1;
    let one =
        |at: &(usize, usize)| Ok((*at, clock(&logs[at.0].tables[at.1], choices, several, known, notes)?));
    tables.iter().map(one).collect()
}

/// Questions for what no column gives.
fn missing(logs: &[Log], found: &BTreeMap<Role, Chosen>, known: Known) -> Vec<String> {
    let mut questions = Vec::new();
    if !found.contains_key(&Role::Position) && !found.contains_key(&Role::Velocity) {
        questions.push(roles::missing(logs, Role::Position).to_string());
    }
    if !found.contains_key(&Role::Command) && !known.undriven {
        questions.push(format!(
            "{}; or give --undriven where nothing drives the axis",
            roles::missing(logs, Role::Command)
        ));
    }
    questions
}

impl Rows {
    /// Stores the quantity of a column. If no column is a position, a velocity gives the quantity
    /// of the position.
    fn set_quantity(&mut self, role: Role, quantity: Quantity, has_position: bool) {
        match role {
            Role::Position => self.position = quantity,
            Role::Velocity if self.position == Quantity::Counts && !has_position => {
                self.position = if quantity == Quantity::Speed { Quantity::Length } else { Quantity::Angle };
            }
            Role::Command => self.command = quantity,
            Role::Reference => self.reference = quantity,
            _ => {}
        }
    }
}

/// A clock counted from another's zero.
fn since((clock, zero): &(Vec<f64>, f64), origin: f64) -> Vec<f64> {
    clock.iter().map(|t| t + (zero - origin)).collect()
}

fn said_unit(role: Role, unit: Unit) -> String {
    let Unit { quantity, factor } = unit;
    match (role, factor == 1.0) {
        (Role::Command, true) if quantity == Quantity::Plain => "units of its own".into(),
        (_, true) => quantity.unit().into(),
        (_, false) => format!("{} after a factor of {factor:.6}", quantity.unit()),
    }
}

fn column<'a>(logs: &'a [Log], chosen: &Chosen) -> &'a super::table::Column {
    &logs[chosen.at.0].tables[chosen.at.1].columns[chosen.at.2]
}

/// The unit of every column that was found. A column that nobody asked for and that does not say
/// its unit is left out, and a reference is taken to have the position's; what only a person can
/// know becomes a question.
fn units(
    logs: &[Log],
    found: &mut BTreeMap<Role, Chosen>,
    said: &dyn Fn(Role) -> bool,
    questions: &mut Vec<String>,
    notes: &mut Vec<String>,
) -> BTreeMap<Role, Unit> {
    let mut units: BTreeMap<Role, Unit> = BTreeMap::new();
    let roles: Vec<Role> = found.keys().copied().collect();
    for role in roles {
        let chosen = &found[&role];
        let from = column(logs, chosen);
        if let Some(unit) = chosen.unit.or_else(|| own_unit(role, &from.name, &from.values, notes)) {
            units.insert(role, unit);
            continue;
        }
        let position = units.get(&Role::Position).copied();
        match role {
            Role::Reference if position.is_some() => {
                notes.push(format!("{} has no unit: taken to have the position's", from.name));
                units.extend(position.map(|unit| (role, unit)));
            }
            Role::Reference | Role::Tilt | Role::Force if !said(role) => {
                notes.push(format!(
                    "{} left out: it does not say its unit; {} takes it as the {role}",
                    from.name,
                    roles::option(role, &from.name, Some("UNIT"))
                ));
                found.remove(&role);
            }
            _ => questions.push(format!(
                "the {role} column {} does not say its unit; say it with {}, in {}",
                from.name,
                roles::option(role, &from.name, Some("UNIT")),
                usual_units(role)
            )),
        }
    }
    units
}

/// The unit of a column that does not say it, where it follows from the role or the values.
fn own_unit(role: Role, name: &str, values: &[f64], notes: &mut Vec<String>) -> Option<Unit> {
    let plain = |quantity| Some(Unit { quantity, factor: 1.0 });
    let whole = || values.iter().filter(|x| x.is_finite()).all(|x| x.fract() == 0.0);
    let counts =
        |word: &String| ["count", "counts", "tick", "ticks", "enc", "encoder"].contains(&word.as_str());
    match role {
        Role::Command => {
            notes.push(format!(
                "{name} has no unit; {} says it, if it is A",
                roles::option(Role::Command, name, Some("A"))
            ));
            plain(Quantity::Plain)
        }
        Role::Position | Role::Reference if whole() && super::units::words(name).iter().any(counts) => {
            plain(Quantity::Counts)
        }
        _ => None,
    }
}

fn usual_units(role: Role) -> &'static str {
    match role {
        Role::Position | Role::Reference => "rad, deg, rev, counts, m or mm",
        Role::Velocity => "rad/s, deg/s, rpm, m/s or mm/s",
        Role::Tilt => "rad or deg",
        Role::Force => "Nm, mNm or N",
        Role::Time => "s, ms, us or ns",
        Role::Command => "A, V, Nm or N",
    }
}

/// The value of a slower or faster table at each of `times`: the last one before it.
fn held(clock: &[f64], values: &[f64], times: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> =
        (0..clock.len()).filter(|i| clock[*i].is_finite() && values[*i].is_finite()).collect();
    order.sort_by(|a, b| clock[*a].total_cmp(&clock[*b]));
    times
        .iter()
        .map(|t| {
            let after = order.partition_point(|i| clock[*i] <= *t);
            after.checked_sub(1).map_or(f64::NAN, |i| values[order[i]])
        })
        .collect()
}
