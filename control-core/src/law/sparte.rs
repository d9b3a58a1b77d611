//! The law of Paper 002 (SPARTE), for an injection into a joint: a wall rises along a polynomial of
//! second order until it gives way; then the tip cuts against a *tracking wall*, which follows it
//! at a distance that makes the cutting force of its layer, while LuGre friction rubs along the
//! shaft; on the way out both act the other way, cutting with magnitudes of its own. A fixture
//! holds the direction of entry: its lateral force is computed and reported only, because this
//! device turns freely.
//!
//! A wall that is pushed in may resist more the faster it is pushed in (Hunt and Crossley 1975,
//! J Appl Mech 42:440): `F = f(T)·(1 + λv)`, which begins at no force and gives no energy back.
//!
//! Tracking wall: `z = x − w`, `w` dragged so that `−F_out/K ≤ z ≤ F_in/K`, `F = K·z`. A needle
//! that has not gone on for 20 ms has stopped: `w` comes after it with a time constant until only
//! the friction that holds the needle is left, and makes up for those 20 ms 20 ms later: a needle
//! that turns round has gone on by then. The force that relaxes lets a compliant hand creep on: the
//! needle stays at rest until it stretches the wall again or turns round. Where a wall of the
//! anatomy gives way, the tip cuts already: `w` is put where it makes a share of the cutting force,
//! so that the force falls below that and rises to it again. LuGre (Canudas de Wit 1995):
//! `ż = v − σ₀|v|z/g`, `g = F_c + (F_s − F_c)e^{−(v/v_s)²}`, `F = σ₀z + σ₁ż + σ₂v`, stepped
//! implicitly over the tick's own travel Δx, `z⁺ = (z + Δx)(1 − σ₀|Δx|/(g + σ₀|Δx|))`, which is
//! stable at any speed.

use super::{ForceLimits, LayerHit, Motion, Response, follow_share, reach};
use crate::anatomy::Insertion;
use crate::anchor::Anchor;
use crate::event::State;
use crate::kinematics::{Direction, Movement};
use crate::math::{exp_negative, saturating_multiply, share, truncating_product};
use crate::passivity::Elements;
use crate::refusal::{Field, Refusal, count, milli, within};
use crate::tissue::{MAX_LAYERS, Wall};
use crate::units::{Damping, Millimetres, MillimetresPerSecond, Milliradians, Newtons, Stiffness};
use crate::wall;
use fixed::types::{I2F30, I8F24, I16F16};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Ticks for which the wall follows at twice its pace: as many as a stop takes to be noticed, and
/// after as many, for a needle that turns round looks stopped for a moment too.
const CATCH_UP_TICKS: u16 = 200;
/// A needle at rest goes on once it has stretched the wall by this much again: 0.15 mm, more than a
/// hand trembles.
const GOES_ON: I16F16 = I16F16::from_bits(9_830);
/// Further than this the tip does not go in a tick; more is an encoder fault: 16 mm.
const LARGEST_STEP: i32 = 16 << 16;
/// Faster than this no law is held to what the motor gives: 50 mm/s.
const FASTEST: I16F16 = I16F16::from_bits(50 << 16);
/// Faster than this no force grows: 1,000 mm/s.
const LARGEST_SPEED: i32 = 1_000 << 16;
/// The barrier is reported again once the needle was turned back to this share of the largest
/// angle, in 256ths.
const REARMED_256: i32 = 230;

/// The additions of Paper 002's law to the layers: their walls' rising parabolas are its
/// polynomials of second order.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sparte {
    /// K of the tracking wall.
    pub tracking: Stiffness,
    /// Time constant with which the tracking wall comes after a needle that rests, 10–10,000 ms.
    pub relax_ms: u16,
    /// Share of the cutting force with which the tip goes on where a wall has just given way, 0–1.
    pub after_puncture: I16F16,
    /// The force of cutting in each layer, outermost first.
    pub cutting: Vec<Cutting, MAX_LAYERS>,
    /// Friction along the shaft.
    pub friction: Lugre,
    /// The fixture that holds the direction of entry.
    pub fixture: Fixture,
    /// λ of Hunt and Crossley, s/mm: at v mm/s a wall that is pushed in resists with 1 + λv times
    /// its force. At most 0.05, and so much that λ times the wall's force is 0.02 N·s/mm.
    pub wall_rate: I16F16,
}

