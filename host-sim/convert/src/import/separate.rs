//! Decides if files with the same columns are runs of their own: only their clocks or their names
//! can say so. Two sensors of one run have the same columns too.

use super::rows::Rows;
use super::table::Log;
use super::units;
use device_sim::error::Error;
use std::path::Path;

/// Clocks that begin with the recording distinguish two runs whose lengths differ by this part: two
/// loggers of one run do not stop a tenth of it apart.
const ANOTHER_LENGTH: f64 = 0.1;
/// Words by which people distinguish their runs.
const RUNS: &str = "fit holdout train training test val valid validation verify estimation identification run runs trial take \
                    rep repeat exp experiment session rec recording log slow slower fast faster \
                    day night before after first second third one two three monday tuesday wednesday thursday friday";
/// Words for parts of a machine: a number after one of them is no number of a run.
pub(super) const PARTS: &str =
    "joint joints motor axis axes sensor channel ch encoder drive actuator wheel leg arm finger side";
/// Letters for axes of a machine.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Refuses files of which nothing says whether they are runs; `wholes` holds the rows of each of
/// `logs`.
pub(super) fn check(logs: &[Log], wholes: &[Rows]) -> Result<(), Error> {
    for (i, a) in logs.iter().enumerate() {
        for (k, b) in logs.iter().enumerate().skip(i + 1) {
            let why = match compare(&wholes[i], &wholes[k]) {
                Clocks::Apart => continue,
                Clocks::SameTime => "at the same time",
                Clocks::Unknown if names_are_of_runs(&a.file, &b.file) => continue,
                Clocks::Unknown => "over the same time",
            };
            return Err(Error::input(format_args!(
                "{} and {} have the same columns {why}, and their names do not say whether they are two runs; give --runs if they are, else say whose columns are whose: --column position=FILE/NAME --column command=FILE/NAME",
                a.file, b.file
            )));
        }
    }
    Ok(())
}

#[derive(Debug, PartialEq)]
enum Clocks {
    /// They distinguish two runs.
    Apart,
    /// Their dates show that both were recorded at once.
    SameTime,
    /// They do not decide it.
    Unknown,
}

fn compare(a: &Rows, b: &Rows) -> Clocks {
    let ends = |rows: &Rows| {
        let (low, high) =
            rows.time.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(*t), h.max(*t)));
        (rows.origin + low, rows.origin + high)
    };
    let ((a0, a1), (b0, b1)) = (ends(a), ends(b));
    if b0 >= a1 || a0 >= b1 {
        return Clocks::Apart;
    }
    if a.origin > 0.0 && b.origin > 0.0 {
        return Clocks::SameTime;
    }
    let (a, b) = (a1 - a0, b1 - b0);
    if (a - b).abs() > ANOTHER_LENGTH * a.max(b) { Clocks::Apart } else { Clocks::Unknown }
}

/// True if two names differ only in what people distinguish runs by: numbers, single letters, words
/// such as `fit` and `holdout`.
fn names_are_of_runs(a: &str, b: &str) -> bool {
    let words = |file: &str| {
        let stem = Path::new(file).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let words = units::words(&stem);
        words.iter().flat_map(|word| numbers_apart(word)).collect::<Vec<_>>()
    };
    let (a, b) = (words(a), words(b));
    let known = |list: &str, word: &str| list.split_whitespace().any(|known| known == word);
    let of_runs = |(before, word): (Option<&String>, &String)| {
        let is_short = word.chars().count() == 1 || word.bytes().all(|c| c.is_ascii_digit());
        let is_of_part = AXES.contains(&word.as_str()) || before.is_some_and(|before| known(PARTS, before));
        (is_short && !is_of_part) || known(RUNS, word)
    };
    let mut only = only_in(&a, &b).chain(only_in(&b, &a)).peekable();
    // The same words in another folder say as little as the same name.
    only.peek().is_some() && only.all(of_runs)
}

/// The words of `a` that `b` does not have, each with the word before it.
fn only_in<'a>(a: &'a [String], b: &'a [String]) -> impl Iterator<Item = (Option<&'a String>, &'a String)> {
    let before = std::iter::once(None).chain(a.iter().map(Some));
    before.zip(a).filter(|(_, word)| !b.contains(word))
}

/// `run12b` as `run`, `12`, `b`.
pub(super) fn numbers_apart(word: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut before = None;
    for c in word.chars() {
        if before != Some(c.is_ascii_digit()) {
            out.push(String::new());
        }
        before = Some(c.is_ascii_digit());
        if let Some(word) = out.last_mut() {
            word.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::units::Quantity;
    use super::*;
    use std::collections::BTreeMap;

    fn rows(origin: f64, from: f64, to: f64) -> Rows {
        let time = vec![from, 0.5 * (from + to), to];
        let (position, command, reference) = (Quantity::Angle, Quantity::Plain, Quantity::Angle);
        Rows { time, origin, columns: BTreeMap::new(), position, command, reference }
    }

    #[test]
    fn clocks_distinguish_runs_where_they_can() {
        assert_eq!(compare(&rows(0.0, 0.0, 5.0), &rows(0.0, 5.0, 9.0)), Clocks::Apart);
        assert_eq!(compare(&rows(0.0, 0.0, 5.0), &rows(0.0, 0.0, 6.0)), Clocks::Apart);
        assert_eq!(compare(&rows(0.0, 0.0, 5.0), &rows(0.0, 0.0, 5.0)), Clocks::Unknown);
        assert_eq!(compare(&rows(1.7e9, 0.0, 5.0), &rows(1.7e9 + 2.0, 0.0, 8.0)), Clocks::SameTime);
        assert_eq!(compare(&rows(1.7e9, 0.0, 5.0), &rows(1.7e9 + 9.0, 0.0, 5.0)), Clocks::Apart);
    }

    #[test]
    fn names_distinguish_runs_only_by_numbers_of_runs() {
        for (a, b) in [
            ("run1.csv", "run2.csv"),
            ("fit.csv", "holdout.csv"),
            ("x/log-a.csv", "log-b.csv"),
            ("log.csv", "log2.csv"),
            ("joint1_run1.csv", "joint1_run2.csv"),
        ] {
            assert!(names_are_of_runs(a, b), "{a} {b}");
        }
        for (a, b) in [
            ("position.csv", "torque.csv"),
            ("motor.csv", "load.csv"),
            ("a/log.csv", "b/log.csv"),
            ("joint1.csv", "joint2.csv"),
            ("motor_a.csv", "motor_b.csv"),
            ("left.csv", "right.csv"),
            ("log_x.csv", "log_y.csv"),
        ] {
            assert!(!names_are_of_runs(a, b), "{a} {b}");
        }
    }
}
