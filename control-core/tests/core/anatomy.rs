//! Layers lie in the body and the needle meets them where it comes to them: at any angle, in their
//! order, beside a vessel or through it.

use control_core::config::{Layer, Tissue, Vessel};
use control_core::event::VesselState;
use control_core::units::{Counts, Millimetres, Milliradians};
use control_core::{Config, Controller, Order, TickInput, TickOutput};
use fixed::types::I16F16;
use proptest::prelude::*;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn mrad(degrees: f64) -> Milliradians {
    Milliradians((degrees.to_radians() * 1e3).round() as i16)
}

/// A layer, and the path in mm at which it was met.
type Met = (u8, f64);

/// A needle at an angle, which goes where it is commanded at 10 mm/s.
struct Needle {
    core: Controller,
    tilt: Milliradians,
    at_mm: f64,
}

impl Needle {
    fn new(config: &Config, degrees: f64) -> Self {
        let mut core = Controller::new(config.plan().expect("the configuration is sound"));
        let tilt = mrad(degrees);
        core.tick(TickInput { tilt, count: Counts(-64) });
        core.order(Order::Start);
        Self { core, tilt, at_mm: -1.0 }
    }

    fn tick(&mut self) -> TickOutput {
        let per_count = self.core.plan().mm_per_count().to_num::<f64>();
        self.core.order(Order::Heartbeat);
        let count = Counts((self.at_mm / per_count).round() as i32);
        self.core.tick(TickInput { count, tilt: self.tilt })
    }

    fn go(&mut self, mm: f64, mut see: impl FnMut(&TickOutput)) {
        let step = 1e-3 * (mm - self.at_mm).signum();
        while (mm - self.at_mm).abs() > step.abs() {
            self.at_mm += step;
            see(&self.tick());
        }
    }

    /// Returns the depths at which each layer is touched and gives way on the way to `mm`.
    fn met(&mut self, mm: f64) -> (Vec<Met>, Vec<Met>) {
        let (mut contacts, mut punctures) = (Vec::new(), Vec::new());
        self.go(mm, |out| {
            let at = out.depth.0.to_num::<f64>();
            contacts
                .extend((0..8).filter(|layer| out.transitions.contact >> layer & 1 == 1).map(|l| (l, at)));
            punctures
                .extend((0..8).filter(|layer| out.transitions.puncture >> layer & 1 == 1).map(|l| (l, at)));
        });
        (contacts, punctures)
    }
}

/// One count of the default device, mm.
const COUNT_MM: f64 = 0.016;

#[test]
fn the_vein_is_at_its_depth_over_the_sine_of_the_angle() {
    for degrees in [10.0, 15.0, 22.0, 30.0, 45.0, 60.0, 75.0, 90.0_f64] {
        let (contacts, _) =
            Needle::new(&Config::commissioned_virtual(), degrees).met(4.8 / degrees.to_radians().sin() + 1.0);
        let vein = contacts.iter().find(|(layer, _)| *layer == 2).expect("the vein is met").1;
        let depth = vein * degrees.to_radians().sin();
        assert!((depth - 4.8).abs() < 0.05, "{degrees}°: met at {vein} mm, {depth} mm deep");
        if degrees == 30.0 {
            assert!((vein - 9.6).abs() < 0.02, "{vein} mm along a needle at 30°");
        }
    }
}

#[test]
fn a_wall_that_holds_carries_the_next_one_along() {
    // The skin gives way at 3 mm; a vein 1 mm under it is met no sooner, and pushed in from there.
    let mut config = Config::commissioned_virtual();
    config.patient.layers =
        [config.patient.layers[0], Layer { depth: Millimetres(q(1.0)), ..config.patient.layers[2] }]
            .into_iter()
            .collect();
    let mut needle = Needle::new(&config, 90.0);
    let (contacts, punctures) = needle.met(2.98);
    assert_eq!((contacts.len(), punctures.len()), (1, 0), "only the skin: {contacts:?}");
    let before = needle.tick().force.0.to_num::<f64>();
    let (contacts, punctures) = needle.met(6.0);
    let (skin, vein) = (punctures[0], contacts[0]);
    assert!(skin.0 == 0 && (skin.1 - 3.0).abs() < COUNT_MM, "{skin:?}");
    assert!(vein.0 == 1 && (vein.1 - skin.1).abs() < COUNT_MM, "it lay under the skin: {vein:?}");
    // 1.5 mm of its own, from where it was met.
    assert!(punctures[1].0 == 1 && (punctures[1].1 - 4.5).abs() < 2.0 * COUNT_MM, "{punctures:?}");
    assert!((before - 1.0).abs() < 0.05, "{before} N before the skin gave way");
}