/// The force of cutting in one layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cutting {
    /// On the way in.
    pub inwards: Newtons,
    /// On the way out, against withdrawal.
    pub outwards: Newtons,
}

/// LuGre friction (Canudas de Wit 1995).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lugre {
    /// σ₀, stiffness of the bristles.
    pub stiffness: Stiffness,
    /// σ₁, their damping, at most 0.0005 N·s/mm.
    pub damping: Damping,
    /// σ₂, what grows with speed, at most 0.02 N·s/mm.
    pub viscous: Damping,
    /// F_c, while sliding; at least 0.01 N.
    pub sliding: Newtons,
    /// F_s, before sliding; at least F_c.
    pub sticking: Newtons,
    /// v_s, where sticking gives way to sliding, 0.1–100 mm/s.
    pub speed: MillimetresPerSecond,
}

/// A virtual fixture that holds the direction of entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fixture {
    /// Lateral force for each milliradian off the direction of entry, N, at most 0.1.
    pub per_mrad: Newtons,
    /// Largest angle off it, 1–785 mrad; beyond it a barrier is reported.
    pub largest: Milliradians,
}

/// The law ready for the tick, walls in the order of the anatomy.
#[derive(Clone, Debug)]
pub(crate) struct PreparedSparte {
    walls: Vec<wall::Wall, MAX_LAYERS>,
    walls_that_close: usize,
    /// One entry for each layer.
    cuts: Vec<Cutting, MAX_LAYERS>,
    /// 1/K of the tracking wall.
    inverse_tracking: I16F16,
    /// Share of its way that the wall comes after a resting needle in a tick.
    relax: I2F30,
    rub: Rub,
}

/// Friction along the shaft.
#[derive(Clone, Copy, Debug)]
struct Rub {
    /// σ₀, N/mm.
    stiffness: I16F16,
    /// σ₁, N·s/mm.
    damping: I2F30,
    /// σ₂, N·s/mm.
    viscous: I2F30,
    /// F_c.
    sliding: I16F16,
    /// F_s − F_c.
    sticking: I16F16,
    /// 1/v_s, s/mm: at most 10.
    per_speed: I8F24,
}

impl Sparte {
    /// The tracking wall and the bristles together.
    pub(crate) fn hold(&self) -> I16F16 {
        self.tracking.0.saturating_add(self.friction.stiffness.0)
    }
}

/// The wall that is pushed in, and the cutting that gives way to it.
pub(super) fn steepest(pressed: Option<&Wall>) -> I16F16 {
    pressed.map_or(I16F16::ZERO, wall::steepest_rise).saturating_mul_int(2)
}

impl PreparedSparte {
    /// Checks what each layer asks for with friction at [`FASTEST`] on top.
    pub(crate) fn new(sparte: &Sparte, limits: &ForceLimits) -> Result<Self, Refusal> {
        check(sparte, limits)?;
        let cut = |met: &LayerHit| sparte.cutting.get(usize::from(met.number)).copied().unwrap_or_default();
        let walls = wall::all(limits.layers.iter().map(|met| &met.layer));
        let rub = &sparte.friction;
        Ok(Self {
            walls_that_close: walls.len().min(1),
            walls,
            cuts: limits.layers.iter().map(cut).collect(),
            inverse_tracking: I16F16::ONE.saturating_div(sparte.tracking.0),
            relax: follow_share(sparte.relax_ms),
            rub: Rub {
                stiffness: rub.stiffness.0,
                damping: I2F30::saturating_from_num(rub.damping.0),
                viscous: I2F30::saturating_from_num(rub.viscous.0),
                sliding: rub.sliding.0,
                sticking: rub.sticking.0.saturating_sub(rub.sliding.0),
                per_speed: I8F24::saturating_from_num(I8F24::ONE.wide_div(rub.speed.0)),
            },
        })
    }
}

