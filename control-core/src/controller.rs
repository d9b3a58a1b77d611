//! The tick: strings the stages together and holds the operating mode. The device and the simulator call this and
//! nothing else.

use crate::anatomy::{self, Insertion};
use crate::compensation::Gains;
use crate::compensation::feedforward::{Feedforward, Here};
use crate::event::{Fault, Limits, State, Transitions, VesselState};
use crate::excitation::{Excitation, Player};
use crate::kinematics::{self, Movement, SpeedEstimator, moved};
use crate::law::{Memory, Motion, Response};
use crate::math::{saturating_multiply, truncating_product};
use crate::passivity::{Elements, Observer};
use crate::plan::Plan;
use crate::runaway::{self, LOOK_TICKS, fastest};
use crate::safety::Limiter;
use crate::stillness::{self, Stillness};
use crate::thermal::{WARM_TICKS, Winding};
use crate::units::{
    Counts, DacCode, Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians, Newtons,
};
use fixed::types::I16F16;
use serde::{Deserialize, Serialize};

/// Of eight ticks, the one in which the watch takes the count.
const LOOK_TURN: u32 = 4;

/// What the tick reads.
#[derive(Clone, Copy, Debug, Default)]
pub struct TickInput {
    /// The encoder's absolute count; it may wrap.
    pub count: Counts,
    /// The latest inclination.
    pub tilt: Milliradians,
}

/// What the tick gives.
#[derive(Clone, Copy, Debug)]
pub struct TickOutput {
    /// What to write to the converter.
    pub dac: DacCode,
    /// Whether the amplifier may be on.
    pub enable: bool,
    /// What is streamed.
    pub sample: Sample,
    /// What changed in the tissue.
    pub transitions: Transitions,
    /// What holds torque back.
    pub limits: Limits,
    /// The fault that latched in this tick.
    pub tripped: Option<Fault>,
    /// Depth past the zero.
    pub depth: Millimetres,
    /// Estimated speed.
    pub speed: MillimetresPerSecond,
    /// The force that the law asked for, before limits.
    pub force: Newtons,
    /// The angle to the skin that the layers were met at.
    pub angle: Milliradians,
    /// Where the tip is as seen from the vessel.
    pub vessel: VesselState,
    /// The force across the needle that would hold its direction; this device cannot give it.
    pub lateral: Newtons,
}

/// One tick as it is streamed and recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sample {
    /// Counts past the zero.
    pub count: i32,
    /// The torque as the code of a converter of the same width whose zero is mid-scale, on a motor whose sign is right:
    /// without the commissioned zero and sign, so that a recording needs no device to be read.
    pub dac: u16,
    /// [`State`] as a number.
    pub state: u8,
    /// Inclination in mrad.
    pub tilt_mrad: i16,
}

/// What a person or the supervisor asks of the control law, between ticks.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "nothing allocates here, and a plan is rare")]
pub enum Order {
    /// Power up and fade in; clears a latched fault. Only on a device that has been commissioned.
    Start,
    /// Zero torque, amplifier off.
    Stop,
    /// The needle is at depth 0 now; only while torque is off.
    Zero,
    /// The PC is alive.
    Heartbeat,
    /// Another plan; only while torque is off.
    Configure(Plan),
    /// Something outside the tick went wrong: torque off, latched.
    Trip(Fault),
    /// Play an excitation from where the motor is; only while torque is off, and on a device that has not been
    /// commissioned only where [`Excitation::is_gentle`]. It has passed [`Excitation::check`].
    Excite(Excitation),
    /// The gains of the compensation from now on, until the next [`Order::Configure`]; they have passed
    /// [`crate::compensation::check::check`].
    Compensate(Gains),
    /// The rotor's angle, from which waves are counted, is zero at this many counts past the zero; `None`: it is not known.
    Index(Option<Counts>),
}

/// The control law with its memory.
#[derive(Clone, Debug)]
pub struct Controller {
    plan: Plan,
    mode: Mode,
    /// What plays while exciting.
    player: Option<Player>,
    origin: Counts,
    previous: Option<Counts>,
    speed: SpeedEstimator,
    movement: Movement,
    insertion: Insertion,
    memory: Memory,
    observer: Observer,
    feedforward: Feedforward,
    winding: Winding,
    limiter: Limiter,
    silent_ticks: u32,
    still: Stillness,
    lines_agree: bool,
    /// Torque that was asked for in the tick before, within its limit.
    asked: I16F16,
    runaway: runaway::Watch,
    /// Ticks, for what is done in one of eight or of sixteen only.
    turn: u32,
    tripped: Option<Fault>,
}

