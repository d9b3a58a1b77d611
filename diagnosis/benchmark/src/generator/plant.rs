//! The true machine: every piece of physics that a case may hide, as plain numbers. Written from
//! the physics; independent of the diagnosis and of the rig file.
//!
//! Units: rad or m for travel (called `u` for unit below), N·m or N for force, kg·m² or kg for
//! inertia.

/// A sinusoid along the travel: `amplitude · sin(order · 2π/turn · q + phase)`.
#[derive(Clone, Debug)]
pub(crate) struct Harmonic {
    pub(crate) order: f64,
    pub(crate) amplitude: f64,
    pub(crate) phase: f64,
}

/// The way in which small commands vanish.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DeadbandKind {
    /// Zero inside, the excess outside: `u − d·sgn(u)`.
    Offset,
    /// As above with rounded corners, relative radius given.
    Smooth(f64),
}

/// Small commands do nothing; `half_width` in the command's unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deadband {
    pub(crate) half_width: f64,
    pub(crate) kind: DeadbandKind,
}

/// The drive clips at `limit` (command's unit); `knee` > 0 rounds the corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clip {
    pub(crate) limit: f64,
    pub(crate) knee: f64,
}

/// The course of a slow change from start to settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DriftLaw {
    /// `1 − exp(−t/τ)`.
    Exponential,
    /// `t/(t + τ)`: fast at first, a long tail.
    Hyperbolic,
}

/// A relative change over the recording: the factor goes from 1 to `1 + change`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drift {
    pub(crate) change: f64,
    pub(crate) time_constant: f64,
    pub(crate) law: DriftLaw,
}

impl Drift {
    /// The factor at time `t` after the cold start.
    pub(crate) fn factor(&self, t: f64) -> f64 {
        let x = t.max(0.0) / self.time_constant;
        let settled = match self.law {
            DriftLaw::Exponential => 1.0 - (-x).exp(),
            DriftLaw::Hyperbolic => x / (1.0 + x),
        };
        1.0 + self.change * settled
    }
}

/// The law by which the Stribeck peak falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StribeckLaw {
    /// `exp(−(v/v_s)^δ)` with δ in 1–2 (Bo and Pavelescu; δ = 2 is the Gaussian).
    Exponential(f64),
    /// `1/(1 + (v/v_s)²)` (Hess and Soom).
    Lorentzian,
}

/// Extra dry friction near zero speed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stribeck {
    pub(crate) peak: f64,
    pub(crate) speed: f64,
    pub(crate) law: StribeckLaw,
}

/// Elastic contact before sliding.
#[derive(Clone, Debug)]
pub(crate) enum Presliding {
    /// LuGre (Canudas de Wit 1995): bristle stiffness and damping.
    LuGre { stiffness: f64, damping: f64 },
    /// Maxwell-slip (Iwan; Lampaert 2003): parallel elements, each a share of the sliding force and
    /// its stiffness.
    MaxwellSlip { elements: Vec<(f64, f64)> },
}

/// A dimensionless shape along the travel, measured from the mechanical origin.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// 0 at `from`, 1 at `to`, straight between, flat outside.
    Ramp { from: f64, to: f64 },
    /// A bump of unit height.
    Bump { centre: f64, width: f64 },
    /// A smooth step.
    Step { centre: f64, width: f64 },
}

impl Shape {
    /// The shape's value at `q`, in [0, 1].
    pub(crate) fn at(&self, q: f64) -> f64 {
        match *self {
            Shape::Ramp { from, to } => ((q - from) / (to - from)).clamp(0.0, 1.0),
            Shape::Bump { centre, width } => (-0.5 * ((q - centre) / width).powi(2)).exp(),
            Shape::Step { centre, width } => 0.5 * (1.0 + ((q - centre) / width).tanh()),
        }
    }
}

