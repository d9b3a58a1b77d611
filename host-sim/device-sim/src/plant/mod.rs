//! The physics that the device meets, in floating point and steps finer than the tick: amplifier
//! and motor, roller on its bearings, a needle held by the grip of the roller, its weight, a hand.
//! SI units; positive is the insertion direction.
//!
//! It knows a converter's set value, an enable line and an encoder count, and nothing of force
//! laws: tissue exists only as the torque that the control law asks for. The same inputs give the
//! same bits, always and on every machine, in a browser too: sines come from `libm`, not from the
//! system.

pub mod bearing;
pub mod hand;
pub mod motor;

use bearing::{Bearing, BearingStep};
use hand::{Grip, Hand};
use motor::{Amplifier, Motor};

/// Stiffness and damping of bone under the tip, N/m and N·s/m: a needle that is pushed by 10 N goes
/// 0.05 mm into it. Assumptions; nobody has measured what a needle on bone does.
const BONE: (f64, f64) = (2.0e5, 30.0);
/// Physics steps in a tick of the control law.
pub const STEPS_PER_TICK: u32 = 10;
/// One physics step in s.
pub const STEP_S: f64 = 1.0 / (10_000.0 * STEPS_PER_TICK as f64);
/// Standard gravity in m/s².
pub const GRAVITY: f64 = 9.806_65;

/// The parameters of the mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantConfig {
    /// Motor and amplifier.
    pub motor: Motor,
    /// Rotor and roller, kg·m².
    pub inertia: f64,
    /// Friction of the bearings and brushes.
    pub bearing: Bearing,
    /// Radius of the roller, m.
    pub roller_radius: f64,
    /// Encoder counts a turn.
    pub counts_per_turn: u16,
    /// Needle and what moves with it, kg.
    pub needle_mass: f64,
    /// Largest force that the roller's grip holds before the needle slips, N.
    pub grip_force: f64,
    /// Stiffness of the roller's urethane coat under the needle, N/m.
    pub coat_stiffness: f64,
    /// Damping of the same, N·s/m.
    pub coat_damping: f64,
}

impl PlantConfig {
    /// An RE25-class motor with a bare roller and a light needle, at this roller and encoder.
    pub fn new(roller_radius: f64, counts_per_turn: u16, full_scale_torque: f64) -> Self {
        Self {
            motor: Motor::re25(full_scale_torque),
            // The rotor's 1.1e-6 kg·m² (RE25) plus an aluminium roller.
            inertia: 1.4e-6,
            bearing: Bearing { viscous: 1.2e-6, coulomb: 4.0e-4, breakaway: 4.8e-4 },
            roller_radius,
            counts_per_turn,
            needle_mass: 0.010,
            grip_force: 4.0,
            // Stiff enough that 1 N deflects it by little more than an encoder count.
            coat_stiffness: 5.0e4,
            coat_damping: 8.0,
        }
    }
}

/// A quantity that has decayed below anything physical is zero: left alone it would end among the
/// subnormal numbers, where every operation costs a hundred times as much.
#[inline]
fn settled(x: f64) -> f64 {
    if x.abs() < 1e-30 { 0.0 } else { x }
}

/// The mechanism in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    config: PlantConfig,
    amplifier: Amplifier,
    /// Angle and speed of the roller, rad and rad/s.
    angle: f64,
    speed: f64,
    /// Place and speed of the needle's tip, m and m/s.
    tip: f64,
    tip_speed: f64,
    /// The shear of the coat: needle ahead of the roller's surface, m.
    shear: f64,
    tilt: f64,
    /// Weight of the needle along its axis, N.
    weight: f64,
    bearing: BearingStep,
    /// Change of the needle's speed in a step for a force, m/s for N.
    per_force: f64,
    /// Shear at which the coat lets the needle slip, m.
    most_shear: f64,
    hand: Hand,
    hand_force: f64,
    /// The place at which bone stops the tip, m past the skin.
    bone: Option<f64>,
}

impl Plant {
    /// At rest with the tip at `tip` (m past the skin), where the encoder has counted from the
    /// skin.
    pub fn new(config: PlantConfig, grip: Grip, tip: f64) -> Self {
        Self {
            amplifier: Amplifier::default(),
            angle: tip / config.roller_radius,
            speed: 0.0,
            tip,
            tip_speed: 0.0,
            shear: 0.0,
            tilt: 0.0,
            weight: 0.0,
            bearing: config.bearing.steps(config.inertia, STEP_S),
            per_force: STEP_S / config.needle_mass,
            most_shear: config.grip_force / config.coat_stiffness,
            hand: Hand::new(grip, tip),
            hand_force: 0.0,
            bone: None,
            config,
        }
    }

