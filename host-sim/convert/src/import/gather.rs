//! From chosen columns to rows on one clock, in the contract's units.

use super::clocks::{self, Clock, Key};
use super::column_units::{said_unit, units};
use super::encodings::{self, Encoding, RoleEncoding};
use super::in_force::{self, Stamped};
use super::readings;
use super::role::Role;
use super::roles::{self, Choice, Chosen};
use super::rows::{Known, Rows};
use super::table::Log;
use super::units::{Quantity, Unit};
use device_sim::error::Error;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The options that say what the columns are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Said<'a> {
    /// `--column`.
    pub columns: &'a [Choice],
    /// `--clock`.
    pub clocks: &'a [Choice],
    /// `--encoding`.
    pub encodings: &'a [RoleEncoding],
    /// Rate or missing command.
    pub known: Known,
}

fn find_all(logs: &[Log], said: Said) -> Result<BTreeMap<Role, Chosen>, Error> {
    let mut found: BTreeMap<Role, Chosen> = BTreeMap::new();
    // The motion first: the others are of its axis.
    let motion = |role: &Role| !matches!(role, Role::Position | Role::Velocity);
    let (others, first): (Vec<Role>, Vec<Role>) = Role::ALL.into_iter().partition(motion);
    for role in first.into_iter().chain(others).filter(|r| *r != Role::Time) {
        if role == Role::Command && (said.known.undriven || said.known.error_as_command) {
            continue;
        }
        let of = if motion(&role) { found.get(&Role::Position).or(found.get(&Role::Velocity)) } else { None };
        let at = of.map(|chosen| chosen.at);
        if let Some(chosen) = roles::choose(logs, role, said.columns, at)? {
            found.insert(role, chosen);
        }
    }
    Ok(found)
}

/// True if these files alone have what a recording needs.
pub(super) fn is_whole(logs: &[Log], said: Said) -> bool {
    let has_command = |found: &BTreeMap<Role, Chosen>| {
        let wanted = if said.known.error_as_command { Role::Reference } else { Role::Command };
        found.contains_key(&wanted) || said.known.undriven
    };
    find_all(logs, said).is_ok_and(|found| {
        (found.contains_key(&Role::Position) || found.contains_key(&Role::Velocity)) && has_command(&found)
    })
}

/// Returns the rows of a recording whose columns are in `logs`.
pub(super) fn gather(logs: &[Log], said: Said, notes: &mut Vec<String>) -> Result<Rows, Error> {
    let mut found = find_all(logs, said)?;
    let is_said = |role: Role| said.columns.iter().any(|c| c.role == role);
    // Everything that only a person can know is asked at once.
    let mut questions = missing(logs, &found, said.known);
    leave_out_velocity(logs, &mut found, notes);
    let units = units(logs, &mut found, &is_said, &mut questions, notes);
    if !questions.is_empty() {
        return Err(Error::input(questions.join("; and ")));
    }
    let clocks = clocks(logs, &found, said, notes)?;
    let base = if found.contains_key(&Role::Position) { Role::Position } else { Role::Velocity };
    let (base_key, base_clock) = &clocks[&base];
    let motion = values(logs, base, &found[&base], said, notes)?;
    let kept: Vec<usize> =
        (0..motion.len()).filter(|i| base_clock.time[*i].is_finite() && motion[*i].is_finite()).collect();
    if kept.len() < motion.len() {
        notes.push(format!("{} rows without a time or a {base} left out", motion.len() - kept.len()));
    }
    let mut rows = Rows {
        time: kept.iter().map(|i| base_clock.time[*i]).collect(),
        origin: base_clock.origin,
        columns: BTreeMap::new(),
        position: Quantity::Counts,
        command: Quantity::Plain,
        reference: Quantity::Counts,
    };
    for (role, chosen) in &found {
        let unit = units[role];
        rows.set_quantity(*role, unit.quantity, found.contains_key(&Role::Position));
        let (key, clock) = &clocks[role];
        let raw = if *role == base { motion.clone() } else { values(logs, *role, chosen, said, notes)? };
        if key != base_key {
            check_overlap(chosen.column(logs).name.as_str(), clock, &rows)?;
        }
        let put = on_rows(&rows, (key == base_key).then_some(&kept[..]), &raw, clock, *role);
        let (sign, zero) =
            if *role == Role::Enabled && chosen.sign < 0.0 { (-1.0, 1.0) } else { (chosen.sign, 0.0) };
        let turned = if chosen.sign < 0.0 { ", its sign turned" } else { "" };
        notes.push(format!("{role} is {}, in {}{turned}", chosen.column(logs).name, said_unit(*role, unit)));
        rows.columns.insert(*role, put.into_iter().map(|x| zero + sign * unit.factor * x).collect());
    }
    if let (Some(chosen), Some(command)) = (found.get(&Role::Command), rows.columns.get(&Role::Command))
        && chosen.unit.is_none()
        && readings::follows(command, &kept.iter().map(|i| motion[*i]).collect::<Vec<_>>())
    {
        return Err(roles::is_a_target(logs, chosen));
    }
    rows.add_command(said.known, notes)?;
    readings::refuse_mixed_axes(&rows)?;
    Ok(rows)
}

