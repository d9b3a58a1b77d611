//! The needle as a rigid line, and a place of the tissue that is held to it.

use crate::constraint::{Anchor, Point};
use crate::vector::{Vector, add, direction, dot, is_finite, length, scale, sub};

/// Tissue springs back after a puncture with this time constant, s.
const RECOVERY_S: f32 = 0.08;

/// A rigid needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Needle {
    /// The position of its tip, mm.
    pub tip: Vector,
    /// Its direction, of length 1.
    pub direction: Vector,
}

impl Needle {
    /// Its tip `depth_mm` past the entry point (the origin) along an axis `angle` rad below the
    /// skin, turned `azimuth` rad about the vertical through the entry. What is no number is 0.
    pub fn entering(depth_mm: f32, angle: f32, azimuth: f32) -> Self {
        let number = |value: f32| if value.is_finite() { value } else { 0.0 };
        let (sine, cosine) = number(angle).sin_cos();
        let (side, ahead) = number(azimuth).sin_cos();
        let direction = [cosine * ahead, cosine * side, sine];
        Self { tip: scale(direction, number(depth_mm).clamp(-500.0, 500.0)), direction }
    }

    /// Returns the needle at a `share` of the way from this to another: 0 is this, 1 the other.
    pub fn towards(&self, other: &Self, share: f32) -> Self {
        let between = |from: Vector, to: Vector| add(from, scale(sub(to, from), share));
        let ahead = between(self.direction, other.direction);
        Self { tip: between(self.tip, other.tip), direction: direction(ahead).unwrap_or(other.direction) }
    }

    /// The needle as it can be used: finite, its direction of length 1.
    pub(crate) fn checked(self) -> Option<Self> {
        let direction = direction(self.direction)?;
        (is_finite(self.tip) && self.tip.iter().all(|c| c.abs() < 1e4))
            .then_some(Self { tip: self.tip, direction })
    }
}

/// A place held to the needle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hold {
    pub(crate) anchor: Anchor,
    /// Its position at rest, mm.
    home: Vector,
    /// The travel by which it is dragged along the needle, mm.
    drag: f32,
    /// The largest such travel, mm.
    most: f32,
}

impl Hold {
    pub(crate) fn new(anchor: Anchor, rest: &[Point], needle: &Needle, most: f32, drag_limit: f32) -> Self {
        let home = anchor.place(rest);
        let pushed = dot(sub(needle.tip, home), needle.direction);
        Self { anchor, home, drag: pushed.clamp(-drag_limit, drag_limit), most }
    }

    /// Returns the point on the needle's axis that it belongs to, and its distance from that point
    /// across the axis.
    pub(crate) fn target(&self, needle: &Needle) -> (Vector, f32) {
        let along = dot(sub(self.home, needle.tip), needle.direction);
        let on_axis = add(needle.tip, scale(needle.direction, along));
        (add(on_axis, scale(needle.direction, self.drag)), length(sub(on_axis, self.home)))
    }

    /// Static friction carries it along with the needle until it slips.
    pub(crate) fn follow(&mut self, advance: f32, dt: f32) {
        if self.drag.abs() > self.most {
            // What the wall was pushed in before it gave way springs back.
            let beyond = self.drag - self.most.copysign(self.drag);
            self.drag -= beyond * (1.0 - (-dt / RECOVERY_S).exp());
            if advance * self.drag < 0.0 {
                self.drag += advance.clamp(-2.0 * self.most, 2.0 * self.most);
            }
        } else {
            self.drag = (self.drag + advance).clamp(-self.most, self.most);
        }
    }

    /// The tip has been drawn out of it.
    pub(crate) fn is_left(&self, needle: &Needle) -> bool {
        dot(sub(self.home, needle.tip), needle.direction) + self.drag.min(0.0) > 0.05
    }
}
