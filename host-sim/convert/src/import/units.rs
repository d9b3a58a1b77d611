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

/// Units as they are spelled, in lower case.
const UNITS: &[(&str, Quantity, f64)] = &[
    ("s sec secs second seconds", Quantity::Time, 1.0),
    ("msec millis", Quantity::Time, 1e-3),
    ("usec micros", Quantity::Time, 1e-6),
    ("nsec nanos", Quantity::Time, 1e-9),
    ("min minute minutes", Quantity::Time, 60.0),
    ("day days", Quantity::Time, 86_400.0),
    ("rad rads radian radians", Quantity::Angle, 1.0),
    ("deg degs degree degrees °", Quantity::Angle, PI / 180.0),
    ("rev revs turn turns revolution revolutions", Quantity::Angle, TAU),
    ("m metre metres meter meters", Quantity::Length, 1.0),
    ("cm", Quantity::Length, 1e-2),
    ("inch inches", Quantity::Length, 0.0254),
    ("counts count cts ct ticks tick pulses inc incr increments qc", Quantity::Counts, 1.0),
    ("rad/s rads/s rad*s^-1 rad·s⁻¹ rad_s rad.s^-1 rad/sec radps", Quantity::AngularSpeed, 1.0),
    ("deg/s °/s deg_s deg/sec dps degps", Quantity::AngularSpeed, PI / 180.0),
    ("rev/s turns/s rps hz", Quantity::AngularSpeed, TAU),
    ("rpm rev/min r/min 1/min min^-1", Quantity::AngularSpeed, TAU / 60.0),
    ("m/s m_s m/sec mps", Quantity::Speed, 1.0),
    ("cm/s cm_s", Quantity::Speed, 1e-2),
    ("mm/s mm_s mm/sec mmps", Quantity::Speed, 1e-3),
    ("nm n_m newtonmetre newtonmeter newtonmetres newtonmeters", Quantity::Torque, 1.0),
    ("nmm n_mm", Quantity::Torque, 1e-3),
    ("ncm n_cm", Quantity::Torque, 1e-2),
    ("kgfcm kgcm kgf_cm kg_cm", Quantity::Torque, KGF * 1e-2),
    ("kgfm kgf_m kgfmm", Quantity::Torque, KGF),
    ("ozin ozfin oz_in inoz in_oz", Quantity::Torque, LBF * INCH / 16.0),
    ("lbin lbfin lb_in lbf_in inlb in_lb inlbf", Quantity::Torque, LBF * INCH),
    ("lbft lbfft lb_ft lbf_ft ftlb ft_lb ftlbf", Quantity::Torque, LBF * 12.0 * INCH),
    ("n newton newtons", Quantity::Force, 1.0),
    ("kgf", Quantity::Force, KGF),
    ("lbf", Quantity::Force, LBF),
    ("a amp amps ampere amperes", Quantity::Current, 1.0),
    ("v volt volts", Quantity::Voltage, 1.0),
    ("dac lsb pwm duty % percent pct 1 - code codes raw", Quantity::Plain, 1.0),
];
/// N.
const KGF: f64 = 9.80665;
/// N.
const LBF: f64 = 4.448_221_615_260_5;
/// m.
const INCH: f64 = 0.0254;

/// Prefixes before a unit; a capital M is milli too, except before newtons.
const PREFIXES: [(&str, f64); 16] = [
    ("milli", 1e-3),
    ("micro", 1e-6),
    ("nano", 1e-9),
    ("centi", 1e-2),
    ("kilo", 1e3),
    ("da", 10.0),
    ("m", 1e-3),
    ("M", 1e-3),
    ("k", 1e3),
    ("K", 1e3),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("μ", 1e-6),
    ("n", 1e-9),
    ("c", 1e-2),
    ("d", 1e-1),
];
/// Units that take one, in lower case.
const PREFIXED: &str = "s sec second seconds rad rads radian radians deg degs degree degrees m metre metres meter meters nm n_m newtonmetre \
                        newtonmeter newtonmetres newtonmeters newton_metre newton_meter newton_metres newton_meters n newton newtons a amp amps \
                        ampere amperes v volt volts";

/// A unit as a header has it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Written {
    /// It can be one unit only.
    Sure(Unit),
    /// It can be any of these, as `--column` takes them.
    Unsure(Vec<String>),
}

/// The unit that a person gave; none where it is not one. `MN` is meganewtons here.
pub(super) fn parse(text: &str) -> Option<Unit> {
    match written(text)? {
        Written::Sure(unit) => Some(unit),
        Written::Unsure(_) => {
            let unit = parse(text.trim().strip_prefix('M')?)?;
            Some(Unit { factor: unit.factor * 1e6, ..unit })
        }
    }
}

