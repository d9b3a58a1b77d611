//! Nothing that a PC sends commissions a device or raises what it was commissioned with: its own
//! pulses do, or its own seal.

use control_core::ceilings::Ceilings;
use control_core::excitation::{Excitation, GENTLE_TORQUE, Servo, Signal};
use control_core::plan::Field;
use control_core::units::{Counts, Damping, Millimetres, Stiffness};
use control_core::{Controller, Device, Patient, Plan, Refusal, TickInput};
use fixed::types::I16F16;
use link::codec::MAX_FRAME;
use link::commissioning::Record;
use link::device::{Endpoint, Identity};
use link::frames::{Command, CommandRefusal, DeviceFrame, GuardRefusal, PROTOCOL_VERSION};
use link::host::{Commands, Reception};

const IDENTITY: Identity =
    Identity { serial: [7; 12], firmware: [1, 2, 3], ceilings: Ceilings::new(40, 600), ..Identity::VIRTUAL };

/// A device on a roller of 15 g·cm² with 0.5 mN·m of dry friction.
struct DeviceOnRoller {
    controller: Controller,
    endpoint: Endpoint,
    commands: Commands,
    reception: Reception,
    tick: u64,
    angle: f64,
    speed: f64,
    /// The sign by which the motor turns a torque, and the encoder an angle.
    signs: (f64, f64),
    record: Option<Record>,
}

impl DeviceOnRoller {
    fn new(device: &Device, signs: (f64, f64)) -> Self {
        let plan = Plan::new(device, &Patient::nobody()).expect("sound");
        let mut bench = Self {
            endpoint: Endpoint::new(IDENTITY, &plan, None),
            controller: Controller::new(plan),
            commands: Commands::default(),
            reception: Reception::default(),
            tick: 0,
            angle: 0.0,
            speed: 0.0,
            signs,
            record: None,
        };
        assert_eq!(bench.ask(Command::Hello { version: PROTOCOL_VERSION }), Ok(()));
        bench
    }

    fn ask(&mut self, command: Command) -> Result<(), CommandRefusal> {
        let mut out = [0; MAX_FRAME];
        let (_, length) = self.commands.encode(command, &mut out).expect("it fits");
        self.endpoint.receive(&out[..length]);
        let mut answer = None;
        loop {
            let length = self.endpoint.transmit(&mut out);
            if length == 0 {
                return answer.expect("every command is answered");
            }
            for frame in out[..length].iter().filter_map(|byte| self.reception.push(*byte)) {
                match frame {
                    DeviceFrame::Ack(ack) => answer = Some(ack.result),
                    DeviceFrame::Device(record) => self.record = Some(record),
                    _ => {}
                }
            }
        }
    }

    /// Returns the record that it sends.
    fn record(&mut self) -> Record {
        assert_eq!(self.ask(Command::ReportDevice), Ok(()));
        self.run(1);
        assert_eq!(self.ask(Command::Heartbeat), Ok(()));
        self.record.expect("it is told")
    }

    fn run(&mut self, ticks: u32) {
        const DT: f64 = 1e-4;
        for _ in 0..ticks {
            while let Some(order) = self.endpoint.next_order() {
                self.controller.order(order);
            }
            self.controller.heartbeat();
            let count = (self.signs.1 * self.angle / std::f64::consts::TAU * 4_000.0).floor() as i32;
            let output = self.controller.tick(TickInput { count: Counts(count), ..TickInput::default() });
            self.endpoint.record(self.tick, &output);
            self.tick += 1;
            let code = if output.enable { f64::from(output.dac.0) - 2_048.0 } else { 0.0 };
            let free = self.speed + self.signs.0 * code / 2_047.0 * 0.028_8 / 1.5e-6 * DT;
            let stop = 0.5e-3 / 1.5e-6 * DT;
            self.speed = if free.abs() <= stop { 0.0 } else { free - stop.copysign(free) };
            self.angle += self.speed * DT;
        }
    }

    /// Six pulses both ways, for so many ms of them.
    fn pulse(&mut self, ms: u32) {
        let excitation = Excitation {
            signal: Signal::BreakawayRamps { torque: GENTLE_TORQUE, ramp_ms: 100 },
            duration_ms: 1_200,
            servo: Servo { stiffness: Stiffness::default(), damping: Damping::default() },
            travel: Millimetres(I16F16::from_num(450)),
            compensated: false,
        };
        assert_eq!(self.ask(Command::Excite(excitation)), Ok(()));
        self.run(10 * ms);
    }
}

fn with(change: impl Fn(&mut Device)) -> Device {
    let mut device = Device::commissioned_virtual();
    change(&mut device);
    device
}

#[test]
fn only_pulses_that_the_device_has_played_commission_it() {
    let mut bench = DeviceOnRoller::new(&Device::default(), (1.0, 1.0));
    assert_eq!(
        bench.ask(Command::ConfigureDevice(Device::commissioned_virtual())),
        Err(CommandRefusal::NotShown)
    );
    let forged = Record { device: Device::commissioned_virtual(), seal: 1 };
    assert_eq!(bench.ask(Command::RestoreDevice(forged)), Err(CommandRefusal::NotShown));
    assert_eq!(bench.ask(Command::Commission), Err(CommandRefusal::NotShown));
    bench.pulse(600);
    assert_eq!(bench.ask(Command::Stop), Ok(()));
    bench.run(10);
    assert_eq!(bench.ask(Command::Commission), Err(CommandRefusal::NotShown), "they were cut short");
    bench.pulse(1_300);
    let otherwise = Device { roller_radius: Millimetres(I16F16::from_num(12)), ..Device::default() };
    assert_eq!(bench.ask(Command::ConfigureDevice(otherwise)), Ok(()));
    assert_eq!(bench.ask(Command::Commission), Err(CommandRefusal::NotShown), "of another device");
    bench.run(10);
    bench.pulse(1_300);
    // The converter's zero is what the pulses give.
    assert_eq!(bench.ask(Command::ConfigureDevice(Device { dac_zero: 2, ..otherwise })), Ok(()));
    assert_eq!(bench.ask(Command::Commission), Ok(()));
    assert_eq!(bench.ask(Command::Commission), Ok(()), "it is");
    let wanted = Device { dac_zero: 2, commissioned: true, ..otherwise };
    assert_eq!(bench.record().device, wanted);
    // What was shown counts once.
    assert_eq!(bench.ask(Command::ConfigureDevice(Device { commissioned: false, ..wanted })), Ok(()));
    assert_eq!(bench.ask(Command::Commission), Err(CommandRefusal::NotShown));
}

