//! The player of excitations: one excitation, or the segments of a sequence one after the other.

use super::{Excitation, Reference, Servo, Signal};
use crate::TICK_HZ;
use crate::math::{saturating_multiply, saturating_times};
use crate::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres};
use fixed::types::{I2F30, I16F16};
use heapless::Vec;

/// The most segments of a sequence.
pub const MAX_SEGMENTS: usize = 8;

/// A sequence that is ready to be played: what takes long to compute has been computed before the
/// tick gets it.
#[derive(Clone, Debug)]
pub struct Prepared {
    segments: Segments,
    is_compensated: bool,
}

/// Room for what plays, in order. It is large: a board keeps it apart from what every tick uses,
/// and it is filled where it is.
#[derive(Clone, Debug, Default)]
pub struct Segments(Vec<Segment, MAX_SEGMENTS>);

impl Segments {
    /// Nothing plays.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    pub(crate) fn forget(&mut self) {
        self.0.clear();
    }
}

/// One excitation as it plays.
#[derive(Clone, Debug)]
struct Segment {
    reference: Reference,
    servo: Servo,
    travel: Millimetres,
    /// The speed past which the motor no longer follows.
    too_fast: MillimetresPerSecond,
    /// True if sines swing the torque about a reference at rest.
    shakes: bool,
    remaining_ticks: u32,
}

impl Segment {
    fn new(excitation: &Excitation) -> Self {
        Self {
            reference: Reference::new(&excitation.signal),
            servo: excitation.servo,
            travel: excitation.travel,
            // Half as fast again: the servo overshoots where the reference turns round.
            too_fast: MillimetresPerSecond(
                excitation.fastest().0.saturating_mul(I16F16::from_bits(0x1_8000)),
            ),
            shakes: matches!(excitation.signal, Signal::Multisine { .. }),
            remaining_ticks: ticks(excitation),
        }
    }
}

/// Ticks that an excitation plays.
pub(super) fn ticks(excitation: &Excitation) -> u32 {
    excitation.duration_ms.saturating_mul(TICK_HZ / 1000)
}

impl Prepared {
    /// From excitations that have passed their check; those past the room are left out.
    pub(super) fn new(excitations: &[Excitation]) -> Self {
        let mut segments = Segments::new();
        for excitation in excitations {
            let _ = segments.0.push(Segment::new(excitation));
        }
        Self { segments, is_compensated: excitations.iter().all(|excitation| excitation.compensated) }
    }

    /// True if what the device feeds forward is added.
    pub(crate) fn is_compensated(&self) -> bool {
        self.is_compensated
    }

    /// True if there is nothing to play.
    pub(crate) fn is_empty(&self) -> bool {
        self.segments.0.is_empty()
    }
}

/// Plays segments against the motor: the servo, the seams and the end.
#[derive(Clone, Debug, Default)]
pub(crate) struct Player {
    current: usize,
    /// The position at which all of it began: the travel counts from there.
    origin: Millimetres,
    /// The position at which the reference of this segment began.
    begin: Millimetres,
    travel: Millimetres,
    too_fast: MillimetresPerSecond,
    shakes: bool,
    has_servo: bool,
}

impl Player {
    /// From now on `segments` are one excitation, from where the motor is.
    pub(crate) fn begin_one(&mut self, segments: &mut Segments, excitation: &Excitation, depth: Millimetres) {
        segments.forget();
        let _ = segments.0.push(Segment::new(excitation));
        self.begin_at(segments, depth);
    }

    /// From now on `segments` are those of a sequence, from where the motor is.
    pub(crate) fn begin(&mut self, segments: &mut Segments, prepared: &Prepared, depth: Millimetres) {
        segments.forget();
        for segment in &prepared.segments.0 {
            let _ = segments.0.push(segment.clone());
        }
        self.begin_at(segments, depth);
    }

    fn begin_at(&mut self, segments: &Segments, depth: Millimetres) {
        (self.current, self.origin, self.begin) = (0, depth, depth);
        self.take_limits(segments);
    }

    fn take_limits(&mut self, segments: &Segments) {
        if let Some(segment) = segments.0.get(self.current) {
            (self.travel, self.too_fast) = (segment.travel, segment.too_fast);
            self.shakes = segment.shakes;
            self.has_servo = segment.servo.stiffness.0 != I16F16::ZERO;
        }
    }

    /// Torque in the insertion direction, or nothing at the end.
    pub(crate) fn tick(
        &mut self,
        segments: &mut Segments,
        roller_radius: Millimetres,
        depth: Millimetres,
        speed: MillimetresPerSecond,
    ) -> Option<MillinewtonMetres> {
        if segments.0.get(self.current)?.remaining_ticks == 0 {
            self.next_segment(segments, depth);
        }
        let segment = segments.0.get_mut(self.current)?;
        segment.remaining_ticks = segment.remaining_ticks.checked_sub(1)?;
        let target = segment.reference.tick();
        let behind = self.begin.0.saturating_add(target.position.0).saturating_sub(depth.0);
        let slower = target.speed.0.saturating_sub(speed.0);
        let damping = I2F30::saturating_from_num(segment.servo.damping.0);
        let force = saturating_multiply(behind, segment.servo.stiffness.0)
            .saturating_add(saturating_times(slower, damping));
        Some(MillinewtonMetres(saturating_multiply(force, roller_radius.0).saturating_add(target.torque.0)))
    }

    /// The reference goes on from where it is, so that the servo does not jerk. Where no servo held
    /// the motor to it, it goes on from where the motor is.
    #[cold]
    #[inline(never)]
    fn next_segment(&mut self, segments: &Segments, depth: Millimetres) {
        if let Some(ended) = segments.0.get(self.current) {
            self.begin.0 = if ended.servo.stiffness.0 == I16F16::ZERO {
                depth.0
            } else {
                self.begin.0.saturating_add(ended.reference.position().0)
            };
        }
        self.current = self.current.saturating_add(1);
        self.take_limits(segments);
    }

    /// True if the motor is faster than it has to be to follow, and than a torque without a servo
    /// makes it where a hand trips at `hand`: three times that, half of what counts as a jump of
    /// the encoder. The pulses of `commission` reach 0.77 m/s where a hand trips at 0.42, and a
    /// motor still runs on when the next excitation begins.
    #[cold]
    pub(crate) fn is_too_fast(&self, speed: MillimetresPerSecond, hand: MillimetresPerSecond) -> bool {
        speed > self.too_fast && speed.0 > hand.0.saturating_mul_int(3)
    }

    /// True if a servo holds the motor to a reference.
    #[cold]
    pub(crate) fn has_servo(&self) -> bool {
        self.has_servo
    }

    /// True if sines shake the motor, which turns to and fro without getting on.
    #[cold]
    pub(crate) fn shakes(&self) -> bool {
        self.shakes
    }

    /// True if the motor is further from the beginning of all than this segment allows.
    pub(crate) fn is_beyond(&self, depth: Millimetres) -> bool {
        depth.0.saturating_sub(self.origin.0).saturating_abs() > self.travel.0
    }
}
