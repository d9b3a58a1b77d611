//! The virtual device for a while, as `run` drives it, and a hash (FNV-1a) of every byte that it
//! sent: what the same device in a browser has to equal. `device_digest PROFILE TICKS`.

use device_sim::device::virtual_device::VirtualDevice;
use device_sim::driver::Driver;
use device_sim::lockstep;
use device_sim::needle::LineSender;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use std::time::Duration;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "adult".into());
    let ticks: u64 = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(100_000);
    let profile = Profile::find(&name).expect("a built-in profile");
    let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
    let mut device = VirtualDevice::new(&profile, procedure);
    let mut driver = Driver::new(profile.config.patient.clone());
    let mut needle = LineSender::new(&profile);
    driver.connected(Duration::ZERO);
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut hear = |bytes: &[u8]| {
        hash = bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3));
    };
    while device.ticks() < ticks {
        let is_ready = driver.is_ready(lockstep::time(device.ticks()));
        if is_ready && !driver.has_started() && !driver.is_starting() {
            driver.start();
        }
        lockstep::exchange(&mut device, &mut driver, Some(&mut needle), &mut hear, |_| {});
    }
    println!("{hash:016x}");
}
