//! The device without the hardware: the control core, tick by tick, against the plant, behind the
//! same end of the link that the board has. It may not know who listens; it sees bytes, and a hand
//! that somebody moves.

use super::deformed::Deformed;
use super::device_config::DeviceConfig;
use super::grip::Grip;
use crate::error::Error;
use crate::plant::{Plant, PlantConfig};
use crate::procedure::{Procedure, Target};
use crate::profile::Profile;
use crate::session::Control;
use control_core::event::Fault;
use control_core::units::{Counts, DacCode, Milliradians};
use control_core::{AnyOrder, Controller, Order, Patient, Plan, TICK_HZ, TickInput};
use link::codec::MAX_FRAME;
use link::device::{Endpoint, Identity};
use link::frames::{Stage, StageTime, Timing};
use std::f64::consts::FRAC_PI_2;
use std::time::{Duration, Instant};

/// One tick in s.
const TICK_S: f64 = 1.0 / TICK_HZ as f64;
/// Fastest that a dragged hand moves, mm/s: a quick reach, and well within what the encoder check
/// allows.
const DRAG_MM_PER_S: f64 = 250.0;
/// A dragged hand closes in on the mouse with this time constant, s.
const DRAG_LAG_S: f64 = 0.04;
/// Largest change of a dragged hand's speed: a firm stab. A mouse that jumps asks for more than a
/// hand with a needle in tissue can do, and the device would take it for a motor that is wired the
/// wrong way.
const DRAG_MM_PER_S2: f64 = 3000.0;
/// The name by which a barrier is reported that stops the needle's turning.
pub const SLOPE_BARRIER: &str = "slope_barrier";
/// One tick in this many is timed: a look at the clock costs a quarter of a tick.
const TIMED_TICKS: u64 = 16;

/// The source of the needle's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hand {
    /// The procedure, since this tick.
    Script { since: u64 },
    /// The procedure, as soon as the device is started; until then it stays where it is.
    Rest,
    /// A person, to this depth in mm.
    Drag { wanted_mm: f64 },
}

/// The control core on the plant.
pub struct VirtualDevice {
    plant: Plant,
    controller: Controller,
    endpoint: Endpoint,
    procedure: Procedure,
    tick: u64,
    hand: Hand,
    /// The hand's position, mm past the plant's zero.
    hand_mm: f64,
    hand_mm_per_s: f64,
    /// The zero that a person has set, mm past the plant's zero.
    zero_mm: f64,
    /// By how much the procedure has turned the needle, rad.
    turned_rad: f64,
    /// The step of the procedure that is going on, as soon as it has begun.
    step: Option<usize>,
    is_on_bone: bool,
    /// Ticks until a needle that slips is reported again.
    slips_for: u32,
    /// The tilt that the hand wants, and those at which a barrier stops the needle, rad.
    wanted_tilt: f64,
    tilt_limits: Option<[f64; 2]>,
    /// Tasks that the scripted hand has done and that have not been reported yet, and "bone" where
    /// the tip has met bone.
    done: Vec<&'static str>,
    set_value: f64,
    enable: bool,
    tripped: Option<Fault>,
    powered_before: bool,
    timing: Timing,
    timed: bool,
    /// Tissue from whose surface depth counts, by choice.
    deformed: Option<Deformed>,
}

impl VirtualDevice {
    /// Powered down, the needle where `procedure` begins, the device configured as it leaves the
    /// bench: with the defaults.
    pub fn new(profile: &Profile, procedure: Procedure) -> Self {
        Self::built(profile, procedure, None)
    }

