//! The tick: strings the stages together and holds the operating mode. The device and the simulator
//! call this and nothing else.

mod exchange;
mod torque;
mod watches;
mod with_segments;

use crate::anatomy::{self, Insertion};
use crate::compensation::feedforward::Feedforward;
use crate::event::{Fault, Limits, State, Transitions};
use crate::excitation::{Player, Segments};
use crate::kinematics::{Movement, SpeedEstimator, moved};
use crate::law::{Memory, Motion, Response};
use crate::passivity::Observer;
use crate::plan::Plan;
use crate::runaway;
use crate::safety::Limiter;
use crate::stillness::Stillness;
use crate::thermal::Winding;
use crate::tissue::MAX_LAYERS;
use crate::units::{Counts, Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians};
use core::borrow::BorrowMut;
pub use exchange::{AnyOrder, LargeOrder, Order, Sample, TickInput, TickOutput};
use fixed::types::I16F16;
pub use with_segments::Controller;

/// The one of eight ticks in which the watch takes the count.
const LOOK_TURN: u32 = 4;

/// The control law with its memory, but for the segments that play.
#[derive(Clone, Debug)]
// In this order: on the board the longest tick takes some 27 instructions fewer than in the
// compiler's own, because the nearer a field is to the beginning, the fewer instructions it takes
// to reach it.
#[repr(C)]
pub(crate) struct Core {
    mode: Mode,
    lines_agree: bool,
    tripped: Option<Fault>,
    origin: Counts,
    previous: Option<Counts>,
    silent_ticks: u32,
    /// Torque that was asked for in the tick before, within its limit.
    asked: I16F16,
    /// Ticks, for what is done in one of eight or of sixteen only.
    turn: u32,
    still: Stillness,
    limiter: Limiter,
    winding: Winding,
    observer: Observer,
    insertion: Insertion,
    plan: Plan,
    memory: Memory,
    movement: Movement,
    runaway: runaway::Watch,
    /// Plays while exciting.
    player: Player,
    feedforward: Feedforward,
    speed: SpeedEstimator,
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

impl Core {
    /// Torque off, waiting to be started, with a motor that has this heat, if it is known.
    fn warm(plan: Plan, heat: Option<u32>) -> Self {
        let mut winding = heat.map_or_else(|| Winding::unknown(&plan.thermal), Winding::with_heat);
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
            player: Player::default(),
        }
    }

    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn is_powered(&self) -> bool {
        self.mode.is_powered()
    }

    fn heat(&self) -> u32 {
        self.winding.heat()
    }

    fn order(&mut self, segments: &mut Segments, order: Order) {
        match order {
            Order::Start if self.mode == Mode::Idle && self.plan.device().commissioned => {
                self.insertion.begin();
                self.power_up(Mode::Running, true);
            }
            Order::Stop if self.mode.is_powered() => {
                self.mode = Mode::Idle;
                segments.forget();
            }
            Order::Zero if !self.mode.is_powered() => {
                self.origin = self.previous.unwrap_or_default();
                self.withdraw();
                self.speed = SpeedEstimator::new(self.plan.config.device.speed, Counts(0));
            }
            Order::Clear if self.mode == Mode::Faulted => self.mode = Mode::Idle,
            Order::Heartbeat => self.heartbeat(),
            Order::Trip(fault) => self.trip(fault),
            Order::Compensate(gains) => self.feedforward.set_gains(gains),
            Order::Start | Order::Stop | Order::Zero | Order::Clear => {}
        }
    }

    fn large_order(&mut self, segments: &mut Segments, order: LargeOrder) {
        if self.mode.is_powered() {
            return;
        }
        let depth = self.plan.scale.depth(self.latest_count());
        let is_commissioned = self.plan.device().commissioned;
        let may_play = self.mode == Mode::Idle;
        match order {
            LargeOrder::Configure(plan) => {
                self.speed = SpeedEstimator::new(plan.config.device.speed, self.latest_count());
                self.feedforward.configure(self.plan.device(), plan.device());
                self.plan = plan;
                self.withdraw();
                self.winding.allow(&self.plan.thermal, self.plan.torque_limits.torque);
            }
            LargeOrder::Excite(ref excitation) if may_play && (is_commissioned || excitation.is_gentle()) => {
                self.player.begin_one(segments, excitation, depth);
                self.play(excitation.compensated);
            }
            LargeOrder::Play(ref sequence) if may_play && is_commissioned && !sequence.is_empty() => {
                self.player.begin(segments, sequence, depth);
                self.play(sequence.is_compensated());
            }
            LargeOrder::Index(index) => {
                self.feedforward.set_index(index.map(|count| self.origin.0.wrapping_add(count.0)));
            }
            LargeOrder::Excite(_) | LargeOrder::Play(_) => {}
        }
    }

    /// Torque on, to play what the player has.
    fn play(&mut self, is_compensated: bool) {
        self.withdraw();
        self.power_up(Mode::Exciting, is_compensated);
    }

    fn heartbeat(&mut self) {
        self.silent_ticks = 0;
    }

    fn displace(&mut self, displacement: Millimetres) {
        self.memory.displace(displacement);
    }

    #[inline]
    fn take_line(&mut self, depths: &[Millimetres]) {
        self.insertion.take_line(&self.plan.anatomy, depths);
    }

    #[inline]
    fn set_lines_agree(&mut self, agree: bool) {
        self.lines_agree = agree;
    }

    /// As if the needle had never been in this tissue.
    fn withdraw(&mut self) {
        self.insertion = Insertion::new(&self.plan.anatomy);
        for layer in 0..MAX_LAYERS {
            self.plan.law.place(self.insertion.depths(), layer);
        }
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

    /// One tick. Not generic over the place of the segments: the crate that calls it would compile
    /// it and could not inline its parts, for which a tick on a PC takes 110 instructions more.
    fn tick(&mut self, segments: &mut dyn BorrowMut<Segments>, input: TickInput) -> TickOutput {
        let count = self.count(Counts(input.count.0.wrapping_mul(self.plan.encoder_sign)));
        let depth = self.plan.scale.depth(count);
        let speed = self.speed.tick(&self.plan.scale, count);
        self.turn = (self.turn + 1) % anatomy::LOOK_TICKS;
        let (transitions, tissue) = self.meet(input.tilt, depth, speed);
        let angle = self.insertion.angle();
        self.watch_host();
        let has_given_way = transitions.puncture != 0;
        let (torque, limits) = match self.wanted_torque(segments, tissue.force, (depth, speed), has_given_way)
        {
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

    /// Returns the tissue and the force of the tip at `depth`. During an excitation nobody's hand
    /// is on the needle, and nobody feels tissue.
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
            let (law, prepared) = (&self.plan.config.patient.law, &self.plan.law);
            let motion = Motion { depth, speed, movement: &self.movement };
            self.memory.tick(law, prepared, &self.insertion, motion)
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
                self.player.is_beyond(depth)
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

    fn trip(&mut self, fault: Fault) {
        if !matches!(self.mode, Mode::Faulted) {
            self.tripped = Some(fault);
        }
        self.mode = Mode::Faulted;
    }
}
