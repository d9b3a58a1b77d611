//! Tests that a configuration which may not run is refused with the reason; the last value that may
//! run is not.

use control_core::config::{FrictionLaw, Law, Layer, Parabola, SPRING_BACK, Tissue, Vessel, Wall};
use control_core::plan::Field;
use control_core::units::{
    Counts, FrictionPerMillimetre, Grams, JogCompliance, Millimetres, MillinewtonMetres, Milliradians,
    Newtons, Stiffness,
};
use control_core::{Config, Controller, Order, Patient, Plan, Refusal, TickInput};
use fixed::types::I16F16;

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

pub(crate) fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

pub(crate) fn refusal(change: impl FnOnce(&mut Config)) -> Option<Refusal> {
    let mut config = Config::commissioned_virtual();
    change(&mut config);
    config.plan().err()
}

/// A tissue that asks for next to nothing, so that what is tested is alone in being refused.
pub(crate) fn weak(config: &mut Config) {
    config.device.limits.stiffness = Stiffness(q(2.0));
    // So much friction and mass that any encoder and any drive bears it.
    config.device.mechanism.dry_friction = Newtons(q(3.0));
    config.device.mechanism.mass = Grams(q(100.0));
    config.patient.law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(0.05)) });
    config.patient.layers = [layer(0.0, None)].into_iter().collect();
}

fn layer(top: f64, wall: Option<Wall>) -> Layer {
    let friction = FrictionPerMillimetre(I16F16::ZERO);
    Layer { tissue: Tissue::Other, depth: Millimetres(q(top)), wall, friction }
}

fn parabola(vertex: f64, compliance: f64, base: f64) -> Parabola {
    Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons(q(base)),
    }
}

/// 0.25 N at 1 mm.
fn wall() -> Wall {
    Wall {
        elastic: parabola(0.0, 4.0, 0.0),
        puncture_travel: Millimetres(q(1.0)),
        relief: parabola(1.5, 4.0, 0.0),
        unload: Stiffness(q(0.5)),
        spring_back: SPRING_BACK,
    }
}

/// With one wall changed.
fn with_wall(change: impl FnOnce(&mut Wall)) -> Option<Refusal> {
    let mut changed = wall();
    change(&mut changed);
    refusal(|config| {
        weak(config);
        config.patient.layers = [layer(1.0, Some(changed))].into_iter().collect();
    })
}

fn is_field(refusal: Option<Refusal>, wanted: Field) -> bool {
    matches!(refusal, Some(Refusal::OutOfRange { field, .. }) if field == wanted)
}

#[test]
fn a_wall_that_would_ring_hit_or_pull_is_refused() {
    assert_eq!(with_wall(|_| {}), None);
    // 2T/a at the puncture, and the limit is 2 N/mm: a of 1 is the limit itself.
    assert_eq!(with_wall(|w| w.elastic.compliance.0 = q(1.01)), None);
    let too_stiff = with_wall(|w| w.elastic.compliance.0 = q(0.99));
    assert!(matches!(too_stiff, Some(Refusal::TooStiff { layer: 0, .. })), "{too_stiff:?}");
    // Drawn back, the wall lets go along its unloading slope while friction holds.
    assert_eq!(with_wall(|w| w.unload.0 = q(1.94)), None);
    assert!(matches!(with_wall(|w| w.unload.0 = q(1.96)), Some(Refusal::TooStiff { layer: 0, .. })));
    assert!(is_field(with_wall(|w| w.unload.0 = q(2.01)), Field::UnloadStiffness));
    assert!(is_field(with_wall(|w| w.unload.0 = q(0.04)), Field::UnloadStiffness));

    assert_eq!(with_wall(|w| w.elastic.base.0 = I16F16::from_bits(3_277)), None);
    for base in [0.051, -0.051] {
        let hit = with_wall(|w| w.elastic.base.0 = q(base));
        assert!(matches!(hit, Some(Refusal::ContactStep { layer: 0, .. })), "{hit:?}");
    }
    assert_eq!(with_wall(|w| w.elastic.vertex.0 = q(0.01)), Some(Refusal::WrongWay { layer: 0 }));
    assert_eq!(with_wall(|w| w.relief.vertex.0 = q(1.0)), Some(Refusal::WrongWay { layer: 0 }));
    assert_eq!(with_wall(|w| w.relief.vertex.0 = q(1.01)), None);
    // The relief begins at (1 − 1.5)²/a + b: 0.25 N are what the wall gave way at.
    assert_eq!(with_wall(|w| w.relief.compliance.0 = q(1.0)), None);
    let strong = with_wall(|w| w.relief.compliance.0 = q(0.99));
    assert_eq!(strong, Some(Refusal::ReliefAboveElastic { layer: 0 }));

    assert!(is_field(with_wall(|w| w.elastic.compliance.0 = q(0.04)), Field::Compliance));
    assert!(is_field(with_wall(|w| w.relief.compliance.0 = q(1_000.1)), Field::Compliance));
    assert!(is_field(with_wall(|w| w.puncture_travel.0 = q(0.04)), Field::PunctureTravel));
    assert!(is_field(with_wall(|w| w.puncture_travel.0 = q(30.1)), Field::PunctureTravel));
    assert!(is_field(with_wall(|w| w.elastic.vertex.0 = q(-30.1)), Field::Vertex));
    assert!(is_field(with_wall(|w| w.relief.base.0 = q(-20.1)), Field::BaseForce));
}

