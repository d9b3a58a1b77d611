//! The result of compensating a device: what it feeds forward now, and what a hand felt before and
//! feels after.

use super::angle;
use super::residual_force::ResidualForce;
use device_sim::error::Error;
use link::commissioning::Record;

/// The result.
#[derive(Clone, Debug)]
pub struct CompensationOutcome {
    /// The device's part, as the device has it now, under its seal.
    pub record: Record,
    /// The rotor's angle, if any part depends on it.
    pub angle: Option<angle::Angle>,
    /// The force of the mechanism that a hand would feel without compensation.
    pub before: ResidualForce,
    /// The force that it felt before, with what the device fed forward; none where it fed nothing
    /// forward.
    pub as_it_was: Option<ResidualForce>,
    /// The force that it feels with what the device feeds forward now.
    pub after: ResidualForce,
    /// The weight that was measured because the report had none, in mN·m.
    pub weight_mnm: Option<f64>,
    /// The findings that cannot be fed forward, a sentence each.
    pub left_out: Vec<String>,
    /// The parts that were tried and undone because the hand would have felt more than before, a
    /// sentence each.
    pub taken_back: Vec<String>,
    /// False where everything was taken back: the device is configured as it was before.
    pub is_compensated: bool,
    /// The motion that all of it took, s.
    pub motion_s: f64,
}

impl CompensationOutcome {
    /// Returns the result, one line each.
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.weight_mnm.iter().map(|weight| format!("weight measured={weight:.3} mN·m")).collect();
        lines.extend(self.taken_back.iter().chain(&self.left_out).cloned());
        let (before, after) = (&self.before, &self.after);
        let rows = [
            ("insertion", before.insertion, after.insertion),
            ("hold", before.hold, after.hold),
            ("withdrawal", before.withdrawal, after.withdrawal),
            ("all", before.all(), after.all()),
        ];
        lines.extend(rows.map(|(what, before, after)| {
            format!("{what} before={:.1} after={:.1} mN rms", before * 1e3, after * 1e3)
        }));
        lines
    }

    /// Returns the reason why nothing is fed forward, where everything was taken back.
    pub fn refusal(&self) -> Option<Error> {
        (!self.is_compensated).then(|| {
            Error::failed(format_args!(
                "the device is as it was before: {}; characterise and diagnose again",
                self.taken_back.join("; ")
            ))
        })
    }
}
