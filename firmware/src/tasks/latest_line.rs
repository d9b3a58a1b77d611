//! The latest line of the needle on its way from telemetry to the tick: outside the queue of
//! orders, and without a lock.

use control_core::NeedleLine;
use control_core::config::MAX_LAYERS;
use control_core::units::Millimetres;
use core::sync::atomic::{
    AtomicI32, AtomicU32, AtomicUsize, Ordering::Relaxed, Ordering::SeqCst, compiler_fence,
};
use fixed::types::I16F16;

/// Written by telemetry, read by the tick, which interrupts it and finds a line that is half
/// written in the next tick.
pub struct LatestLine {
    /// The number of the line, doubled; odd while it is being written. 0: none yet.
    number: AtomicU32,
    layers: AtomicUsize,
    depths: [AtomicI32; MAX_LAYERS],
}

impl LatestLine {
    /// None yet.
    pub(crate) const fn new() -> Self {
        Self {
            number: AtomicU32::new(0),
            layers: AtomicUsize::new(0),
            depths: [const { AtomicI32::new(0) }; MAX_LAYERS],
        }
    }

    /// Another line in the place of the one before.
    pub(crate) fn set(&self, line: &NeedleLine) {
        let number = self.begin();
        self.layers.store(line.depths.len(), Relaxed);
        for (to, depth) in self.depths.iter().zip(&line.depths) {
            to.store(depth.0.to_bits(), Relaxed);
        }
        self.number.store(number.wrapping_add(2), SeqCst);
    }

    /// From here on it is half written. Returns the number of the line before.
    pub(crate) fn begin(&self) -> u32 {
        let number = self.number.load(Relaxed) & !1;
        self.number.store(number.wrapping_add(1), SeqCst);
        // No depth is written before it: an ordering of the store holds back what comes before it
        // only. The tick runs on the same core, so that this is for the compiler.
        compiler_fence(SeqCst);
        number
    }

    /// The number of the latest line; another one than before: there is another line.
    #[inline]
    pub(crate) fn number(&self) -> u32 {
        self.number.load(Relaxed)
    }

    /// Returns the number of the latest line, its depths and how many of them count, unless it is
    /// half written.
    #[inline]
    pub(crate) fn read(&self) -> Option<(u32, [Millimetres; MAX_LAYERS], usize)> {
        let number = self.number.load(SeqCst);
        let depths = self.depths.each_ref().map(|depth| Millimetres(I16F16::from_bits(depth.load(Relaxed))));
        let layers = self.layers.load(Relaxed);
        let is_whole = number.is_multiple_of(2) && self.number.load(SeqCst) == number;
        is_whole.then_some((number, depths, layers))
    }
}
