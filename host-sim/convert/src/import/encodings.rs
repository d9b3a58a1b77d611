//! Whole numbers that are not what they seem: negative ones of a register as large positive ones,
//! or with their sign in a bit.

use super::role::Role;
use super::roles::option_of;
use device_sim::error::Error;
use std::collections::BTreeSet;

/// The way in which a register holds negative numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// As they are.
    Plain,
    /// Two's complement of so many bits, read without its sign.
    Int(u32),
    /// The sign is this bit, counted from 0, and the size is below it.
    Sign(u32),
}

/// One `--encoding ROLE=int16`.
#[derive(Clone, Copy, Debug)]
pub struct RoleEncoding {
    /// The role of the column.
    pub role: Role,
    /// Its encoding.
    pub encoding: Encoding,
}

/// Sizes of registers, bits.
const BITS: [u32; 6] = [8, 10, 12, 16, 24, 32];
/// Places of signs.
const SIGNS: [u32; 6] = [7, 9, 10, 11, 14, 15];
/// Numbers that are decoded well change by less than this part of what they change by as they are.
const SMOOTHER: f64 = 0.75;
/// Sizes of a force both ways are as large as each other within this part, reach no more than this
/// part of what a register holds, and begin below that: then it need only be smoother at all, as a
/// large dry friction jumps however it is decoded.
const ALIKE: f64 = 0.1;
const FULL: f64 = 0.94;
const SMALL: f64 = 0.125;
/// So few different numbers of either sign show nothing.
const FEWEST: usize = 20;

/// Reads one `--encoding`.
pub fn encoding(text: &str) -> Result<RoleEncoding, Error> {
    let form = "give it as --encoding command=int16, sign10 or plain";
    let read = || {
        let (role, name) = text.split_once('=')?;
        let role = Role::ALL.into_iter().find(|known| known.name() == role.trim())?;
        let bits = |prefix: &str| name.strip_prefix(prefix)?.parse().ok();
        let encoding = match name {
            "plain" => Encoding::Plain,
            _ => bits("int").map(Encoding::Int).or_else(|| bits("sign").map(Encoding::Sign))?,
        };
        let (Encoding::Plain | Encoding::Int(2..=32) | Encoding::Sign(1..=31)) = encoding else {
            return None;
        };
        Some(RoleEncoding { role, encoding })
    };
    read().ok_or_else(|| Error::input(format_args!("--encoding {text}: is not known; {form}")))
}

impl Encoding {
    /// The number that a register means.
    pub(super) fn decoded(self, x: f64) -> f64 {
        match self {
            Self::Plain => x,
            Self::Int(bits) => {
                let size = f64::from(bits).exp2();
                if x >= size / 2.0 && x < size { x - size } else { x }
            }
            Self::Sign(bit) => {
                let size = f64::from(bit).exp2();
                if x >= size && x < 2.0 * size { size - x } else { x }
            }
        }
    }

    fn name(self) -> String {
        match self {
            Self::Plain => "plain".into(),
            Self::Int(bits) => format!("int{bits}"),
            Self::Sign(bit) => format!("sign{bit}"),
        }
    }
}

/// Asks for the encoding of a column whose numbers are far smoother when they are decoded.
pub(super) fn ask(role: Role, name: &str, values: &[f64]) -> Result<(), Error> {
    let Some(encoding) = seen(role, values) else { return Ok(()) };
    let what = match encoding {
        Encoding::Int(bits) => format!("numbers of {bits} bits whose negative ones were read as positive"),
        _ => "numbers with their sign in a bit".to_owned(),
    };
    Err(Error::input(format_args!(
        "the {role} column {name} seems to hold {what}; give {}, or {} if they are right as they are",
        option_of("--encoding", role, &encoding.name()),
        option_of("--encoding", role, "plain")
    )))
}

