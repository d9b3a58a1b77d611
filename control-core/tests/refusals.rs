//! What may not run is refused with the reason; the last value that may run is not.

use control_core::config::{FrictionLaw, Layer, Parabola, Tissue, Wall};
use control_core::plan::Field;
use control_core::units::{
    Counts, Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillinewtonMetres, Newtons, Stiffness,
};
use control_core::{Config, Controller, Order, Plan, Refusal, TickInput};
use fixed::types::{I8F24, I16F16};

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn refusal(change: impl FnOnce(&mut Config)) -> Option<Refusal> {
    let mut config = Config::default();
    change(&mut config);
    Plan::new(&config).err()
}

/// The field that is refused; any other reason is told apart.
fn field(change: impl FnOnce(&mut Config)) -> Option<Field> {
    match refusal(change) {
        None => None,
        Some(Refusal::OutOfRange { field, .. }) => Some(field),
        Some(other) => panic!("{other:?}"),
    }
}

/// A value, a step beyond the least and the most that it may be, and how it is set.
type Range = (Field, [f64; 2], [f64; 2], fn(&mut Config, f64));

/// A change of the law of friction.
type ChangedLaw = fn(&mut FrictionLaw);

/// A tissue that asks for next to nothing, so that what is tested is alone in being refused.
fn weak(config: &mut Config) {
    config.limits.stiffness = Stiffness(q(2.0));
    config.friction = FrictionLaw::Cone { stiffness: Stiffness(q(0.05)) };
    config.layers = [layer(0.0, None)].into_iter().collect();
}

fn layer(top: f64, wall: Option<Wall>) -> Layer {
    let friction = FrictionPerMillimetre(I16F16::ZERO);
    Layer { tissue: Tissue::Other, top: Millimetres(q(top)), wall, friction }
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
    }
}