#[test]
fn inside_tissue_the_slopes_of_a_wall_and_of_friction_add_up() {
    let below = |hold: f64| {
        refusal(|config| {
            weak(config);
            config.patient.law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(hold)) });
            config.patient.layers = [layer(0.0, None), layer(1.0, Some(wall()))].into_iter().collect();
        })
    };
    // 0.5 N/mm of the wall.
    assert_eq!(below(1.49), None);
    assert!(matches!(below(1.51), Some(Refusal::TooStiff { layer: 1, .. })));
    // 1.6 N/mm on the way in, where nothing holds the needle above the outermost layer.
    let on_the_way_in = |layers: &[Layer]| {
        refusal(|config| {
            weak(config);
            config.patient.law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(0.5)) });
            config.patient.layers = layers.iter().copied().collect();
        })
    };
    let steep = Wall { elastic: parabola(0.0, 1.25, 0.0), unload: Stiffness(q(0.05)), ..wall() };
    assert_eq!(on_the_way_in(&[layer(1.0, Some(steep))]), None);
    let inner = on_the_way_in(&[layer(0.0, None), layer(1.0, Some(steep))]);
    assert!(matches!(inner, Some(Refusal::TooStiff { layer: 1, .. })), "{inner:?}");
}

#[test]
fn friction_as_printed_is_as_stiff_as_its_highest_level() {
    let with_cap = |level_cap: f64| {
        refusal(|config| {
            weak(config);
            config.patient.law = Law::Jog(FrictionLaw::Paper {
                level_length: Millimetres(q(23.0)),
                level_cap: q(level_cap),
                anchor_ms: 60,
                stiffness: Stiffness(q(1.0)),
                limit: Newtons(q(0.5)),
                limit_out: Newtons(q(0.5)),
            });
        })
    };
    // The limit is 2 N/mm; the number of layers stands for friction.
    assert_eq!(with_cap(2.0), None);
    assert!(matches!(with_cap(2.01), Some(Refusal::TooStiff { layer: 1, .. })));
}

