//! Checks that the needle moves as a hand and a correctly wired motor move it. Three checks, each
//! every 0.8 ms, none of the force law: a fault of the wiring shows in the counts alone.
//!
//! **Against the motor.** Where the motor's leads or the encoder's channels are swapped, what
//! should hold the needle back drives it on: a needle that nobody holds speeds up against the
//! torque by `torque/(radius·mass)`. That is looked for, with a mass of 13 to 60 g, and from 10
//! m/s² on: a hand that pushes against the torque carries its own mass along and takes its time (a
//! stab that reaches 300 mm/s in 50 ms makes 6 m/s²). A wall that gives way leaves the hand's force
//! over and the needle leaps as well, but there the torque falls first: while it is less than three
//! quarters of what it was, no leap counts.
//!
//! During an excitation nobody's hand is on the needle, and the torque swings faster than a hand
//! does. Then a rightly wired needle may go against it as well: a load that flies on through a gap
//! knocks the motor on, and a drive that obeys late gives the torque of before. Either is over
//! within 4 ms, while a servo whose motor is swapped drives the needle away permanently.
//!
//! **Too fast.** Whatever drives it.
//!
//! **To and fro.** An encoder with one channel dead counts each edge of the other one up and then
//! down again. So does a needle that a stiff wall throws to and fro over one edge, as fast as any:
//! the wall's force steps with the count, and the less the needle moves the sooner it is back.
//! Removing the step distinguishes the two: when counts go to and fro, the torque is held for 10 ms
//! at the mean of both sides. A chatter then has nothing that throws it, and ends; a hand that
//! moves on past a dead channel does not.

use crate::TICK_HZ;
use crate::event::Fault;
use crate::units::MillimetresPerSecond;
use fixed::types::{I2F30, I16F16, U16F16};

/// Ticks from one look to the next: 0.8 ms.
pub(crate) const LOOK_TICKS: u32 = 8;
/// Looks over which a speed is taken: 2.4 ms. Two of them make an acceleration.
const SPAN_LOOKS: usize = 3;
/// Looks that are remembered.
const LOOKS: usize = 8;
/// Looks after which one turn to and fro is forgotten: 4.8 ms. A tremor turns 20 times a second.
const FORGET_LOOKS: u32 = 6;
/// Turns to and fro without getting on: more than a tremor or a rattle makes.
const TURNS: u32 = 5;
/// Turns at which the torque is held to see whether they go on without it.
const DOUBTFUL_TURNS: u32 = 3;
/// Ticks for which it is held: 10 ms.
const HOLD_TICKS: u32 = 100;
/// Turns in that time that a needle which coasts may still make.
const COASTING_TURNS: u32 = 1;
/// Looks in a row at which a needle must go as if it were driven: a knock of 40 mm/s is one.
const DRIVEN_LOOKS: u32 = 2;
/// The same under the servo of an excitation, 4 ms: longer than a late drive or a knock of the
/// load.
const SERVO_DRIVEN_LOOKS: u32 = 5;
/// Rounding to counts makes up to two of an acceleration: fewer counts than this do not count.
const LEAST_COUNTS: i32 = 5;

/// A needle is too fast at this share of what an encoder that works may count in a tick: 0.4 m/s
/// where that is 16 counts of 16 µm.
const SLOWER: u32 = 6;

/// The speed past which a needle is too fast that may move so many counts, each so many mm long, in
/// a tick.
pub(crate) fn fastest(mm_per_count: I2F30, max_counts_per_tick: u16) -> MillimetresPerSecond {
    let per_tick_q30 = i64::from(mm_per_count.to_bits()) * i64::from(max_counts_per_tick);
    let bits = (per_tick_q30 * i64::from(TICK_HZ / SLOWER)) >> 14;
    MillimetresPerSecond(I16F16::from_bits(i32::try_from(bits).unwrap_or(i32::MAX)))
}

/// Ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// The least counts that an acceleration against the motor adds to a span.
    least: i32,
    /// Counts that a mN·m adds to a span of the lightest and of the heaviest needle, in Q8.
    per_mnm_q8: (i32, i32),
    /// The most counts in a span.
    fastest: u32,
}