/// The numbers of a column, decoded, without those that stand for none; a note on those that could
/// not be read.
fn values(
    logs: &[Log],
    role: Role,
    chosen: &Chosen,
    said: Said,
    notes: &mut Vec<String>,
) -> Result<Vec<f64>, Error> {
    let column = chosen.column(logs);
    if let Some((first, line, count)) = &column.unread {
        notes.push(format!(
            "{count} values of {} could not be read, the first \"{first}\" in line {line}",
            column.name
        ));
    }
    let values = readings::without_sentinels(role, &column.values, notes);
    match said.encodings.iter().find(|e| e.role == role) {
        Some(RoleEncoding { encoding, .. }) => {
            if *encoding != Encoding::Plain {
                notes.push(format!("{} decoded, as --encoding says", column.name));
            }
            Ok(values.into_iter().map(|x| encoding.decoded(x)).collect())
        }
        None => encodings::ask(role, &column.name, &values).map(|()| values),
    }
}

/// A column put on rows: by their places in the table where both have one clock, else by time.
fn on_rows(rows: &Rows, places: Option<&[usize]>, raw: &[f64], clock: &Clock, role: Role) -> Vec<f64> {
    let later = if places.is_some() { 0.0 } else { clock.origin - rows.origin };
    let stamp = |i: usize| {
        let time = clock.time[i] + later;
        Stamped { key: if places.is_some() { i as f64 } else { time }, time, value: raw[i] }
    };
    let is_there = |i: &usize| clock.time[*i].is_finite() && raw[*i].is_finite();
    let mut values: Vec<Stamped> = (0..raw.len()).filter(is_there).map(stamp).collect();
    values.sort_by(|a, b| a.key.total_cmp(&b.key));
    let keys: Vec<(f64, f64)> = match places {
        Some(places) => places.iter().zip(&rows.time).map(|(place, t)| (*place as f64, *t)).collect(),
        None => rows.time.iter().map(|t| (*t, *t)).collect(),
    };
    in_force::on(&keys, &values, matches!(role, Role::Command | Role::Force))
}

/// Refuses a clock that has no time in common with that of the rows.
fn check_overlap(name: &str, clock: &Clock, rows: &Rows) -> Result<(), Error> {
    let ends = |time: &[f64], later: f64| {
        let finite = time.iter().copied().filter(|t| t.is_finite());
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t + later), h.max(t + later)))
    };
    let (a0, a1) = ends(&clock.time, clock.origin - rows.origin);
    let (b0, b1) = ends(&rows.time, 0.0);
    if a1.min(b1) - a0.max(b0) > 0.1 * (b1 - b0) {
        return Ok(());
    }
    Err(Error::input(format_args!(
        "the clock of {name} runs from {a0:.3} to {a1:.3} s where that of the motion runs from {b0:.3} to {b1:.3} s, so that they have hardly any time in common; put both on one clock first"
    )))
}

/// Leaves out a velocity if there is a position: most velocities are differences of the position,
/// not measurements.
fn leave_out_velocity(logs: &[Log], found: &mut BTreeMap<Role, Chosen>, notes: &mut Vec<String>) {
    if found.contains_key(&Role::Position)
        && let Some(left) = found.remove(&Role::Velocity)
    {
        let name = &left.column(logs).name;
        notes.push(format!("{name} left out: the speed is found from the position"));
    }
}

/// The clock of each role, with its place.
type Clocks = BTreeMap<Role, (Key, Clock)>;

