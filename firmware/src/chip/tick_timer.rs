//! TIM4: its update is the tick, its channel 1 the instant at which the converter takes the code.

use firmware::{port, timing};
use stm32f4xx_hal::pac::TIM4;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Core cycles of a count of the timer.
const TIMER_CYCLES: u32 = timing::CORE_HZ / timing::TICK_TIMER_HZ;

/// The timer.
pub(crate) struct TickTimer(TIM4);

impl TickTimer {
    /// Runs from now on.
    pub(crate) fn start(timer: TIM4, rcc: &mut Rcc) -> Self {
        TIM4::enable(rcc);
        TIM4::reset(rcc);
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set((timing::TICK_TIMER_COUNTS - 1) as u16));
        // Channel 1 falls with the edge and rises when the converter is to take its code; the
        // converter listens.
        let output_at = timing::OUTPUT_CYCLES / TIMER_CYCLES;
        timer.ccr1().write(|w| w.ccr().set(output_at as u16));
        timer.ccmr1_output().write(|w| w.oc1m().pwm_mode2());
        timer.cr2().write(|w| w.mms().compare_oc1());
        timer.egr().write(|w| w.ug().set_bit());
        timer.sr().write(|w| w.uif().clear_bit());
        timer.dier().write(|w| w.uie().set_bit());
        timer.cr1().write(|w| w.cen().set_bit());
        Self(timer)
    }
}

impl port::TickTimer for TickTimer {
    fn acknowledge(&self) {
        self.0.sr().write(|w| w.uif().clear_bit());
    }

    fn edge_waits(&self) -> bool {
        self.0.sr().read().uif().bit()
    }

    fn cycles_since_edge(&self) -> u32 {
        u32::from(self.0.cnt().read().cnt().bits()) * TIMER_CYCLES
    }
}