    /// Inclines the insertion axis below the horizontal, rad.
    pub fn set_tilt(&mut self, tilt: f64) {
        self.tilt = tilt;
        self.weight = self.config.needle_mass * GRAVITY * libm::sin(tilt);
    }

    /// Puts bone at `place` m past the skin, or takes it away.
    pub fn set_bone(&mut self, place: Option<f64>) {
        self.bone = place;
    }

    /// True if the needle slips in the rollers, or is about to: they hold no more.
    pub fn is_slipping(&self) -> bool {
        self.shear.abs() >= self.most_shear
    }

    /// True if the tip presses on bone.
    pub fn is_on_bone(&self) -> bool {
        self.bone.is_some_and(|place| self.tip > place)
    }

    /// Force of bone on the tip, against insertion, N.
    fn bone_force(&self) -> f64 {
        let Some(place) = self.bone.filter(|place| self.tip > *place) else { return 0.0 };
        (BONE.0 * (self.tip - place) + BONE.1 * self.tip_speed).max(0.0)
    }

    /// Inclination below the horizontal, rad.
    pub fn tilt(&self) -> f64 {
        self.tilt
    }

    /// Moves time on by one tick: 100 µs. `set_value` is the amplifier's input as a share of full
    /// scale, −1 to 1; `enable` its enable line. `hand` is where the hand wants the tip at the
    /// start of the tick (m) and how fast (m/s), or `None` where it has let go.
    pub fn tick(&mut self, set_value: f64, enable: bool, hand: Option<(f64, f64)>) {
        let tremor = self.hand.tremor_tick();
        let mut hand = hand.map(|(place, speed)| (place + tremor.0, speed + tremor.1));
        let wanted = enable.then(|| self.config.motor.wanted_current(set_value));
        for _ in 0..STEPS_PER_TICK {
            self.step(wanted, hand);
            if let Some((place, speed)) = &mut hand {
                *place += *speed * STEP_S;
            }
        }
    }

    /// A step, semi-implicit: speeds from forces, then places from speeds.
    #[inline]
    fn step(&mut self, wanted_current: Option<f64>, hand: Option<(f64, f64)>) {
        let c = &self.config;
        self.hand_force = self.hand.force(hand, self.tip, self.tip_speed);
        let slide = self.tip_speed - self.speed * c.roller_radius;
        let grip =
            (c.coat_stiffness * self.shear + c.coat_damping * slide).clamp(-c.grip_force, c.grip_force);
        let torque = self.amplifier.step(&c.motor, wanted_current, self.speed);

        self.tip_speed = settled(
            self.tip_speed + self.per_force * (self.hand_force + self.weight - grip - self.bone_force()),
        );
        self.speed = self.bearing.step(self.speed, torque + grip * c.roller_radius);
        self.tip += STEP_S * self.tip_speed;
        self.angle += STEP_S * self.speed;
        // Beyond the grip the needle slips: the coat holds what it can and no more.
        let shear = self.shear + STEP_S * (self.tip_speed - self.speed * c.roller_radius);
        self.shear = shear.clamp(-self.most_shear, self.most_shear);
    }

    /// Returns the encoder's count since the tip was at the skin, quantised.
    pub fn count(&self) -> i32 {
        let counts_per_rad = f64::from(self.config.counts_per_turn) / std::f64::consts::TAU;
        // Travel is centimetres; `as` would saturate anyway.
        (self.angle * counts_per_rad).floor() as i32
    }

    /// Place of the tip past the skin, m. Not what the encoder sees: the needle may have slipped.
    pub fn tip(&self) -> f64 {
        self.tip
    }

    /// Speed of the tip, m/s.
    pub fn tip_speed(&self) -> f64 {
        self.tip_speed
    }

    /// Speed of the roller, rad/s.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Force of the hand on the needle, N.
    pub fn hand_force(&self) -> f64 {
        self.hand_force
    }

    /// Current of the motor, A.
    pub fn current(&self) -> f64 {
        self.torque() / self.config.motor.torque_constant
    }

    /// Torque of the motor, N·m.
    pub fn torque(&self) -> f64 {
        self.amplifier.torque(&self.config.motor)
    }

    /// Kinetic energy and that of the sheared coat, J.
    pub fn energy(&self) -> f64 {
        let c = &self.config;
        0.5 * (c.inertia * self.speed.powi(2)
            + c.needle_mass * self.tip_speed.powi(2)
            + c.coat_stiffness * self.shear.powi(2))
    }

    /// Returns its parameters.
    pub fn config(&self) -> &PlantConfig {
        &self.config
    }
}
