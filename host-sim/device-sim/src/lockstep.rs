//! A simulated device and the PC's side of its link in one thread, in step: a millisecond of ticks,
//! then what each has for the other. The clock of both is the device's, so that a busy computer
//! slows both and neither finds the other silent.

use crate::device::virtual_device::VirtualDevice;
use crate::driver::Driver;
use crate::needle::LineSender;
use control_core::TICK_HZ;
use link::codec::MAX_FRAME;
use link::frames::DeviceFrame;
use std::time::Duration;

/// Ticks between two exchanges: 1 ms.
pub const TICKS: u64 = 10;

/// Returns the device's own time, `ticks` after power-up.
pub fn time(ticks: u64) -> Duration {
    Duration::from_micros(ticks * 1_000_000 / u64::from(TICK_HZ))
}

/// Passes every frame that waits for the PC to `take`, in order. `transmit` writes the next one and
/// returns its length in bytes, 0 where nothing waits.
pub fn empty(mut transmit: impl FnMut(&mut [u8; MAX_FRAME]) -> usize, mut take: impl FnMut(&[u8])) {
    let mut frame = [0; MAX_FRAME];
    loop {
        match transmit(&mut frame) {
            0 => return,
            count => take(&frame[..count]),
        }
    }
}

/// Moves a device and the driver of its link on by one exchange, with the needle that is followed
/// in the patient: it tells where bone stops the tip and barriers stop its turning. `hear` gets
/// every byte that the device sends, `see` every frame.
pub fn exchange(
    device: &mut VirtualDevice,
    driver: &mut Driver,
    mut needle: Option<&mut LineSender>,
    mut hear: impl FnMut(&[u8]),
    mut see: impl FnMut(&DeviceFrame),
) {
    let now = time(device.ticks());
    device.receive(driver.transmit(now));
    for _ in 0..TICKS {
        device.tick();
    }
    empty(
        |frame| device.transmit(frame),
        |bytes| {
            hear(bytes);
            driver.receive(now, bytes, |frame| {
                see(frame);
                needle.iter_mut().for_each(|needle| needle.frame(frame));
            });
        },
    );
    if let Some(needle) = needle {
        driver.follow(now, needle);
        device.meet_bone(needle.track().bone_mm());
        device.limit_tilt(needle.tilt_limits());
    }
}
