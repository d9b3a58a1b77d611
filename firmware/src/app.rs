//! The tasks of the firmware and nothing else: which interrupt starts them and at which priority.
//! What they do is in [`firmware::tasks`], what they do it with in [`crate::board`] and
//! [`crate::chip`].
//!
//! No task shares anything by lock. Orders go to the tick and samples come from it through queues
//! with one writer and one reader; single words go through atomics ([`firmware::tasks::shared`]).

// RTIC takes priorities as literals only: these hold them to the ones that `timing` explains.
const _: () = {
    use firmware::timing::priority::{SUPERVISOR, SUPPLY, TELEMETRY, TICK, TILT, USB};
    assert!(TICK == 16 && SUPPLY == 15 && SUPERVISOR == 4 && USB == 3 && TILT == 2 && TELEMETRY == 1);
};

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use crate::SHARED;
    use crate::board::{Current, Wires};
    use crate::chip::{Statics, Supply, Wiring};
    use core::mem::MaybeUninit;
    use firmware::tasks::planner::Planner;
    use firmware::tasks::queues::Queues;
    use firmware::tasks::supervisor::Watch;
    use firmware::tasks::telemetry::Telemetry;
    use firmware::tasks::tick::Tick;
    use firmware::tasks::tilt::Tilt;
    use firmware::tasks::usb::Port;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        tick: &'static mut Tick<Current>,
        supply: Supply,
        supervisor: Watch<Current>,
        usb: Port<Current>,
        telemetry: &'static mut Telemetry<Current>,
        tilt: Tilt<Current>,
        planner: Planner<Current>,
    }

    // What is large has its place from the start: a `Local` that held it would be moved there over
    // the stack.
    #[init(local = [
        queues: Queues = Queues::new(),
        statics: Statics = Statics::new(),
        tick_place: MaybeUninit<Tick<Current>> = MaybeUninit::uninit(),
        telemetry_place: MaybeUninit<Telemetry<Current>> = MaybeUninit::uninit(),
    ])]
    fn init(context: init::Context) -> (Shared, Local) {
        let ends = context.local.queues.split();
        let parts = Wires::init(context.core, context.device);
        let started = parts.chip.start::<Wires>(context.local.statics);
        let wired = parts.wired;
        let (encoder, encoder_lines) = wired.encoder;
        let local = Local {
            tick: context.local.tick_place.write(Tick::new(
                &SHARED,
                (started.tick_timer, encoder, wired.drive),
                &started.plan,
                started.heat,
                ends.tick,
            )),
            supply: parts.supply,
            supervisor: Watch::new(
                &SHARED,
                started.watchdog,
                parts.supply_level,
                encoder_lines,
                wired.drive_lines,
            ),
            usb: Port::new(&SHARED, started.serial, ends.usb),
            telemetry: context.local.telemetry_place.write(Telemetry::new(
                &SHARED,
                (started.identity, &started.plan, started.reset_cause, started.crash, started.heat.is_some()),
                started.store,
                ends.telemetry,
                wired.lamps,
            )),
            tilt: Tilt::new(&SHARED, wired.tilt),
            planner: Planner::new(ends.planner),
        };
        (Shared {}, local)
    }

    /// Makes plans; with nothing to do it sleeps until an interrupt.
    #[idle(local = [planner])]
    fn idle(context: idle::Context) -> ! {
        loop {
            context.local.planner.run();
            // What is asked for from here on waits for the next tick.
            crate::chip::sleep();
        }
    }

    /// The control tick. Deadline: the next tick, 100 µs after the timer's edge; a tick that misses
    /// it takes torque away and says so. Above every other task, masked by PRIMASK only; never
    /// logs, never waits.
    #[task(binds = TIM4, priority = 16, local = [tick])]
    fn tick(context: tick::Context) {
        context.local.tick.run();
    }

    /// The supply falls: torque goes before the brown-out reset comes.
    #[task(binds = PVD, priority = 15, local = [supply])]
    fn supply(context: supply::Context) {
        context.local.supply.clear();
        firmware::tasks::supply::fell(&SHARED);
    }

    /// Every millisecond: sets the others off, hears who is alive, feeds the watchdog. Deadline:
    /// its period.
    #[task(binds = SysTick, priority = 4, local = [supervisor])]
    fn supervisor(context: supervisor::Context) {
        context.local.supervisor.run();
    }

    /// Moves packets between the USB core and the queues. Set off by the core and by the
    /// supervisor.
    #[task(binds = OTG_FS, priority = 3, local = [usb])]
    fn usb(context: usb::Context) {
        context.local.usb.run();
    }

    /// Commands in, orders out; samples in, frames out. On the interrupt of a serial port that is
    /// not used.
    #[task(binds = USART2, priority = 1, local = [telemetry])]
    fn telemetry(context: telemetry::Context) {
        context.local.telemetry.run();
    }

    /// Reads the tilt sensor. On the interrupt of a serial port that is not used.
    #[task(binds = USART3, priority = 2, local = [tilt])]
    fn tilt(context: tilt::Context) {
        context.local.tilt.run();
    }
}
