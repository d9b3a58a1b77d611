//! The lines that a device is sent while its needle turns in tissue.

use super::NeedleTrack;
use crate::profile::Profile;
use control_core::units::Millimetres;
use control_core::{NeedleLine, Plan};
use fixed::types::I16F16;
use link::frames::{DeviceFrame, EventKind};
use std::time::Duration;

/// Time between two lines: 66 a second. The device takes up to 12 ms for one.
const PERIOD: Duration = Duration::from_millis(15);
/// A layer that has moved by less is where it was, mm.
const SAME_MM: f64 = 0.005;
/// Two layers are at least this far apart, mm: a layer that the line does not meet has no more.
const APART_MM: f64 = 0.01;
/// A wall that the line does not meet, and all below it, are out of reach, mm along the needle.
const OUT_OF_REACH_MM: f64 = 55.0;

/// Follows a device by its frames and says which line to send it.
#[derive(Clone, Debug)]
pub struct LineSender {
    track: NeedleTrack,
    plan: Plan,
    /// The tilts, rad, at which a barrier stops the needle.
    tilt_limits: Option<[f64; 2]>,
    /// The layers of the patient, which a device has until it is sent a line.
    own: NeedleLine,
    sent: NeedleLine,
    sent_at: Duration,
    /// A wall has given way since: a line, be it the same, tells the device that what the tip has
    /// passed turns with the needle.
    has_pierced: bool,
}

impl LineSender {
    /// A needle outside `profile`; the device has the layers of its patient.
    pub fn new(profile: &Profile) -> Self {
        Self {
            track: NeedleTrack::new(profile),
            sent: profile.plan.own_line(),
            own: profile.plan.own_line(),
            plan: profile.plan.clone(),
            tilt_limits: profile.slope.map(|slope| {
                [slope.smallest, slope.largest].map(|deg| deg.to_radians() + profile.skin_tilt_rad())
            }),
            sent_at: Duration::ZERO,
            has_pierced: false,
        }
    }

    /// Takes what the device has sent.
    pub fn frame(&mut self, frame: &DeviceFrame) {
        match frame {
            DeviceFrame::Pose(pose) => {
                self.track.move_to(pose.depth.0.to_num(), f64::from(pose.angle.0) * 1e-3);
            }
            DeviceFrame::Event(event) => {
                if event.kind == EventKind::Started {
                    // A zero before it has made the device forget the last line.
                    self.sent = self.own.clone();
                }
                self.has_pierced |= matches!(event.kind, EventKind::Puncture { .. });
                self.track.happen(&event.kind);
            }
            DeviceFrame::Hello(_) => self.sent = self.own.clone(),
            _ => {}
        }
    }

    /// The needle that it follows.
    pub fn track(&self) -> &NeedleTrack {
        &self.track
    }

    /// Returns the tilts, rad, at which a barrier stops a needle that is turned; none where the
    /// patient has no such range.
    pub fn tilt_limits(&self) -> Option<[f64; 2]> {
        self.tilt_limits
    }

    /// Returns the line to send at `now`, if it has changed or a wall has given way since the last
    /// one, and that is long enough ago.
    pub fn due(&mut self, now: Duration) -> Option<NeedleLine> {
        if now < self.sent_at + PERIOD {
            return None;
        }
        let line = line(&self.track);
        let moved = line.depths.iter().zip(&self.sent.depths);
        let is_same = moved
            .map(|(new, old)| (new.0.to_num::<f64>() - old.0.to_num::<f64>()).abs())
            .all(|mm| mm < SAME_MM);
        // One that the device would refuse is not sent: it stays with the last.
        if is_same && !self.has_pierced || self.plan.check_line(&line).is_err() {
            return None;
        }
        (self.sent, self.sent_at, self.has_pierced) = (line.clone(), now, false);
        Some(line)
    }
}

/// Returns the line of a needle: lengths along it times the sine of its angle. A layer without a
/// wall that it does not meet has no thickness; a wall is out of reach.
fn line(track: &NeedleTrack) -> NeedleLine {
    let sine = libm::sin(track.angle_rad());
    let out_of_reach_mm = OUT_OF_REACH_MM * sine;
    let tops = track.tops_mm();
    let mut depths_mm = vec![0.0; tops.len()];
    let mut below_mm = out_of_reach_mm + APART_MM * tops.len() as f64;
    for (number, top) in tops.iter().enumerate().rev() {
        below_mm = match top {
            Some(mm) => (mm * sine).min(below_mm - APART_MM),
            None => below_mm - APART_MM,
        };
        depths_mm[number] = below_mm;
    }
    let mut above_mm = 0.0_f64;
    for (number, depth_mm) in depths_mm.iter_mut().enumerate() {
        if tops[number].is_none() && track.walls[number] {
            above_mm = above_mm.max(out_of_reach_mm);
        }
        *depth_mm = depth_mm.max(above_mm);
        above_mm = *depth_mm + APART_MM;
    }
    let depths = depths_mm.iter().map(|mm| Millimetres(I16F16::saturating_from_num(*mm)));
    NeedleLine { depths: depths.collect() }
}