#[test]
fn skin_indentation_delays_the_next_layer_until_relieved() {
    // Given way at 3 mm, 0.3 of it left, gone at 4 mm: a layer 3.5 mm deep is met where x = 3.5 +
    // 0.9·(4 − x).
    let mut config = Config::commissioned_virtual();
    config.patient.layers[1].depth = Millimetres(q(3.5));
    let (contacts, _) = Needle::new(&config, 90.0).met(6.0);
    assert!(contacts[1].0 == 1 && (contacts[1].1 - 7.1 / 1.9).abs() < COUNT_MM, "{contacts:?}");
    config.patient.layers[0].wall.as_mut().expect("the skin has one").spring_back = I16F16::ZERO;
    let (contacts, _) = Needle::new(&config, 90.0).met(6.0);
    assert!((contacts[1].1 - 3.5).abs() < COUNT_MM, "sprung back at once: {contacts:?}");
}

/// A vein so deep below the skin, which gives way at 3 mm, that it was carried along with the skin,
/// comes to rest on the relief, or does not move at all: what it resists with at a depth is one
/// force, however fast the needle came there.
#[test]
fn where_a_wall_is_met_does_not_depend_on_when_a_tick_falls() {
    for depth in [1.0, 2.5, 3.2, 3.9, 3.96, 3.99, 4.05] {
        let mut config = Config::commissioned_virtual();
        config.patient.layers =
            [config.patient.layers[0], Layer { depth: Millimetres(q(depth)), ..config.patient.layers[2] }]
                .into_iter()
                .collect();
        let force_after = |step: f64| {
            let mut needle = Needle::new(&config, 90.0);
            let mut gently = 0.0_f64;
            while needle.at_mm + step < 4.4 {
                gently = (gently + 6e-5).min(step);
                needle.at_mm += gently;
                assert_eq!(needle.tick().tripped, None);
            }
            needle.at_mm = 4.4;
            // Until nothing is left of the speed.
            (0..3_000).map(|_| needle.tick().force.0.to_num::<f64>()).last().expect("it rests")
        };
        let slowly = force_after(0.002);
        for step in [0.007, 0.011, 0.013, 0.017, 0.023] {
            let fast = force_after(step);
            assert!(
                (fast - slowly).abs() < 0.002,
                "{depth} mm deep, {step} mm a tick: {fast} N for {slowly} N"
            );
        }
    }
}

/// States in their order, and how often blood showed.
fn through(needle: &mut Needle, mm: f64) -> (Vec<VesselState>, usize) {
    let (mut states, mut flashbacks) = (vec![needle.tick().vessel], 0);
    needle.go(mm, |out| {
        states.push(out.vessel);
        flashbacks += usize::from(out.transitions.flashback);
    });
    states.dedup();
    (states, flashbacks)
}

#[test]
fn blood_shows_in_a_vessel_entered_from_either_side() {
    use VesselState::{InLumen, Outside, Through, Touching};
    let mut needle = Needle::new(&Config::commissioned_virtual(), 30.0);
    assert_eq!(through(&mut needle, 13.0), (vec![Outside, Touching, InLumen], 1));
    // The far wall lies at 15.6 mm and gives way 1.5 mm further in.
    assert_eq!(through(&mut needle, 16.5), (vec![InLumen], 0), "it is pushed in and holds");
    assert_eq!(through(&mut needle, 18.0), (vec![InLumen, Through], 0));
    assert_eq!(through(&mut needle, 14.0), (vec![Through, InLumen], 1), "drawn back, blood shows again");
    assert_eq!(through(&mut needle, 5.0), (vec![InLumen, Outside], 0));
}