/// A needle that has stopped, while the wall follows it.
#[derive(Clone, Copy, Debug)]
struct Rest {
    /// The smallest stretch of the wall since then, without its sign.
    least: I16F16,
    /// Ticks until the wall has caught up.
    catching_up: u16,
}

/// The needle's history so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// w.
    wall: Anchor,
    rest: Option<Rest>,
    /// Walls that had given way.
    given: usize,
    /// z of LuGre.
    bristles: I8F24,
    last_depth: Millimetres,
    /// The angle at entry, while the needle is inside.
    entry: Option<Milliradians>,
    is_beyond: bool,
}

impl Memory {
    /// One tick with the tip at `depth` along the needle.
    pub(crate) fn tick(
        &mut self,
        config: &Sparte,
        prepared: &PreparedSparte,
        met: &Insertion,
        Motion { depth, speed, movement }: Motion,
    ) -> Response {
        let step =
            depth.0.to_bits().wrapping_sub(self.last_depth.0.to_bits()).clamp(-LARGEST_STEP, LARGEST_STEP);
        self.last_depth = depth;
        let speed = speed.0.clamp(I16F16::from_bits(-LARGEST_SPEED), I16F16::from_bits(LARGEST_SPEED));
        let pressed = pressed(prepared, met, depth);
        let elastic = pressed.unwrap_or_default();
        let rate = rate_force(elastic, speed.to_bits(), config.wall_rate);
        if met.given() < prepared.walls_that_close || depth.0 < met.top(0) {
            self.wall.release(depth);
            self.bristles = I8F24::ZERO;
            self.rest = None;
            self.entry = None;
            self.is_beyond = false;
            self.given = met.given();
            let state = if pressed.is_some() { State::Elastic } else { State::Approach };
            let force = Elements { walls: Newtons(elastic), friction: Newtons(rate) };
            return Response { force, state, ..Response::NONE };
        }
        let cut = prepared.cuts.get(met.innermost(depth)).copied().unwrap_or_default();
        if met.given() > self.given {
            let left = truncating_product(cut.inwards.0.to_bits(), config.after_puncture.to_bits(), 16);
            let left = Newtons(I16F16::from_bits(left));
            self.wall.release(Millimetres(depth.0.saturating_sub(reach(left.0, prepared.inverse_tracking))));
        }
        self.given = met.given();
        let (cutting, is_full) = self.track(config, prepared, cut, elastic, (depth, movement));
        let friction = self.rub(&prepared.rub, step, speed.to_bits()).saturating_add(rate);
        let (lateral, barrier) = self.hold_direction(&config.fixture, met.angle());
        let state = if movement.direction() == Direction::Out {
            State::Withdrawal
        } else if pressed.is_some() {
            State::Elastic
        } else if !is_full && self.rest.is_none() && movement.direction() == Direction::In {
            State::Puncture
        } else {
            State::Friction
        };
        let force = Elements { walls: Newtons(elastic), friction: Newtons(cutting.saturating_add(friction)) };
        Response { force, state, lateral, barrier, ..Response::NONE }
    }

