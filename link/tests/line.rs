//! The line of a needle on its way: the latest counts, an unsound one leaves everything as it was,
//! and no number of them pushes anything out.

use control_core::config::Config;
use control_core::units::Millimetres;
use control_core::{AnyOrder, NeedleLine, Order, Refusal};
use fixed::types::I16F16;
use link::codec::MAX_FRAME;
use link::device::{Endpoint, Identity};
use link::frames::{Ack, Command, CommandRefusal, DeviceFrame, PROTOCOL_VERSION};
use link::host::{Commands, Reception};

struct Device {
    endpoint: Endpoint,
    commands: Commands,
    reception: Reception,
}

impl Device {
    fn in_session() -> Self {
        let plan = Config::commissioned_virtual().plan().expect("the default is sound");
        let endpoint = Endpoint::new(Identity::VIRTUAL, &plan, None).knowing_depth();
        let mut device = Self { endpoint, commands: Commands::default(), reception: Reception::default() };
        assert_eq!(device.ask(Command::Hello { version: PROTOCOL_VERSION }), Ok(()));
        assert!(device.endpoint.next_order().is_some(), "the heartbeat of a hello");
        device
    }

    fn bytes(&mut self, command: Command) -> Vec<u8> {
        let mut out = [0; MAX_FRAME];
        let (_, length) = self.commands.encode(command, &mut out).expect("it fits");
        out[..length].to_vec()
    }

    fn answers(&mut self) -> Vec<Ack> {
        let (mut out, mut acks) = ([0; MAX_FRAME], Vec::new());
        loop {
            let length = self.endpoint.transmit(&mut out);
            if length == 0 {
                return acks;
            }
            for frame in out[..length].iter().filter_map(|byte| self.reception.push(*byte)) {
                if let DeviceFrame::Ack(ack) = frame {
                    acks.push(ack);
                }
            }
        }
    }

    fn ask(&mut self, command: Command) -> Result<(), CommandRefusal> {
        let bytes = self.bytes(command);
        self.endpoint.receive(&bytes);
        self.answers().last().expect("every command is answered").result
    }

    /// The answer to a line, and the line that the control law is given.
    fn line(&mut self, line: NeedleLine) -> (Result<(), CommandRefusal>, Option<NeedleLine>) {
        let bytes = self.bytes(Command::Line(line));
        self.endpoint.receive(&bytes);
        let taken = self.endpoint.take_line();
        (self.answers().last().expect("the latest is answered").result, taken)
    }
}

fn line(vein: f64) -> NeedleLine {
    let depths = [0.0, 2.0, vein, 9.0].map(|depth| Millimetres(I16F16::from_num(depth)));
    NeedleLine { depths: depths.into_iter().collect() }
}

#[test]
fn the_latest_line_counts_and_is_no_order() {
    let mut device = Device::in_session();
    for vein in [5.0, 6.0, 7.0] {
        let bytes = device.bytes(Command::Line(line(vein)));
        device.endpoint.receive(&bytes);
    }
    assert_eq!(device.endpoint.take_line(), Some(line(7.0)));
    assert_eq!(device.answers().len(), 1, "the latest is answered");
    assert_eq!(device.endpoint.take_line(), None, "once");
    assert!(device.endpoint.next_order().is_none());
}

#[test]
fn an_unsound_line_is_given_to_nobody() {
    let mut device = Device::in_session();
    assert_eq!(device.line(line(5.0)), (Ok(()), Some(line(5.0))));
    let overlap = Err(CommandRefusal::Config(Refusal::Overlap { layer: 2 }));
    assert_eq!(device.line(line(1.5)), (overlap, None));
    assert!(matches!(device.line(NeedleLine::default()), (Err(CommandRefusal::Config(_)), None)));
}

#[test]
fn a_line_waits_for_no_order_and_outlives_no_configuration() {
    let mut device = Device::in_session();
    while device.ask(Command::Zero) == Ok(()) {}
    assert_eq!(device.line(line(5.0)), (Ok(()), Some(line(5.0))), "the queue is full");
    while device.endpoint.next_order().is_some() {}
    let sent = device.bytes(Command::Line(line(5.0)));
    device.endpoint.receive(&sent);
    assert_eq!(device.ask(Command::ConfigurePatient(Config::default().patient)), Ok(()));
    assert_eq!(device.endpoint.take_line(), None, "it was for the patient before");
    device.endpoint.receive(&sent);
    device.endpoint.disconnect();
    assert_eq!(device.endpoint.take_line(), None, "the PC is gone");
}

/// Neither answers that wait, nor what the device remembers of commands that it has carried out.
#[test]
fn lines_push_nothing_out() {
    let mut device = Device::in_session();
    let zero = device.bytes(Command::Zero);
    for _ in 0..2 {
        device.endpoint.receive(&zero);
        for vein in 0..100 {
            let sent = device.bytes(Command::Line(line(4.0 + 0.01 * f64::from(vein))));
            device.endpoint.receive(&sent);
            device.endpoint.take_line();
        }
        assert_eq!(device.answers().len(), 2, "of the zero and of the last line");
    }
    let orders = std::iter::from_fn(|| device.endpoint.next_order());
    let zeros = orders.filter(|order| matches!(order, AnyOrder::Small(Order::Zero)));
    assert_eq!(zeros.count(), 1, "carried out once");
}

/// Both in one packet: the answer to the first has not been sent when the second comes.
#[test]
fn a_stop_right_before_a_hello_is_answered() {
    let mut device = Device::in_session();
    let stop = device.bytes(Command::Stop);
    let hello = device.bytes(Command::Hello { version: PROTOCOL_VERSION });
    device.endpoint.receive(&[stop, hello].concat());
    assert_eq!(device.answers().len(), 2);
}