/// Those with power last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Mode {
    Idle,
    Faulted,
    Running,
    Exciting,
}

impl Mode {
    fn is_powered(self) -> bool {
        self >= Mode::Running
    }
}

impl Controller {
    /// Torque off, waiting to be started.
    pub fn new(plan: Plan) -> Self {
        Self::warm(plan, 0)
    }

    /// The same, with a motor that has the heat which [`Self::heat`] gave before a reset.
    pub fn warm(plan: Plan, heat: u32) -> Self {
        let mut winding = Winding::with_heat(heat);
        winding.allow(&plan.thermal, plan.torque_limits.torque);
        let mut feedforward = Feedforward::default();
        feedforward.set_gains(plan.device().compensation.gains);
        Self {
            speed: SpeedEstimator::new(plan.config.device.speed, Counts(0)),
            movement: Movement::default(),
            insertion: Insertion::new(&plan.anatomy),
            memory: plan.law.memory(),
            plan,
            mode: Mode::Idle,
            player: None,
            origin: Counts(0),
            previous: None,
            observer: Observer::default(),
            feedforward,
            winding,
            limiter: Limiter::default(),
            silent_ticks: 0,
            still: Stillness::default(),
            lines_agree: false,
            asked: I16F16::ZERO,
            runaway: runaway::Watch::default(),
            turn: 0,
            tripped: None,
        }
    }

    /// The plan in force.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The winding's heat in (mN·m)², in Q16: what must not be forgotten in a reset.
    pub fn heat(&self) -> u32 {
        self.winding.heat()
    }

    /// Takes an order. What does not fit the mode is ignored: the link has refused it before.
    pub fn order(&mut self, order: Order) {
        match order {
            Order::Start if !self.mode.is_powered() && self.plan.device().commissioned => {
                self.insertion.begin();
                self.power_up(Mode::Running, true);
            }
            Order::Excite(excitation)
                if !self.mode.is_powered() && (self.plan.device().commissioned || excitation.is_gentle()) =>
            {
                let depth = self.plan.scale.depth(self.latest_count());
                self.player = Some(Player::new(&excitation, depth));
                self.withdraw();
                self.power_up(Mode::Exciting, excitation.compensated);
            }
            Order::Stop if self.mode.is_powered() => self.mode = Mode::Idle,
            Order::Zero if !self.mode.is_powered() => {
                self.origin = self.previous.unwrap_or_default();
                self.withdraw();
                self.speed = SpeedEstimator::new(self.plan.config.device.speed, Counts(0));
            }
            Order::Heartbeat => self.heartbeat(),
            Order::Configure(plan) if !self.mode.is_powered() => {
                self.speed = SpeedEstimator::new(plan.config.device.speed, self.latest_count());
                self.feedforward.configure(self.plan.device(), plan.device());
                self.plan = plan;
                self.withdraw();
                self.winding.allow(&self.plan.thermal, self.plan.torque_limits.torque);
            }
            Order::Trip(fault) => self.trip(fault),
            Order::Compensate(gains) => self.feedforward.set_gains(gains),
            Order::Index(index) if !self.mode.is_powered() => {
                self.feedforward.set_index(index.map(|count| self.origin.0.wrapping_add(count.0)));
            }
            Order::Start
            | Order::Stop
            | Order::Zero
            | Order::Configure(_)
            | Order::Excite(_)
            | Order::Index(_) => {}
        }
    }

    /// [`Order::Heartbeat`], the one that comes while the needle moves.
    pub fn heartbeat(&mut self) {
        self.silent_ticks = 0;
    }

    /// Says that the tissue's surface is displaced by so much along the needle: the law of Paper 000 counts depth from there. At most 3 mm
    /// count, they change by at most 20 mm/s, and they go back to 0 if they are not said again within 50 ms. The firmware never says it.
    pub fn displace(&mut self, displacement: Millimetres) {
        self.memory.displace(displacement);
    }