#[test]
fn each_value_has_a_range_and_its_ends_belong_to_it() {
    let paper = |config: &mut Config, change: fn(&mut FrictionLaw)| {
        config.friction = FrictionLaw::Paper {
            level_length: Millimetres(q(23.0)),
            level_cap: q(1.0),
            anchor_ms: 60,
            stiffness: Stiffness(q(0.5)),
            limit: Newtons(q(0.5)),
        };
        change(&mut config.friction);
    };
    let ranges: [Range; 14] = [
        (Field::RollerRadius, [4.0, 3.99], [25.0, 25.01], |c, v| c.device.roller_radius.0 = q(v)),
        (Field::CountsPerTurn, [256.0, 255.0], [65_535.0, f64::NAN], |c, v| {
            c.device.counts_per_turn = v as u16
        }),
        (Field::FullScaleTorque, [28.8, 9.99], [500.0, 500.01], |c, v| c.device.full_scale_torque.0 = q(v)),
        (Field::TorqueLimit, [0.1, 0.09], [28.79, 28.81], |c, v| c.limits.torque.0 = q(v)),
        (Field::ContinuousTorque, [3.0, 2.99], [180.0, 180.1], |c, v| c.limits.continuous_torque.0 = q(v)),
        (Field::WindingTimeS, [1.0, 0.0], [600.0, 601.0], |c, v| c.limits.winding_time_s = v as u16),
        (Field::SlewPerTick, [0.0011, 0.0009], [100.0, 100.1], |c, v| c.limits.slew_per_tick.0 = q(v)),
        (Field::FadeInMs, [10.0, 9.0], [5_000.0, 5_001.0], |c, v| c.limits.fade_in_ms = v as u16),
        (Field::MaxCountsPerTick, [2.0, 1.0], [1_000.0, 1_001.0], |c, v| {
            c.limits.max_counts_per_tick = v as u16
        }),
        (Field::Travel, [1.0, 0.99], [500.0, 500.1], |c, v| c.limits.travel.0 = q(v)),
        (Field::StiffnessLimit, [0.051, 0.049], [7.0, 7.01], |c, v| c.limits.stiffness.0 = q(v)),
        (Field::HeartbeatMs, [20.0, 19.0], [5_000.0, 5_001.0], |c, v| c.limits.heartbeat_ms = v as u16),
        (Field::Damping, [0.0, -0.0001], [0.0005, 0.0006], |c, v| c.damping = Damping(I8F24::from_num(v))),
        (Field::PassivityDamping, [0.0, -0.001], [0.0199, 0.0201], |c, v| {
            c.passivity_damping = Damping(I8F24::from_num(v));
        }),
    ];
    for (name, low, high, set) in ranges {
        for [within, beyond] in [low, high] {
            // Gentle in all else, for a weak motor is refused for other reasons.
            let run = |value: f64| {
                field(|config| {
                    weak(config);
                    set(config, value);
                    if name == Field::StiffnessLimit && value < 0.05 {
                        config.friction = FrictionLaw::Cone { stiffness: Stiffness(q(value)) };
                    }
                })
            };
            assert_eq!(run(within), None, "{name:?} {within}");
            if !beyond.is_nan() {
                assert_eq!(run(beyond), Some(name), "{name:?} {beyond}");
            }
        }
    }
    let papers: [(Field, ChangedLaw); 6] = [
        (Field::LevelLength, |l| {
            if let FrictionLaw::Paper { level_length, .. } = l {
                level_length.0 = q(0.9)
            }
        }),
        (Field::LevelCap, |l| {
            if let FrictionLaw::Paper { level_cap, .. } = l {
                *level_cap = q(0.9)
            }
        }),
        (Field::AnchorMs, |l| {
            if let FrictionLaw::Paper { anchor_ms, .. } = l {
                *anchor_ms = 4
            }
        }),
        (Field::AnchorMs, |l| {
            if let FrictionLaw::Paper { anchor_ms, .. } = l {
                *anchor_ms = 1_001
            }
        }),
        (Field::FrictionStiffness, |l| {
            if let FrictionLaw::Paper { stiffness, .. } = l {
                stiffness.0 = q(0.0)
            }
        }),
        (Field::FrictionLimit, |l| {
            if let FrictionLaw::Paper { limit, .. } = l {
                limit.0 = q(2.9)
            }
        }),
    ];
    for (name, change) in papers {
        assert_eq!(field(|config| paper(config, change)), Some(name));
    }
    assert_eq!(field(|config| paper(config, |_| {})), None);
    assert_eq!(
        field(|c| c.friction = FrictionLaw::Cone { stiffness: Stiffness(q(0.04)) }),
        Some(Field::FrictionStiffness)
    );
}