impl Bounds {
    /// For counts of this length in mm, a roller of this radius in mm, and a needle that moves at
    /// most so many counts in a tick.
    pub(crate) fn new(mm_per_count: I2F30, roller_radius: I16F16, max_counts_per_tick: u16) -> Self {
        /// Ticks of a span.
        const SPAN: i64 = SPAN_LOOKS as i64 * LOOK_TICKS as i64;
        /// mm for each m/s² in a span, squared as (2.4 ms)², in Q30.
        const MM_Q30: i64 = ((1000 * SPAN * SPAN) << 30) / (TICK_HZ as i64 * TICK_HZ as i64);
        /// m/s²: the least that is looked for.
        const LEAST: i64 = 10;
        /// m/s² for a newton: of 13 g and of 60 g.
        const PER_NEWTON: (i64, i64) = (75, 17);
        let per_count = i64::from(mm_per_count.to_bits().max(1));
        let radius = i64::from(roller_radius.to_bits().max(1));
        let counts = |acceleration: i64| acceleration * MM_Q30 / per_count;
        // N for a mN·m is 1/mm.
        let per_mnm_q8 = |per_newton: i64| {
            let q8 = ((per_newton * MM_Q30) << 8) / per_count * (1 << 16) / radius;
            i32::try_from(q8).unwrap_or(i32::MAX)
        };
        Self {
            least: i32::try_from(counts(LEAST)).unwrap_or(i32::MAX).max(LEAST_COUNTS),
            per_mnm_q8: (per_mnm_q8(PER_NEWTON.0), per_mnm_q8(PER_NEWTON.1)),
            fastest: u32::from(max_counts_per_tick) * (SPAN as u32) / SLOWER,
        }
    }

    /// True if `against`, the counts that a span has gained against `torque`, are those of a needle
    /// without a hand.
    fn is_driven(&self, against: i32, torque: U16F16) -> bool {
        // Torques stay below 512 mN·m, counts of them below 2^24.
        let counts = |per_mnm_q8: i32| ((i64::from(torque.to_bits()) * i64::from(per_mnm_q8)) >> 24) as i32;
        against >= self.least && against <= counts(self.per_mnm_q8.0) && against >= counts(self.per_mnm_q8.1)
    }
}

/// The watch with its memory.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watch {
    counts: [i32; LOOKS],
    /// Torque at each look.
    torques: [I16F16; LOOKS],
    /// The place of the latest look, from 0 on without end.
    next: usize,
    /// Counts that the last span has more than the one before it.
    gained: i32,
    /// The same against the motor; zero where a wall has just given way.
    gained_against: i32,
    /// The torque under which it was gained.
    gained_under: U16F16,
    /// Looks in a row at which the needle went as its motor would drive it the wrong way.
    driven_looks: u32,
    turns: u32,
    /// Looks until a turn is forgotten.
    forget: u32,
    last_step: i32,
    hold: Hold,
}

/// The torque while it is seen whether turns go on without the force's steps.
#[derive(Clone, Copy, Debug, Default)]
struct Hold {
    torque: I16F16,
    remaining_ticks: u32,
    /// [`Watch::turns`] when it began.
    turns: u32,
}

impl Watch {
    /// From where the needle is.
    pub(crate) fn new(count: i32) -> Self {
        Self { counts: [count; LOOKS], ..Self::default() }
    }

    /// True if `step` of the needle undoes the one before. Called in every tick.
    pub(crate) fn is_back(&mut self, step: i32) -> bool {
        let is_back = step == self.last_step.wrapping_neg();
        if is_back {
            self.turns = self.turns.wrapping_add(1);
        } else {
            self.turns = 0;
            self.hold.remaining_ticks = 0;
        }
        self.last_step = step;
        is_back
    }

    /// The torque to ask for instead of `wanted`, where `before` was given in the tick before:
    /// itself, or what is held while turns are in doubt. Called in every tick in which the law's
    /// force is given.
    pub(crate) fn steady(&mut self, wanted: I16F16, before: I16F16) -> I16F16 {
        if self.turns < DOUBTFUL_TURNS { wanted } else { self.held(wanted, before) }
    }

    #[cold]
    fn held(&mut self, wanted: I16F16, before: I16F16) -> I16F16 {
        if self.hold.remaining_ticks == 0 {
            let torque = I16F16::from_bits(wanted.to_bits().midpoint(before.to_bits()));
            self.hold = Hold { torque, remaining_ticks: HOLD_TICKS, turns: self.turns };
        }
        self.hold.remaining_ticks -= 1;
        if self.hold.remaining_ticks == 0 && self.turns <= self.hold.turns + COASTING_TURNS {
            self.turns = 0;
        }
        self.hold.torque
    }

    /// Takes the count and the torque in mN·m of a look, which the next three ticks judge.
    pub(crate) fn take(&mut self, count: i32, torque: I16F16) {
        self.next = self.next.wrapping_add(1);
        let place = self.next % LOOKS;
        if let (Some(last), Some(given)) = (self.counts.get_mut(place), self.torques.get_mut(place)) {
            (*last, *given) = (count, torque);
        }
        // A look that a puncture keeps from being looked at is not judged by the one before it.
        (self.gained, self.gained_against) = (0, 0);
    }