/// The unit that a text is; none where it is not one. Upper case and lower case are the same, but
/// for `MN`.
pub(super) fn written(text: &str) -> Option<Written> {
    let text = text.trim().trim_matches(['[', ']', '(', ')', '{', '}', '"']).trim();
    let plain: String = text.replace(['⋅', '·', '*', ' ', '-', '.'], "_").replace("_per_", "/");
    for name in [text, &plain, plain.trim_start_matches('_')] {
        if let Some(unit) = spelled(&name.to_lowercase()) {
            return Some(Written::Sure(unit));
        }
    }
    let mega_or_milli = |base: &str| Some(Written::Unsure(vec![format!("m{base}"), format!("M{base}")]));
    if let Some(base @ ("N" | "Nm" | "NM" | "N_m")) =
        plain.strip_prefix('M').map(|b| b.trim_start_matches('_'))
    {
        return mega_or_milli(if base == "N" { "N" } else { "Nm" });
    }
    prefixed(&plain).map(Written::Sure)
}

/// The unit of a name in [`UNITS`].
fn spelled(name: &str) -> Option<Unit> {
    UNITS
        .iter()
        .find(|(names, _, _)| names.split(' ').any(|known| known == name))
        .map(|(_, quantity, factor)| Unit { quantity: *quantity, factor: *factor })
}

/// The unit of a prefix and the unit after it.
fn prefixed(text: &str) -> Option<Unit> {
    PREFIXES.iter().find_map(|(prefix, factor)| {
        let matches = text
            .get(..prefix.len())
            .filter(|start| *start == *prefix || (prefix.len() > 1 && start.eq_ignore_ascii_case(prefix)));
        let base = text.get(matches?.len()..)?.trim_start_matches('_');
        // `kv` and `na` are words rather than units.
        let is_rare = !matches!(*prefix, "m" | "M" | "u" | "µ" | "μ");
        if is_rare && matches!(base, "a" | "v")
            || matches!(*prefix, "d" | "da") && base == base.to_lowercase() && base.len() < 3
        {
            return None;
        }
        let base = base.to_lowercase();
        let (base, over) =
            base.split_once('/').map_or((base.as_str(), None), |(base, over)| (base, Some(over)));
        if !PREFIXED.split_whitespace().any(|known| known == base) {
            return None;
        }
        let unit = match over {
            None => spelled(&base.replace("newton_m", "newtonm"))?,
            Some(over) => spelled(&format!("{base}/{over}"))?,
        };
        Some(Unit { factor: unit.factor * factor, ..unit })
    })
}

/// A column's name without its unit, and the unit where it holds one: `theta [deg]`, `theta (deg)`,
/// `theta_deg`, `theta/deg`, `thetaDeg`.
pub(super) fn split_name(name: &str) -> (String, Option<Written>) {
    let name = name.trim().trim_matches('"');
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}')] {
        if let (Some(from), Some(to)) = (name.find(open), name.rfind(close))
            && from < to
            && !name[from + 1..to].bytes().all(|c| c.is_ascii_digit())
            && let Some(unit) = written(&name[from..=to])
        {
            return (
                format!("{} {}", &name[..from], &name[to + close.len_utf8()..]).trim().to_owned(),
                Some(unit),
            );
        }
    }
    let tokens = tokens(name);
    if let Some((before, after)) = name.split_once('/')
        && !before.is_empty()
        && let Some(unit) = written(after)
        && !tokens.last().is_some_and(|(last, _)| tokens.len() > 1 && written(last).is_some())
    {
        return (before.trim().to_owned(), Some(unit));
    }
    // A number at the end counts columns or joints.
    let is_counted = tokens.last().is_some_and(|(last, _)| last.bytes().all(|c| c.is_ascii_digit()));
    for length in (1..=4).rev().filter(|length| *length < tokens.len() && !is_counted) {
        let (before, of_unit) = tokens.split_at(tokens.len() - length);
        if let Some((unit, prefix)) = at_the_end(before, of_unit) {
            let plain = before.iter().map(|t| t.0).collect::<Vec<_>>().join("_");
            return (words(&plain[..plain.len() - prefix]).join("_"), Some(unit));
        }
    }
    (name.to_owned(), None)
}

/// A part of a name, and whether something stands between it and the part before.
type Token<'a> = (&'a str, bool);

