//! A virtual device in place of a board: in a thread of its own, in real time, with a cable that
//! may be pulled. It does not wait for the PC, as a board does not.

use super::pipe::{self, End};
use device_sim::device::Wire;
use device_sim::device::virtual_device::VirtualDevice;
use link::codec::MAX_FRAME;
use server::realtime_clock::RealtimeClock;
use std::io;
use std::sync::mpsc;
use std::time::Duration;

/// Ticks between two looks at the cable: 1 ms.
const BURST: u32 = 10;

/// A board that is powered up; it goes on until this and its last cable are dropped.
pub(crate) struct Board {
    cables: mpsc::Sender<End>,
}

impl Board {
    /// Powers it up.
    pub(crate) fn start(device: VirtualDevice) -> Self {
        let (cables, plugged) = mpsc::channel();
        std::thread::spawn(move || run(device, &plugged));
        Self { cables }
    }

    /// The PC's end of a new cable.
    pub(crate) fn plug_in(&mut self) -> Box<dyn Wire> {
        let (near, far) = pipe::cable();
        self.cables.send(far).expect("the board runs");
        Box::new(near)
    }
}

fn run(mut device: VirtualDevice, cables: &mpsc::Receiver<End>) {
    let mut cable: Option<End> = None;
    let mut clock = RealtimeClock::real_time();
    loop {
        match cables.try_recv() {
            Ok(end) => cable = Some(end),
            Err(mpsc::TryRecvError::Disconnected) if cable.is_none() => return,
            Err(_) => {}
        }
        if let Some(end) = &mut cable
            && exchange(&mut device, end).is_err()
        {
            device.disconnect();
            cable = None;
        }
        for _ in 0..BURST {
            device.tick();
        }
        if clock.wait(Duration::from_micros(device.ticks() * 100)).is_err() {
            device.note_late();
        }
    }
}

/// Takes what has arrived and sends what fits.
fn exchange(device: &mut VirtualDevice, cable: &mut End) -> io::Result<()> {
    let mut bytes = [0; MAX_FRAME];
    loop {
        match cable.read(&mut bytes, Duration::ZERO)? {
            0 => break,
            count => device.receive(&bytes[..count]),
        }
    }
    while cable.room() >= MAX_FRAME {
        match device.transmit(&mut bytes) {
            0 => break,
            count => cable.write(&bytes[..count])?,
        }
    }
    Ok(())
}