#[test]
fn more_force_than_the_motor_has_is_refused() {
    // Force at a 10 mm roller: torque over ten.
    let with = |torque: f64, friction: f64| {
        refusal(|config| {
            weak(config);
            config.device.limits.torque = MillinewtonMetres(q(torque));
            config.device.limits.travel = Millimetres(q(11.0));
            let mut inner = layer(5.0, Some(wall()));
            inner.friction.0 = q(friction);
            let mut outer = layer(1.0, None);
            outer.friction.0 = q(friction);
            config.patient.layers = [outer, inner].into_iter().collect();
        })
    };
    assert_eq!(with(2.5, 0.0), None);
    assert!(matches!(with(2.49, 0.0), Some(Refusal::TooStrong { layer: 1, .. })));
    // Flat enough to meet the wall at the end of the travel, 8.8 mm of 0.01 N/mm lie above its 0.25
    // N.
    assert_eq!(with(3.39, 0.01), None);
    assert!(matches!(with(3.37, 0.01), Some(Refusal::TooStrong { layer: 1, .. })));
    // 1/16 N/mm: 0.8 N there, and 0.625 N at the end with the needle straight in.
    assert_eq!(with(8.01, 0.0625), None);
    assert!(matches!(with(7.99, 0.0625), Some(Refusal::TooStrong { layer: 1, .. })));
}

#[test]
fn layers_lie_in_their_order_within_the_travel() {
    let with = |layers: &[Layer]| {
        refusal(|config| {
            weak(config);
            config.device.limits.travel = Millimetres(q(20.0));
            config.patient.layers = layers.iter().copied().collect();
        })
    };
    assert_eq!(with(&[]), Some(Refusal::Empty));
    assert_eq!(with(&[layer(0.0, None), layer(0.001, None)]), None);
    assert_eq!(with(&[layer(1.0, None), layer(1.0, None)]), Some(Refusal::Overlap { layer: 1 }));
    assert_eq!(with(&[layer(0.0, Some(wall())), layer(0.5, None)]), None);
    assert_eq!(with(&[layer(0.0, Some(wall())), layer(1.01, Some(wall()))]), None);
    // A wall that is carried along while the one above is pushed in is met later.
    assert_eq!(with(&[layer(0.0, Some(wall())), layer(0.5, Some(wall()))]), None);
    assert_eq!(
        with(&[layer(0.5, Some(wall())), layer(0.5, Some(wall()))]),
        Some(Refusal::Overlap { layer: 1 })
    );
    assert_eq!(with(&[layer(18.99, Some(wall()))]), None);
    assert_eq!(with(&[layer(19.0, Some(wall()))]), Some(Refusal::BeyondTravel { layer: 0 }));
    assert_eq!(with(&[layer(20.0, None)]), Some(Refusal::BeyondTravel { layer: 0 }));
    assert!(is_field(with(&[layer(-0.01, None)]), Field::LayerDepth));
}

#[test]
fn a_vessel_has_two_walls_one_below_the_other_and_is_alone() {
    let of = |tissues: &[Tissue], vessel: Option<Vessel>| {
        refusal(|config| {
            weak(config);
            let layers = tissues.iter().enumerate();
            config.patient.layers =
                layers.map(|(index, &tissue)| Layer { tissue, ..layer(index as f64, None) }).collect();
            config.patient.vessel = vessel;
        })
    };
    use Tissue::{FarWall, Muscle, Skin};
    let shape = |width: f64, offset: f64| {
        Some(Vessel { width: Millimetres(q(width)), offset: Millimetres(q(offset)) })
    };
    assert_eq!(of(&[Skin, Tissue::Vessel, FarWall, Muscle], shape(0.21, 99.0)), None);
    assert_eq!(of(&[Skin, Tissue::Vessel], None), None);
    assert_eq!(of(&[Skin, FarWall], None), Some(Refusal::NoVessel { layer: 1 }));
    let apart = [Skin, Tissue::Vessel, Muscle, FarWall];
    assert_eq!(of(&apart, None), Some(Refusal::NoVessel { layer: 3 }));
    let two = [Tissue::Vessel, FarWall, Tissue::Vessel, FarWall];
    assert_eq!(of(&two, None), Some(Refusal::NoVessel { layer: 2 }));
    assert_eq!(of(&[Skin, Muscle], shape(3.0, 0.0)), Some(Refusal::NoVessel { layer: 2 }));
    let whole = [Skin, Tissue::Vessel, FarWall];
    assert!(is_field(of(&whole, shape(0.19, 0.0)), Field::VesselWidth));
    assert!(is_field(of(&whole, shape(30.1, 0.0)), Field::VesselWidth));
    assert!(is_field(of(&whole, shape(3.0, -100.1)), Field::VesselOffset));
    assert!(is_field(with_wall(|w| w.spring_back = q(1.01)), Field::SpringBack));
    assert!(is_field(with_wall(|w| w.spring_back = q(-0.01)), Field::SpringBack));
}

