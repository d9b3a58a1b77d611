//! From the layers of a patient to the anatomy and the forces that the tick runs.

use super::stiffest;
use crate::anatomy::{self, Anatomy, NeedleLine};
use crate::config::{self, Config, Layer, MAX_LAYERS, Tissue, Vessel, Wall};
use crate::law::LayerHit;
use crate::refusal::{Field, Refusal, count, milli, within};
use crate::units::Millimetres;
use crate::wall::Parabola;
use fixed::types::{I2F30, I16F16, U32F32};
use heapless::Vec;

/// A force that appears at contact all at once is felt as a hit and rings: at most 0.05 N.
const LARGEST_CONTACT_STEP: I16F16 = I16F16::from_bits(3_277);
/// A change of the force by a line is at most 10 mN: this, and what rounding adds to it.
const LINE_FORCE: I16F16 = I16F16::from_bits(645);
/// A vessel that the needle would see less of is passed beside: 0.2 mm.
const LEAST_LUMEN: I16F16 = I16F16::from_bits(13_107);

/// The layers that the needle meets, and its way to the vessel.
pub(super) struct Meeting {
    pub(super) layers: Vec<LayerHit, MAX_LAYERS>,
    way: Option<Way>,
}

/// The needle's way to the vessel.
#[derive(Clone, Copy)]
enum Way {
    /// Through the walls in these layers.
    Through { near: usize, far: Option<usize> },
    /// Past it from this depth on, perpendicular to the skin, that of layer `number`.
    Beside { depth: Millimetres, number: u8 },
}

/// Prepares what has been checked; `ruptures` has a bit for each layer that gives way by the law of
/// force.
pub(super) fn plan(config: &Config, met: &Meeting, ruptures: u8) -> Anatomy {
    let mut anatomy = Anatomy {
        skin_tilt: config.device.skin_tilt.0,
        configured: config.patient.layers.len(),
        line_steps: line_steps(config, met),
        ..Anatomy::default()
    };
    for (index, LayerHit { number, layer }) in met.layers.iter().enumerate() {
        // All vectors hold MAX_LAYERS: no push can fail.
        let _ = anatomy.layers.push(anatomy::Layer {
            number: *number,
            depth: layer.depth,
            walls_above: anatomy.walls.len(),
            has_wall: layer.wall.is_some(),
            opens: ruptures & 1_u8.unbounded_shl(u32::from(*number)),
        });
        if let Some(wall) = &layer.wall {
            let relief = wall.relief.vertex.0.saturating_sub(wall.puncture_travel.0);
            let left = wall.spring_back.saturating_mul(wall.puncture_travel.0);
            let _ = anatomy.walls.push(anatomy::Wall {
                layer: index,
                puncture: wall.puncture_travel.0,
                relieved: wall.relief.vertex.0,
                left,
                share: I2F30::saturating_from_num(left.wide_div(left.saturating_add(relief))),
            });
        }
    }
    anatomy.vessel = met.way.and_then(|way| vessel(&anatomy.layers, way));
    anatomy
}

/// The vessel that the needle comes to on its `way` through `layers`.
fn vessel(layers: &[anatomy::Layer], way: Way) -> Option<anatomy::Vessel> {
    let passage = |layer: usize| Some(anatomy::Passage::of(layer, layers.get(layer)?));
    Some(match way {
        Way::Through { near, far } => {
            anatomy::Vessel::Met { near: passage(near)?, far: far.and_then(passage) }
        }
        Way::Beside { depth, number } => anatomy::Vessel::Beside { depth, number },
    })
}

/// The way of a layer for which the force changes by 10 mN, less what rounding takes, once so many
/// walls have given way; none where the force may jump.
fn line_steps(config: &Config, met: &Meeting) -> Vec<I16F16, { MAX_LAYERS + 1 }> {
    let walls: Vec<Wall, MAX_LAYERS> = met.layers.iter().filter_map(|met| met.layer.wall).collect();
    let step = |given: usize| {
        let (given, next) = walls.split_at_checked(given)?;
        let steepest = config.patient.law.steepest(&met.layers, (given, next.first()))?;
        Some(LINE_FORCE.saturating_div(steepest.max(I16F16::DELTA)))
    };
    (0..=walls.len()).map(|given| step(given).unwrap_or_default()).collect()
}

