//! The laws of a plain regression, each on a few shapes, as one or two columns on the same side of
//! the equation as the drive's force: the additional force that the drive has to give. They see a
//! motion that was differentiated from the readings, and share nothing with the laws that the
//! filter fits.

use super::EffectName as N;
use std::f64::consts::TAU;

/// The motion of a recording on an even grid, one value a point.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlainMotion {
    /// s, from the first row.
    pub(crate) time: Vec<f64>,
    /// rad or m, from the first row, or from the zero of absolute counts.
    pub(crate) place: Vec<f64>,
    /// rad/s or m/s.
    pub(crate) speed: Vec<f64>,
    /// Sign of the motion; zero at rest.
    pub(crate) direction: Vec<f64>,
    /// Travel since the last reversal, rad or m.
    pub(crate) since_reversal: Vec<f64>,
    /// Sine of the inclination.
    pub(crate) tilt: Vec<f64>,
    /// N·m or N.
    pub(crate) load: Vec<f64>,
    /// The drive's force by the rig's gain, N·m or N.
    pub(crate) drive: Vec<f64>,
    /// Points a second, and the band of the regression, Hz.
    pub(crate) rate_hz: f64,
    pub(crate) band_hz: f64,
}

impl PlainMotion {
    fn len(&self) -> usize {
        self.time.len()
    }

    /// True if the inclination changes by more than its sensor trembles: the force of one that does
    /// not is an offset.
    fn tilts(&self) -> bool {
        let square = |less: f64| self.tilt.iter().map(|x| (x - less).powi(2)).sum::<f64>();
        let mean = self.tilt.iter().sum::<f64>() / self.tilt.len().max(1) as f64;
        square(mean) > TILTS * square(0.0)
    }

    fn seconds(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0)
    }

    /// A signal that comes later by a time.
    fn delayed(&self, signal: &[f64], seconds: f64) -> Vec<f64> {
        let last = signal.len().saturating_sub(1);
        let at = |i: usize| {
            let x = (i as f64 - seconds * self.rate_hz).clamp(0.0, last as f64);
            let j = (x as usize).min(last.saturating_sub(1));
            signal[j] + (signal[(j + 1).min(last)] - signal[j]) * (x - j as f64)
        };
        (0..signal.len()).map(at).collect()
    }

    /// A signal behind a first-order lag.
    fn lagged(&self, signal: &[f64], seconds: f64) -> Vec<f64> {
        let keep = (-1.0 / (self.rate_hz * seconds)).exp();
        let mut state = signal.first().copied().unwrap_or(0.0);
        let mut last = state;
        let next = |x: &f64| {
            state = keep * state + (1.0 - keep) * 0.5 * (x + last);
            last = *x;
            state
        };
        signal.iter().map(next).collect()
    }

    /// Change a second, by the points on both sides.
    fn rate(&self, signal: &[f64]) -> Vec<f64> {
        let last = signal.len().saturating_sub(1);
        let at = |i: usize| {
            let (low, high) = (i.saturating_sub(1), (i + 1).min(last));
            (signal[high] - signal[low]) * self.rate_hz / (high - low).max(1) as f64
        };
        (0..signal.len()).map(at).collect()
    }
}

/// The facts about a rig on which laws depend.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlainRig {
    /// True if its nominal model has the term.
    pub(crate) has_viscous: bool,
    pub(crate) has_coulomb: bool,
    pub(crate) has_weight: bool,
    /// True if a place of one recording is known in another.
    pub(crate) knows_place: bool,
    /// Travel of one turn, rad or m, where the axis has turns.
    pub(crate) turn: Option<f64>,
    pub(crate) is_rotary: bool,
    /// True if the axis moves one way only.
    pub(crate) one_way: bool,
}

/// Part of the inclination's mean square by which it has to swing about its mean.
const TILTS: f64 = 1e-3;

/// Columns of a law on a motion, from the drive's force that is predicted.
type Columns = Box<dyn Fn(&PlainMotion, &[f64]) -> Vec<Vec<f64>> + Send + Sync>;

/// One law with one shape.
pub(crate) struct PlainLaw {
    pub(crate) name: N,
    pub(crate) columns: Columns,
    /// True if every recording has a phase of its own: sine and cosine.
    pub(crate) periodic: bool,
    /// True if it acts on the command that is predicted.
    pub(crate) by_command: bool,
}

