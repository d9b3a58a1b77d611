//! The tick: strings the stages together and holds the operating mode. The device and the simulator call this and
//! nothing else.

mod exchange;
mod torque;
mod watches;

use crate::anatomy::{self, Insertion};
use crate::compensation::feedforward::Feedforward;
use crate::event::{Fault, Limits, State, Transitions};
use crate::excitation::Player;
use crate::kinematics::{Movement, SpeedEstimator, moved};
use crate::law::{Memory, Motion, Response};
use crate::passivity::Observer;
use crate::plan::Plan;
use crate::runaway;
use crate::safety::Limiter;
use crate::stillness::Stillness;
use crate::thermal::Winding;
use crate::units::{Counts, Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians};
pub use exchange::{Order, Sample, TickInput, TickOutput};
use fixed::types::I16F16;

/// Of eight ticks, the one in which the watch takes the count.
const LOOK_TURN: u32 = 4;

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

    fn trip(&mut self, fault: Fault) {
        if !matches!(self.mode, Mode::Faulted) {
            self.tripped = Some(fault);
        }
        self.mode = Mode::Faulted;
    }
}