/// The level of the dry friction; the law of what happens at zero speed is the integrator's.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dry {
    pub(crate) coulomb: f64,
    /// (forward − backward)/(forward + backward).
    pub(crate) asymmetry: f64,
    pub(crate) stribeck: Option<Stribeck>,
    pub(crate) profile: Option<(f64, Shape)>,
    pub(crate) warm: Option<Drift>,
    /// Extra level per unit of external load.
    pub(crate) per_load: f64,
    /// Extra level per unit of drive force: gear loss.
    pub(crate) per_drive: f64,
    /// Extra level in a window of speed: (height, centre, width).
    pub(crate) speed_window: Option<(f64, f64, f64)>,
    pub(crate) presliding: Option<Presliding>,
}

/// The connection of the driven inertia to the motor.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Train {
    Rigid,
    /// A spring and a damper between the motor and a share of the inertia and of the friction.
    Spring {
        load_share: f64,
        friction_share: f64,
        stiffness: f64,
        damping: f64,
    },
    /// A gap of full width `gap`, with stiff damped contact.
    Gap {
        load_share: f64,
        friction_share: f64,
        gap: f64,
        stiffness: f64,
        damping: f64,
    },
    /// A friction drive: traction rises over a small creep speed and lets go at the ceiling.
    Slip {
        load_share: f64,
        friction_share: f64,
        ceiling: f64,
        creep: f64,
    },
}

/// Physics that no name of the contract covers.
#[derive(Clone, Debug)]
pub(crate) enum Foreign {
    /// A spring in series with a dashpot to ground (Maxwell body).
    CreepSpring { stiffness: f64, relaxation: f64 },
    /// A force periodic in a phase that advances with speed but not with the turn: rate = a +
    /// b·|v|^p.
    WhirlingForce { amplitude: f64, base_hz: f64, per_speed_hz: f64, power: f64 },
    /// A force periodic in time, phase by chance in each recording.
    Hum { amplitude: f64, hertz: f64 },
    /// Conservative wells at irregular places: (depth, centre, width).
    Wells { wells: Vec<(f64, f64, f64)> },
    /// The inertia changes at once during the recording.
    PayloadChange { share: f64, at: f64 },
    /// A flywheel behind a one-way clutch: inertia only while it is pushed along.
    Flywheel { share: f64 },
    /// A force that turns round at places of its own on the way up and on the way down.
    Latch { force: f64, places: Vec<(f64, f64)>, side: f64 },
    /// A force of the product of travel and speed, rising and falling again.
    Shuttle { amplitude: f64, centre: f64, scale: f64 },
    /// Configuration-dependent inertia (a linkage): J(q) = J·(1 + share·shape), with its ½J′v²
    /// force.
    Linkage { share: f64, centre: f64, width: f64 },
}

/// The conditions and the size of lost counts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LostCounts {
    /// Counts a burst.
    pub(crate) burst: f64,
    /// Lost and won alike, instead of always against the motion.
    pub(crate) both_ways: bool,
    /// Bursts a second while moving.
    pub(crate) rate: f64,
    /// Bursts come only above this speed.
    pub(crate) above_speed: f64,
}

/// The whole truth.
#[derive(Clone, Debug)]
pub(crate) struct Plant {
    pub(crate) inertia: f64,
    pub(crate) viscous: f64,
    pub(crate) viscous_asymmetry: f64,
    pub(crate) dry: Dry,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
    pub(crate) weight: f64,
    /// Travel per turn of the motor.
    pub(crate) turn: f64,
    pub(crate) delay: f64,
    pub(crate) lag: f64,
    pub(crate) deadband: Option<Deadband>,
    pub(crate) clip: Option<Clip>,
    pub(crate) gain_drift: Option<Drift>,
    pub(crate) ripple: Vec<Harmonic>,
    pub(crate) cogging: Vec<Harmonic>,
    /// (amplitude, phase): gravity on an off-centre mass, turned with the tilt.
    pub(crate) imbalance: Option<(f64, f64)>,
    /// (stiffness, rest place, cubic share at one unit of `cubic_at`).
    pub(crate) spring: Option<(f64, f64, f64)>,
    pub(crate) damping_profile: Option<(f64, Shape)>,
    pub(crate) drag: f64,
    pub(crate) train: Train,
    /// (amplitude in u, phase) of the once-per-turn reading error.
    pub(crate) eccentricity: Option<(f64, f64)>,
    pub(crate) lost: Option<LostCounts>,
    pub(crate) counts_per_unit: f64,
    pub(crate) foreign: Vec<Foreign>,
}