/// Laws that are being gathered.
struct Laws(Vec<PlainLaw>);

impl Laws {
    fn of_motion(&mut self, name: N, value: impl Fn(&PlainMotion, usize) -> f64 + Send + Sync + 'static) {
        let columns: Columns = Box::new(move |m, _| vec![(0..m.len()).map(|i| value(m, i)).collect()]);
        self.0.push(PlainLaw { name, columns, periodic: false, by_command: false });
    }

    fn of_command(
        &mut self,
        name: N,
        value: impl Fn(&PlainMotion, &[f64]) -> Vec<f64> + Send + Sync + 'static,
    ) {
        let columns: Columns = Box::new(move |m, drive| vec![value(m, drive)]);
        self.0.push(PlainLaw { name, columns, periodic: false, by_command: true });
    }

    /// Sine and cosine of a multiple of the angle, times the drive's force where `by_command`.
    fn wave(&mut self, name: N, radians: f64, by_command: bool) {
        let columns: Columns = Box::new(move |m, drive| {
            let factor = |i: usize| if by_command { drive[i] } else { 1.0 };
            let of = |wave: fn(f64) -> f64| -> Vec<f64> {
                (0..m.len()).map(|i| factor(i) * wave(radians * m.place[i])).collect()
            };
            vec![of(f64::sin), of(f64::cos)]
        });
        self.0.push(PlainLaw { name, columns, periodic: true, by_command });
    }

    fn friction(&mut self, rig: &PlainRig, scale: &Scale, motions: &[PlainMotion]) {
        if !rig.has_viscous {
            self.of_motion(N::ViscousFriction, |m, i| m.speed[i]);
        }
        if !rig.has_coulomb {
            self.of_motion(N::CoulombFriction, |m, i| m.direction[i]);
        }
        if !rig.one_way {
            self.of_motion(N::AsymmetricFriction, |m, i| m.speed[i].abs());
        }
        self.of_motion(N::QuadraticDrag, |m, i| m.speed[i] * m.speed[i].abs());
        for part in [0.03, 0.06, 0.12, 0.25] {
            let speed = part * scale.fast;
            let law = move |m: &PlainMotion, i: usize| m.direction[i] * (-m.speed[i].abs() / speed).exp();
            self.of_motion(N::StribeckFriction, law);
        }
        for part in [0.01, 0.03, 0.1, 0.3] {
            let length = part * scale.stroke;
            let law =
                move |m: &PlainMotion, i: usize| -m.direction[i] * (-m.since_reversal[i] / length).exp();
            self.of_motion(N::PreslidingFriction, law);
        }
        for part in [0.1, 0.2, 0.4] {
            let time = part * scale.seconds;
            self.of_motion(N::FrictionDrift, move |m, i| m.direction[i] * (-m.time[i] / time).exp());
        }
        if motions.iter().all(|m| m.load.iter().any(|f| *f != 0.0)) {
            self.of_motion(N::LoadDependentFriction, |m, i| m.direction[i] * m.load[i].abs());
        }
    }

    fn along_travel(&mut self, rig: &PlainRig, motions: &[PlainMotion]) {
        self.of_motion(N::PositionSpring, |m, i| m.place[i]);
        if !rig.has_weight && motions.iter().all(PlainMotion::tilts) {
            self.of_motion(N::TiltGravity, |m, i| -m.tilt[i]);
        }
        if rig.knows_place {
            self.of_motion(N::PositionDependentFriction, |m, i| m.direction[i] * m.place[i]);
            self.of_motion(N::PositionDependentDamping, |m, i| m.speed[i] * m.place[i]);
        }
    }

