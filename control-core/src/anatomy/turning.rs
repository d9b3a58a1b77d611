//! The needle's angle to the skin as it turns, taken over in parts, each in another tick.

use super::layers::Angle;
use super::{Anatomy, Insertion, Vessel};
use crate::math::{reciprocal, sine};
use crate::units::{Millimetres, Milliradians};
use fixed::types::{I2F30, I16F16};

/// Ticks from one look at the tilt to the next.
pub(crate) const LOOK_TICKS: u32 = 16;
/// Share of the way to the measured tilt at each look, as a shift: with [`LOOK_TICKS`], a time
/// constant of 51 ms.
const SMOOTHING: u32 = 5;
/// The angle follows what is smoothed once it is this far off: 0.75 mrad in Q16.
const DEAD_BAND: u32 = 49_152;

/// A new angle on its way, a part in each of four or five ticks: all of it in one would make that
/// tick the longest of all.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Turning {
    /// The angle that was taken over holds.
    #[default]
    Done,
    /// The needle has turned to this angle.
    To(Milliradians),
    /// And this is its sine.
    Sine(Milliradians, I2F30),
    /// All that there is to know of it.
    Whole(Angle),
    /// Those that the tip has touched turn with the needle.
    Carried(Angle),
    /// And the layers begin at [`Insertion::next_tops`] then.
    Placed(Angle),
    /// The angle stays, and this layer is to go towards where the needle's line meets it.
    Lined(usize),
    /// It is to go to its [`Insertion::next_tops`], found with so many layers touched and walls
    /// given way.
    Met(usize, [usize; 2]),
    /// It has gone: the law of force is to follow.
    Followed(usize),
}

impl Insertion {
    /// Takes over the tilt as it is, all at once. Like its parts out of the way of the ticks that
    /// look at nothing.
    #[cold]
    #[inline(never)]
    pub(crate) fn look_anew(&mut self, anatomy: &Anatomy, tilt: Milliradians) {
        let has_line = core::mem::take(&mut self.line.is_new);
        self.look(anatomy, tilt);
        self.turn_at_once(anatomy);
        self.line.is_new = has_line;
    }

    pub(super) fn turn_at_once(&mut self, anatomy: &Anatomy) {
        while !matches!(self.turning, Turning::Done) {
            self.turn_angle(anatomy);
        }
    }

    /// Follows the tilt, every [`LOOK_TICKS`].
    #[inline(never)]
    pub(crate) fn look(&mut self, anatomy: &Anatomy, tilt: Milliradians) {
        let measured = i32::from(anatomy.angle(tilt).0) << 16;
        self.smoothed = if core::mem::take(&mut self.is_new) {
            measured
        } else {
            self.smoothed + ((measured - self.smoothed) >> SMOOTHING)
        };
        let off = self.smoothed - (i32::from(self.angle.taken.0) << 16);
        if !matches!(self.turning, Turning::Done) {
            return;
        }
        // In turns, where the needle turns all the while.
        let turns = off.unsigned_abs() > DEAD_BAND;
        if self.line.is_new && (self.line.has_waited || !turns) {
            (self.line.is_new, self.line.has_waited) = (false, false);
            self.turning = Turning::Lined(0);
        } else if turns {
            self.turning = Turning::To(Milliradians(((self.smoothed + (1 << 15)) >> 16) as i16));
            self.line.has_waited = true;
        }
    }

    /// The next part of taking over an angle or a line, if one is on its way: three times in
    /// [`LOOK_TICKS`], so that an angle is there 3 ms after the look. Returns the layer that has
    /// come to another depth, which the law of force is to follow.
    #[inline(never)]
    pub(crate) fn turn(&mut self, anatomy: &Anatomy, depth: Millimetres) -> Option<usize> {
        match self.turning {
            Turning::Lined(index) => self.turning = self.meet_line(anatomy, index, depth),
            Turning::Met(index, [touched, given]) => {
                let is_valid = (touched, given) == (self.touched, self.given);
                self.turning =
                    if is_valid { self.follow_line(anatomy, index, depth) } else { Turning::Lined(index) };
            }
            Turning::Followed(index) => {
                self.turning = Turning::Lined(index + 1);
                return Some(index);
            }
            _ => self.turn_angle(anatomy),
        }
        None
    }

    fn turn_angle(&mut self, anatomy: &Anatomy) {
        self.turning = match self.turning {
            Turning::Done | Turning::Lined(_) | Turning::Met(..) | Turning::Followed(_) => Turning::Done,
            Turning::To(angle) => Turning::Sine(angle, sine(angle)),
            Turning::Sine(taken, sine) => {
                Turning::Whole(Angle { taken, path_per_depth: reciprocal(sine), depth_per_path: sine })
            }
            Turning::Whole(angle) => {
                for (top, depth) in self.next_tops.iter_mut().zip(self.depths) {
                    *top = angle.along(Millimetres(depth));
                }
                if self.line.carries { Turning::Carried(angle) } else { Turning::Placed(angle) }
            }
            Turning::Carried(angle) => {
                let layers = self.next_tops.iter_mut().zip(&mut self.depths).zip(self.tops);
                for ((next, depth), top) in layers.take(self.touched) {
                    (*next, *depth) = (top, angle.below_skin(top));
                }
                Turning::Placed(angle)
            }
            Turning::Placed(angle) => {
                self.meet_at(anatomy, angle);
                Turning::Done
            }
        };
    }

    /// Takes over `angle` and where the layers begin at it.
    fn meet_at(&mut self, anatomy: &Anatomy, angle: Angle) {
        self.angle = angle;
        self.tops = self.next_tops;
        self.place_walls(anatomy);
    }

    /// Follows the tops with what hangs on them.
    pub(super) fn place_walls(&mut self, anatomy: &Anatomy) {
        for ((origin, carried), wall) in self.origins.iter_mut().zip(self.carried).zip(&anatomy.walls) {
            let top = self.tops.get(wall.layer).copied().unwrap_or(I16F16::MAX);
            *origin = top.saturating_add(carried);
        }
        if let Some(Vessel::Beside { .. }) = anatomy.vessel {
            self.beside = self.angle.along(Millimetres(self.beside_depth));
        }
    }
}
