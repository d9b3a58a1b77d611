//! The regression's input: plain data, without files.

/// A nominal value and how far it may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value {
    /// The value in the rig's unit.
    pub nominal: f64,
    /// Standard deviation relative to `nominal`; `None` if the rig declares none.
    pub spread: Option<f64>,
}

/// The nominal simulation: J·q̈ = k·u − b·q̇ − F·sgn q̇ + offset + weight·sin tilt.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// True if the coordinate is an angle in rad; a length in m otherwise.
    pub rotary: bool,
    /// J, kg·m² or kg.
    pub inertia: Value,
    /// b, N·m·s/rad or N·s/m; `None` if the nominal model has none.
    pub viscous: Option<Value>,
    /// F, N·m or N.
    pub coulomb: Option<Value>,
    /// The load at a tilt of 90°, N·m or N.
    pub weight: Option<Value>,
    /// Gravity on an off-centre mass, N·m, and the angle at which it is zero, rad.
    pub gravity: Option<(Value, f64)>,
    /// True if the rig has an offset key; without one, a force in one direction is physics.
    pub has_offset: bool,
    /// k, N·m or N per unit of command.
    pub gain: Value,
    /// Delay that is already known, s.
    pub known_delay_s: f64,
    /// Time constants of first-order lags that are already known, of the drive and of the reading's
    /// filter, s.
    pub known_lags_s: Vec<f64>,
    /// Counts per rad or per m.
    pub counts_per_unit: f64,
    /// True if counts have the same zero in every recording.
    pub absolute: bool,
    /// Standard deviation of a reading beyond its quantisation, counts.
    pub noise_counts: f64,
    /// Travel per turn of the motor, rad or m.
    pub turn: Option<f64>,
    /// Recordings start at the same place within this, rad or m.
    pub start_spread: Option<f64>,
}

/// The use that a recording is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// To choose and to fit.
    Fit,
    /// To judge, once.
    Holdout,
}

/// One recording; all columns are as long as `time_s`.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The use that it is for.
    pub part: Part,
    /// Strictly increasing, s.
    pub time_s: Vec<f64>,
    /// The command, held until the next row, in the unit that `Rig::gain` is per.
    pub command: Vec<f64>,
    /// Readings in counts; noisy readings need not be whole.
    pub position_counts: Vec<f64>,
    /// Inclination below the horizontal, rad.
    pub tilt_rad: Option<Vec<f64>>,
    /// A measured external load, N·m or N.
    pub load: Option<Vec<f64>>,
}
