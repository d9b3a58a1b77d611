//! The evidence table: one row a hypothesis, in the same numbers on every machine.

use std::fmt::Write as _;

/// The numbers of a row, in their order; empty where neither proposer has one.
pub(crate) const COLUMNS: [&str; 13] = [
    // The filter: gain on held-out recordings, nats, and its mean over its standard error.
    "filter_gain",
    "filter_z",
    // The regression: share of the force error and its z, on left-out frames of the fit and on
    // held-out recordings.
    "share",
    "z",
    "held_share",
    "held_z",
    // Agreement of the size in two halves of the fit and on held-out recordings, the smaller one.
    "size_agreement",
    // Standard errors ahead of the next law; negative: behind the first.
    "lead_z",
    // Share that a smooth force of any form takes beyond the law.
    "free_form_more",
    // Force error after the law over the noise of the readings, and degrees of freedom.
    "residual_over_noise",
    "rows",
    // Logarithm of the error of the patched simulation over the refitted one's, in windows of 0.1
    // and 0.5 s; of named effects.
    "motion_0_1_s",
    "motion_0_5_s",
];

/// The evidence for one hypothesis; `none` is the hypothesis that nothing is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct EvidenceRow {
    pub(crate) name: &'static str,
    pub(crate) is_named: bool,
    pub(crate) numbers: [Option<f64>; COLUMNS.len()],
}

/// The table as CSV, with a header.
pub(crate) fn csv(rows: &[EvidenceRow]) -> String {
    let mut out = format!("hypothesis,named,{}\n", COLUMNS.join(","));
    for row in rows {
        let _ = write!(out, "{},{}", row.name, u8::from(row.is_named));
        for number in row.numbers {
            out.push(',');
            if let Some(x) = number.filter(|x| x.is_finite()) {
                let _ = write!(out, "{x:.6e}");
            }
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_number_for_every_column_or_a_gap() {
        let mut numbers = [None; COLUMNS.len()];
        (numbers[0], numbers[12]) = (Some(3.5), Some(-0.25));
        let text = csv(&[EvidenceRow { name: "backlash", is_named: true, numbers }]);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(lines[0].len(), lines[1].len());
        let cell =
            |column: &str| lines[1][lines[0].iter().position(|name| *name == column).expect("a column")];
        assert_eq!((cell("hypothesis"), cell("named"), cell("share")), ("backlash", "1", ""));
        let number = |column: &str| cell(column).parse::<f64>().expect("a number");
        assert_eq!((number("filter_gain"), number("motion_0_5_s")), (3.5, -0.25));
    }
}
