//! The line of a needle that has turned in tissue: whoever models the tissue says where it meets
//! the layers, and they go there without a jump of the force.
//!
//! From its first line on, what the tip of a needle has touched turns with it: it stays at its
//! length along the needle, until a line says otherwise. A line moves such a layer by 10 mN, some
//! 0.004 mm, and a milliradian of turning would by 0.03 mm: the tip would leave a vessel that it
//! only turns in.
//!
//! A line makes no event. What the tip has not touched lies where the line says, but not above the
//! tip; what it has touched goes there in steps, one for each line, of at most
//! [`Anatomy::line_steps`], neither past the tip nor so far that a wall gives way. The needle's own
//! movement does what is then left to do. So a needle at rest feels a change of at most 10 mN for
//! each line. A layer takes three ticks, 0.5 ms apart, so that no tick is longer than others: a
//! line of six layers takes 12 ms.

use super::turning::Turning;
use super::{Anatomy, Insertion, Vessel};
use crate::tissue::MAX_LAYERS;
use crate::units::Millimetres;
use fixed::types::I16F16;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The line of a needle that has turned in tissue.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NeedleLine {
    /// One for each layer of the patient, outermost first: the length along the needle from the
    /// zero to the layer, times the sine of the angle to the skin that the device reports. For a
    /// needle that has turned about its entry these are the patient's own depths. A vessel that the
    /// needle passes beside begins at its near wall's.
    pub depths: Vec<Millimetres, MAX_LAYERS>,
}

/// The latest line.
#[derive(Clone, Debug, Default)]
pub(super) struct LatestLine {
    /// It has not been followed yet.
    pub(super) is_new: bool,
    /// There has been one: what the tip has touched turns with the needle.
    pub(super) carries: bool,
    /// It has waited for an angle.
    pub(super) has_waited: bool,
    /// As the layers are numbered in the configuration.
    depths: [Millimetres; MAX_LAYERS],
}

impl Insertion {
    /// Takes a line, which has passed [`crate::Plan::check_line`], in the place of the one before;
    /// it is followed in the next turns. One for another patient changes nothing.
    pub(crate) fn take_line(&mut self, anatomy: &Anatomy, depths: &[Millimetres]) {
        if depths.len() != anatomy.configured {
            return;
        }
        for (to, depth) in self.line.depths.iter_mut().zip(depths) {
            *to = *depth;
        }
        self.line.is_new = true;
        self.line.carries = true;
    }

    /// Perpendicular to the skin, where the needle meets the layers now.
    pub(crate) fn depths(&self) -> &[I16F16] {
        &self.depths
    }

    /// Finds where layer `index` goes on its way to the line, with the tip at `depth` along the
    /// needle; after the last one, the vessel that the needle passes beside.
    pub(super) fn meet_line(&mut self, anatomy: &Anatomy, index: usize, depth: Millimetres) -> Turning {
        let wanted = |number: u8| self.line.depths.get(usize::from(number)).copied().unwrap_or_default();
        let Some(layer) = anatomy.layers.get(index) else {
            if let Some(Vessel::Beside { number, .. }) = anatomy.vessel {
                self.beside_depth = wanted(number).0;
                self.beside = self.angle.along(Millimetres(self.beside_depth));
            }
            return Turning::Done;
        };
        let wanted = self.angle.along(wanted(layer.number));
        let next = if index < self.touched {
            self.step(anatomy, index, wanted, depth)
        } else {
            wanted.max(self.above(index))
        };
        if let Some(top) = self.next_tops.get_mut(index) {
            *top = next;
        }
        Turning::Met(index, [self.touched, self.given])
    }

    /// Takes layer `index` there.
    pub(super) fn follow_line(&mut self, anatomy: &Anatomy, index: usize, depth: Millimetres) -> Turning {
        let top = self.next_tops.get(index).copied().unwrap_or(I16F16::MAX);
        self.set_top(index, top);
        if let Some(layer) = anatomy.layers.get(index).filter(|layer| layer.has_wall)
            && let Some(origin) = self.origins.get_mut(layer.walls_above)
        {
            *origin = top.saturating_add(self.carried.get(layer.walls_above).copied().unwrap_or_default());
        }
        if self.would_touch(anatomy, depth) {
            self.set_top(self.touched, depth.0.saturating_add(I16F16::DELTA).max(self.above(self.touched)));
        }
        Turning::Followed(index)
    }

    /// Returns the top of the layer above layer `index`.
    fn above(&self, index: usize) -> I16F16 {
        index.checked_sub(1).map_or(I16F16::MIN, |above| self.top(above))
    }

    /// Returns where a layer that the tip has touched goes on its way to `wanted`.
    fn step(&self, anatomy: &Anatomy, index: usize, wanted: I16F16, depth: Millimetres) -> I16F16 {
        let step = anatomy.line_steps.get(self.given).copied().unwrap_or_default();
        let top = self.top(index);
        let next = wanted.max(top.saturating_sub(step)).min(top.saturating_add(step));
        let pressed = anatomy.walls.get(self.given).filter(|wall| wall.layer == index);
        let Some(wall) = pressed else { return next.min(top.max(depth.0)) };
        let carried = self.carried.get(self.given).copied().unwrap_or_default();
        let met_at_tip = depth.0.saturating_sub(carried);
        let gives_way = met_at_tip.saturating_sub(wall.puncture);
        next.min(top.max(met_at_tip)).max(top.min(gives_way.saturating_add(I16F16::DELTA)))
    }

    /// True if the next tick would touch the next layer with the tip at `depth`.
    fn would_touch(&self, anatomy: &Anatomy, depth: Millimetres) -> bool {
        let top = self.top(self.touched);
        depth.0 >= top
            && anatomy.layers.get(self.touched).is_some_and(|next| self.given >= next.walls_above)
            && depth.0 >= top.saturating_add(self.carried_along(anatomy))
    }

    fn set_top(&mut self, index: usize, top: I16F16) {
        let below_skin = self.angle.below_skin(top);
        if let Some((to, depth)) = self.tops.get_mut(index).zip(self.depths.get_mut(index)) {
            (*to, *depth) = (top, below_skin);
        }
    }
}
