//! The tables of a debrief: figures side by side, which of two is better, and a row for each
//! insertion.

use super::Attempt;
use crate::score::Insertion;
use html_report::{Cell, Sheet};

/// A figure of the table: its words, its value, its decimals, and which of two values is better.
type Figure = (&'static str, fn(&Insertion) -> Option<f64>, usize, Better);

/// The direction in which a figure improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Better {
    Less,
    More,
    /// The sign counts for nothing.
    NearerZero,
    /// It depends on the patient and the goal.
    Neither,
}

/// Figures closer than this share of the larger one are called the same.
const SAME_WITHIN: f64 = 0.05;

impl Better {
    /// Judges `last` against `first` in a word; nothing where neither value is better.
    fn judge(self, first: f64, last: f64) -> &'static str {
        if self == Self::Neither {
            return "";
        }
        if (last - first).abs() <= SAME_WITHIN * first.abs().max(last.abs()) {
            return "same";
        }
        let is_better = match self {
            Self::Less => last < first,
            Self::More => last > first,
            Self::NearerZero => last.abs() < first.abs(),
            Self::Neither => false,
        };
        if is_better { "better" } else { "worse" }
    }
}

const FIGURES: [Figure; 26] = [
    ("time in tissue, s", |i| Some(i.time_s), 2, Better::Less),
    ("time in the lumen, s", |i| Some(i.in_lumen_s), 2, Better::Neither),
    ("time in the target, s", |i| i.target.as_ref().map(|target| target.time_s), 2, Better::Neither),
    ("path of the tip, mm", |i| Some(i.path_mm), 1, Better::Less),
    ("deepest, along the needle, mm", |i| Some(i.depth_mm), 1, Better::Neither),
    ("vessel first touched at, mm", |i| i.vessel_contact_path_mm, 2, Better::Neither),
    ("went on in the vessel by, mm", |i| i.overshoot_mm, 1, Better::Neither),
    ("walls that gave way", |i| Some(f64::from(i.punctures)), 0, Better::Neither),
    ("layers met again in the needle's track", |i| Some(f64::from(i.met_in_track)), 0, Better::Neither),
    ("layers pierced once more", |i| Some(f64::from(i.pierced_again)), 0, Better::Neither),
    ("blood in the hub, times", |i| Some(f64::from(i.flashbacks)), 0, Better::Neither),
    ("through the far wall", |i| Some(f64::from(u8::from(i.through_far_wall))), 0, Better::Less),
    ("touches of what was to be spared", |i| Some(f64::from(i.spared_hits)), 0, Better::Less),
    ("critical errors", |i| Some(i.verdict.errors(true) as f64), 0, Better::Less),
    ("other errors", |i| Some(i.verdict.errors(false) as f64), 0, Better::Less),
    ("passes", |i| Some(f64::from(i.passes)), 0, Better::Less),
    ("redirections", |i| Some(f64::from(i.redirections)), 0, Better::Less),
    ("largest force, N", |i| Some(i.peak_force_n), 2, Better::Less),
    ("angle at the first puncture, °", |i| i.angle_deg, 1, Better::Neither),
    ("angle error along the way, ° rms", |i| i.angle_rms_error_deg, 1, Better::Less),
    ("largest angle error, °", |i| i.angle_largest_error_deg, 1, Better::NearerZero),
    ("turned beyond the largest angle, times", |i| Some(f64::from(i.barriers)), 0, Better::Less),
    ("largest lateral force, N", |i| i.largest_lateral_n, 2, Better::Neither),
    ("tip in the ultrasound image, share of the time", |i| i.tip_seen_share, 2, Better::More),
    ("needle in the ultrasound plane, share of it", |i| i.in_plane_share, 2, Better::More),
    ("smoothness", |i| i.smoothness, 2, Better::More),
];

/// Writes the table of figures, side by side.
pub(super) fn compare(sheet: &mut Sheet, compared: &[&Attempt]) {
    let mut head = vec![""];
    head.extend(compared.iter().map(|one| one.name.as_str()));
    if compared.len() == 2 {
        head.extend(["change", "verdict"]);
    }
    let rows = FIGURES.iter().map(|(words, value, decimals, better)| {
        let values: Vec<Option<f64>> = compared.iter().map(|one| value(&one.figures)).collect();
        let mut row = vec![Cell::text(*words)];
        row.extend(values.iter().map(|v| Cell::number(*v, *decimals)));
        if let [Some(first), Some(last)] = values[..] {
            row.extend([Cell::number(Some(last - first), *decimals), Cell::text(better.judge(first, last))]);
        } else if values.len() == 2 {
            row.extend([Cell::number(None, 0), Cell::text("")]);
        }
        row
    });
    sheet.table(&head, &rows.collect::<Vec<_>>());
}

/// Writes a row for each insertion.
pub(super) fn list(sheet: &mut Sheet, attempts: &[Attempt]) {
    let head = [
        "",
        "time, s",
        "lumen, s",
        "path, mm",
        "force, N",
        "angle, ° rms",
        "smoothness",
        "far wall",
        "redirections",
    ];
    let rows = attempts.iter().map(|one| {
        let figures = &one.figures;
        vec![
            Cell::text(one.name.clone()),
            Cell::number(Some(figures.time_s), 1),
            Cell::number(Some(figures.in_lumen_s), 1),
            Cell::number(Some(figures.path_mm), 1),
            Cell::number(Some(figures.peak_force_n), 2),
            Cell::number(figures.angle_rms_error_deg, 1),
            Cell::number(figures.smoothness, 2),
            Cell::text(if figures.through_far_wall { "through" } else { "" }),
            Cell::number(Some(f64::from(figures.redirections)), 0),
        ]
    });
    sheet.table(&head, &rows.collect::<Vec<_>>());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_judged_in_its_own_direction() {
        assert_eq!(
            [(4.0, 6.0), (6.0, 4.0), (4.0, 4.1)].map(|(a, b)| Better::Less.judge(a, b)),
            ["worse", "better", "same"]
        );
        assert_eq!([(-4.0, -2.0), (-1.4, -3.0)].map(|(a, b)| Better::More.judge(a, b)), ["better", "worse"]);
        assert_eq!(Better::NearerZero.judge(-12.0, 3.0), "better");
        assert_eq!(Better::Neither.judge(1.0, 9.0), "");
    }
}