impl Plant {
    /// A plant of one rigid mass with dry friction, on which nothing else acts.
    pub(crate) fn rigid(inertia: f64, coulomb: f64, gain: f64, turn: f64, counts_per_unit: f64) -> Self {
        Self {
            inertia,
            viscous: 0.0,
            viscous_asymmetry: 0.0,
            dry: Dry { coulomb, ..Dry::default() },
            gain,
            offset: 0.0,
            weight: 0.0,
            turn,
            delay: 0.0,
            lag: 0.0,
            deadband: None,
            clip: None,
            gain_drift: None,
            ripple: Vec::new(),
            cogging: Vec::new(),
            imbalance: None,
            spring: None,
            damping_profile: None,
            drag: 0.0,
            train: Train::Rigid,
            eccentricity: None,
            lost: None,
            counts_per_unit,
            foreign: Vec::new(),
        }
    }

    /// Angle within the turn, for what is periodic in it.
    pub(crate) fn angle(&self, q: f64) -> f64 {
        std::f64::consts::TAU / self.turn * q
    }

    /// The level of dry friction (not its direction) in the state given; never negative.
    pub(crate) fn dry_level(&self, speed: f64, q: f64, t: f64, load: f64, drive: f64) -> f64 {
        let dry = &self.dry;
        let v = speed.abs();
        let mut level = dry.coulomb;
        if let Some(s) = dry.stribeck {
            let x = v / s.speed;
            level += s.peak
                * match s.law {
                    StribeckLaw::Exponential(power) => (-x.powf(power)).exp(),
                    StribeckLaw::Lorentzian => 1.0 / (1.0 + x * x),
                };
        }
        if let Some((height, shape)) = dry.profile {
            level += height * shape.at(q);
        }
        if let Some((height, centre, width)) = dry.speed_window {
            level += height * (-((v - centre) / width).powi(2)).exp();
        }
        if let Some(warm) = dry.warm {
            level *= warm.factor(t);
        }
        level += dry.per_load * load.abs() + dry.per_drive * drive.abs();
        (level * (1.0 + dry.asymmetry * sign(speed))).max(0.0)
    }

    /// Returns the command after the drive's electronics, before the current has risen.
    pub(crate) fn shaped_command(&self, command: f64) -> f64 {
        let mut u = command;
        if let Some(d) = self.deadband {
            u = match d.kind {
                DeadbandKind::Offset => u - u.clamp(-d.half_width, d.half_width),
                DeadbandKind::Smooth(radius) => {
                    let r = radius * d.half_width;
                    soft_excess(u - d.half_width, r) - soft_excess(-u - d.half_width, r)
                }
            };
        }
        if let Some(c) = self.clip {
            u = if c.knee > 0.0 {
                // Follows |u| below the limit and bends to it above.
                let k = c.knee * c.limit;
                sign(u) * (u.abs() - k * softplus((u.abs() - c.limit) / k))
            } else {
                u.clamp(-c.limit, c.limit)
            };
        }
        u
    }

    /// Force per current (in the command's unit) at this place and time.
    pub(crate) fn force_constant(&self, q: f64, t: f64) -> f64 {
        let drift = self.gain_drift.map_or(1.0, |d| d.factor(t));
        let ripple = if self.ripple.is_empty() { 0.0 } else { harmonic_sum(&self.ripple, self.angle(q)) };
        self.gain * drift * (1.0 + ripple)
    }
}

/// The sum of harmonics at `angle`.
pub(crate) fn harmonic_sum(harmonics: &[Harmonic], angle: f64) -> f64 {
    harmonics.iter().map(|h| h.amplitude * (h.order * angle + h.phase).sin()).sum()
}

/// −1, 0 or 1; `sgn(0)` is 0, as the contract says.
pub(crate) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}

fn softplus(x: f64) -> f64 {
    if x > 30.0 { x } else { x.exp().ln_1p() }
}

/// max(x, 0) with a corner rounded over `r`.
fn soft_excess(x: f64, r: f64) -> f64 {
    0.5 * (x + (x * x + r * r).sqrt())
}
