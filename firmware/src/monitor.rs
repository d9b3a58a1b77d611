//! The watch on amplifier and emergency stop, once a millisecond: the loop of the stop, the
//! amplifier's ready output, the enable line as it is and not as it was set, and the motor's
//! current where it is measured. Which of it keeps the device from being started, and which ends a
//! run.

use control_core::event::Fault;
use control_core::interlock::Interlock;
use control_core::units::DacCode;

/// The levels of the lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Readings {
    /// The emergency stop's loop is open: pressed, or its wire is off.
    pub stop_open: bool,
    /// The amplifier says that it is ready.
    pub ready: bool,
    /// The level of the enable line.
    pub enable_line: bool,
    /// The motor's current where it is measured, as the 12-bit code that asks for it.
    pub current: Option<DacCode>,
}

/// The request to the amplifier in the last tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveRequest {
    /// True if it is to be on.
    pub powered: bool,
    /// The code, of 12 bits.
    pub code: DacCode,
}

/// Looks in a row that must agree: one may come between a change and what follows from it, or in a
/// bounce.
const LOOKS: u8 = 2;
/// The same for the current, which follows its command within a millisecond or two.
const CURRENT_LOOKS: u8 = 3;
/// Codes that the current may differ from every command of the last looks: an eighth of full scale.
const TOLERANCE: u16 = 256;
const ZERO: u16 = 2048;

/// A condition that counts once it has been seen so often in a row.
#[derive(Clone, Copy, Debug, Default)]
struct Lasting(u8);

impl Lasting {
    fn look(&mut self, is_seen: bool, looks: u8) -> bool {
        self.0 = if is_seen { (self.0 + 1).min(looks) } else { 0 };
        self.0 >= looks
    }
}

/// The watch with its memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct DriveMonitor {
    stop: Lasting,
    not_ready: Lasting,
    line_on: Lasting,
    line_off: Lasting,
    current: Lasting,
    asked: [Option<DriveRequest>; CURRENT_LOOKS as usize],
    /// The stuck amplifier has been seen: only a restart puts that right.
    is_stuck: bool,
}

/// The result of a look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// [`Interlock::EmergencyStop`].
    pub stop: bool,
    /// [`Interlock::AmplifierNotReady`].
    pub not_ready: bool,
    /// [`Interlock::AmplifierStuckOn`].
    pub stuck_on: bool,
    /// A fault that is no condition.
    pub fault: Option<Fault>,
}

impl Verdict {
    /// Each condition with whether it is on.
    pub fn conditions(&self) -> [(Interlock, bool); 3] {
        [
            (Interlock::EmergencyStop, self.stop),
            (Interlock::AmplifierNotReady, self.not_ready),
            (Interlock::AmplifierStuckOn, self.stuck_on),
        ]
    }
}

impl DriveMonitor {
    /// Nothing seen.
    pub const fn new() -> Self {
        Self {
            stop: Lasting(0),
            not_ready: Lasting(0),
            line_on: Lasting(0),
            line_off: Lasting(0),
            current: Lasting(0),
            asked: [None; CURRENT_LOOKS as usize],
            is_stuck: false,
        }
    }

    /// One look.
    pub fn look(&mut self, readings: &Readings, asked: DriveRequest) -> Verdict {
        let line_on = self.line_on.look(!asked.powered && readings.enable_line, LOOKS);
        let line_off = self.line_off.look(asked.powered && !readings.enable_line, LOOKS);
        let is_wrong = self.current_is_wrong(readings.current, asked);
        let wrong = self.current.look(is_wrong, CURRENT_LOOKS);
        self.is_stuck |= line_on || wrong && !asked.powered;
        Verdict {
            stop: self.stop.look(readings.stop_open, LOOKS),
            not_ready: self.not_ready.look(!readings.ready, LOOKS),
            stuck_on: self.is_stuck,
            fault: if line_off {
                Some(Fault::AmplifierNotReady)
            } else {
                (wrong && asked.powered).then_some(Fault::Current)
            },
        }
    }