/// Refuses a line that meets the layers where no patient may have them, or where they ask for more
/// than the motor gives.
pub(super) fn check_line(plan: &super::Plan, line: &NeedleLine) -> Result<(), Refusal> {
    let config = plan.config();
    let layers = &config.patient.layers;
    count(Field::LayerDepth, line.depths.len(), layers.len())?;
    let mut above = None;
    for (number, (&depth, layer)) in (0..).zip(line.depths.iter().zip(layers)) {
        check_depth(config, number, &Layer { depth, ..*layer }, &mut above)?;
    }
    let moved = plan.anatomy.layers.iter().filter_map(|met| {
        let number = usize::from(met.number);
        let (layer, &depth) = layers.get(number).zip(line.depths.get(number))?;
        Some(LayerHit { number: met.number, layer: Layer { depth, ..*layer } })
    });
    let moved: Vec<LayerHit, MAX_LAYERS> = moved.collect();
    config.patient.law.check_depths(&super::force_limits(config, &moved))
}

/// Checks the depth of layer `number` below the one `above` it.
fn check_depth(
    config: &Config,
    number: u8,
    layer: &Layer,
    above: &mut Option<Millimetres>,
) -> Result<(), Refusal> {
    within(Field::LayerDepth, layer.depth.0, I16F16::ZERO, milli(500_000))?;
    if above.is_some_and(|above| above >= layer.depth) {
        return Err(Refusal::Overlap { layer: number });
    }
    *above = Some(layer.depth);
    if gives_way(layer) >= config.device.limits.travel.0 {
        return Err(Refusal::BeyondTravel { layer: number });
    }
    Ok(())
}

fn check_layers(config: &Config) -> Result<(), Refusal> {
    if config.patient.layers.is_empty() {
        return Err(Refusal::Empty);
    }
    let mut above = None;
    for (number, layer) in (0..).zip(&config.patient.layers) {
        check_depth(config, number, layer, &mut above)?;
        within(Field::Friction, layer.friction.0, I16F16::ZERO, milli(1_900))?;
        if let Some(wall) = &layer.wall {
            check_wall(wall, number, config)?;
        }
    }
    Ok(())
}

/// The depth at which the layer's wall gives way with the needle straight in; the layer's top if it
/// has no wall.
fn gives_way(layer: &Layer) -> I16F16 {
    layer.depth.0.saturating_add(layer.wall.map_or(I16F16::ZERO, |wall| wall.puncture_travel.0))
}

/// Returns the layers of the vessel's near and far wall.
fn vessel_walls(config: &Config) -> Result<Option<(usize, Option<usize>)>, Refusal> {
    let layers = &config.patient.layers;
    let near = layers.iter().position(|layer| layer.tissue == Tissue::Vessel);
    let far = near.map(|near| near + 1);
    let is_far = |index: usize| layers.get(index).is_some_and(|layer| layer.tissue == Tissue::FarWall);
    let misplaced = layers.iter().enumerate().position(|(index, layer)| match layer.tissue {
        Tissue::Vessel => near != Some(index),
        Tissue::FarWall => far != Some(index),
        _ => false,
    });
    match (misplaced, near, far) {
        (Some(layer), ..) => Err(Refusal::NoVessel { layer: layer as u8 }),
        (None, None, _) if config.patient.vessel.is_some() => {
            Err(Refusal::NoVessel { layer: layers.len() as u8 })
        }
        (None, None, _) | (None, _, None) => Ok(None),
        (None, Some(near), Some(far)) => Ok(Some((near, is_far(far).then_some(far)))),
    }
}

