//! Paper 001, condition 1, at the needle: the force that the hand feels in the simulated mechanism,
//! behind converter, amplifier, motor and bearings, is that of equation 1.

use device_sim::device::virtual_device::VirtualDevice;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;

/// Dry friction of bearings and brushes at the roller (0.04 N), a count of the encoder on the
/// steepest slope of the skin (0.01 N), and a code of the converter.
const ALLOWED_N: f64 = 0.06;

/// The skin of the adult: (T mm)²/9 N until it gives way after 3 mm, by a stage at 1 mm/s.
#[test]
fn the_hand_feels_equation_1_at_the_needle() {
    let profile = Profile::find("adult").expect("it is built in").at_angle(90.0).expect("it goes in");
    let procedure = Procedure::find("insertion-1mms-90deg", &profile).expect("it is well named");
    let mut device = VirtualDevice::new(&profile, procedure);
    device.start_alone();
    let (mut worst_n, mut compared) = (0.0_f64, 0);
    while device.plant().tip() < 2.9e-3 {
        device.tick_alone();
        let travel_mm = device.plant().tip() * 1e3;
        if !(0.3..2.9).contains(&travel_mm) {
            continue;
        }
        // The weight of a needle that points down helps the hand.
        let weight_n = device.plant().config().needle_mass * 9.806_65;
        let felt_n = device.plant().hand_force() + weight_n;
        worst_n = worst_n.max((felt_n - travel_mm * travel_mm / 9.0).abs());
        compared += 1;
    }
    assert!(compared > 20_000, "{compared} ticks");
    assert!(worst_n < ALLOWED_N, "{worst_n:.3} N off the law");
}