    /// True if the current is that of no command of the last looks, between the least and the
    /// largest of which it may be on its way.
    fn current_is_wrong(&mut self, current: Option<DacCode>, asked: DriveRequest) -> bool {
        self.asked.rotate_right(1);
        self.asked[0] = Some(asked);
        let Some(DacCode(current)) = current else { return false };
        let codes =
            || self.asked.iter().flatten().map(|asked| if asked.powered { asked.code.0 } else { ZERO });
        let least = codes().min().unwrap_or(ZERO).saturating_sub(TOLERANCE);
        let largest = codes().max().unwrap_or(ZERO).saturating_add(TOLERANCE);
        self.asked.iter().all(Option::is_some) && !(least..=largest).contains(&current)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FINE: Readings = Readings { stop_open: false, ready: true, enable_line: true, current: None };
    const ON: DriveRequest = DriveRequest { powered: true, code: DacCode(3000) };
    const OFF: DriveRequest = DriveRequest { powered: false, code: DacCode(ZERO) };

    /// The look in which `wanted` first holds of `readings`, after ten of a device that is fine.
    fn found(readings: Readings, asked: DriveRequest, wanted: impl Fn(&Verdict) -> bool) -> Option<usize> {
        let mut monitor = DriveMonitor::new();
        let fine = Readings { enable_line: asked.powered, ..FINE };
        for _ in 0..10 {
            let current = readings.current.map(|_| asked.code);
            assert_eq!(monitor.look(&Readings { current, ..fine }, asked), Verdict::default());
        }
        (1..=20).find(|_| wanted(&monitor.look(&readings, asked)))
    }

    #[test]
    fn each_line_is_found_in_two_looks() {
        assert_eq!(found(Readings { stop_open: true, ..FINE }, ON, |v| v.stop), Some(2));
        assert_eq!(found(Readings { ready: false, ..FINE }, ON, |v| v.not_ready), Some(2));
        assert_eq!(found(FINE, OFF, |v| v.stuck_on), Some(2));
        let off = Readings { enable_line: false, ..FINE };
        assert_eq!(found(off, ON, |v| v.fault == Some(Fault::AmplifierNotReady)), Some(2));
        assert_eq!(found(FINE, ON, |v| *v != Verdict::default()), None);
    }

    #[test]
    fn a_current_of_no_command_is_found_in_three() {
        let with = |current| Readings { current: Some(DacCode(current)), ..FINE };
        let is_current = |v: &Verdict| v.fault == Some(Fault::Current);
        for wrong in [0, 2048, 3000 - 257, 3000 + 257, 4095] {
            assert_eq!(found(with(wrong), ON, is_current), Some(3), "{wrong}");
        }
        for right in [3000 - 256, 3000, 3000 + 256] {
            assert_eq!(found(with(right), ON, is_current), None, "{right}");
        }
        let off = |current| Readings { enable_line: false, ..with(current) };
        assert_eq!(found(off(3000), OFF, |v| v.stuck_on), Some(3));
        assert_eq!(found(off(2100), OFF, |v| *v != Verdict::default()), None);
    }

    #[test]
    fn a_current_on_its_way_to_its_command_does_not_count() {
        let mut monitor = DriveMonitor::new();
        let mut code = 2048;
        for look in 0..40 {
            // Steps of a thousand codes every fourth look; the current is a look behind.
            let before = code;
            code = if look % 8 < 4 { 2500 } else { 1500 };
            let readings = Readings { current: Some(DacCode(before)), ..FINE };
            let verdict = monitor.look(&readings, DriveRequest { code: DacCode(code), ..ON });
            assert_eq!(verdict, Verdict::default(), "look {look}");
        }
    }

    #[test]
    fn a_stuck_amplifier_is_not_forgotten_and_a_stop_is_released() {
        let mut monitor = DriveMonitor::new();
        for _ in 0..5 {
            monitor.look(&Readings { stop_open: true, ..FINE }, OFF);
        }
        let verdict = monitor.look(&Readings { enable_line: false, ..FINE }, OFF);
        assert_eq!(
            verdict.conditions(),
            [
                (Interlock::EmergencyStop, false),
                (Interlock::AmplifierNotReady, false),
                (Interlock::AmplifierStuckOn, true),
            ]
        );
    }
}