    /// Says, until it is said again, whether both of the encoder's lines are at one level, as they also are without its supply or
    /// its ground. An encoder without lines, such as a simulated one, leaves it at `false`.
    #[inline]
    pub fn set_lines_agree(&mut self, agree: bool) {
        self.lines_agree = agree;
    }

    /// As if the needle had never been in this tissue.
    fn withdraw(&mut self) {
        self.insertion = Insertion::new(&self.plan.anatomy);
        self.memory = self.plan.law.memory();
    }

    fn power_up(&mut self, mode: Mode, is_compensated: bool) {
        self.limiter.restart();
        let count = self.previous.unwrap_or_default().0;
        self.feedforward.restart(&self.plan.compensation, count, is_compensated);
        self.observer = Observer::new(self.plan.scale.depth(self.latest_count()));
        self.silent_ticks = 0;
        self.still = Stillness::default();
        self.asked = I16F16::ZERO;
        self.runaway = runaway::Watch::new(self.latest_count().0);
        self.mode = mode;
    }

    /// One tick, 100 µs after the one before.
    pub fn tick(&mut self, input: TickInput) -> TickOutput {
        let count = self.count(Counts(input.count.0.wrapping_mul(self.plan.encoder_sign)));
        let depth = self.plan.scale.depth(count);
        let speed = self.speed.tick(&self.plan.scale, count);
        self.turn = (self.turn + 1) % anatomy::LOOK_TICKS;
        let (transitions, tissue) = self.meet(input.tilt, depth, speed);
        let angle = self.insertion.angle();
        self.watch_host();
        let has_given_way = transitions.puncture != 0;
        let (torque, limits) = match self.wanted_torque(tissue.force, depth, speed, has_given_way) {
            Some((wanted, limits)) => {
                let limits = if tissue.estimated { limits.with(Limits::ESTIMATED) } else { limits };
                let (wanted, limits) = if self.feedforward.is_on() {
                    self.compensated(wanted, limits, speed, input.tilt)
                } else {
                    (wanted, limits)
                };
                self.limit(wanted, limits)
            }
            None => (MillinewtonMetres::default(), Limits::default()),
        };
        self.winding.tick(torque);
        if self.turn % 8 == LOOK_TURN {
            // Always at its time, for speeds are taken from it.
            self.runaway.take(count.0, torque.0);
            self.look_at_stillness();
        } else if !self.insertion.is_busy() {
            // A tick in which a layer is touched, gives way or is left is long enough.
            self.take_turn(input.tilt, depth);
        }
        let codes = self.plan.dac.codes(torque);
        let state = match self.mode {
            Mode::Running => tissue.state,
            Mode::Exciting => State::Excitation,
            Mode::Idle => State::Idle,
            Mode::Faulted => State::Fault,
        };
        TickOutput {
            dac: codes.written,
            enable: self.mode.is_powered(),
            sample: Sample {
                count: count.0,
                dac: codes.plain.0,
                state: state as u8,
                tilt_mrad: input.tilt.0,
            },
            transitions,
            limits,
            tripped: self.tripped.take(),
            depth,
            speed,
            force: tissue.force.total(),
            angle,
            vessel: self.insertion.vessel(),
            lateral: tissue.lateral,
        }
    }

    /// What is slow enough to be done in one tick of eight or sixteen, each in another one.
    #[inline(never)]
    fn take_turn(&mut self, tilt: Milliradians, depth: Millimetres) {
        const { assert!(WARM_TICKS == 8 && LOOK_TICKS == 8 && LOOK_TURN == 4, "the turns below") };
        const {
            assert!(
                kinematics::LOOK_TICKS == 16 && anatomy::LOOK_TICKS == 16 && stillness::LOOK_TICKS == 8,
                "the turns below"
            )
        };
        let fault = match self.turn {
            0 | 8 => return self.winding.warm(&self.plan.thermal),
            2 => return self.winding.allow(&self.plan.thermal, self.plan.torque_limits.torque),
            10 => return self.movement.look(depth),
            3 => return self.insertion.look(&self.plan.anatomy, tilt),
            1 | 9 | 11 => return self.insertion.turn(&self.plan.anatomy),
            5 | 13 => self.runaway.look(&self.plan.runaway),
            6 | 14 => return self.runaway.compare(),
            7 | 15 => self.runaway.judge(&self.plan.runaway),
            _ => return,
        };
        if let Some(fault) = fault
            && self.mode.is_powered()
        {
            self.trip_by_movement(fault);
        }
    }