    /// The force of the tracking wall, and whether it is dragged along. What the tip presses on is
    /// not cut: as the wall that is pushed in takes over, cutting gives way to it.
    fn track(
        &mut self,
        config: &Sparte,
        prepared: &PreparedSparte,
        cut: Cutting,
        elastic: I16F16,
        (depth, movement): (Millimetres, &Movement),
    ) -> (I16F16, bool) {
        let inwards =
            reach(cut.inwards.0.saturating_sub(elastic).max(I16F16::ZERO), prepared.inverse_tracking);
        let is_full = self.wall.stretch(depth) >= inwards;
        self.wall.drag(depth, inwards, reach(cut.outwards.0, prepared.inverse_tracking));
        let stretch = self.wall.stretch(depth);
        let held = reach(prepared.rub.sliding, prepared.inverse_tracking);
        if let Some(paces) = self.rest(stretch, movement)
            && stretch.unsigned_abs() > held.unsigned_abs()
        {
            let held = if stretch < I16F16::ZERO { -held } else { held };
            self.wall.follow(depth.0.saturating_sub(held), prepared.relax * paces);
        }
        let force = saturating_multiply(self.wall.stretch(depth), config.tracking.0);
        (force, is_full)
    }

    /// Returns the pace at which the wall follows a needle that rests, in its own.
    fn rest(&mut self, stretch: I16F16, movement: &Movement) -> Option<i32> {
        let has_stopped = movement.has_stopped();
        if self.rest.is_none() && !has_stopped {
            return None;
        }
        let stretch = stretch.saturating_abs();
        let starts = Rest { least: stretch, catching_up: 2 * CATCH_UP_TICKS };
        let rest = self.rest.get_or_insert(starts);
        rest.least = rest.least.min(stretch);
        let goes_on = movement.is_turning() || stretch > rest.least.saturating_add(GOES_ON);
        if !has_stopped && goes_on {
            self.rest = None;
            return None;
        }
        let left = rest.catching_up;
        rest.catching_up = left.saturating_sub(1);
        Some(1 + i32::from((1..=CATCH_UP_TICKS).contains(&left)))
    }

    /// LuGre over a step of `step` mm at `speed` mm/s, both in Q16.
    fn rub(&mut self, rub: &Rub, step: i32, speed: i32) -> I16F16 {
        let level = rub.level(speed);
        if step != 0 {
            let stretched = truncating_product(step.abs(), rub.stiffness.to_bits(), 16);
            let moved = self.bristles.to_bits() + (step << 8);
            let lost = truncating_product(moved, share(stretched, level + stretched), 28);
            self.bristles = I8F24::from_bits(moved - lost);
        }
        let held = truncating_product(self.bristles.to_bits(), rub.stiffness.to_bits(), 24);
        // σ₁ż with ż = v − |v|·σ₀z/g: at rest and while sliding steadily, nothing.
        let ratio = share(held.abs().min(level), level);
        let ratio = if held < 0 { -ratio } else { ratio };
        let bristle_speed = speed - truncating_product(speed.abs(), ratio, 28);
        let damped = truncating_product(bristle_speed, rub.damping.to_bits(), 30);
        let viscous = truncating_product(speed, rub.viscous.to_bits(), 30);
        I16F16::from_bits(held + damped + viscous)
    }

    /// The lateral force that would bring the needle back to its direction of entry, and whether it
    /// has just been turned beyond the largest angle.
    fn hold_direction(&mut self, fixture: &Fixture, angle: Milliradians) -> (Newtons, bool) {
        let entry = *self.entry.get_or_insert(angle);
        let largest = i32::from(fixture.largest.0);
        let off = i32::from(angle.0) - i32::from(entry.0);
        let was_beyond = self.is_beyond;
        let bound = if was_beyond { (largest * REARMED_256) >> 8 } else { largest };
        self.is_beyond = off.abs() > bound;
        // Not `clamp`, which panics where the bounds are the wrong way round.
        let lateral = off.min(largest).max(-largest) * fixture.per_mrad.0.to_bits();
        (Newtons(I16F16::from_bits(lateral)), self.is_beyond && !was_beyond)
    }
}

impl Rub {
    /// g(v), N in Q16; `speed` in mm/s, Q16.
    fn level(&self, speed: i32) -> i32 {
        // v/v_s, at most 4 of them: beyond that nothing sticks.
        let ratio = truncating_product(speed.abs(), self.per_speed.to_bits(), 24).min(4 << 16);
        let square = truncating_product(ratio, ratio, 16);
        let sticking = exp_negative(I16F16::from_bits(square));
        self.sliding.to_bits() + truncating_product(self.sticking.to_bits(), sticking.to_bits(), 30)
    }
}

