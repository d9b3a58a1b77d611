//! The virtual device with no hand on it: the control core on the plant of a rig file, whatever
//! effects that file has. The plant's laws are the ones that the diagnosis names, so a patched rig
//! runs here unchanged.

use control_core::units::{Counts, Milliradians};
use control_core::{Controller, Device, Patient, Plan, TICK_HZ, TickInput};
use diagnosis::rig::{Kind, Rig};
use diagnosis::simulation::{Plant, Surroundings};
use link::codec::MAX_FRAME;
use link::device::{Endpoint, Identity};

use device_sim::error::Error;

/// Physics steps in a tick.
const STEPS_PER_TICK: u32 = 20;
const STEP_S: f64 = 1.0 / (TICK_HZ as f64 * STEPS_PER_TICK as f64);

/// The faults in the wiring between motor, encoder and board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wiring {
    /// The motor's leads are reversed.
    pub leads_reversed: bool,
    /// The encoder's channels are swapped.
    pub channels_swapped: bool,
    /// The encoder's channel that stays at a level.
    pub dead: Option<Channel>,
    /// The motor gets no current.
    pub leads_off: bool,
}

/// A channel of the encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it all")]
pub enum Channel {
    A,
    B,
}

impl Wiring {
    /// Returns the board's count when the encoder is at `count`.
    fn counted(self, count: i32) -> i32 {
        let count = match self.dead {
            None => count,
            // One track alone: up at its one edge, down at its other.
            Some(Channel::A) => i32::from(count.rem_euclid(4) >= 2),
            Some(Channel::B) => i32::from((1..=2).contains(&count.rem_euclid(4))),
        };
        if self.channels_swapped { count.wrapping_neg() } else { count }
    }

    /// Returns the motor's response to a command.
    fn driven(self, command: f64) -> f64 {
        match self {
            Wiring { leads_off: true, .. } => 0.0,
            Wiring { leads_reversed: true, .. } => -command,
            _ => command,
        }
    }
}

/// The control core on the plant of a rig.
pub struct BareDevice {
    plant: Plant,
    wiring: Wiring,
    controller: Controller,
    endpoint: Endpoint,
    middle: f64,
    tick: u64,
    command: f64,
}

impl BareDevice {
    /// At rest, powered down. The rig's command is in DAC steps away from mid-scale, and its
    /// coordinate an angle.
    pub fn new(rig: &Rig, file: &str) -> Result<Self, Error> {
        if rig.kind != Kind::Rotary || rig.actuator.command_unit != "dac" {
            return Err(Error::input(format_args!(
                "{file}: the virtual device is rotary and commanded in DAC steps; give a rig with kind = \"rotary\" and command_unit = \"dac\", such as one that characterise has written"
            )));
        }
        let plan = super::configuration().plan().map_err(Error::failed)?;
        Ok(Self {
            plant: Plant::new(rig),
            wiring: Wiring::default(),
            middle: f64::from(plan.zero_torque_code().0),
            endpoint: Endpoint::new(Identity::VIRTUAL, &plan, None).knowing_depth(),
            controller: Controller::new(plan),
            tick: 0,
            command: 0.0,
        })
    }

    /// The same, wired as `wiring`.
    pub fn wired(self, wiring: Wiring) -> Self {
        Self { wiring, ..self }
    }

    /// The same before anybody has commissioned it, wired as `wiring`.
    pub fn uncommissioned(self, wiring: Wiring) -> Result<Self, Error> {
        let device = Device::default();
        let plan = Plan::new(&device, &Patient::nobody()).map_err(Error::failed)?;
        let endpoint = Endpoint::new(Identity::VIRTUAL, &plan, None);
        Ok(Self { wiring, endpoint, controller: Controller::new(plan), ..self })
    }

    /// One tick of the control law, then 100 µs of physics under `tilt` rad.
    pub fn tick(&mut self, tilt: f64) {
        self.tick_under(tilt, 0.0);
    }

    /// The same with a hand that turns the roller by `external` N·m.
    pub(crate) fn tick_under(&mut self, tilt: f64, external: f64) {
        while let Some(order) = self.endpoint.next_order() {
            self.controller.order(order);
        }
        let count = Counts(self.wiring.counted(self.plant.counts() as i32));
        let output =
            self.controller.tick(TickInput { count, tilt: Milliradians((tilt * 1e3).round() as i16) });
        self.endpoint.record(self.tick, &output);
        let asked = if output.enable { f64::from(output.dac.0) - self.middle } else { 0.0 };
        self.command = self.wiring.driven(asked);
        for _ in 0..STEPS_PER_TICK {
            self.plant.step(self.command, Surroundings { tilt, external }, STEP_S);
        }
        self.tick += 1;
    }

    /// The roller's true angle, rad.
    pub fn position(&self) -> f64 {
        self.plant.position()
    }

    /// Its true speed, rad/s.
    pub fn velocity(&self) -> f64 {
        self.plant.velocity()
    }

    /// The plan in force.
    pub fn plan(&self) -> &Plan {
        self.controller.plan()
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
