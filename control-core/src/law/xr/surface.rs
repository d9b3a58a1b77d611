//! The displacement of the tissue's surface, as the picture's dynamics give it: depth may be
//! counted from there instead of from where the surface was at rest.
//!
//! Whoever computes a picture may be late, wrong or gone. So the displacement is bounded, changes
//! no faster than a slow hand, and goes back to 0 by itself if it is not renewed: when a picture
//! freezes, its effect ends.

use crate::units::Millimetres;
use fixed::types::I16F16;

/// Largest displacement that counts, either way: 3 mm.
const LARGEST: I16F16 = I16F16::from_bits(3 << 16);
/// Largest change in a tick: 2 µm, 20 mm/s.
const STEP: I16F16 = I16F16::from_bits(131);
/// It counts for so many ticks: 50 ms, three pictures.
const RENEWED_WITHIN: u16 = 500;

/// The surface above the needle, along it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Surface {
    wanted: I16F16,
    now: I16F16,
    left: u16,
}

impl Surface {
    /// Moves the surface to `displacement` past its place at rest, along the needle.
    pub(crate) fn follow(&mut self, displacement: Millimetres) {
        self.wanted = displacement.0.clamp(-LARGEST, LARGEST);
        self.left = RENEWED_WITHIN;
    }

    /// One tick: the displacement that counts.
    #[inline]
    pub(crate) fn tick(&mut self) -> I16F16 {
        // On the board nobody displaces it.
        if self.left == 0 && self.now == I16F16::ZERO {
            return I16F16::ZERO;
        }
        if self.left > 0 {
            self.left -= 1;
        } else {
            self.wanted = I16F16::ZERO;
        }
        self.now += (self.wanted - self.now).clamp(-STEP, STEP);
        self.now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mm(value: f64) -> Millimetres {
        Millimetres(I16F16::from_num(value))
    }

    #[test]
    fn it_is_bounded_slow_and_gone_when_nobody_renews_it() {
        let mut surface = Surface::default();
        assert_eq!(surface.tick(), I16F16::ZERO, "off by default");
        let mut before = I16F16::ZERO;
        for tick in 0..4_000 {
            if tick % 160 == 0 {
                surface.follow(mm(if tick < 2_000 { 500.0 } else { 1.0 }));
            }
            let now = surface.tick();
            assert!((now - before).abs() <= STEP && now <= LARGEST, "{before} mm, then {now} mm");
            before = now;
        }
        assert!((before.to_num::<f64>() - 1.0).abs() < 1e-4, "{before} mm");
        // The picture freezes.
        let after: [I16F16; 2_000] = core::array::from_fn(|_| surface.tick());
        assert!(after[300] > I16F16::from_num(0.99) && after[1_100] == I16F16::ZERO, "{}", after[1_100]);
        surface.follow(Millimetres(I16F16::MIN));
        assert!((0..5_000).all(|_| surface.tick() >= -LARGEST));
    }
}