/// The unit that the last parts of a name are, and how many bytes of the parts before belong to it.
fn at_the_end(before: &[Token], of_unit: &[Token]) -> Option<(Written, usize)> {
    let joined = |parts: &[Token]| parts.iter().map(|t| t.0).collect::<Vec<_>>().join("_");
    let is_prefix = |token: &str| matches!(token, "m" | "k" | "u" | "µ" | "μ" | "c");
    if let [(first, _), rest @ ..] = of_unit
        && let [(_, true), ..] = rest
        && is_prefix(first)
        && spelled(&joined(of_unit).to_lowercase()).is_none()
    {
        // `tau_m_Nm` may be the motor's torque in N·m.
        let base = joined(rest).replace('_', "");
        let both = [format!("{first}{base}"), base.clone()];
        return both.iter().all(|unit| parse(unit).is_some()).then(|| (Written::Unsure(both.to_vec()), 0));
    }
    let unit = written(&joined(of_unit))?;
    // `IqmA`: the prefix is at the end of the word before.
    if let ([.., (last, _)], [(base, false), ..]) = (before, of_unit)
        && let Some((at, prefix)) = last.char_indices().next_back()
        && is_prefix(prefix.encode_utf8(&mut [0; 4]))
        && at > 0
        && let Some(with_prefix) = parse(&format!("{prefix}{base}"))
    {
        let is_word = |word: &str| WORDS.split_whitespace().any(|known| known == word.to_lowercase());
        return Some(match () {
            () if is_word(last) => (unit, 0),
            () if is_word(&last[..at]) && at > 1 => (Written::Sure(with_prefix), last.len() - at),
            () => (Written::Unsure(vec![format!("{prefix}{base}"), (*base).to_owned()]), 0),
        });
    }
    Some((unit, 0))
}

/// Words for what is measured, and words that end in a letter that may be a prefix.
const WORDS: &str = "iq id tau torque current strom moment drehmoment force kraft angle theta pos position winkel volt voltage duty \
                     load cmd speed time motor joint arm sum alarm feedback fbk track peak enc max";

/// The parts of a name: split at anything but letters and digits and before a capital, each with
/// whether a separator is before it.
fn tokens(name: &str) -> Vec<Token<'_>> {
    let mut tokens = Vec::new();
    let (mut from, mut separated, mut before) = (None, true, ' ');
    for (at, c) in name.char_indices() {
        let breaks = !c.is_alphanumeric() && !matches!(c, '°' | '%' | '·' | '/');
        if breaks || (c.is_uppercase() && before.is_lowercase()) {
            if let Some(from) = from.take() {
                tokens.push((&name[from..at], separated));
                separated = false;
            }
            separated |= breaks;
        }
        if !breaks && from.is_none() {
            from = Some(at);
        }
        before = c;
    }
    tokens.extend(from.map(|from| (&name[from..], separated)));
    tokens
}

/// The words of a name, in lower case: split at anything but letters and digits and before a
/// capital.
pub(super) fn words(name: &str) -> Vec<String> {
    tokens(name)
        .iter()
        .flat_map(|(token, _)| token.split('/'))
        .filter(|w| !w.is_empty())
        .map(str::to_lowercase)
        .collect()
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
            ("omega_rad_per_s", "omega", "rad/s", 1.0),
            ("tau [mN·m]", "tau", "N·m", 1e-3),
            ("position_counts", "position", "counts", 1.0),
            ("tau_mNm", "tau", "N·m", 1e-3),
            ("tauMilliNewtonMetres", "tau", "N·m", 1e-3),
            ("tau (m Nm)", "tau", "N·m", 1e-3),
            ("torque_kNm", "torque", "N·m", 1e3),
            ("torqueKNm", "torque", "N·m", 1e3),
            ("torque_N_mm", "torque", "N·m", 1e-3),
            ("torque [N mm]", "torque", "N·m", 1e-3),
            ("torque_kN_m", "torque", "N·m", 1e3),
            ("torque_µNm", "torque", "N·m", 1e-6),
            ("torque [oz-in]", "torque", "N·m", 0.007_061_552),
            ("current_mA", "current", "A", 1e-3),
            ("currentMA", "current", "A", 1e-3),
            ("IqmA", "iq", "A", 1e-3),
            ("current_cA", "current", "A", 1e-2),
            ("angle_mRad", "angle", "rad", 1e-3),
            ("angleMRad", "angle", "rad", 1e-3),
            ("feedbackNm", "feedback", "N·m", 1.0),
            ("dist_um", "dist", "m", 1e-6),
        ] {
            let (found, of) = split_name(name);
            let Some(Written::Sure(of)) = of else { panic!("{name}: {of:?}") };
            assert_eq!((found.as_str(), of.quantity.unit()), (plain, unit), "{name}");
            assert!((of.factor / factor - 1.0).abs() < 1e-6, "{name}: {}", of.factor);
        }
        for name in ["theta", "u", "time", "n", "m", "dof_pos.1", "position[1]"] {
            assert_eq!(split_name(name), (name.to_owned(), None), "one word is a name");
        }
        for (name, either) in [
            ("tau_MNm", ["mNm", "MNm"]),
            ("tau_m_Nm", ["mNm", "Nm"]),
            ("i_m_A", ["mA", "A"]),
            ("offmA", ["mA", "A"]),
        ] {
            let either = either.map(str::to_owned).to_vec();
            assert_eq!(split_name(name).1, Some(Written::Unsure(either)), "{name}");
        }
    }
}
