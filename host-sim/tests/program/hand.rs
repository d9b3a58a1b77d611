//! A person's hand on the virtual needle: dragging, letting go, the script again, tilt, a new zero.

use device_sim::device::virtual_device::VirtualDevice;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use device_sim::session::Control;

fn started() -> VirtualDevice {
    let profile = Profile::find("adult").expect("it is built in");
    let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
    let mut device = VirtualDevice::new(&profile, procedure);
    device.start_alone();
    // Faded in, and still waiting above the skin.
    run(&mut device, 0.4);
    device
}

/// Runs for some seconds; the largest resistance in N on the way.
fn run(device: &mut VirtualDevice, seconds: f64) -> f64 {
    (0..(seconds * 1e4) as u32).fold(0.0, |largest: f64, _| {
        device.tick_alone();
        largest.max(resistance_n(device))
    })
}

/// 28.8 mN·m at a roller of 10 mm.
fn resistance_n(device: &VirtualDevice) -> f64 {
    -device.set_value() * 2.88
}

#[test]
fn a_dragged_needle_meets_the_parabola_and_stays_when_released() {
    let mut device = started();
    device.control(Control::Drag { depth_mm: 2.6 });
    run(&mut device, 1.0);
    assert_eq!(device.tripped(), None);
    let depth = device.plant().tip() * 1e3;
    // T²/9 against a hand of 1 N/mm that is 2.6 − T ahead, and as much as the needle weighs: T is
    // near 2.13 mm.
    let expected = depth * depth / 9.0;
    assert!((1.9..2.4).contains(&depth), "{depth} mm");
    assert!((resistance_n(&device) - expected).abs() < 0.02, "{} N at {depth} mm", resistance_n(&device));
    device.control(Control::Release);
    run(&mut device, 2.0);
    assert!((device.plant().tip() * 1e3 - depth).abs() < 0.15, "it stays, but for the tremor");
    assert!(device.is_enabled());
}

#[test]
fn a_wild_drag_trips_nothing_and_the_script_resumes() {
    let mut device = started();
    for depth_mm in [1e9, -1e9, f64::NAN, 55.0, -40.0, f64::INFINITY, 0.0] {
        device.control(Control::Drag { depth_mm });
        run(&mut device, 0.5);
        assert_eq!(device.tripped(), None, "after a drag to {depth_mm} mm");
    }
    device.control(Control::Demo);
    let largest = run(&mut device, 6.0);
    assert!(largest > 0.95, "the skin was punctured again, at {largest} N");
    assert!(device.is_enabled());
}

#[test]
fn tilt_is_bounded() {
    let mut device = started();
    for (asked, given) in [(0.3, 0.3), (-0.2, -0.2), (9.0, std::f64::consts::FRAC_PI_2), (f64::NAN, 1.0)] {
        let before = device.plant().tilt();
        device.control(Control::Tilt { rad: asked });
        let expected = if asked.is_nan() { before } else { given };
        assert_eq!(device.plant().tilt(), expected);
    }
}
