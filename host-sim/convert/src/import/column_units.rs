//! The units of the columns that were found: their own, those that follow, and those that a person
//! is asked for.

use super::role::Role;
use super::roles::{self, Chosen};
use super::table::Log;
use super::units::{Quantity, Unit, words};
use std::collections::BTreeMap;

/// A unit as a note has it.
pub(super) fn said_unit(role: Role, unit: Unit) -> String {
    let Unit { quantity, factor } = unit;
    match (role, factor == 1.0) {
        (Role::Command, true) if quantity == Quantity::Plain => "units of its own".into(),
        (_, true) => quantity.unit().into(),
        (_, false) => format!("{} after a factor of {factor:.6}", quantity.unit()),
    }
}

/// The unit of every column that was found. A column that nobody asked for and that does not say
/// its unit is left out, and a reference is taken to have the position's; what only a person can
/// know becomes a question.
pub(super) fn units(
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
        let from = chosen.column(logs);
        let own = || {
            Some(from)
                .filter(|from| from.unsure.is_empty())
                .and_then(|from| own_unit(role, &from.name, &from.values, notes))
        };
        if let Some(unit) = chosen.unit.or_else(own) {
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
            _ if !from.unsure.is_empty() => {
                let each: Vec<String> =
                    from.unsure.iter().map(|unit| roles::option(role, &from.name, Some(unit))).collect();
                questions.push(format!(
                    "the {role} column {} may be in {}; say which with {}",
                    from.name,
                    from.unsure.join(" or in "),
                    each.join(" or ")
                ));
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
        Role::Enabled => plain(Quantity::Plain),
        Role::Position | Role::Reference if whole() && words(name).iter().any(counts) => {
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
        Role::Enabled => "1",
    }
}