    /// The same, with the rollers' grip and the motor's winding that a device's file gives.
    pub fn built(profile: &Profile, procedure: Procedure, part: Option<&DeviceConfig>) -> Self {
        let device = &profile.config.device;
        // A device that is too weak for the default patient waits for the one that it is for.
        let plan = Plan::new(device, &Patient::default()).unwrap_or_else(|_| profile.plan.clone());
        let mechanism = PlantConfig::new(
            device.roller_radius.0.to_num::<f64>() * 1e-3,
            device.counts_per_turn,
            device.full_scale_torque.0.to_num::<f64>() * 1e-3,
        );
        let grip = part.and_then(|part| part.grip);
        let winding = part.and_then(|part| part.winding);
        let mechanism = PlantConfig {
            grip_force: grip.map_or(mechanism.grip_force, Grip::slips_at_n),
            motor: winding
                .map_or(mechanism.motor, |winding| winding.motor(mechanism.motor.full_scale_torque)),
            ..mechanism
        };
        let mut plant = Plant::new(mechanism, procedure.grip, procedure.start_mm * 1e-3);
        plant.set_tilt(procedure.entry_rad.unwrap_or(profile.entry_rad) + profile.skin_tilt_rad());
        Self {
            wanted_tilt: plant.tilt(),
            plant,
            endpoint: Endpoint::new(Identity::VIRTUAL, &plan, None).knowing_depth(),
            controller: Controller::new(plan),
            tick: 0,
            hand: Hand::Script { since: 0 },
            hand_mm: procedure.start_mm,
            hand_mm_per_s: 0.0,
            zero_mm: 0.0,
            turned_rad: 0.0,
            tilt_limits: None,
            step: None,
            is_on_bone: false,
            slips_for: 0,
            done: Vec::new(),
            set_value: 0.0,
            enable: false,
            tripped: None,
            powered_before: false,
            procedure,
            timing: Timing::default(),
            timed: false,
            deformed: None,
        }
    }

    /// Lets the law count depth from the surface of the deformed tissue instead of from where it
    /// was at rest: the law xr, on a patient with a vessel and its far wall.
    pub fn with_deformed(self, profile: &Profile) -> Result<Self, Error> {
        let deformed = Deformed::new(profile).map_err(Error::input)?;
        Ok(Self { deformed: Some(deformed), ..self })
    }

    /// The plant behind it.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// True if the amplifier is on.
    pub fn is_enabled(&self) -> bool {
        self.enable
    }

    /// The fault that latched last.
    pub fn tripped(&self) -> Option<Fault> {
        self.tripped
    }

    /// The converter's output as a share of full scale, −1 to 1.
    pub fn set_value(&self) -> f64 {
        self.set_value
    }

    /// Ticks since power-on.
    pub fn ticks(&self) -> u64 {
        self.tick
    }

    /// Starts it without a PC: for measuring and for tests of the control law against the plant.
    pub fn start_alone(&mut self) {
        self.controller.order(Order::Start);
    }

    /// A tick with a heartbeat from nobody and no link behind it.
    pub fn tick_alone(&mut self) {
        self.controller.order(Order::Heartbeat);
        self.tick();
    }

    /// Notes the time of ticks from now on, for the timing frames.
    pub fn take_times(&mut self) {
        self.timed = true;
    }

    /// The clock on the wall ran away from the device's: ticks came late.
    pub fn note_late(&mut self) {
        self.timing.missed_ticks = self.timing.missed_ticks.saturating_add(1);
        self.endpoint.set_timing(self.timing);
    }

    /// One tick of the control law, then 100 µs of physics.
    pub fn tick(&mut self) {
        if let Some(line) = self.endpoint.take_line() {
            self.controller.take_line(&line.depths);
        }
        while let Some(order) = self.endpoint.next_order() {
            self.order(order);
        }
        let begin = (self.timed && self.tick.is_multiple_of(TIMED_TICKS)).then(Instant::now);
        let output = self.controller.tick(TickInput {
            count: Counts(self.encoder_count()),
            tilt: Milliradians((self.plant.tilt() * 1e3).round() as i16),
        });
        if let Some(begin) = begin {
            self.note_time(begin.elapsed());
        }
        self.set_value = self.share(output.dac);
        self.enable = output.enable;
        self.tripped = output.tripped.or(self.tripped);
        self.endpoint.record(self.tick, &output);
        if let Some(displacement) = self.deformed.as_mut().and_then(|tissue| tissue.follow(&output)) {
            self.controller.displace(displacement);
        }
        if self.enable && !self.powered_before && !matches!(self.hand, Hand::Drag { .. }) {
            // The scripted hand waits for a person to start the device; a person who holds the
            // needle goes on holding it.
            self.restart_script();
        }
        self.powered_before = self.enable;
        let wanted = self.move_hand();
        self.plant.tick(self.set_value, self.enable, Some(wanted));
        let was_on_bone = std::mem::replace(&mut self.is_on_bone, self.plant.is_on_bone());
        if self.is_on_bone && !was_on_bone {
            self.done.push("bone");
        }
        self.note_slipping();
        self.tick += 1;
    }

