//! Units as people write them into headers, and what each is in the contract's.

/// The quantity that a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// In s.
    Time,
    /// In rad.
    Angle,
    /// In m.
    Length,
    /// Encoder counts.
    Counts,
    /// In rad/s.
    AngularSpeed,
    /// In m/s.
    Speed,
    /// In N·m.
    Torque,
    /// In N.
    Force,
    /// In A.
    Current,
    /// In V.
    Voltage,
    /// A command without a physical unit: converter steps, per cent, a duty cycle.
    Plain,
}

impl Quantity {
    /// The contract's unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Angle => "rad",
            Self::Length => "m",
            Self::Counts => "counts",
            Self::AngularSpeed => "rad/s",
            Self::Speed => "m/s",
            Self::Torque => "N·m",
            Self::Force => "N",
            Self::Current => "A",
            Self::Voltage => "V",
            Self::Plain => "1",
        }
    }
}

/// A unit: what it measures, and how much one of it is in the contract's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// The quantity that it measures.
    pub quantity: Quantity,
    /// One of it in [`Quantity::unit`].
    pub factor: f64,
}

use std::f64::consts::{PI, TAU};

const UNITS: &[(&str, Quantity, f64)] = &[
    ("s sec secs second seconds", Quantity::Time, 1.0),
    ("ms msec millis millisecond milliseconds", Quantity::Time, 1e-3),
    ("us µs μs usec micros microsecond microseconds", Quantity::Time, 1e-6),
    ("ns nsec nanos nanosecond nanoseconds", Quantity::Time, 1e-9),
    ("min minute minutes", Quantity::Time, 60.0),
    ("rad rads radian radians", Quantity::Angle, 1.0),
    ("mrad", Quantity::Angle, 1e-3),
    ("deg degs degree degrees °", Quantity::Angle, PI / 180.0),
    ("rev revs turn turns revolution revolutions", Quantity::Angle, TAU),
    ("m metre metres meter meters", Quantity::Length, 1.0),
    ("cm", Quantity::Length, 1e-2),
    ("mm", Quantity::Length, 1e-3),
    ("um µm μm", Quantity::Length, 1e-6),
    ("inch inches", Quantity::Length, 0.0254),
    ("counts count cts ct ticks tick pulses inc incr increments qc", Quantity::Counts, 1.0),
    ("rad/s rads/s rad*s^-1 rad·s⁻¹ rad_s rad.s^-1 rad/sec radps", Quantity::AngularSpeed, 1.0),
    ("deg/s °/s deg_s deg/sec dps degps", Quantity::AngularSpeed, PI / 180.0),
    ("rev/s turns/s rps hz", Quantity::AngularSpeed, TAU),
    ("rpm rev/min r/min 1/min min^-1", Quantity::AngularSpeed, TAU / 60.0),
    ("m/s m_s m/sec mps", Quantity::Speed, 1.0),
    ("cm/s cm_s", Quantity::Speed, 1e-2),
    ("mm/s mm_s mm/sec mmps", Quantity::Speed, 1e-3),
    ("n·m nm n*m n.m n-m n_m newtonmetre newtonmeter", Quantity::Torque, 1.0),
    ("mn·m mnm mn*m mn.m mn-m mn_m", Quantity::Torque, 1e-3),
    ("n·cm ncm n*cm n.cm n_cm", Quantity::Torque, 1e-2),
    ("n newton newtons", Quantity::Force, 1.0),
    ("mn", Quantity::Force, 1e-3),
    ("kn", Quantity::Force, 1e3),
    ("a amp amps ampere amperes", Quantity::Current, 1.0),
    ("ma milliamp milliamps", Quantity::Current, 1e-3),
    ("v volt volts", Quantity::Voltage, 1.0),
    ("mv millivolt millivolts", Quantity::Voltage, 1e-3),
    ("dac lsb pwm duty % percent pct 1 - code codes raw", Quantity::Plain, 1.0),
];

/// The unit that a text names; none where it is not one. Upper case and lower case are the same,
/// but for `MN`.
pub(super) fn parse(text: &str) -> Option<Unit> {
    let text = text.trim().trim_matches(['[', ']', '(', ')', '{', '}', '"']).trim();
    let plain: String = text.replace('⋅', "·").replace(' ', "_").to_lowercase();
    if plain.is_empty() || text.starts_with("MN") {
        return None;
    }
    UNITS
        .iter()
        .find(|(names, _, _)| names.split(' ').any(|name| name == plain))
        .map(|(_, quantity, factor)| Unit { quantity: *quantity, factor: *factor })
}

/// A column's name without its unit, and the unit where it holds one: `theta [deg]`, `theta (deg)`,
/// `theta_deg`, `theta/deg`, `thetaDeg`.
pub(super) fn split_name(name: &str) -> (String, Option<Unit>) {
    let name = name.trim().trim_matches('"');
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}')] {
        if let (Some(from), Some(to)) = (name.find(open), name.rfind(close))
            && from < to
            && let Some(unit) = parse(&name[from..=to])
        {
            return (
                format!("{} {}", &name[..from], &name[to + close.len_utf8()..]).trim().to_owned(),
                Some(unit),
            );
        }
    }
    if let Some((before, after)) = name.split_once('/')
        && !before.is_empty()
        && let Some(unit) = parse(after)
    {
        return (before.trim().to_owned(), Some(unit));
    }
    let words = words(name);
    for length in [2, 1] {
        if words.len() > length
            && let Some(unit) = parse(&words[words.len() - length..].join("_"))
        {
            return (words[..words.len() - length].join("_"), Some(unit));
        }
    }
    (name.to_owned(), None)
}

/// The words of a name, in lower case: split at anything but letters and digits and before a
/// capital.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in name.chars() {
        let breaks = !c.is_alphanumeric() && !matches!(c, '°' | '%' | '·');
        if (breaks || (c.is_uppercase() && before.is_lowercase()))
            && words.last().is_some_and(|w| !w.is_empty())
        {
            words.push(String::new());
        }
        if !breaks && let Some(last) = words.last_mut() {
            last.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_carry_their_units_in_every_usual_way() {
        for (name, plain, unit, factor) in [
            ("theta [deg]", "theta", "rad", PI / 180.0),
            ("Theta (deg)", "Theta", "rad", PI / 180.0),
            ("theta_deg", "theta", "rad", PI / 180.0),
            ("Weg/mm", "Weg", "m", 1e-3),
            ("t_ms", "t", "s", 1e-3),
            ("motorSpeedRpm", "motor_speed", "rad/s", TAU / 60.0),
            ("omega (rad/s)", "omega", "rad/s", 1.0),
            ("omega_rad_s", "omega", "rad/s", 1.0),
            ("tau [mN·m]", "tau", "N·m", 1e-3),
            ("position_counts", "position", "counts", 1.0),
        ] {
            let (found, of) = split_name(name);
            let of = of.unwrap_or_else(|| panic!("{name} has a unit"));
            assert_eq!((found.as_str(), of.quantity.unit()), (plain, unit), "{name}");
            assert!((of.factor - factor).abs() < 1e-12 * factor, "{name}");
        }
        for name in ["theta", "u", "time", "n", "m"] {
            assert_eq!(split_name(name), (name.to_owned(), None), "one word is a name");
        }
        assert_eq!(parse("MNm"), None, "meganewtons are nobody's drive");
    }
}