fn clocks(
    logs: &[Log],
    found: &BTreeMap<Role, Chosen>,
    said: Said,
    notes: &mut Vec<String>,
) -> Result<Clocks, Error> {
    let is_said = said.columns.iter().any(|c| c.role == Role::Time);
    let mut keys: BTreeMap<Role, (Key, Option<Unit>)> = BTreeMap::new();
    for (role, chosen) in found {
        let (l, t, _) = chosen.at;
        let own = chosen.column(logs).clock.filter(|_| !is_said);
        let key = match roles::clock_of(logs, said.clocks, *role)? {
            Some((at, unit)) if (at.0, at.1) == (l, t) => ((l, t, Some(at.2)), unit),
            Some(_) => {
                return Err(Error::input(format_args!(
                    "--clock {role}: is in another table than {}; give a column of the same one",
                    chosen.column(logs).name
                )));
            }
            None => ((l, t, own), own.and_then(|at| logs[l].tables[t].columns[at].unit)),
        };
        keys.insert(*role, key);
    }
    let tables: Vec<(usize, usize)> = keys.values().map(|(key, _)| (key.0, key.1)).collect();
    let several = tables.iter().any(|at| *at != tables[0]);
    let mut done: BTreeMap<Key, Clock> = BTreeMap::new();
    for (key, unit) in keys.values() {
        if !done.contains_key(key) {
            done.insert(*key, clocks::clock(logs, *key, *unit, said.columns, several, said.known, notes)?);
        }
    }
    if done.len() > 1 {
        let base = keys.get(&Role::Position).or(keys.get(&Role::Velocity)).map_or((0, 0, None), |k| k.0);
        let table = &logs[base.0].tables[base.1];
        notes.push(format!(
            "columns of {} {} put on the clock of {}: each holds until its next value",
            done.len(),
            if several { "tables" } else { "clocks" },
            base.2.map_or(&table.name, |at| &table.columns[at].name)
        ));
    }
    Ok(keys.into_iter().map(|(role, (key, _))| (role, (key, done[&key].clone()))).collect())
}

/// Questions for what no column gives.
fn missing(logs: &[Log], found: &BTreeMap<Role, Chosen>, known: Known) -> Vec<String> {
    let mut questions = Vec::new();
    if !found.contains_key(&Role::Position) && !found.contains_key(&Role::Velocity) {
        questions.push(roles::missing(logs, Role::Position).to_string());
    }
    if known.error_as_command && !found.contains_key(&Role::Reference) {
        questions.push(roles::missing(logs, Role::Reference).to_string());
    } else if !found.contains_key(&Role::Command) && !known.undriven && !known.error_as_command {
        questions.push(format!(
            "{}; or give --undriven where nothing drives the axis{}",
            roles::missing(logs, Role::Command),
            if found.contains_key(&Role::Reference) {
                ", or --error-as-command where a position loop ran: the command is reference − position then"
            } else {
                ""
            }
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

    /// Adds the command that no column has: zero, or reference − position.
    fn add_command(&mut self, known: Known, notes: &mut Vec<String>) -> Result<(), Error> {
        if known.undriven {
            self.columns.insert(Role::Command, vec![0.0; self.time.len()]);
            notes.push("the command is zero throughout, as --undriven says".into());
        }
        if !known.error_as_command {
            return Ok(());
        }
        let (Some(reference), Some(position)) =
            (self.columns.get(&Role::Reference), self.columns.get(&Role::Position))
        else {
            return Err(Error::input(
                "--error-as-command takes a position and its reference; name them with --column",
            ));
        };
        if self.reference != self.position {
            return Err(Error::input(format_args!(
                "the reference is in {} and the position in {}, so that --error-as-command has no difference; correct a unit with --column reference=NAME:UNIT",
                self.reference.unit(),
                self.position.unit()
            )));
        }
        let span = |column: &[f64]| {
            let finite = column.iter().copied().filter(|x| x.is_finite());
            let (low, high) =
                finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        // Angles that wrap are apart by a turn where only one of them has wrapped.
        let wraps = self.position == Quantity::Angle && span(position).max(span(reference)) < 1.002 * TAU;
        let difference =
            |(r, p): (&f64, &f64)| if wraps { (r - p) - TAU * ((r - p) / TAU).round() } else { r - p };
        let command = reference.iter().zip(position).map(difference).collect();
        self.columns.insert(Role::Command, command);
        self.command = self.position;
        notes.push(format!(
            "the command is reference − position, in {}, as --error-as-command says; the gain is the stiffness of the loop",
            self.position.unit()
        ));
        Ok(())
    }
}