/// With one wall changed.
fn with_wall(change: impl FnOnce(&mut Wall)) -> Option<Refusal> {
    let mut changed = wall();
    change(&mut changed);
    refusal(|config| {
        weak(config);
        config.layers = [layer(1.0, Some(changed))].into_iter().collect();
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
    assert!(is_field(with_wall(|w| w.elastic.vertex.0 = q(-30.1)), Field::PunctureTravel));
    assert!(is_field(with_wall(|w| w.relief.base.0 = q(-20.1)), Field::BaseForce));
}

#[test]
fn inside_tissue_the_slopes_of_a_wall_and_of_friction_add_up() {
    let below = |hold: f64| {
        refusal(|config| {
            weak(config);
            config.friction = FrictionLaw::Cone { stiffness: Stiffness(q(hold)) };
            config.layers = [layer(0.0, None), layer(1.0, Some(wall()))].into_iter().collect();
        })
    };
    // 0.5 N/mm of the wall.
    assert_eq!(below(1.49), None);
    assert!(matches!(below(1.51), Some(Refusal::TooStiff { layer: 1, .. })));
    // 1.6 N/mm on the way in, where nothing holds the needle above the outermost layer.
    let on_the_way_in = |layers: &[Layer]| {
        refusal(|config| {
            weak(config);
            config.friction = FrictionLaw::Cone { stiffness: Stiffness(q(0.5)) };
            config.layers = layers.iter().copied().collect();
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
            config.friction = FrictionLaw::Paper {
                level_length: Millimetres(q(23.0)),
                level_cap: q(level_cap),
                anchor_ms: 60,
                stiffness: Stiffness(q(1.0)),
                limit: Newtons(q(0.5)),
            };
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
            config.limits.torque = MillinewtonMetres(q(torque));
            config.limits.travel = Millimetres(q(11.0));
            let mut inner = layer(5.0, Some(wall()));
            inner.friction.0 = q(friction);
            let mut outer = layer(1.0, None);
            outer.friction.0 = q(friction);
            config.layers = [outer, inner].into_iter().collect();
        })
    };
    assert_eq!(with(2.5, 0.0), None);
    assert!(matches!(with(2.49, 0.0), Some(Refusal::TooStrong { layer: 1, .. })));
    // 4 mm of 0.01 N/mm above the wall's 0.25 N; 10 mm of it at the end of the travel.
    assert_eq!(with(2.92, 0.01), None);
    assert!(matches!(with(2.88, 0.01), Some(Refusal::TooStrong { layer: 1, .. })));
    // 1/16 N/mm: 0.5 N at the wall, 0.625 N at the end.
    assert_eq!(with(6.25, 0.0625), None);
    assert!(matches!(with(6.24, 0.0625), Some(Refusal::TooStrong { layer: 1, .. })));
}

#[test]
fn layers_lie_in_their_order_within_the_travel() {
    let with = |layers: &[Layer]| {
        refusal(|config| {
            weak(config);
            config.limits.travel = Millimetres(q(20.0));
            config.layers = layers.iter().copied().collect();
        })
    };
    assert_eq!(with(&[]), Some(Refusal::Empty));
    assert_eq!(with(&[layer(0.0, None), layer(0.001, None)]), None);
    assert_eq!(with(&[layer(1.0, None), layer(1.0, None)]), Some(Refusal::Overlap { layer: 1 }));
    assert_eq!(with(&[layer(0.0, Some(wall())), layer(0.5, None)]), None);
    assert_eq!(with(&[layer(0.0, Some(wall())), layer(1.01, Some(wall()))]), None);
    let walls = [layer(0.0, Some(wall())), layer(1.0, Some(wall()))];
    assert_eq!(with(&walls), Some(Refusal::Overlap { layer: 1 }));
    // A layer without a wall between the two changes nothing.
    let between = [layer(0.0, Some(wall())), layer(0.2, None), layer(0.9, Some(wall()))];
    assert_eq!(with(&between), Some(Refusal::Overlap { layer: 2 }));
    assert_eq!(with(&[layer(18.99, Some(wall()))]), None);
    assert_eq!(with(&[layer(19.0, Some(wall()))]), Some(Refusal::BeyondTravel { layer: 0 }));
    assert_eq!(with(&[layer(20.0, None)]), Some(Refusal::BeyondTravel { layer: 0 }));
    assert!(is_field(with(&[layer(-0.01, None)]), Field::LayerTop));
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
        Refusal::Empty,
    ]
    .map(|refusal| refusal.to_string());
    assert_eq!(texts[0], "Travel is 1.5000; it must lie from 3.0000 to 2.0000");
    assert!(texts[1..].iter().all(|text| text.contains("layer")), "{texts:?}");
    assert!(texts[3..8].iter().all(|text| text.contains("layer 1")), "{texts:?}");
}

/// What a plan says of itself.
#[test]
fn a_plan_knows_its_force_its_layers_and_its_torque_of_a_dead_encoder() {
    let plan = Plan::new(&Config::default()).expect("sound");
    assert_eq!(plan.largest_force().0, q(28.8).saturating_div(q(10.0)));
    assert_eq!(plan.tissue(0), Some(Tissue::Skin));
    assert_eq!((plan.tissue(2), plan.tissue(3)), (Some(Tissue::Vessel), None));
    // An eighth of the torque limit is 3.6 mN·m: 1.8 mm into the skin, 0.36 N.
    let trips = |depth_mm: f64| {
        let count = Counts((depth_mm / plan.mm_per_count().to_num::<f64>()) as i32);
        let mut c = Controller::new(plan.clone());
        c.tick(TickInput { count, ..TickInput::default() });
        c.order(Order::Start);
        (0..50_000).any(|_| {
            c.order(Order::Heartbeat);
            c.tick(TickInput { count, ..TickInput::default() }).tripped.is_some()
        })
    };
    assert!(!trips(1.75) && trips(1.85));
}