/// The polynomial of the wall that is pushed in, where one is.
fn pressed(prepared: &PreparedSparte, met: &Insertion, depth: Millimetres) -> Option<I16F16> {
    let wall = prepared.walls.get(met.given()).filter(|_| met.presses())?;
    let travel = met.travel(met.given(), depth);
    (travel >= I16F16::ZERO).then(|| wall.elastic_force(travel).0)
}

/// `λv·f` of a wall that resists with f, at `speed` mm/s in Q16; it takes no more than f away.
fn rate_force(wall: I16F16, speed: i32, rate: I16F16) -> I16F16 {
    let share = truncating_product(speed, rate.to_bits(), 16).max(-1 << 16);
    I16F16::from_bits(truncating_product(wall.to_bits(), share, 16))
}

fn check(sparte: &Sparte, limits: &ForceLimits) -> Result<(), Refusal> {
    let (stiff, largest) = (limits.stiffest, limits.largest);
    let rub = &sparte.friction;
    within(Field::TrackingStiffness, sparte.tracking.0, milli(50), stiff)?;
    within(Field::RelaxMs, I16F16::from_num(sparte.relax_ms.min(30_000)), milli(10_000), milli(10_000_000))?;
    within(Field::AfterPuncture, sparte.after_puncture, I16F16::ZERO, I16F16::ONE)?;
    within(Field::BristleStiffness, rub.stiffness.0, milli(50), stiff)?;
    within(Field::BristleDamping, I16F16::from_num(rub.damping.0), I16F16::ZERO, milli(1) / 2)?;
    within(Field::ViscousFriction, I16F16::from_num(rub.viscous.0), I16F16::ZERO, milli(20))?;
    within(Field::SlidingFriction, rub.sliding.0, milli(10), largest)?;
    within(Field::StickingFriction, rub.sticking.0, rub.sliding.0, largest)?;
    within(Field::StribeckSpeed, rub.speed.0, milli(100), milli(100_000))?;
    within(Field::LateralForce, sparte.fixture.per_mrad.0, I16F16::ZERO, milli(100))?;
    within(Field::LargestAngle, I16F16::from_num(sparte.fixture.largest.0), milli(1_000), milli(785_000))?;
    count(Field::CuttingForce, sparte.cutting.len(), limits.configured)?;
    let layer = limits.configured as u8;
    let slope = sparte.hold();
    if slope > stiff {
        return Err(Refusal::TooStiff { layer, slope, limit: stiff });
    }
    // At the fastest, with bristles that are stretched as far as they go.
    let rubbing = rub.sticking.0.saturating_add(I16F16::from_num(rub.viscous.0).saturating_mul(FASTEST));
    let mut before = I16F16::ZERO;
    for LayerHit { number, layer } in limits.layers {
        let Some(cut) = sparte.cutting.get(usize::from(*number)) else { continue };
        for force in [cut.inwards.0, cut.outwards.0] {
            within(Field::CuttingForce, force, I16F16::ZERO, milli(100_000))?;
        }
        let peak = layer.wall.as_ref().map(wall::peak).unwrap_or_default();
        // No more damping than `viscous` may give.
        let most = milli(20).saturating_div(peak.max(milli(400)));
        within(Field::WallRate, sparte.wall_rate, I16F16::ZERO, most)?;
        let peak = peak.saturating_add(peak.saturating_mul(sparte.wall_rate.saturating_mul(FASTEST)));
        let strongest = cut.inwards.0.max(cut.outwards.0).max(peak).max(before);
        before = cut.inwards.0;
        let force = strongest.saturating_add(rubbing);
        if force > largest {
            return Err(Refusal::TooStrong { layer: *number, force, limit: largest });
        }
    }
    Ok(())
}