    fn count(&self, looks_ago: usize) -> i32 {
        self.counts.get(self.next.wrapping_sub(looks_ago) % LOOKS).copied().unwrap_or_default()
    }

    fn torque(&self, looks_ago: usize) -> I16F16 {
        self.torques.get(self.next.wrapping_sub(looks_ago) % LOOKS).copied().unwrap_or_default()
    }

    /// Too fast. What the needle has gained is kept for [`Self::compare`].
    pub(crate) fn look(&mut self, bounds: &Bounds) -> Option<Fault> {
        let middle = self.count(SPAN_LOOKS);
        let speed = self.count(0).wrapping_sub(middle);
        self.gained = speed.wrapping_sub(middle.wrapping_sub(self.count(2 * SPAN_LOOKS)));
        // Fewer counts are no acceleration anyway.
        if self.gained.unsigned_abs() >= LEAST_COUNTS.unsigned_abs() && !self.still_gains() {
            self.gained = 0;
        }
        (speed.unsigned_abs() > bounds.fastest).then_some(Fault::Overspeed)
    }

    /// The speed of the last span, for counts of this length in mm.
    #[cold]
    pub(crate) fn speed(&self, mm_per_count: I2F30) -> MillimetresPerSecond {
        const SPAN_TICKS: i64 = SPAN_LOOKS as i64 * LOOK_TICKS as i64;
        let counts = self.count(0).wrapping_sub(self.count(SPAN_LOOKS)).unsigned_abs();
        let per_span_q30 = i64::from(mm_per_count.to_bits()).saturating_mul(counts.into());
        let bits = (per_span_q30.saturating_mul(TICK_HZ.into()) / SPAN_TICKS) >> 14;
        MillimetresPerSecond(I16F16::from_bits(i32::try_from(bits).unwrap_or(i32::MAX)))
    }

    /// True if the needle has been driven against its motor for no longer than a drive that is
    /// wired rightly may do so under a servo.
    #[cold]
    pub(crate) fn is_knock(&self) -> bool {
        self.driven_looks < SERVO_DRIVEN_LOOKS
    }

    /// True if the motion of the spans continues in the last 3.2 ms. A motor that drives continues;
    /// a knock is over.
    fn still_gains(&self) -> bool {
        let middle = self.count(2);
        let latest = self.count(0).wrapping_sub(middle).wrapping_sub(middle.wrapping_sub(self.count(4)));
        latest.signum() == self.gained.signum()
    }

    /// The torque that [`Self::gained`] would come from: that of the middle of its spans. The
    /// latest one is a quarter of a period late where a needle swings on a stiff wall.
    fn mean_torque(&self) -> I16F16 {
        let [early, middle, late] = [4, 3, 2].map(|looks| self.torque(looks).to_bits());
        I16F16::from_bits((early >> 2) + (middle >> 1) + (late >> 2))
    }

    /// Compares the needle's gain against the motor with the torque; [`Self::judge`] decides.
    pub(crate) fn compare(&mut self) {
        let gained = self.gained;
        let torque = self.mean_torque();
        let (last, before) = (self.torque(0).unsigned_abs(), self.torque(2 * SPAN_LOOKS).unsigned_abs());
        // A wall that has just given way: three quarters.
        let has_fallen = last < before - (before >> 2);
        let against = if torque.is_negative() { gained } else { gained.wrapping_neg() };
        self.gained_against = if has_fallen { 0 } else { against };
        self.gained_under = torque.unsigned_abs();
    }

    /// The look's last part: looks in a row at which the needle was driven, and to and fro.
    pub(crate) fn judge(&mut self, bounds: &Bounds) -> Option<Fault> {
        let is_driven = bounds.is_driven(self.gained_against, self.gained_under);
        self.driven_looks = if is_driven { self.driven_looks.saturating_add(1) } else { 0 };
        if self.driven_looks >= DRIVEN_LOOKS {
            return Some(Fault::WrongWay);
        }
        if self.turns > TURNS {
            return Some(Fault::EncoderChannel);
        }
        self.forget += 1;
        // While the torque is held every turn counts.
        if self.forget >= FORGET_LOOKS && self.hold.remaining_ticks == 0 {
            self.forget = 0;
            self.turns = self.turns.saturating_sub(1);
        }
        None
    }
}

#[cfg(test)]
#[expect(clippy::float_arithmetic, reason = "a test")]
mod tests;