/// The layers that the needle meets: without a vessel that it passes beside, and with one as high
/// as it is where the needle goes through.
pub(super) fn met(config: &Config) -> Result<Meeting, Refusal> {
    check_layers(config)?;
    let layers = &config.patient.layers;
    let mut met: Vec<LayerHit, MAX_LAYERS> =
        (0..).zip(layers).map(|(number, layer)| LayerHit { number, layer: *layer }).collect();
    let Some((near, far)) = vessel_walls(config)? else { return Ok(Meeting { layers: met, way: None }) };
    let through = Way::Through { near, far };
    let (Some(shape), Some(far)) = (config.patient.vessel, far) else {
        return Ok(Meeting { layers: met, way: Some(through) });
    };
    let depth = |index: usize| layers.get(index).map_or(I16F16::ZERO, |layer| layer.depth.0);
    let height = depth(far).saturating_sub(depth(near));
    let lumen = height.saturating_mul(chord(&shape)?);
    if lumen < LEAST_LUMEN {
        met.retain(|met| !anatomy::is_vessel_wall(met.layer.tissue));
        let way = Some(Way::Beside { depth: Millimetres(depth(near)), number: near as u8 });
        return Ok(Meeting { layers: met, way });
    }
    let lower = (height - lumen) / 2;
    for (index, sign) in [(near, I16F16::ONE), (far, I16F16::NEG_ONE)] {
        if let Some(met) = met.get_mut(index) {
            met.layer.depth.0 = met.layer.depth.0.saturating_add(lower.saturating_mul(sign));
        }
    }
    Ok(Meeting { layers: met, way: Some(through) })
}

/// Returns the share of the vessel's height that a needle beside the axis passes, √(1 −
/// (2·offset/width)²).
fn chord(shape: &Vessel) -> Result<I16F16, Refusal> {
    within(Field::VesselWidth, shape.width.0, milli(200), milli(30_000))?;
    within(Field::VesselOffset, shape.offset.0, milli(-100_000), milli(100_000))?;
    let share = shape.offset.0.saturating_mul_int(2).saturating_div(shape.width.0);
    if share.unsigned_abs() >= I16F16::ONE.unsigned_abs() {
        return Ok(I16F16::ZERO);
    }
    let left = U32F32::ONE
        - U32F32::from_num(share.unsigned_abs()).saturating_mul(U32F32::from_num(share.unsigned_abs()));
    Ok(I16F16::from_bits(left.to_bits().isqrt() as i32))
}

fn check_wall(wall: &Wall, layer: u8, config: &Config) -> Result<(), Refusal> {
    for parabola in [&wall.elastic, &wall.relief] {
        check_parabola(parabola)?;
    }
    within(Field::PunctureTravel, wall.puncture_travel.0, milli(50), milli(30_000))?;
    within(Field::UnloadStiffness, wall.unload.0, milli(50), stiffest(config))?;
    within(Field::SpringBack, wall.spring_back, I16F16::ZERO, I16F16::ONE)?;
    if wall.elastic.vertex.0 > I16F16::ZERO || wall.relief.vertex.0 <= wall.puncture_travel.0 {
        return Err(Refusal::WrongWay { layer });
    }
    let limit = stiffest(config);
    let slope = wall.puncture_travel.0.saturating_sub(wall.elastic.vertex.0).saturating_mul_int(2);
    let slope = slope.saturating_div(wall.elastic.compliance.0);
    // Inside tissue the needle feels the wall and the hold of friction together.
    let hold = config.patient.law.hold();
    let slope =
        if layer > 0 { slope.saturating_add(hold) } else { slope }.max(wall.unload.0.saturating_add(hold));
    if slope > limit {
        return Err(Refusal::TooStiff { layer, slope, limit });
    }
    let (elastic, relief) = (Parabola::new(&wall.elastic), Parabola::new(&wall.relief));
    let step = elastic.force(Millimetres::default()).0;
    if step.unsigned_abs() > LARGEST_CONTACT_STEP.unsigned_abs() {
        return Err(Refusal::ContactStep { layer, force: step });
    }
    if relief.force(wall.puncture_travel) > elastic.force(wall.puncture_travel) {
        return Err(Refusal::ReliefAboveElastic { layer });
    }
    Ok(())
}

fn check_parabola(parabola: &config::Parabola) -> Result<(), Refusal> {
    within(Field::Compliance, parabola.compliance.0, milli(50), milli(1_000_000))?;
    within(Field::Vertex, parabola.vertex.0, milli(-30_000), milli(100_000))?;
    within(Field::BaseForce, parabola.base.0, milli(-20_000), milli(20_000))
}