/// The encoding under which whole numbers become smooth; none where they are as they are.
fn seen(role: Role, values: &[f64]) -> Option<Encoding> {
    let finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    let (low, high) =
        finite.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    if low < 0.0 || finite.iter().any(|x| x.fract() != 0.0) {
        return None;
    }
    let travel = |of: Encoding| -> f64 {
        finite.windows(2).map(|w| (of.decoded(w[1]) - of.decoded(w[0])).abs()).sum()
    };
    // A position that runs over is made continuous anyway.
    let ints = BITS.into_iter().filter(|_| !matches!(role, Role::Position | Role::Reference));
    let fits = |half: f64| high >= half && high < 2.0 * half;
    let all = ints
        .filter(|bits| fits(f64::from(bits - 1).exp2()))
        .map(Encoding::Int)
        .chain(SIGNS.into_iter().filter(|bit| fits(f64::from(*bit).exp2())).map(Encoding::Sign));
    let best = all.map(|of| (travel(of), of)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    // Steps between a few values are no sign of a register.
    let different = |is_negative: bool| {
        let decoded = finite.iter().map(|x| best.1.decoded(*x)).filter(|x| (*x < 0.0) == is_negative);
        decoded.map(|x| x as i64).collect::<BTreeSet<_>>().len() >= FEWEST
    };
    let least = if is_mirrored(best.1, &finite) { 1.0 } else { SMOOTHER };
    (best.0 < least * travel(Encoding::Plain) && different(true) && different(false)).then_some(best.1)
}

/// True if numbers with their sign in a bit have the same sizes with it and without, and none is
/// between the largest without it and the bit.
fn is_mirrored(encoding: Encoding, values: &[f64]) -> bool {
    let Encoding::Sign(bit) = encoding else { return false };
    let size = f64::from(bit).exp2();
    let without = values.iter().filter(|x| **x < size).fold(0.0_f64, |most, x| most.max(*x));
    let with = values.iter().filter(|x| **x >= size).map(|x| x - size);
    let (low, high) = with.fold((size, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    (without - high).abs() < ALIKE * high && without < FULL * size && low < SMALL * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_seen_and_plain_numbers_left_alone() {
        let wave: Vec<f64> = (0..500).map(|i| (200.0 * (f64::from(i) * 0.05).sin()).round()).collect();
        for of in [
            Encoding::Int(8 + 8),
            Encoding::Int(12),
            Encoding::Int(32),
            Encoding::Sign(10),
            Encoding::Sign(15),
        ] {
            let size = match of {
                Encoding::Int(bits) => f64::from(bits).exp2(),
                Encoding::Sign(bit) => f64::from(bit).exp2(),
                Encoding::Plain => 0.0,
            };
            let raw = |x: &f64| match of {
                Encoding::Int(_) if *x < 0.0 => x + size,
                Encoding::Sign(_) if *x < 0.0 => size - x,
                _ => *x,
            };
            let registers: Vec<f64> = wave.iter().map(raw).collect();
            assert_eq!(seen(Role::Command, &registers), Some(of));
            assert!(registers.iter().zip(&wave).all(|(r, x)| (of.decoded(*r) - x).abs() < 1e-9), "{of:?}");
        }
        // Dry friction jumps by twice its size where the motion turns back.
        let dry = |i: i32| {
            let angle = f64::from(i) * 0.05;
            (500.0 * (angle.sin() * 20.0).clamp(-1.0, 1.0) + 80.0 * angle.cos()).round()
        };
        let signed: Vec<f64> = (0..500).map(dry).map(|x| if x < 0.0 { 1024.0 - x } else { x }).collect();
        assert_eq!(seen(Role::Command, &signed), Some(Encoding::Sign(10)));
        let centred: Vec<f64> = (0..500).map(|i| 512.0 + 0.8 * dry(i).round()).map(f64::round).collect();
        assert_eq!(seen(Role::Command, &centred), None, "half of the range is zero");
        let shifted: Vec<f64> = wave.iter().map(|x| x + 40_000.0).collect();
        assert_eq!(seen(Role::Command, &shifted), None);
        let turning: Vec<f64> = (0..500).map(|i| f64::from(i * 37 % 4096)).collect();
        assert_eq!(seen(Role::Position, &turning), None);
    }
}
