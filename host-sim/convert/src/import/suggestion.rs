//! The role that a column's name suggests, and to which axis of a machine it belongs.

use super::role::Role;
use super::separate::{PARTS, numbers_apart};
use super::table::Column;
use super::units::{self, Quantity};
use std::collections::BTreeSet;

const EFFORT: &str = "torque tau effort current iq strom voltage volt volts pwm duty moment drehmoment";
const POSITION: &str =
    "position pos angle theta phi q x enc encoder count counts ticks weg winkel travel displacement";
const VELOCITY: &str = "velocity vel speed omega rpm erpm dot qd dq v w geschwindigkeit drehzahl";
const WANTED: &str =
    "reference ref setpoint set target desired des demand demanded goal action soll setpos targetpos";
const ORDERED: &str = "command cmd commanded ctrl control input u";
const MEASURED: &str = "measured meas actual act feedback fbk ist estimated est present";
/// Words of columns that have no role, whatever else is in their names.
const NO_ROLE: &str = "std var variance acceleration acc accel ddot qdd ddq temperature temp index mode status flag \
                       flags fault limit min max lower upper gain kp ki kd power watt energy phase packet packets cycle \
                       loop frame frames msg message messages seq sequence sample samples overrun retry baud checksum crc \
                       word register bits";
/// The last words of names of columns that have no role.
const NO_ROLE_AT_THE_END: &str = "state id code type source version";
const ERROR: &str = "error err deviation abweichung regelabweichung regeldifferenz";
/// Words for the supply of a drive, whose voltage and current do not command it.
const SUPPLY: &str = "input battery batt bat supply bus dc rail psu link vbus vbat vin vdc akku versorgung";
const ENABLED: &str = "enable enabled torque_enable servo_on drive_on motor_on power_on armed freigabe";
const TIME: &str = "t time timestamp stamp zeit seconds sec millis micros elapsed asctime datetime uhrzeit";
/// Words for a joint or a side of a machine.
const JOINTS: &str =
    "left right front rear hip knee ankle shoulder elbow wrist thigh calf neck waist roll pitch yaw";

fn is_in(list: &str, word: &str) -> bool {
    list.split_whitespace().any(|known| known == word)
}

/// The words of a column's own name: of a path, as structures and topics have them, the last part.
fn own_words(column: &Column) -> Vec<String> {
    column.plain.rsplit(['.', '/']).next().map(units::words).unwrap_or_default()
}

/// True for the name of a difference of two positions.
pub(super) fn is_error(name: &str) -> bool {
    units::words(name).iter().any(|word| is_in(ERROR, word))
}

/// A role that a column's name suggests and its unit allows, and how good a match it is: 0 is the
/// best.
pub(super) fn suggested(column: &Column) -> Option<(Role, u32)> {
    let words = units::words(&column.plain);
    let own = own_words(column);
    let quantity = column.unit.map(|u| u.quantity);
    let takes = |found: &(Role, u32)| quantity.is_none_or(|quantity| found.0.takes(quantity));
    if own.last().is_some_and(|word| word == "enable" || word == "enabled") || is_in(ENABLED, &own.join("_"))
    {
        return Some((Role::Enabled, 0));
    }
    if let Some(rank) = rank_as_time(column, &words, &own) {
        return Some((Role::Time, rank)).filter(takes);
    }
    if has_no_role(column, &words, &own) {
        return None;
    }
    by_name(column, &words, &own).filter(takes).or_else(|| by_unit(quantity?))
}

/// Returns how well a column matches the time; `None` where it is another quantity's.
fn rank_as_time(column: &Column, words: &[String], own: &[String]) -> Option<u32> {
    let is = |list: &str| own.len() == 1 && is_in(list, &own[0]);
    if let Some(unit) = column.unit {
        let rank = if is("log_time") || words == ["log", "time"] { 3 } else { 0 };
        return (unit.quantity == Quantity::Time && !is("dt")).then_some(rank);
    }
    // `t1` and `t2` too.
    let unnumbered = own.first().map_or("", |word| word.trim_end_matches(|c: char| c.is_ascii_digit()));
    if own.len() == 1 && is_in(TIME, unnumbered) || words == ["time", "s"] {
        return Some(0);
    }
    let is_time = |word: Option<&String>| word.is_some_and(|word| is_in("time timestamp stamp", word));
    let begins = own.len() > 1 && (is_time(own.first()) || own[0] == "t");
    (is_time(words.last()) || begins && column.rises()).then_some(1)
}

/// True for a column whose name says that it is no motion and does not drive one.
fn has_no_role(column: &Column, words: &[String], own: &[String]) -> bool {
    let has = |list: &str| words.iter().any(|word| is_in(list, word));
    let quantity = column.unit.map(|u| u.quantity);
    let is_voltage = has("voltage volt volts vbus vbat vin vdc") || quantity == Some(Quantity::Voltage);
    let is_electrical = is_voltage || has("current v") || quantity == Some(Quantity::Current);
    has(NO_ROLE)
        || has(ERROR)
        || own.last().is_some_and(|word| is_in(NO_ROLE_AT_THE_END, word))
        || is_electrical && has(SUPPLY)
        || is_voltage && column.is_steady()
        || own == ["id"]
        || own.windows(2).any(|w| w[0] == "d" && w[1] == "axis")
}

/// The role that words for forces and motions suggest.
fn by_name(column: &Column, words: &[String], own: &[String]) -> Option<(Role, u32)> {
    let has = |list: &str| words.iter().any(|word| is_in(list, word));
    let is = |list: &str| own.len() == 1 && is_in(list, &own[0]);
    // `current_position` is a position, and `current_A` a current.
    let of_motion = |word: &str| word.len() > 1 && (is_in(POSITION, word) || is_in(VELOCITY, word));
    let adjective = words.windows(2).any(|w| w[0] == "current" && of_motion(&w[1]));
    let effort = !adjective && has(EFFORT) || is("i") || own == ["i", "q"];
    let found = Found { effort, position: has(POSITION) && own != ["i", "q"], velocity: has(VELOCITY) };
    by_motion(column, &has, is("u"), found)
}

