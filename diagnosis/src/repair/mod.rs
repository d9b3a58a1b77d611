//! Faults of the recordings themselves, found before any law is searched: readings and commands
//! that are logged more often than they are renewed, and commands that are logged late.
//!
//! [`check`] is a function of rig and recordings alone. It gives the recordings that are to be
//! diagnosed, in which nothing is left that would look like physics, and says what it found; or it
//! says why nothing can be learnt from them. The rig is never changed.

mod balance;
mod held;
mod late;
mod one_way;
mod slow_command;

use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::data::schema::{DataFault, FaultKind};
use crate::data::sufficiency::SLOWEST_HZ;
use std::borrow::Cow;

/// Recordings without the faults of their logs, and what these were.
pub(crate) struct Checked<'a> {
    pub(crate) fit: Cow<'a, [Recording]>,
    pub(crate) holdout: Cow<'a, [Recording]>,
    pub(crate) faults: Vec<DataFault>,
    /// Why nothing can be learnt from the rows that are kept; none where something can.
    pub(crate) too_slow: Option<String>,
    /// True if the axis moves one way only in all of them.
    pub(crate) is_one_way: bool,
}

/// Looks for faults in the recordings of a rig and takes them out.
pub(crate) fn check<'a>(rig: &Rig, fit: &'a [Recording], holdout: &'a [Recording]) -> Checked<'a> {
    let mut checked = Checked::unchanged(fit, holdout);
    let held = checked.all().into_iter().map(held::renewals).collect();
    checked.keep_renewed(FaultKind::HeldReadings, held);
    let slow = slow_command::renewals(&checked.all(), rig);
    checked.keep_renewed(FaultKind::SlowCommand, slow);
    if checked.too_slow.is_none()
        && let Some(late) = late::late_rows(&checked.all(), rig)
    {
        checked.advance_commands(&late);
    }
    if let Some(value) = one_way::back(&checked.all()) {
        let files: Vec<String> = checked.all().iter().map(|one| one.file.clone()).collect();
        let fault = |file| DataFault { kind: FaultKind::OneWayMotion, value, unit: "1".into(), file };
        checked.faults.extend(files.into_iter().map(fault));
        checked.is_one_way = true;
    }
    checked
}

/// The rows at which a column has a new value, where that is not every row, and new values a
/// second.
struct Renewals {
    rows: Vec<usize>,
    rate_hz: f64,
}

impl<'a> Checked<'a> {
    /// Recordings as they are.
    pub(crate) fn unchanged(fit: &'a [Recording], holdout: &'a [Recording]) -> Self {
        Self {
            fit: Cow::Borrowed(fit),
            holdout: Cow::Borrowed(holdout),
            faults: Vec::new(),
            too_slow: None,
            is_one_way: false,
        }
    }

    fn all(&self) -> Vec<&Recording> {
        self.fit.iter().chain(&*self.holdout).collect()
    }

    /// The recording at a place in [`Self::all`], to be changed.
    fn recording(&mut self, place: usize) -> &mut Recording {
        match place.checked_sub(self.fit.len()) {
            None => &mut self.fit.to_mut()[place],
            Some(place) => &mut self.holdout.to_mut()[place],
        }
    }

    /// Keeps the rows at which a column is renewed, of each recording in which it is not renewed at
    /// every row.
    fn keep_renewed(&mut self, kind: FaultKind, found: Vec<Option<Renewals>>) {
        for (place, renewals) in found.into_iter().enumerate() {
            let Some(Renewals { rows, rate_hz }) = renewals else { continue };
            let recording = self.recording(place);
            let (before_hz, file) = (recording.rate_hz(), recording.file.clone());
            *recording = recording.at_rows(&rows);
            if rate_hz < SLOWEST_HZ && self.too_slow.is_none() {
                let what = if kind == FaultKind::HeldReadings {
                    "readings of the position"
                } else {
                    "values of the command"
                };
                self.too_slow = Some(format!(
                    "{file} has {before_hz:.0} rows and only {rate_hz:.0} new {what} a second, where 20 are needed: log it as often as it is renewed, and renew it more often"
                ));
            }
            self.faults.push(DataFault { kind, value: rate_hz, unit: "Hz".into(), file });
        }
    }

    /// Gives each recording the commands that were logged so many rows later.
    fn advance_commands(&mut self, late: &[usize]) {
        for (place, rows) in late.iter().enumerate() {
            let recording = self.recording(place);
            let value = *rows as f64 / recording.rate_hz();
            let file = recording.file.clone();
            *recording = recording.with_earlier_command(*rows);
            self.faults.push(DataFault { kind: FaultKind::LateCommand, value, unit: "s".into(), file });
        }
    }
}
