//! The positions of the layers along the needle and their states: touched, pushed in, given way,
//! left. It serves the laws of force, which all ask here, and knows none of them.
//!
//! A layer has its depth perpendicular to the skin and stays there. Along the needle it is met at
//! depth / sin(angle to the skin), which changes when the needle turns. A wall that has not given
//! way is pushed in and carries what lies under it along: the next layer is touched only once the
//! wall above it has given way. Then the wall springs back to a stated part of its indentation, and
//! that part vanishes with its relief: the next layer lies deeper by the remaining indentation
//! where the tip comes to it, or is met where the wall gave way, if that is further in. So the
//! order of events is the order of the anatomy, and where a wall is met does not depend on when a
//! tick falls.
//!
//! The angle is the measured tilt less what the tilt reads with the needle laid on the skin. It is
//! smoothed over 51 ms and taken over in steps of a milliradian with three quarters of one as
//! deadband; a layer that was touched is left only 0.2 mm further out. Noise of a milliradian
//! therefore makes no layer come and go: at 15° it moves a vein by 0.07 mm.

mod layers;
mod line;
mod turning;

pub(crate) use layers::{
    Anatomy, LARGEST_ANGLE, Layer, Passage, SMALLEST_ANGLE, Vessel, Wall, is_vessel_wall,
};

use crate::event::{Transitions, VesselState};
use crate::math::truncating_product;
use crate::tissue::MAX_LAYERS;
use crate::units::{Millimetres, Milliradians};
use fixed::types::{I2F30, I8F24, I16F16};
use layers::Angle;
use line::LatestLine;
pub use line::NeedleLine;
pub(crate) use turning::LOOK_TICKS;
use turning::Turning;

/// A layer is left when the tip is this far outside it: 0.2 mm along the needle, so that a tremor
/// does not heal a wall.
const EXIT_DISTANCE: I16F16 = I16F16::from_bits(13_107);
/// The tip's place among the layers. It comes through layers and walls in their order, so that two
/// numbers say which it has touched and which have given way; it meets or leaves at most one layer
/// a tick.
#[derive(Clone, Debug)]
pub(crate) struct Insertion {
    angle: Angle,
    /// The next look takes the tilt over as it is.
    is_new: bool,
    /// Milliradians, Q16.
    smoothed: i32,
    turning: Turning,
    next_tops: [I16F16; MAX_LAYERS],
    /// The depth of each layer along the needle.
    tops: [I16F16; MAX_LAYERS],
    /// The depth of each layer perpendicular to the skin, and where the needle passes beside the
    /// vessel: those of the anatomy, or on their way to those of a [`NeedleLine`].
    depths: [I16F16; MAX_LAYERS],
    beside_depth: I16F16,
    /// The latest [`NeedleLine`], perpendicular to the skin.
    line: LatestLine,
    /// The depth at which the tip began to push in each wall.
    origins: [I16F16; MAX_LAYERS],
    /// The distance of that from the layer's top, because the wall was carried along.
    carried: [I16F16; MAX_LAYERS],
    touched: usize,
    given: usize,
    /// A wall has just given way: what the tip is past already it meets now, a layer a tick.
    is_springing_back: bool,
    /// The tip has touched the wall that gives way next.
    is_pressing: bool,
    /// Along the needle, where the tip passes beside the vessel.
    beside: I16F16,
    /// A bit for each layer that has given way by the law of force.
    open: u8,
    /// A bit for each layer that was touched, gave way or was left in this tick; the vessel is
    /// looked at for them in the next.
    happened: u8,
    /// The same of this tick and the one before.
    busy: u8,
    vessel: VesselState,
}

impl Insertion {
    /// Outside, at the angle of the next tick.
    pub(crate) fn new(anatomy: &Anatomy) -> Self {
        let straight = Angle { taken: LARGEST_ANGLE, path_per_depth: I8F24::ONE, depth_per_path: I2F30::ONE };
        let mut insertion = Self {
            angle: straight,
            is_new: true,
            smoothed: i32::from(LARGEST_ANGLE.0) << 16,
            turning: Turning::To(LARGEST_ANGLE),
            next_tops: [I16F16::ZERO; MAX_LAYERS],
            depths: [I16F16::ZERO; MAX_LAYERS],
            beside_depth: I16F16::MAX,
            line: LatestLine::default(),
            tops: [I16F16::ZERO; MAX_LAYERS],
            origins: [I16F16::ZERO; MAX_LAYERS],
            carried: [I16F16::ZERO; MAX_LAYERS],
            touched: 0,
            given: 0,
            is_springing_back: false,
            is_pressing: false,
            beside: I16F16::MAX,
            open: 0,
            happened: 0,
            busy: 0,
            vessel: VesselState::Outside,
        };
        for (depth, layer) in insertion.depths.iter_mut().zip(&anatomy.layers) {
            *depth = layer.depth.0;
        }
        if let Some(Vessel::Beside { depth, .. }) = anatomy.vessel {
            insertion.beside_depth = depth.0;
        }
        insertion.turn_at_once(anatomy);
        insertion
    }

