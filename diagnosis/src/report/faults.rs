//! Faults of recordings in words.

use crate::data::schema::{DataFault, FaultKind};
use numerics::digits::in_sentence;

/// A clause for each kind of fault, with the recordings that have it.
pub(super) fn clauses(faults: &[DataFault]) -> Vec<String> {
    let kinds = faults.chunk_by(|a, b| a.kind == b.kind);
    kinds.map(clause).collect()
}

/// The clause of faults of one kind, of which there is at least one.
fn clause(faults: &[DataFault]) -> String {
    let files: Vec<&str> = faults.iter().map(|one| one.file.as_str()).collect();
    let files = match &files[..] {
        [before @ .., last] if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => files.join(""),
    };
    let value = faults.iter().map(|one| one.value).fold(f64::INFINITY, f64::min);
    match faults[0].kind {
        FaultKind::HeldReadings => format!(
            "{files}: the position has {} new readings a second, fewer than it has rows; only rows with a new one count",
            in_sentence(value)
        ),
        FaultKind::SlowCommand => format!(
            "{files}: the command has {} new values a second, fewer than it has rows, and the motion shows that it changed in between; only rows with a new one count",
            in_sentence(value)
        ),
        FaultKind::LateCommand => format!(
            "{files}: the command is logged {} ms late, as the motion comes before it; all values are those after that shift",
            in_sentence(1e3 * value)
        ),
        FaultKind::OneWayMotion => format!(
            "{files}: the axis moves one way only, where dry friction, friction that differs with direction and a constant force cannot be distinguished; the patched rig has friction that is the same both ways"
        ),
    }
}
