//! The clocks of a recording: which column has the time of which other, in which unit, and from
//! which zero.

use super::role::Role;
use super::roles::{self, Choice};
use super::rows::{Known, median_step};
use super::suggestion::suggested;
use super::table::{Column, ColumnTable, Log};
use super::units::{self, Quantity, Unit};
use device_sim::error::Error;

/// The place of a clock: file, table, and the column, where the channel has a clock of its own.
pub(super) type Key = (usize, usize, Option<usize>);

/// Rows a second that are read.
pub(super) const SLOWEST_HZ: f64 = 19.0;
pub(super) const FASTEST_HZ: f64 = 25_000.0;
/// Slower rows than this come from a clock in another unit, s.
const LONGEST_STEP_S: f64 = 0.25;
/// Nobody's recording at less than [`SLOWEST_HZ`] lasts longer, s.
const LONGEST_S: f64 = 3600.0;
/// Steps of numbers in single precision are larger than this part of the number.
const SINGLE: f64 = 5e-8;

/// Time stamps of the rows of a table.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    /// s since `origin`.
    pub time: Vec<f64>,
    /// Zero of the time, s: a date since 1970, or 0 where the clock begins with the recording.
    pub origin: f64,
}

/// The unit of a number that is a date of this century: since 1970, or in Windows' steps of 100 ns
/// since 1601 or since the year 1.
fn unit_of_date(first: f64, step: f64) -> Option<(f64, &'static str)> {
    let is_date = |second: f64| (9.4e8..4.2e9).contains(&(first * second)) && step * second < 1.0;
    let since = |year_1970: f64| (9.4e8..4.2e9).contains(&(first * 1e-7 - year_1970));
    [(1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")]
        .into_iter()
        .find(|(factor, _)| is_date(*factor))
        .or_else(|| (since(11_644_473_600.0) || since(62_135_596_800.0)).then_some((1e-7, "steps of 100 ns")))
}

/// The unit of a clock that does not say it, from its usual step; an error where that could be two.
fn unit_of_clock(name: &str, time: &[f64], first: f64, notes: &mut Vec<String>) -> Result<f64, Error> {
    let Some(step) = median_step(time) else {
        return Err(Error::input(format_args!(
            "the time column {name} never increases; choose another with --column time=NAME:s"
        )));
    };
    let span = time.iter().copied().filter(|t| t.is_finite()).fold(0.0, f64::max);
    if let Some((factor, unit)) = unit_of_date(first, step) {
        notes.push(format!("time {name} taken as {unit}, for its date"));
        return Ok(factor);
    }
    let is_day = (20_000.0..80_000.0).contains(&first) || (650_000.0..800_000.0).contains(&first);
    let (factor, unit) = match step {
        d if is_day && d < 1e-3 && span < 0.5 => (86_400.0, "days"),
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

/// The clock at `key`, whose unit is `unit` where it has a column of its own.
pub(super) fn clock(
    logs: &[Log],
    key: Key,
    unit: Option<Unit>,
    choices: &[Choice],
    several: bool,
    known: Known,
    notes: &mut Vec<String>,
) -> Result<Clock, Error> {
    let table = &logs[key.0].tables[key.1];
    let alone = [Log { file: table.name.clone(), tables: vec![table.clone()], notes: Vec::new() }];
    let said = choices.iter().find(|c| c.role == Role::Time);
    let logged = table.columns.iter().position(|c| c.name == "log_time");
    let (at, unit) = match (key.2, said, logged) {
        (Some(at), ..) => (Some(at), unit),
        // Topics stamp their messages by clocks of their own; the log has one.
        (None, None, Some(at)) if several => (Some(at), table.columns[at].unit),
        _ => {
            if said.is_none() {
                ask_between_clocks(table)?;
            }
            let chosen = roles::choose(&alone, Role::Time, choices, None)?;
            (chosen.as_ref().map(|c| c.at.2), chosen.and_then(|c| c.unit))
        }
    };
    let Some(at) = at else {
        let Some(rate) = known.rate_hz else {
            return Err(Error::input(format_args!(
                "{}; or give --rate HZ where its rows are evenly spaced",
                roles::missing(&alone, Role::Time)
            )));
        };
        notes.push(format!("no column for the time: {rate} rows a second, as --rate says"));
        return Ok(Clock { time: (0..table.rows()).map(|row| row as f64 / rate).collect(), origin: 0.0 });
    };
    let column = &table.columns[at];
    // Before scaling: digits of a date since 1970 are scarce.
    let first = column.values.iter().copied().find(|t| t.is_finite()).unwrap_or(0.0);
    refuse_single_precision(column, first)?;
    let origin = if first.abs() > 1e8 { first } else { 0.0 };
    let time: Vec<f64> = column.values.iter().map(|t| t - origin).collect();
    let factor = match unit {
        Some(Unit { factor, .. }) => factor,
        None => {
            let from_first: Vec<f64> = time.iter().map(|t| t - (first - origin)).collect();
            unit_of_clock(&column.name, &from_first, first, notes)?
        }
    };
    let time: Vec<f64> = time.into_iter().map(|t| t * factor).collect();
    if !several && said.is_none_or(|said| said.unit.is_none()) {
        ask_for_odd_rate(&column.name, &time)?;
    }
    Ok(Clock { time, origin: origin * factor })
}

/// Refuses a date since 1970 that was rounded to single precision: its steps are minutes.
fn refuse_single_precision(column: &Column, first: f64) -> Result<(), Error> {
    let repeated = column.values.windows(2).filter(|w| w[0] == w[1]).count();
    let step = median_step(&column.values).unwrap_or(f64::INFINITY);
    if first > 1e8 && 2 * repeated > column.values.len() && step > SINGLE * first {
        return Err(Error::input(format_args!(
            "the time column {} is a date in single precision ({first}), which does not distinguish rows; give --column time=none --rate HZ where rows are evenly spaced",
            column.name
        )));
    }
    Ok(())
}

/// Asks for the unit of a clock by which rows come far slower or faster than anybody records.
fn ask_for_odd_rate(name: &str, time: &[f64]) -> Result<(), Error> {
    let Some(step) = median_step(time) else { return Ok(()) };
    let finite = || time.iter().copied().filter(|t| t.is_finite());
    let span = finite().fold(f64::NEG_INFINITY, f64::max) - finite().fold(f64::INFINITY, f64::min);
    let is_slow = step > LONGEST_STEP_S || step > 1.0 / SLOWEST_HZ && span > LONGEST_S;
    if !is_slow && 1.0 / step < FASTEST_HZ {
        return Ok(());
    }
    let [likely, other] = if is_slow { ["ms", "us"] } else { ["s", "ms"] };
    Err(Error::input(format_args!(
        "the rows come every {step:.3e} s by {name}, where 20 to 20000 a second are read; say its unit with {} or {}, or with {} if it is right",
        roles::option(Role::Time, name, Some(likely)),
        roles::option(Role::Time, name, Some(other)),
        roles::option(Role::Time, name, Some(if is_slow { "s" } else { "us" }))
    )))
}

/// Joins stamps in two columns, seconds and nanoseconds, and gives each channel of a table its own
/// clock where the layout shows which it is.
pub(super) fn prepare(log: &mut Log) {
    let Log { tables, notes, .. } = log;
    for table in tables {
        join_nanoseconds(table, notes);
        pair(table, notes);
    }
}

/// Adds nanoseconds to the seconds in the column before.
fn join_nanoseconds(table: &mut ColumnTable, notes: &mut Vec<String>) {
    for at in 1..table.columns.len() {
        let (before, after) = table.columns.split_at_mut(at);
        let (seconds, part) = (&mut before[at - 1], &mut after[0]);
        let last = |column: &Column| units::words(&column.name).pop().unwrap_or_default();
        let factor = match last(part).as_str() {
            "usec" | "microsec" | "microseconds" | "us" => 1e-6,
            _ => 1e-9,
        };
        let named = ["sec", "secs", "seconds", "s"].contains(&last(seconds).as_str())
            && [
                "nanosec",
                "nsec",
                "nsecs",
                "nanosecs",
                "nanoseconds",
                "ns",
                "usec",
                "microsec",
                "microseconds",
                "us",
            ]
            .contains(&last(part).as_str());
        let unnamed = !seconds.is_named && !part.is_named;
        if (named || unnamed) && are_parts(&seconds.values, &part.values, factor) {
            let joined: Vec<f64> =
                seconds.values.iter().zip(&part.values).map(|(s, part)| s + factor * part).collect();
            notes.push(format!("the time is {} and {} together", seconds.name, part.name));
            for column in [seconds, part] {
                column.values.clone_from(&joined);
                column.plain = "time".into();
                column.set_unit(units::written("s"));
            }
        }
    }
}

/// True for whole seconds that count on where their parts begin again.
fn are_parts(seconds: &[f64], parts: &[f64], factor: f64) -> bool {
    let mut turns = 0;
    let whole = |x: &f64| x.fract() == 0.0;
    let within = parts.iter().all(|x| whole(x) && (0.0..1.0).contains(&(x * factor)));
    let rows = seconds.windows(2).zip(parts.windows(2));
    let agree = rows.filter(|(s, part)| {
        turns += usize::from(s[1] > s[0]);
        (s[1] > s[0]) == (part[1] < part[0])
    });
    let agree = agree.count();
    let largest = parts.iter().copied().fold(0.0, f64::max);
    within && seconds.iter().all(whole) && turns > 0 && agree + 1 >= seconds.len() && largest * factor > 0.1
}

/// The columns that are clocks, without those that are an earlier one in another unit.
fn different_clocks(table: &ColumnTable) -> Vec<usize> {
    let is_clock = |c: &Column| matches!(suggested(c), Some((Role::Time, _))) && c.rises();
    let mut found: Vec<(usize, Vec<f64>)> = Vec::new();
    for (at, column) in table.columns.iter().enumerate().filter(|(_, c)| is_clock(c)) {
        let time: Vec<f64> = match column.unit {
            Some(unit) => column.values.iter().map(|t| t * unit.factor).collect(),
            None => {
                let first = column.values.iter().copied().find(|t| t.is_finite()).unwrap_or(0.0);
                let from_first: Vec<f64> = column.values.iter().map(|t| t - first).collect();
                let factor = unit_of_clock(&column.name, &from_first, first, &mut Vec::new()).unwrap_or(1.0);
                column.values.iter().map(|t| t * factor).collect()
            }
        };
        let near = 0.6 * median_step(&time).unwrap_or(0.0);
        let same = |other: &[f64]| {
            let apart = || time.iter().zip(other).map(|(a, b)| (a - b).abs()).filter(|d| d.is_finite());
            // A date beside seconds from the start is one clock with two zeros.
            let zero = apart().next().filter(|zero| *zero > 1e6).unwrap_or(0.0);
            apart().all(|d| (d - zero).abs() <= near)
        };
        if !found.iter().any(|(_, other)| same(other)) {
            found.push((at, time));
        }
    }
    found.into_iter().map(|(at, _)| at).collect()
}

/// Gives the channels of a table their clocks: those beside it, where clocks and channels
/// alternate, else the one whose name has a word of the channel's.
fn pair(table: &mut ColumnTable, notes: &mut Vec<String>) {
    let clocks = different_clocks(table);
    if clocks.len() < 2 {
        return;
    }
    let is_time = |c: &Column| {
        matches!(suggested(c), Some((Role::Time, _))) || c.unit.is_some_and(|u| u.quantity == Quantity::Time)
    };
    let channels: Vec<usize> = (0..table.columns.len())
        .filter(|i| table.columns[*i].has_numbers() && !is_time(&table.columns[*i]))
        .collect();
    let (Some(first), Some(last)) = (channels.first(), channels.last()) else { return };
    let before = |channel: usize| clocks.iter().copied().rfind(|clock| *clock < channel);
    let after = |channel: usize| clocks.iter().copied().find(|clock| *clock > channel);
    let has_all = |of: &dyn Fn(usize) -> Option<usize>| {
        clocks.iter().all(|clock| channels.iter().any(|c| of(*c) == Some(*clock)))
    };
    let words = |at: usize| units::words(&table.columns[at].plain);
    let by_name = |channel: usize| {
        let of_channel = words(channel);
        let mut fitting = clocks.iter().copied().filter(|clock| {
            words(*clock).iter().any(|word| word != "t" && word != "time" && of_channel.contains(word))
        });
        fitting.next().filter(|_| fitting.next().is_none())
    };
    let is_first_clock = clocks[0] < *first && clocks[clocks.len() - 1] < *last;
    let pairs: Vec<(usize, usize)> = if is_first_clock && has_all(&before) {
        channels.iter().filter_map(|c| Some((*c, before(*c)?))).collect()
    } else if clocks[0] > *first && clocks[clocks.len() - 1] > *last && has_all(&after) {
        channels.iter().filter_map(|c| Some((*c, after(*c)?))).collect()
    } else if has_all(&by_name) {
        channels.iter().filter_map(|c| Some((*c, by_name(*c)?))).collect()
    } else {
        return;
    };
    for (channel, clock) in pairs {
        table.columns[channel].clock = Some(clock);
        notes.push(format!("{} is on the clock {}", table.columns[channel].name, table.columns[clock].name));
    }
}

/// Asks whose the clocks of a table are, where they differ and nothing tells.
fn ask_between_clocks(table: &ColumnTable) -> Result<(), Error> {
    let clocks = different_clocks(table);
    let rank = |at: &usize| suggested(&table.columns[*at]).map(|s| s.1);
    let best = clocks.iter().filter_map(rank).min();
    let alike: Vec<&str> =
        clocks.iter().filter(|at| rank(at) == best).map(|at| table.columns[*at].name.as_str()).collect();
    let [a, b, ..] = alike[..] else { return Ok(()) };
    Err(Error::input(format_args!(
        "{}: {} are different clocks; say whose they are with {} {}, or {} if one counts for all",
        table.name,
        alike.join(" and "),
        format_args!("--clock {}", crate::shell::quoted(&format!("command={a}"))),
        format_args!("--clock {}", crate::shell::quoted(&format!("position={b}"))),
        roles::option(Role::Time, a, None)
    )))
}