    /// Trips because of the way the needle moves. An excitation may be faster than a hand on purpose, and then only up to a bound of its
    /// own.
    #[cold]
    #[inline(never)]
    fn trip_by_movement(&mut self, fault: Fault) {
        let is_asked_for = (self.mode, fault) == (Mode::Exciting, Fault::Overspeed)
            && self.player.as_ref().is_some_and(|player| {
                let mm_per_count = self.plan.scale.mm_per_count;
                let hand = fastest(mm_per_count, self.plan.config.device.limits.max_counts_per_tick);
                !player.is_too_fast(self.runaway.speed(mm_per_count), hand)
            });
        if !is_asked_for {
            self.trip(fault);
        }
    }

    /// What the tip at `depth` meets and feels. During an excitation nobody's hand is on the needle, and nobody feels tissue.
    fn meet(
        &mut self,
        tilt: Milliradians,
        depth: Millimetres,
        speed: MillimetresPerSecond,
    ) -> (Transitions, Response) {
        if self.mode == Mode::Exciting {
            return (Transitions::default(), Response::NONE);
        }
        if self.insertion.is_new() {
            self.insertion.look_anew(&self.plan.anatomy, tilt);
        }
        let mut transitions = self.insertion.tick(&self.plan.anatomy, depth);
        let response = {
            let (law, plan) = (&self.plan.config.patient.law, &self.plan.law);
            self.memory.tick(law, plan, &self.insertion, Motion { depth, speed, movement: &self.movement })
        };
        transitions.barrier = response.barrier;
        if response.open | self.insertion.opened() != 0 {
            transitions.in_track = transitions.contact & response.open;
            transitions.puncture |= response.ruptured;
            self.insertion.open(response.open);
        }
        (transitions, response)
    }

    /// Counts past the zero in the tick before.
    fn latest_count(&self) -> Counts {
        self.previous.map_or(Counts(0), |previous| moved(self.origin, previous))
    }

    /// Counts past the zero; a jump or a needle beyond its travel trips.
    fn count(&mut self, absolute: Counts) -> Counts {
        let count = moved(self.origin, absolute);
        let step = if let Some(previous) = self.previous {
            moved(previous, absolute).0
        } else {
            // Started before its first tick: the watch knows now where the needle is.
            self.runaway = runaway::Watch::new(count.0);
            0
        };
        self.previous = Some(absolute);
        let is_beyond = match self.mode {
            Mode::Running => count.0.unsigned_abs() > self.plan.travel_counts,
            Mode::Exciting => {
                let depth = self.plan.scale.depth(count);
                self.player.as_ref().is_some_and(|player| player.is_beyond(depth))
            }
            Mode::Idle | Mode::Faulted => return count,
        };
        if step.unsigned_abs() > u32::from(self.plan.config.device.limits.max_counts_per_tick) {
            self.trip(Fault::EncoderJump);
        } else if is_beyond {
            self.trip(Fault::Travel);
        } else if step != 0 {
            self.still.step(self.runaway.is_back(step));
        }
        count
    }

    /// The look for an encoder that no longer counts. A count up and down again is less than one: a live channel gives them when
    /// the other one is dead.
    fn look_at_stillness(&mut self) {
        if self.still.is_moving() {
            return self.still.forget();
        }
        // While the encoder is asked, what would be given counts, and else what is: less while it fades in.
        let torque = if self.still.is_asking() { self.asked } else { self.limiter.given().0 };
        self.still.look(torque.unsigned_abs() >= self.plan.loaded_torque);
        if self.still.is_asking() || self.still.is_doubtful(self.lines_agree) {
            self.ask_for_a_count();
        }
    }

    /// Asks a needle that is in doubt for a count; trips if its encoder is dead.
    #[cold]
    #[inline(never)]
    fn ask_for_a_count(&mut self) {
        let given = self.limiter.given().0;
        let is_dead = match self.mode {
            Mode::Running => {
                if !self.still.is_asking() {
                    self.asked = given;
                }
                self.still.ask(self.still.is_doubtful(self.lines_agree), given == I16F16::ZERO)
            }
            // Nobody's hand is on the needle, and less torque would be another signal.
            Mode::Exciting => self.still.is_doubtful(false),
            Mode::Idle | Mode::Faulted => {
                self.still = Stillness::default();
                false
            }
        };
        if is_dead {
            self.trip(Fault::EncoderFrozen);
        }
    }