    fn command(&mut self, scale: &Scale) {
        if scale.drive == 0.0 {
            return;
        }
        for part in [0.05, 0.15, 0.4] {
            let width = part * scale.drive;
            let law = move |_: &PlainMotion, u: &[f64]| u.iter().map(|u| u.clamp(-width, width)).collect();
            self.of_command(N::CommandDeadband, law);
        }
        for part in [0.4, 0.6, 0.8] {
            let limit = part * scale.drive;
            let law =
                move |_: &PlainMotion, u: &[f64]| u.iter().map(|u| u - u.clamp(-limit, limit)).collect();
            self.of_command(N::CommandSaturation, law);
        }
        self.of_command(N::CommandDelay, |m, u| m.rate(u));
        let less = |a: Vec<f64>, b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
        for part in [0.1, 0.3] {
            let late = part / scale.band_hz;
            let lag = move |m: &PlainMotion, u: &[f64]| less(m.lagged(u, late), u);
            self.of_command(N::ElectricalLag, lag);
            let delay = move |m: &PlainMotion, u: &[f64]| less(m.delayed(u, late), u);
            self.of_command(N::CommandDelay, delay);
        }
        for part in [0.1, 0.2, 0.4] {
            let time = part * scale.seconds;
            let law = move |m: &PlainMotion, u: &[f64]| {
                u.iter().zip(&m.time).map(|(u, t)| u * (1.0 - (-t / time).exp())).collect()
            };
            self.of_command(N::GainDrift, law);
        }
    }

    fn waves(&mut self, rig: &PlainRig, scale: &Scale) {
        let Some(turn) = rig.turn else { return };
        for order in (1..=ORDERS).map(f64::from) {
            let is_seen = order * scale.travel / turn >= PERIODS;
            let is_slow = order == 1.0 || order * scale.fast / turn <= 2.0 * scale.band_hz;
            if !is_seen || !is_slow {
                continue;
            }
            let radians = order * TAU / turn;
            let by_weight = order == 1.0 && rig.is_rotary;
            self.wave(if by_weight { N::MassImbalance } else { N::Cogging }, radians, false);
            self.wave(N::TorqueRipple, radians, true);
            if by_weight {
                self.eccentricity(radians);
            }
        }
    }

    /// The error of the inertia's force by a reading error once a turn.
    fn eccentricity(&mut self, radians: f64) {
        let columns: Columns = Box::new(move |m, _| {
            let of = |wave: fn(f64) -> f64| {
                let error: Vec<f64> = m.place.iter().map(|q| wave(radians * q)).collect();
                m.rate(&m.rate(&error))
            };
            vec![of(f64::sin), of(f64::cos)]
        });
        self.0.push(PlainLaw { name: N::EncoderEccentricity, columns, periodic: true, by_command: false });
    }
}

/// The orders of a turn that are tried, and the periods of each that a recording must hold.
const ORDERS: u32 = 48;
const PERIODS: f64 = 1.5;
/// A size that this part of the rows do not exceed counts as the largest.
const TOP: f64 = 0.98;

/// Sizes that all recordings have.
struct Scale {
    /// rad/s or m/s, exceeded in one row of fifty.
    fast: f64,
    /// Way between reversals, rad or m, in the same sense.
    stroke: f64,
    /// N·m or N, in the same sense.
    drive: f64,
    /// The shortest travel, time and band.
    travel: f64,
    seconds: f64,
    band_hz: f64,
}

impl Scale {
    fn of(motions: &[PlainMotion]) -> Self {
        let top = |of: fn(&PlainMotion) -> &[f64]| {
            let mut all: Vec<f64> = motions.iter().flat_map(|m| of(m).iter().map(|x| x.abs())).collect();
            all.sort_by(f64::total_cmp);
            all.get(((all.len().max(1) - 1) as f64 * TOP) as usize).copied().unwrap_or(0.0)
        };
        let least = |of: fn(&PlainMotion) -> f64| motions.iter().map(of).fold(f64::INFINITY, f64::min);
        let span = |m: &PlainMotion| {
            let ends = m.place.iter().fold((f64::MAX, f64::MIN), |(l, h), &q| (l.min(q), h.max(q)));
            ends.1 - ends.0
        };
        Self {
            fast: top(|m| &m.speed),
            stroke: top(|m| &m.since_reversal),
            drive: top(|m| &m.drive),
            travel: least(span),
            seconds: least(PlainMotion::seconds),
            band_hz: least(|m| m.band_hz),
        }
    }
}

/// Every law that the rig and the columns of the recordings allow.
pub(crate) fn plain_laws(rig: &PlainRig, motions: &[PlainMotion]) -> Vec<PlainLaw> {
    let (scale, mut laws) = (Scale::of(motions), Laws(Vec::new()));
    laws.friction(rig, &scale, motions);
    laws.along_travel(rig, motions);
    laws.command(&scale);
    laws.waves(rig, &scale);
    laws.0
}