    /// The angle to the skin that the layers are met at.
    pub(crate) fn angle(&self) -> Milliradians {
        self.angle.taken
    }

    /// Length along the needle for each length perpendicular to the skin.
    pub(crate) fn path_per_depth(&self) -> I8F24 {
        self.angle.path_per_depth
    }

    /// Length perpendicular to the skin for each length along the needle.
    pub(crate) fn depth_per_path(&self) -> I2F30 {
        self.angle.depth_per_path
    }

    /// Returns the tip's place relative to the vessel.
    pub(crate) fn vessel(&self) -> VesselState {
        self.vessel
    }

    /// True if the tip is in the layer of the wall that gives way next, and that wall is pushed in.
    pub(crate) fn presses(&self) -> bool {
        self.is_pressing
    }

    /// Returns the number of walls that have given way.
    pub(crate) fn given(&self) -> usize {
        self.given
    }

    /// Returns the depth of layer `index` along the needle; the largest number if there is no such
    /// layer.
    pub(crate) fn top(&self, index: usize) -> I16F16 {
        self.tops.get(index).copied().unwrap_or(I16F16::MAX)
    }

    /// Returns the travel of the tip at `depth` since it met wall `index`.
    pub(crate) fn travel(&self, index: usize, depth: Millimetres) -> I16F16 {
        depth.0.saturating_sub(self.origins.get(index).copied().unwrap_or(I16F16::MAX))
    }

    /// The layer that the tip is in. A touched one may be a little deeper than the tip that draws
    /// back.
    pub(crate) fn innermost(&self, depth: Millimetres) -> usize {
        let last = self.touched.saturating_sub(1);
        if depth.0 >= self.top(last) { last } else { self.innermost_above(last, depth) }
    }

    /// Out of the way, for it is seldom wanted.
    #[inline(never)]
    fn innermost_above(&self, last: usize, depth: Millimetres) -> usize {
        let above = self.tops.get(..last).unwrap_or_default();
        above.iter().rposition(|&top| depth.0 >= top).unwrap_or(0)
    }

    /// A bit for each layer that has given way by the law of force.
    pub(crate) fn opened(&self) -> u8 {
        self.open
    }

    /// The law of force says which layers have given way: a bit each. What it means for the vessel
    /// is seen in the next tick.
    pub(crate) fn open(&mut self, open: u8) {
        let changed = open ^ self.open;
        self.happened |= changed;
        self.busy |= changed;
        self.open = open;
    }

    /// True in a tick in which a layer is touched, gives way or is left, and in the next one, in
    /// which the vessel is looked at.
    pub(crate) fn is_busy(&self) -> bool {
        self.busy != 0
    }

    /// Takes over the tilt of the next look as it is, without smoothing: what was before does not
    /// matter.
    pub(crate) fn begin(&mut self) {
        self.is_new = true;
        self.turning = Turning::Done;
    }

    /// True if the tilt must be read without waiting for its turn.
    pub(crate) fn is_new(&self) -> bool {
        self.is_new
    }

    /// One tick with the tip at `depth` along the needle.
    pub(crate) fn tick(&mut self, anatomy: &Anatomy, depth: Millimetres) -> Transitions {
        let puncture = self.puncture(anatomy, depth);
        let mut transitions = Transitions { puncture, ..self.cross_layer(anatomy, depth) };
        self.is_pressing = anatomy.walls.get(self.given).is_some_and(|wall| wall.layer < self.touched);
        let happened = transitions.contact | transitions.puncture | transitions.exit;
        let due = core::mem::replace(&mut self.happened, happened);
        self.busy = due | happened;
        if due != 0 {
            transitions.flashback = self.look_at_vessel(anatomy);
        }
        self.pass_beside(anatomy, depth);
        transitions
    }

