//! Condition 5 of Paper 001: the slope of the needle may be set within a range, at whose ends a
//! barrier stops it.

use device_sim::device::virtual_device::{SLOPE_BARRIER, VirtualDevice};
use device_sim::named_files::Text;
use device_sim::procedure::Procedure;
use device_sim::profile::{BUILT_IN, Profile};
use device_sim::session::Control;

const RANGE: &str = "format = 1\nslope_deg = { smallest = 10.0, largest = 45.0 }";

fn patient(name: &str, range: &str) -> Result<Profile, String> {
    let file = BUILT_IN.iter().find(|(own, _)| *own == name).expect("it is built in").1;
    let text = file.replacen("format = 1", range, 1);
    Profile::parse(Text { origin: "test.toml".into(), text }).map_err(|refused| refused.to_string())
}

#[test]
fn an_entry_outside_the_slope_is_refused_everywhere() {
    for name in ["adult", "forearm"] {
        let entered = |degrees| patient(name, RANGE).expect("it may run").at_angle(degrees);
        assert!(entered(10.0).is_ok() && entered(45.0).is_ok(), "{name}");
        for degrees in [9.0, 46.0] {
            let said = entered(degrees).expect_err("outside").to_string();
            assert!(said.contains("--angle is") && said.contains("from 10 to 45 degrees"), "{name}: {said}");
        }
    }
    let adult = patient("adult", RANGE).expect("it may run");
    let said = Procedure::find("insertion-5mms-60deg", &adult).expect_err("too steep").to_string();
    assert!(said.contains("entry_deg is 60 degrees; it must be from 10 to 45 degrees"), "{said}");
    for (range, hint) in [
        ("format = 1\nslope_deg = { smallest = 40.0, largest = 60.0 }", "entry_deg is 30 degrees"),
        ("format = 1\nslope_deg = { smallest = 45.0, largest = 10.0 }", "slope_deg is from 45 to 10"),
        ("format = 1\nslope_deg = { smallest = 1.0, largest = 10.0 }", "slope_deg.smallest is 1 degrees"),
        ("format = 1\nslope_deg = { smallest = 10.0 }", "largest"),
    ] {
        let said = patient("adult", range).expect_err(range);
        assert!(said.contains(hint) && said.contains("test.toml"), "{said}");
    }
}

/// A person turns the needle to 60° and to 2°, twice each: it stops at 45° and 10°, which is
/// reported whenever it comes to one.
#[test]
fn a_barrier_stops_a_needle_that_is_turned() {
    let adult = patient("adult", RANGE).expect("it may run");
    let procedure = Procedure::find("hold", &adult).expect("it is built in");
    let mut device = VirtualDevice::new(&adult, procedure);
    device.limit_tilt(Some([10_f64.to_radians(), 45_f64.to_radians()]));
    let mut turned = |degrees: f64| {
        device.control(Control::Tilt { rad: degrees.to_radians() });
        let count = device.take_done().iter().filter(|name| **name == SLOPE_BARRIER).count();
        (device.plant().tilt().to_degrees().round(), count)
    };
    let found = [40.0, 60.0, 61.0, 44.0, 50.0, 2.0, 20.0].map(&mut turned);
    assert_eq!(found, [(40.0, 0), (45.0, 1), (45.0, 0), (44.0, 0), (45.0, 1), (10.0, 1), (20.0, 0)]);
    device.limit_tilt(None);
    device.control(Control::Tilt { rad: 1.2 });
    assert!((device.plant().tilt() - 1.2).abs() < 1e-9 && device.take_done().is_empty());
}

/// Another patient is chosen while the hand has the needle lowered: it is turned as the new patient
/// says, 45°, and not by what it was lowered more.
#[test]
fn a_new_procedure_does_not_inherit_the_last_ones_turn() {
    let adult = Profile::find("adult").expect("it is built in");
    let find = |name| Procedure::find(name, &adult).expect("it is built in");
    let mut device = VirtualDevice::new(&adult, find("cannulation"));
    device.start_alone();
    let entry = device.plant().tilt();
    let lowered = (0..100_000).any(|_| {
        device.tick_alone();
        device.plant().tilt() < entry - 9_f64.to_radians()
    });
    assert!(lowered, "the procedure lowers the needle");
    device.follow(find("venepuncture"));
    device.control(Control::Tilt { rad: 45_f64.to_radians() });
    (0..1_000).for_each(|_| device.tick_alone());
    assert!(
        (device.plant().tilt().to_degrees() - 45.0).abs() < 1e-6,
        "{}",
        device.plant().tilt().to_degrees()
    );
}
