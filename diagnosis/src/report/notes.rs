//! Notes that a reader has to know: commands that act early or late, an inertia far from the rig's,
//! and what a log alone cannot distinguish from a name.

use crate::decide::diagnosis::{Moved, NamedEffect};

/// Standard deviations from the rig's value at which a value is reported as far from it.
const FAR: f64 = 2.0;
/// Rows by which commands act early or late at which that is reported: a hundredth is the last
/// digit shown.
const SKEWED: f64 = 0.005;

/// Scatter of a reading, counts, from which its noise is no longer that of counting, which is 0.29.
const SCATTERS: f64 = 1.0;

/// The note where the motion shows no inertia.
const HIDDEN: &str =
    "the recordings do not show the inertia, so the rig's is kept: a faster motion would show it";

/// The notes on a diagnosis, each a clause.
pub(crate) fn notes(moved: &Moved, named: &[NamedEffect]) -> Vec<String> {
    let of_a_log = named.iter().filter_map(|effect| effect.name.definition().fault_of_a_log());
    of_refit(moved).into_iter().chain(of_a_log.map(str::to_owned)).collect()
}

fn of_refit(moved: &Moved) -> Vec<String> {
    let timing = moved.late_rows.filter(|rows| rows.abs() >= SKEWED).map(timing);
    let is_far = moved.is_at_limit || moved.deviations.abs() >= FAR;
    let inertia = match (moved.is_hidden, is_far) {
        (true, _) => Some(HIDDEN.to_owned()),
        (false, true) => Some(inertia(moved)),
        (false, false) => None,
    };
    let scatter = moved.scatter.filter(|counts| *counts >= SCATTERS).map(|counts| {
        format!(
            "readings scatter by about {counts:.1} counts, more than whole counts do: if the sensor is analogue, set encoder.noise_counts to that"
        )
    });
    timing.into_iter().chain(inertia).chain(scatter).collect()
}

fn timing(rows: f64) -> String {
    let when = if rows > 0.0 { "after" } else { "before" };
    format!("commands act {:.2} rows {when} their time stamps, which the models allow for", rows.abs())
}

fn inertia(moved: &Moved) -> String {
    let far = if moved.is_at_limit {
        "as far as the rig's uncertainty allows".to_owned()
    } else {
        format!("{:.1} of its standard deviations away", moved.deviations.abs())
    };
    format!(
        "the refit makes the inertia over the drive's gain {:.2} times the rig's, {far}: check both values, or the units",
        moved.inertia_by_gain,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_far_inertia_and_a_visible_skew_are_reported() {
        let near = Moved {
            late_rows: None,
            inertia_by_gain: 1.1,
            deviations: -0.6,
            is_at_limit: false,
            is_hidden: false,
            scatter: Some(0.3),
        };
        assert!(of_refit(&near).is_empty());
        assert!(of_refit(&Moved { late_rows: Some(0.002), ..near }).is_empty());
        let far = Moved { inertia_by_gain: 0.1, deviations: 3.5, ..near };
        let both = of_refit(&Moved { late_rows: Some(-0.5), ..far });
        assert!(both[0].contains("0.50 rows before"), "{both:?}");
        assert!(both[1].contains("0.10 times the rig's, 3.5 of"), "{both:?}");
        let at_limit =
            of_refit(&Moved { inertia_by_gain: 4.64, deviations: 1.47, is_at_limit: true, ..near });
        assert!(at_limit[0].contains("4.64 times the rig's, as far as"), "{at_limit:?}");
        let analogue = of_refit(&Moved { scatter: Some(3.26), ..near });
        assert!(analogue.len() == 1 && analogue[0].contains("about 3.3 counts"), "{analogue:?}");
        let hidden = of_refit(&Moved { is_at_limit: true, is_hidden: true, ..near });
        assert!(hidden.len() == 1 && hidden[0].contains("do not show the inertia"), "{hidden:?}");
    }
}