    /// Returns the extra depth of the next layer where the tip comes to it, due to the remaining
    /// indentation of the last wall.
    ///
    /// With l left at the puncture and zero from R on, l·(R − x)/ρ remains at x, where ρ is the way
    /// from the puncture to R. A layer at T is then at `T + l·(R − x)/ρ`, and the tip reaches it at
    /// `x = T + (R − T)·l/(l + ρ)`.
    fn carried_along(&self, anatomy: &Anatomy) -> I16F16 {
        let Some((wall, origin)) = self.last_given(anatomy) else { return I16F16::ZERO };
        let before = origin.saturating_add(wall.relieved).saturating_sub(self.top(self.touched));
        let share = truncating_product(before.to_bits(), wall.share.to_bits(), 30);
        I16F16::from_bits(share).min(wall.left).max(I16F16::ZERO)
    }

    /// The wall that gave way last, and where the tip began to push it in.
    fn last_given<'a>(&self, anatomy: &'a Anatomy) -> Option<(&'a Wall, I16F16)> {
        let last = self.given.checked_sub(1)?;
        anatomy.walls.get(last).zip(self.origins.get(last).copied())
    }

    /// The layer that the tip touches or leaves; a wall is whole again once the tip has left its
    /// layer.
    fn cross_layer(&mut self, anatomy: &Anatomy, depth: Millimetres) -> Transitions {
        if let Some(next) = anatomy.layers.get(self.touched)
            && depth.0 >= self.top(self.touched)
        {
            if self.given >= next.walls_above {
                let place = self.top(self.touched).saturating_add(self.carried_along(anatomy));
                if depth.0 >= place {
                    self.touch(anatomy, next, place);
                    return Transitions { contact: 1 << next.number, ..Transitions::default() };
                }
            }
        } else if let Some(last) = self.touched.checked_sub(1)
            && let Some(layer) = anatomy.layers.get(last)
            && depth.0 < self.top(last).saturating_sub(EXIT_DISTANCE)
        {
            self.touched = last;
            self.given = self.given.min(layer.walls_above);
            return Transitions { exit: 1 << layer.number, ..Transitions::default() };
        }
        self.is_springing_back = false;
        Transitions::default()
    }

    /// A layer is touched. Its wall, if it has one, is pushed in from `place` on, or from where the
    /// wall above has just given way.
    #[inline(never)]
    fn touch(&mut self, anatomy: &Anatomy, layer: &Layer, mut place: I16F16) {
        if self.is_springing_back
            && let Some((wall, origin)) = self.last_given(anatomy)
        {
            place = place.max(origin.saturating_add(wall.puncture));
        }
        let top = self.top(self.touched);
        self.touched += 1;
        if layer.has_wall
            && let Some(origin) = self.origins.get_mut(layer.walls_above)
            && let Some(carried) = self.carried.get_mut(layer.walls_above)
        {
            *carried = place.saturating_sub(top);
            *origin = place;
        }
    }

    /// The wall that gives way, a bit for its layer.
    fn puncture(&mut self, anatomy: &Anatomy, depth: Millimetres) -> u8 {
        let Some(wall) = anatomy.walls.get(self.given) else { return 0 };
        if !self.is_pressing || self.travel(self.given, depth) < wall.puncture {
            return 0;
        }
        self.given += 1;
        self.is_springing_back = true;
        anatomy.layers.get(wall.layer).map_or(0, |layer| 1 << layer.number)
    }

    /// Notes that the needle passes beside the vessel, or has left it.
    fn pass_beside(&mut self, anatomy: &Anatomy, depth: Millimetres) {
        if let Some(Vessel::Beside { .. }) = anatomy.vessel {
            self.vessel = if depth.0 >= self.beside { VesselState::Beside } else { VesselState::Outside };
        }
    }

    /// The tip's place as seen from a vessel that it does not pass beside: in the tick after a
    /// layer was touched, gave way or was left. True if it has come into the lumen.
    #[inline(never)]
    fn look_at_vessel(&mut self, anatomy: &Anatomy) -> bool {
        let Some(Vessel::Met { near, far }) = anatomy.vessel else { return false };
        let is_past = |wall: Passage| {
            self.touched > wall.layer && self.given >= wall.given && self.open & wall.opens == wall.opens
        };
        let state = if far.is_some_and(is_past) {
            VesselState::Through
        } else if is_past(near) {
            VesselState::InLumen
        } else if self.touched > near.layer {
            VesselState::Touching
        } else {
            VesselState::Outside
        };
        let before = core::mem::replace(&mut self.vessel, state);
        state == VesselState::InLumen && before != VesselState::InLumen
    }
}