#[test]
fn each_refusal_says_what_to_do() {
    let (layer, force, slope, limit) = (1, q(1.5), q(3.0), q(2.0));
    let texts = [
        Refusal::OutOfRange { field: Field::Travel, value: force, low: slope, high: limit },
        Refusal::TooStiff { layer, slope, limit },
        Refusal::TooStrong { layer, force, limit },
        Refusal::Overlap { layer },
        Refusal::ContactStep { layer, force },
        Refusal::WrongWay { layer },
        Refusal::ReliefAboveElastic { layer },
        Refusal::BeyondTravel { layer },
        Refusal::NoVessel { layer },
        Refusal::Empty,
        Refusal::AboveCeiling { force, ceiling: limit },
    ]
    .map(|refusal| refusal.to_string());
    assert_eq!(texts[0], "travel_mm is 1.5000; it must be from 3.0000 to 2.0000");
    assert!(texts[1..10].iter().all(|text| text.contains("layer")), "{texts:?}");
    assert!(texts[10].contains("ceiling of 2.000 N"), "{texts:?}");
    assert!(texts[3..9].iter().all(|text| text.contains("layer 1")), "{texts:?}");
}

#[test]
fn a_patient_may_lower_the_devices_ceiling_but_not_raise_it() {
    let wants = |force: f64| {
        refusal(|config| {
            config.patient.largest_force = Some(Newtons(q(force)));
        })
    };
    // 28.8 mN·m at 10 mm.
    assert_eq!(wants(2.87), None);
    let refused = wants(2.9);
    assert!(matches!(refused, Some(Refusal::AboveCeiling { .. })), "{refused:?}");
    // The default tissue asks for up to 1.2 N at the end of the travel: a patient that asks for
    // more than its largest force is refused.
    assert!(matches!(wants(0.9), Some(Refusal::TooStrong { layer: 0, .. })));
    let mut config = Config::commissioned_virtual();
    config.patient.largest_force = Some(Newtons(q(2.0)));
    assert_eq!(config.plan().expect("sound").largest_force().0, q(2.0));
}

#[test]
fn any_device_that_may_be_bears_nobody() {
    let nobody = Patient::nobody();
    let mut device = control_core::Device::commissioned_virtual();
    assert!(Plan::new(&device, &nobody).is_ok());
    device.roller_radius.0 = q(25.0);
    device.limits.torque.0 = q(0.1);
    device.limits.stiffness.0 = q(0.05);
    device.limits.travel.0 = q(1.0);
    assert!(Plan::new(&device, &nobody).is_ok(), "{:?}", Plan::new(&device, &nobody).err());
    device.roller_radius.0 = q(26.0);
    assert!(Plan::new(&device, &nobody).is_err());
}

/// Tests of a plan's own figures.
#[test]
fn a_plan_has_force_layers_and_torque_of_a_dead_encoder() {
    let plan = Config::commissioned_virtual().plan().expect("sound");
    assert_eq!(plan.largest_force().0, q(28.8).saturating_div(q(10.0)));
    assert_eq!(plan.tissue(0), Some(Tissue::Skin));
    assert_eq!((plan.tissue(2), plan.tissue(4)), (Some(Tissue::Vessel), None));
    // An eighth of the torque limit is 3.6 mN·m: 1.8 mm into the skin, 0.36 N.
    let trips = |depth_mm: f64| {
        let count = Counts((depth_mm / plan.mm_per_count().to_num::<f64>()) as i32);
        let mut c = Controller::new(plan.clone());
        c.tick(TickInput { count, tilt: STRAIGHT });
        c.order(Order::Start);
        (0..50_000).any(|_| {
            c.order(Order::Heartbeat);
            c.tick(TickInput { count, tilt: STRAIGHT }).tripped.is_some()
        })
    };
    assert!(!trips(1.75) && trips(1.85));
}
