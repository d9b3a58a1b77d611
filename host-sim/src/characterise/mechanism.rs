//! The virtual device with nobody's hand on it: the control core on the plant of a rig file, whatever effects that file has.
//! The plant's laws are the ones that the diagnosis names, so a patched rig runs here as it stands.

use control_core::units::{Counts, Milliradians};
use control_core::{Controller, TICK_HZ, TickInput};
use diagnosis::rig::{Kind, Rig};
use diagnosis::simulation::{Plant, Surroundings};
use link::codec::MAX_FRAME;
use link::device::{Endpoint, Identity};

use crate::failure::Failure;

/// Physics steps in a tick.
const STEPS_PER_TICK: u32 = 20;
const STEP_S: f64 = 1.0 / (TICK_HZ as f64 * STEPS_PER_TICK as f64);

/// The control core on the plant of a rig.
pub struct BareDevice {
    plant: Plant,
    controller: Controller,
    endpoint: Endpoint,
    middle: f64,
    tick: u64,
    command: f64,
}

impl BareDevice {
    /// At rest, powered down. The rig's command is in DAC steps away from mid-scale, and its coordinate an angle.
    pub fn new(rig: &Rig, file: &str) -> Result<Self, Failure> {
        if rig.kind != Kind::Rotary || rig.actuator.command_unit != "dac" {
            return Err(Failure::input(format_args!(
                "{file}: the virtual device is rotary and commanded in DAC steps; give a rig with kind = \"rotary\" and command_unit = \"dac\", such as one that characterise has written"
            )));
        }
        let plan = super::configuration().plan().map_err(Failure::failed)?;
        let identity = Identity { serial: [0; 12], firmware: [0, 1, 0] };
        Ok(Self {
            plant: Plant::new(rig),
            middle: f64::from(plan.zero_torque_code().0),
            endpoint: Endpoint::new(identity, &plan, None),
            controller: Controller::new(plan),
            tick: 0,
            command: 0.0,
        })
    }

    /// One tick of the control law, then 100 µs of physics under `tilt` rad.
    pub fn tick(&mut self, tilt: f64) {
        while let Some(order) = self.endpoint.next_order() {
            self.controller.order(order);
        }
        let count = Counts(self.plant.counts() as i32);
        let output =
            self.controller.tick(TickInput { count, tilt: Milliradians((tilt * 1e3).round() as i16) });
        self.endpoint.record(self.tick, &output);
        self.command = if output.enable { f64::from(output.dac.0) - self.middle } else { 0.0 };
        for _ in 0..STEPS_PER_TICK {
            self.plant.step(self.command, Surroundings { tilt, external: 0.0 }, STEP_S);
        }
        self.tick += 1;
    }

    /// Ticks since power-on.
    pub fn ticks(&self) -> u64 {
        self.tick
    }

    /// Takes bytes from the PC.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.endpoint.receive(bytes);
    }

    /// Writes the next frame for the PC to `out`; 0 where nothing waits.
    pub fn transmit(&mut self, out: &mut [u8; MAX_FRAME]) -> usize {
        self.endpoint.transmit(out)
    }
}
