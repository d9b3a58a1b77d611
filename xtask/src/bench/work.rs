//! The growth of cost with work: the same thing at one, ten and a hundred times the amount.

use super::values::{Values, WORK};

/// A subject that is measured at several amounts of work.
#[derive(Debug, PartialEq)]
pub(crate) struct Work {
    subject: String,
    unit: String,
    /// Amounts and the seconds that they took, from the least to the most.
    taken: Vec<(f64, f64)>,
}

/// From this on a ratio is distinguished from 1, and its reason is printed.
const APART: f64 = 1.2;

/// The subjects, and what makes their cost grow other than their work.
const REASONS: [(&str, &str); 4] = [
    ("plant", "the shortest run ends before the needle is in tissue, where a tick does more"),
    (
        "diagnose",
        "a longer recording shows more effects, and each one found adds columns to every fit; part of the time is the same for all",
    ),
    ("xpbd", "the larger mesh leaves the nearest caches, and its passes wait for memory"),
    ("class", "the instructor's own work is shared by more devices"),
];

impl Work {
    /// Time per work at the largest amount over that at the smallest: 1 where the cost grows as the
    /// work does.
    fn growth(&self) -> Option<f64> {
        let ((least, short), (most, long)) = (self.taken.first()?, self.taken.last()?);
        (most > least && *short > 0.0).then(|| (long / most) / (short / least))
    }

    fn is_linear(&self) -> bool {
        self.growth().is_some_and(|growth| growth < APART && growth > 1.0 / APART)
    }

    fn lines(&self) -> Vec<String> {
        let Some((least, first)) = self.taken.first() else { return vec![] };
        let mut lines: Vec<String> = self
            .taken
            .iter()
            .map(|(amount, seconds)| {
                let times = (seconds / amount) / (first / least);
                let work = format!("{amount} {}", self.unit);
                format!("{:<12}{work:>18}{seconds:>14.4} s  {times:>6.2}", self.subject)
            })
            .collect();
        let reason = REASONS.iter().find(|(subject, _)| *subject == self.subject);
        if let (false, Some((_, reason))) = (self.is_linear(), reason) {
            lines.push(format!("{:<12}  not linear: {reason}", ""));
        }
        lines
    }
}

/// The measured work, by subject; what was printed as `work.subject.unit.amount=seconds`.
pub(crate) fn works(values: &Values) -> Vec<Work> {
    let mut works: Vec<Work> = vec![];
    for (name, value) in values {
        let parts: Vec<&str> = name.split('.').collect();
        let [WORK, subject, unit, amount] = parts[..] else { continue };
        let (Ok(amount), Ok(seconds)) = (amount.parse(), value.parse()) else { continue };
        match works.iter_mut().find(|work| work.subject == subject) {
            Some(work) => work.taken.push((amount, seconds)),
            None => works.push(Work {
                subject: subject.into(),
                unit: unit.into(),
                taken: vec![(amount, seconds)],
            }),
        }
    }
    works.iter_mut().for_each(|work| work.taken.sort_by(|a, b| a.0.total_cmp(&b.0)));
    works
}

/// The rows that follow: `subject_growth`.
pub(crate) fn growths(works: &[Work]) -> Values {
    let of = |work: &Work| Some((format!("{}_growth", work.subject), format!("{:.2}", work.growth()?)));
    works.iter().filter_map(of).collect()
}

/// Prints the table of work.
pub(crate) fn print(works: &[Work]) {
    if works.is_empty() {
        return;
    }
    println!("\n{:<12}{:>18}{:>14}    {:>6}", "subject", "work", "time", "time/work, least = 1");
    works.iter().flat_map(Work::lines).for_each(|line| println!("{line}"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::values::values_in;

    #[test]
    fn work_is_read_and_its_growth_is_a_row() {
        let values =
            values_in("work.xpbd.particles.500=0.1 work.xpbd.particles.5000=1.5 work.xpbd.particles.=1 a=2");
        let works = works(&values);
        assert_eq!(works.len(), 1);
        assert_eq!(works[0].taken, [(500.0, 0.1), (5_000.0, 1.5)]);
        assert_eq!(growths(&works), Values::from([("xpbd_growth".into(), "1.50".into())]));
        let lines = works[0].lines();
        assert!(lines.len() == 3 && lines[2].contains("memory"), "{lines:?}");
    }

    #[test]
    fn work_that_grows_in_proportion_needs_no_reason() {
        let work =
            Work { subject: "plant".into(), unit: "ticks".into(), taken: vec![(1.0, 2.0), (100.0, 210.0)] };
        assert_eq!(work.lines().len(), 2);
        let once = Work { taken: vec![(1.0, 2.0)], ..work };
        assert_eq!(once.growth(), None, "nothing to compare");
    }
}