#[test]
fn a_motor_that_drives_the_other_way_is_not_commissioned() {
    for (motor, encoder) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        let mut bench = DeviceOnRoller::new(&Device::default(), (motor, encoder));
        bench.pulse(1_300);
        let goes_together = motor * encoder > 0.0;
        let answer = bench.ask(Command::Commission);
        assert_eq!(answer, if goes_together { Ok(()) } else { Err(CommandRefusal::NotShown) });
    }
}

#[test]
fn commands_lower_ceilings_and_only_the_own_record_raises_them() {
    let mut bench = DeviceOnRoller::new(&Device::commissioned_virtual(), (1.0, 1.0));
    let whole = bench.record();
    let half = with(|device| device.limits.torque.0 /= 2);
    let raised = |field| Err(CommandRefusal::Commissioned(field));
    let stronger = with(|device| {
        device.full_scale_torque.0 += I16F16::ONE;
        device.limits.torque.0 += I16F16::ONE;
    });
    assert_eq!(bench.ask(Command::ConfigureDevice(stronger)), raised(Field::FullScaleTorque));
    let faster = with(|device| device.limits.max_counts_per_tick += 1);
    assert_eq!(bench.ask(Command::ConfigureDevice(faster)), raised(Field::MaxCountsPerTick));
    assert_eq!(bench.ask(Command::ConfigureDevice(half)), Ok(()));
    assert_eq!(
        bench.ask(Command::ConfigureDevice(Device::commissioned_virtual())),
        raised(Field::TorqueLimit)
    );
    assert_eq!(bench.record().device, half, "refused whole");

    let anothers = Record::of(&Device::commissioned_virtual(), [8; 12]);
    assert_eq!(bench.ask(Command::RestoreDevice(anothers)), raised(Field::TorqueLimit));
    let edited = Record { device: stronger, ..whole };
    assert_eq!(bench.ask(Command::RestoreDevice(edited)), raised(Field::FullScaleTorque));
    assert_eq!(bench.ask(Command::RestoreDevice(whole)), Ok(()));
    // After the flash was lost it is the device's own still.
    let mut bench = DeviceOnRoller::new(&Device::default(), (1.0, 1.0));
    assert_eq!(bench.ask(Command::RestoreDevice(whole)), Ok(()));
    assert_eq!(bench.record(), whole);
}

#[test]
fn no_command_passes_the_boards_ceilings() {
    let mut bench = DeviceOnRoller::new(&Device::default(), (1.0, 1.0));
    let strong = Device {
        full_scale_torque: control_core::units::MillinewtonMetres(I16F16::from_num(50)),
        ..with(|device| device.limits.torque.0 = I16F16::from_num(41))
    };
    let fast = with(|device| device.limits.max_counts_per_tick = 24);
    for (device, wanted) in [(strong, Field::TorqueLimit), (fast, Field::SpeedCeiling)] {
        let unknown = Device { commissioned: false, ..device };
        let record = Record::of(&device, IDENTITY.serial);
        for command in [Command::ConfigureDevice(unknown), Command::RestoreDevice(record)] {
            let answer = bench.ask(command);
            assert!(
                matches!(answer, Err(CommandRefusal::Config(Refusal::OutOfRange { field, .. })) if field == wanted),
                "{answer:?}"
            );
        }
    }
}

/// A virtual device has no supply; a board answers when it has looked, and a command that is
/// repeated meanwhile is carried out once.
#[test]
fn a_board_answers_for_its_supply_later() {
    let mut bench = DeviceOnRoller::new(&Device::default(), (1.0, 1.0));
    assert_eq!(bench.ask(Command::GuardSupply { set: true }), Ok(()));
    let mut endpoint = bench.endpoint.guarding_supply();
    let mut out = [0; MAX_FRAME];
    let (id, length) = bench.commands.encode(Command::GuardSupply { set: true }, &mut out).expect("it fits");
    let command = out[..length].to_vec();
    let mut answers = |endpoint: &mut Endpoint| {
        let mut found = Vec::new();
        while let length @ 1.. = endpoint.transmit(&mut out) {
            let frames = out[..length].iter().filter_map(|&byte| bench.reception.push(byte));
            found.extend(frames.filter_map(|frame| match frame {
                DeviceFrame::Ack(ack) if ack.id == id => Some(ack.result),
                _ => None,
            }));
        }
        found
    };
    for _ in 0..2 {
        endpoint.receive(&command);
        assert_eq!((endpoint.guard_asked(), answers(&mut endpoint).len()), (Some(true), 0));
    }
    let refused = Err(CommandRefusal::Guard(GuardRefusal::Restart));
    endpoint.answer_guard(refused);
    assert_eq!((endpoint.guard_asked(), answers(&mut endpoint)), (None, vec![refused]));
    endpoint.receive(&command);
    assert_eq!((endpoint.guard_asked(), answers(&mut endpoint)), (None, vec![refused]), "remembered");
}