#[test]
fn a_needle_off_the_axis_crosses_less_of_the_vessel() {
    let beside = |offset: f64| {
        let mut config = Config::commissioned_virtual();
        config.patient.vessel = Some(Vessel { width: Millimetres(q(4.0)), offset: Millimetres(q(offset)) });
        config
    };
    // 3 mm high: 1 mm of 2 off the axis, √(1 − ¼) of it are left, so that the wall lies 1.5·(1 −
    // 0.866) = 0.201 mm deeper.
    for offset in [1.0, -1.0] {
        let (contacts, _) = Needle::new(&beside(offset), 90.0).met(8.5);
        let at = |layer: u8| contacts.iter().find(|(l, _)| *l == layer).expect("it is met").1;
        assert!((at(2) - 5.001).abs() < COUNT_MM && (at(3) - 7.599).abs() < COUNT_MM, "{contacts:?}");
    }
    let (contacts, _) = Needle::new(&beside(0.0), 90.0).met(8.5);
    assert!((contacts[2].1 - 4.8).abs() < COUNT_MM);
    for offset in [2.0, 5.0] {
        let mut needle = Needle::new(&beside(offset), 30.0);
        let (contacts, punctures) = needle.met(9.0);
        assert_eq!((contacts.len(), punctures.len()), (2, 1), "skin and fat");
        assert_eq!(through(&mut needle, 20.0), (vec![VesselState::Outside, VesselState::Beside], 0));
        assert!(needle.met(25.0).0.is_empty());
    }
}

#[test]
fn a_tilt_that_trembles_makes_no_layer_come_and_go() {
    for degrees in [15.0, 30.0, 60.0_f64] {
        let mut needle = Needle::new(&Config::commissioned_virtual(), degrees);
        let mut noise = 1_u32;
        let tilt = needle.tilt;
        // Just inside the vein, for three seconds, with 3 mrad of white noise at each tick.
        needle.go(4.8 / degrees.to_radians().sin() + 0.02, |_| ());
        let mut changes = 0;
        for _ in 0..30_000 {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            needle.tilt = Milliradians(tilt.0 + (noise >> 24) as i16 % 7 - 3);
            let seen = needle.tick().transitions;
            changes += seen.contact.count_ones() + seen.exit.count_ones();
        }
        assert!(changes <= 1, "{degrees}°: {changes} changes");
    }
}

#[test]
fn a_flattened_needle_leaves_layers_that_it_no_longer_reaches() {
    let mut needle = Needle::new(&Config::commissioned_virtual(), 30.0);
    needle.go(12.0, |_| ());
    assert_eq!(needle.tick().vessel, VesselState::InLumen);
    // At 15° the vein lies at 18.5 mm.
    needle.tilt = mrad(15.0);
    let (mut exits, mut angle) = (0, Milliradians(0));
    for _ in 0..5_000 {
        let out = needle.tick();
        exits |= out.transitions.exit;
        angle = out.angle;
    }
    assert_eq!(exits, 0b100);
    assert!((angle.0 - 262).abs() <= 1, "{angle:?}");
    assert_eq!(needle.tick().vessel, VesselState::Outside);
}

#[test]
fn the_skins_own_slope_is_no_part_of_the_angle() {
    let mut config = Config::commissioned_virtual();
    config.device.skin_tilt = Milliradians(-300);
    let (contacts, _) = Needle::new(&config, 30.0 - 0.3_f64.to_degrees()).met(11.0);
    assert!((contacts[2].1 - 9.6).abs() < 0.05, "{contacts:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Never the fat before the skin has given way.
    #[test]
    fn events_come_in_the_order_of_the_anatomy(
        degrees in 8.0..90.0_f64,
        gaps in prop::collection::vec(0.05..3.0_f64, 3),
        spring_back in 0.0..1.0_f64,
    ) {
        let mut config = Config::commissioned_virtual();
        let mut depth = 0.0;
        for (layer, gap) in config.patient.layers.iter_mut().skip(1).zip(gaps) {
            depth += gap;
            layer.depth = Millimetres(q(depth));
        }
        for wall in config.patient.layers.iter_mut().filter_map(|layer| layer.wall.as_mut()) {
            wall.spring_back = q(spring_back);
        }
        let mut needle = Needle::new(&config, degrees);
        let mut order = Vec::new();
        needle.go(59.0, |out| {
            let seen = out.transitions;
            order.extend((0..4_u8).filter(|l| seen.puncture >> l & 1 == 1).map(|l| (l, 'p')));
            order.extend((0..4_u8).filter(|l| seen.contact >> l & 1 == 1).map(|l| (l, 'c')));
        });
        prop_assert!(order.is_sorted(), "{:?}", order);
        let reached = config.patient.layers.iter().filter(|l| l.depth.0.to_num::<f64>() / degrees.to_radians().sin() < 55.0);
        prop_assert!(order.iter().filter(|(_, what)| *what == 'c').count() >= reached.count());
        prop_assert!(config.patient.layers[1].tissue == Tissue::Fat);
    }
}