/// Kinds of words that a name has.
#[derive(Clone, Copy)]
struct Found {
    effort: bool,
    position: bool,
    velocity: bool,
}

/// The role by words for forces and motions.
fn by_motion(column: &Column, has: &dyn Fn(&str) -> bool, is_u: bool, found: Found) -> Option<(Role, u32)> {
    let Found { effort, position, velocity } = found;
    let quantity = column.unit.map(|u| u.quantity);
    let (wanted, ordered) = (has(WANTED), has(ORDERED));
    let measured = u32::from(has(MEASURED));
    if (wanted || ordered) && velocity && !position && !effort {
        return None;
    }
    if effort && (wanted || ordered) {
        return Some((Role::Command, 1));
    }
    let of_place = matches!(quantity, Some(Quantity::Angle | Quantity::Length | Quantity::Counts));
    if (wanted || (ordered && !is_u)) && (position || of_place) {
        return Some((Role::Reference, 1));
    }
    if wanted && !effort {
        return Some((Role::Reference, 2));
    }
    if velocity && !effort || matches!(quantity, Some(Quantity::AngularSpeed | Quantity::Speed)) {
        return Some((Role::Velocity, 1 + measured));
    }
    if has("tilt inclination incline neigung") {
        return Some((Role::Tilt, 1));
    }
    if ordered {
        return Some((Role::Command, 0));
    }
    let electrical = has("current iq strom voltage pwm duty");
    if has("force load external ext loadcell kraft last") && !position && !electrical {
        return Some((Role::Force, 1));
    }
    if effort {
        return Some((Role::Command, 2 + measured));
    }
    if position {
        let exact = u32::from(!has("position pos"));
        return Some((Role::Position, 1 + exact));
    }
    None
}

/// The role of a column whose name says nothing.
fn by_unit(quantity: Quantity) -> Option<(Role, u32)> {
    match quantity {
        Quantity::Angle | Quantity::Length | Quantity::Counts => Some((Role::Position, 4)),
        Quantity::Current | Quantity::Voltage => Some((Role::Command, 4)),
        _ => None,
    }
}

/// A role that a column's name suggests, if need be without the number at its end: `q1`.
pub(super) fn numbered(column: &Column) -> Option<(Role, u32)> {
    suggested(column).or_else(|| {
        let name = column.plain.trim_end_matches(|c: char| c.is_ascii_digit());
        let is_one = column.plain.len() > name.len() && !name.is_empty() && column.has_numbers();
        let unit = column.unit;
        is_one.then(|| suggested(&Column { unit, ..Column::new(name, Vec::new()) }))?
    })
}

/// Which columns of a machine with several axes belong to one of them.
pub(super) struct Axes {
    /// Words by which columns of one role differ.
    labels: BTreeSet<String>,
}

/// Columns of one role that are compared with each other.
const MOST_COMPARED: usize = 128;

impl Axes {
    /// Finds the words by which columns of one role differ.
    pub(super) fn new<'a>(columns: impl Iterator<Item = &'a Column>) -> Self {
        let all: Vec<(Role, Vec<String>)> =
            columns.filter_map(|c| Some((numbered(c)?.0, split_words(c)))).take(MOST_COMPARED).collect();
        let mut labels = BTreeSet::new();
        for (i, (role, a)) in all.iter().enumerate() {
            for (_, b) in all[i + 1..].iter().filter(|(other, b)| other == role && a.len() == b.len()) {
                let mut differ = a.iter().zip(b).filter(|(a, b)| a != b);
                if let (Some((a, b)), None) = (differ.next(), differ.next())
                    && *role != Role::Time
                    && !is_role_word(a)
                    && !is_role_word(b)
                {
                    labels.extend([a.clone(), b.clone()]);
                }
            }
        }
        Self { labels }
    }

    /// The labels of a column's axis; empty where its name has none.
    fn of(&self, column: &Column) -> BTreeSet<String> {
        let words = split_words(column);
        let is_label = |i: usize| {
            let word = &words[i];
            let is_number = word.bytes().all(|c| c.is_ascii_digit());
            let of_part =
                i > 0 && is_number && (is_in(PARTS, &words[i - 1]) || is_in("dof servo", &words[i - 1]));
            self.labels.contains(word) || of_part || is_in(JOINTS, word)
        };
        (0..words.len()).filter(|i| is_label(*i)).map(|i| words[i].clone()).collect()
    }

    /// True if the names of two columns say that they belong to different axes: each has a label
    /// that the other does not have, as in `left_knee` and `left_hip`.
    pub(super) fn differ(&self, a: &Column, b: &Column) -> bool {
        let (a, b) = (self.of(a), self.of(b));
        !a.is_subset(&b) && !b.is_subset(&a)
    }

    /// The labels of a column's axis, in their order.
    pub(super) fn name(&self, column: &Column) -> String {
        let labels = self.of(column);
        let words = split_words(column).into_iter().filter(|word| labels.contains(word));
        words.collect::<Vec<_>>().join("-")
    }
}

/// The words of a name with numbers apart from letters.
fn split_words(column: &Column) -> Vec<String> {
    units::words(&column.plain).iter().flat_map(|word| numbers_apart(word)).collect()
}

fn is_role_word(word: &str) -> bool {
    [EFFORT, POSITION, VELOCITY, WANTED, ORDERED, MEASURED].iter().any(|list| is_in(list, word))
}
