//! The places at which a line meets the layers that the device has: level ones, or those of a body.

use crate::profile::{InBody, Profile};

/// The layers of a patient, as a line meets them.
#[derive(Clone, Debug)]
pub(super) enum Meeting {
    /// Perpendicular to the skin, mm; of a vessel, the height at which the needle goes through it
    /// beside its axis. The target ends to either side, if its patient says so: its number, and
    /// from where to where along the skin, mm.
    Level { depths_mm: Vec<f64>, bone_mm: Option<f64>, ends: Option<(usize, (f64, f64))> },
    /// The structures of a body.
    Body(Box<InBody>),
}

impl Meeting {
    pub(super) fn new(profile: &Profile) -> Self {
        if let Some(body) = &profile.body {
            return Self::Body(Box::new(body.clone()));
        }
        let depths = profile.plan.own_line().depths;
        let ends = profile.goal().and_then(|goal| Some((usize::from(goal.layer), goal.reach_mm?)));
        let depths_mm = depths.iter().map(|depth| depth.0.to_num()).collect();
        Self::Level { depths_mm, bone_mm: profile.bone_mm, ends }
    }

    /// Returns where a line from `origin_mm` meets each layer, mm along it.
    pub(super) fn tops_mm(&self, origin_mm: [f64; 2], angle_rad: f64) -> Vec<Option<f64>> {
        match self {
            Self::Level { depths_mm, ends, .. } => {
                let met = |(number, depth_mm): (usize, &f64)| {
                    let mm = (depth_mm - origin_mm[1]) / libm::sin(angle_rad);
                    let along_mm = origin_mm[0] + mm * libm::cos(angle_rad);
                    let is_there =
                        ends.is_none_or(|(end, (from, to))| end != number || (from..=to).contains(&along_mm));
                    (mm.is_finite() && is_there).then_some(mm)
                };
                depths_mm.iter().enumerate().map(met).collect()
            }
            Self::Body(body) => body.tops_mm(origin_mm, angle_rad),
        }
    }

    /// Returns where such a line meets bone, mm along it.
    pub(super) fn bone_mm(&self, origin_mm: [f64; 2], angle_rad: f64) -> Option<f64> {
        match self {
            Self::Level { bone_mm, .. } => {
                let mm = ((*bone_mm)? - origin_mm[1]) / libm::sin(angle_rad);
                mm.is_finite().then_some(mm)
            }
            Self::Body(body) => body.bone_mm(origin_mm, angle_rad),
        }
    }
}