    fn watch_host(&mut self) {
        if !self.mode.is_powered() {
            return;
        }
        // It never wraps: what follows turns torque off long before.
        self.silent_ticks = self.silent_ticks.wrapping_add(1);
        if self.silent_ticks > self.plan.heartbeat_ticks {
            self.trip(Fault::HostSilent);
        }
    }

    fn trip(&mut self, fault: Fault) {
        if !matches!(self.mode, Mode::Faulted) {
            self.tripped = Some(fault);
        }
        self.mode = Mode::Faulted;
    }

    /// Motor torque that the law or the excitation asks for; none where torque is off. N times mm is mN·m.
    fn wanted_torque(
        &mut self,
        mut force: Elements,
        depth: Millimetres,
        speed: MillimetresPerSecond,
        has_given_way: bool,
    ) -> Option<(MillinewtonMetres, Limits)> {
        let radius = self.plan.config.device.roller_radius;
        match self.mode {
            Mode::Running => {
                let damping = truncating_product(speed.0.to_bits(), self.plan.damping.to_bits(), 30);
                force.friction.0 = force.friction.0.saturating_add(I16F16::from_bits(damping));
                let (given, damped) =
                    self.observer.tick(self.plan.bounce_damping, depth, force, has_given_way);
                let limits = if damped { Limits::PASSIVITY } else { Limits::default() };
                // Each wall and friction stay below the 125 N of the strongest motor, damping below 17 N: with 25 mm that fits.
                // Were it ever more, it would be too much, and not the other way.
                let torque = saturating_multiply(given.0, self.plan.lever).saturating_neg();
                let before = self.limiter.given().0.saturating_sub(self.feedforward.fed());
                Some((MillinewtonMetres(self.runaway.steady(torque, before)), limits))
            }
            Mode::Exciting => {
                let torque = self.player.as_mut().and_then(|player| player.tick(radius, depth, speed));
                if torque.is_none() {
                    self.mode = Mode::Idle;
                }
                torque.map(|torque| (torque, Limits::default()))
            }
            Mode::Idle | Mode::Faulted => None,
        }
    }

    /// `wanted` and `limits` with what is fed forward beside the law or the excitation.
    #[inline(always)]
    fn compensated(
        &mut self,
        MillinewtonMetres(wanted): MillinewtonMetres,
        limits: Limits,
        speed: MillimetresPerSecond,
        tilt: Milliradians,
    ) -> (MillinewtonMetres, Limits) {
        let count = self.previous.unwrap_or_default().0;
        let here = Here { count, speed, tilt, turn: self.turn };
        let found = &self.plan.config.device.compensation;
        let (torque, is_held) = self.feedforward.tick(found, &self.plan.compensation, here, wanted);
        (MillinewtonMetres(torque), if is_held { limits.with(Limits::PASSIVITY) } else { limits })
    }

    /// What is given of the torque `held` while the encoder is asked whether it counts.
    #[cold]
    #[inline(never)]
    fn left_while_asking(&mut self, held: I16F16) -> I16F16 {
        self.asked = held;
        self.still.left_of(held)
    }

    fn limit(&mut self, wanted: MillinewtonMetres, limits: Limits) -> (MillinewtonMetres, Limits) {
        let most = self.plan.torque_limits.torque;
        let allowed = self.winding.allowed();
        let held = wanted.0.min(allowed).max(-allowed);
        let mut limits = limits;
        if held != wanted.0 {
            let thermal = if allowed < most { Limits::THERMAL } else { Limits::default() };
            let torque = if wanted.0.unsigned_abs() > most.unsigned_abs() {
                Limits::TORQUE
            } else {
                Limits::default()
            };
            limits = limits.with(thermal).with(torque);
        }
        let given = if self.still.is_asking() { self.left_while_asking(held) } else { held };
        let (torque, in_force) = self.limiter.tick(&self.plan.torque_limits, MillinewtonMetres(given));
        let missing = torque.0.saturating_sub(wanted.0);
        if missing != I16F16::ZERO {
            self.observer.held_back(saturating_multiply(missing, self.plan.per_lever));
        }
        (torque, in_force.with(limits))
    }
}