    /// Reports a needle that slips in the rollers, once until it has held for half a second.
    fn note_slipping(&mut self) {
        if !self.plant.is_slipping() {
            self.slips_for = self.slips_for.saturating_sub(1);
        } else if std::mem::replace(&mut self.slips_for, TICK_HZ / 2) == 0 {
            self.done.push("slipping");
        }
    }

    /// Takes bytes from the PC.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.endpoint.receive(bytes);
    }

    /// Writes the next frame for the PC to `out`; 0 where nothing waits.
    pub fn transmit(&mut self, out: &mut [u8; MAX_FRAME]) -> usize {
        self.endpoint.transmit(out)
    }

    /// The cable is pulled: the device sees its bus go silent, and takes the torque away.
    pub fn disconnect(&mut self) {
        self.endpoint.disconnect();
        if self.enable {
            self.controller.order(Order::Trip(Fault::LinkLost));
        }
    }

    /// The scripted hand does something else from now on, from its beginning and with the needle
    /// turned back; one that a person has taken it from waits with it.
    pub fn follow(&mut self, procedure: Procedure) {
        self.turn(0.0);
        self.procedure = procedure;
        if matches!(self.hand, Hand::Script { .. }) {
            self.restart_script();
        }
    }

    /// Bone stops the needle at `depth_mm` past its zero, or nothing does.
    pub fn meet_bone(&mut self, depth_mm: Option<f64>) {
        self.plant.set_bone(depth_mm.map(|mm| (mm + self.zero_mm) * 1e-3));
    }

    /// Barriers stop the needle at these tilts, rad, or nothing does.
    pub fn limit_tilt(&mut self, limits: Option<[f64; 2]>) {
        self.tilt_limits = limits;
    }

    /// Moves the simulated hand or the device. What concerns the control law goes over the link and
    /// not through here.
    pub fn control(&mut self, control: Control) {
        match control {
            Control::Drag { depth_mm } if depth_mm.is_finite() => {
                let travel = self.controller.plan().device().limits.travel.0.to_num::<f64>() - 1.0;
                self.hand = Hand::Drag { wanted_mm: depth_mm.clamp(-travel, travel) + self.zero_mm };
            }
            Control::Release => self.hand = Hand::Drag { wanted_mm: self.hand_mm },
            Control::Demo => self.restart_script(),
            Control::Tilt { rad } if rad.is_finite() => {
                self.turn_to(rad);
            }
            _ => {}
        }
    }

    fn order(&mut self, order: AnyOrder) {
        if matches!(order, AnyOrder::Small(Order::Zero)) && !self.enable {
            self.zero_mm = self.plant.tip() * 1e3;
            if matches!(self.hand, Hand::Script { .. }) {
                self.hand = Hand::Rest;
            }
        }
        self.controller.order(order);
    }

    fn restart_script(&mut self) {
        self.hand = Hand::Script { since: self.tick };
        self.step = None;
    }

    /// The converter's code as a share of full scale, as the amplifier sees it.
    fn share(&self, code: DacCode) -> f64 {
        let device = self.controller.plan().device();
        let zero = f64::from(self.controller.plan().zero_torque_code().0);
        let share = (f64::from(code.0) - zero) / f64::from(device.dac.span());
        if device.motor_reversed { -share } else { share }
    }

    /// As the encoder is mounted.
    fn encoder_count(&self) -> i32 {
        let count = self.plant.count();
        if self.controller.plan().device().encoder_reversed { count.wrapping_neg() } else { count }
    }

    /// Returns the tip's position and speed that the hand wants, in m and m/s.
    fn move_hand(&mut self) -> (f64, f64) {
        let (wanted_mm, speed) = match self.hand {
            Hand::Script { since } => {
                let into = if self.enable { (self.tick - since) as f64 * TICK_S } else { 0.0 };
                let Target { depth_mm, speed_mm_s, turned_rad } = self.procedure.target(into);
                self.turn(turned_rad);
                if self.enable {
                    self.begin_step(into);
                }
                (depth_mm + self.zero_mm, speed_mm_s)
            }
            Hand::Rest => (self.hand_mm, 0.0),
            Hand::Drag { wanted_mm } => (wanted_mm, 0.0),
        };
        // A hand neither jumps to the mouse nor back to the procedure's beginning.
        let most = DRAG_MM_PER_S * TICK_S;
        let gap = wanted_mm - self.hand_mm;
        match self.hand {
            Hand::Script { .. } if gap.abs() <= most => {
                (self.hand_mm, self.hand_mm_per_s) = (wanted_mm, speed);
                (wanted_mm * 1e-3, speed * 1e-3)
            }
            _ => {
                // No faster than it can still stop in time.
                let most = (2.0 * DRAG_MM_PER_S2 * gap.abs()).sqrt().min(DRAG_MM_PER_S);
                let wanted = (gap / DRAG_LAG_S).clamp(-most, most);
                let change = DRAG_MM_PER_S2 * TICK_S;
                self.hand_mm_per_s += (wanted - self.hand_mm_per_s).clamp(-change, change);
                self.hand_mm += self.hand_mm_per_s * TICK_S;
                (self.hand_mm * 1e-3, self.hand_mm_per_s * 1e-3)
            }
        }
    }

    /// Notes the task of the step that has begun `into` s into the procedure.
    fn begin_step(&mut self, into: f64) {
        let step = self.procedure.step_at(into);
        if self.step.replace(step) != Some(step) {
            self.done.extend(self.procedure.task_of(step));
        }
    }

    /// Returns the tasks that the scripted hand has done since the last time, "bone" where the tip
    /// has met bone, "slipping" where the rollers did not hold the needle, and [`SLOPE_BARRIER`].
    pub fn take_done(&mut self) -> Vec<&'static str> {
        std::mem::take(&mut self.done)
    }

    /// The scripted hand turns the needle by what its procedure says, from wherever a person or the
    /// beginning has put it.
    fn turn(&mut self, turned_rad: f64) {
        if turned_rad != self.turned_rad {
            self.turn_to(self.wanted_tilt + turned_rad - self.turned_rad);
            self.turned_rad = turned_rad;
        }
    }

    /// Turns the needle as far as the barriers let it, which are reported when it comes to one.
    fn turn_to(&mut self, tilt: f64) {
        let [low, high] = self.tilt_limits.unwrap_or([-FRAC_PI_2, FRAC_PI_2]);
        let beyond = |tilt: f64| i8::from(tilt > high) - i8::from(tilt < low);
        let before = beyond(std::mem::replace(&mut self.wanted_tilt, tilt));
        self.plant.set_tilt(tilt.clamp(low, high));
        if self.tilt_limits.is_some() && beyond(tilt) != 0 && beyond(tilt) != before {
            self.done.push(SLOPE_BARRIER);
        }
    }

    fn note_time(&mut self, taken: Duration) {
        let taken = u32::try_from(taken.as_nanos()).unwrap_or(u32::MAX);
        let stage = &mut self.timing.stages[Stage::Tick as usize];
        *stage = StageTime { last: taken, longest: stage.longest.max(taken) };
        self.endpoint.set_timing(self.timing);
    }
}
