//! A second mass behind a gap, a grip or a spring, as a patched rig parametrises it: what a rigid
//! machine misses of it, by the command and the motor's motion.
//!
//! With the shares of inertia 1/(1+r) and r/(1+r), drive D/J = d, friction f and forces p on the
//! whole, per inertia, the motor's lead over its load follows w″ = (1+r)·(d − y) − …, where y is
//! what the joint carries.

use std::f64::consts::TAU;

use super::rig::Entry;

/// The joint's inputs at a row.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Instant {
    /// After the command's own effects, in the rig's unit.
    pub(crate) command: f64,
    pub(crate) speed: f64,
    /// Measured external load, N·m or N.
    pub(crate) external: f64,
    /// sin(tilt).
    pub(crate) tilt: f64,
    /// Offset over inertia.
    pub(crate) bias: f64,
    pub(crate) step: f64,
}

/// A gap of full width or a grip with a ceiling.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    grip: bool,
    half_gap: f64,
    /// Natural frequency of the contact, rad/s.
    contact: f64,
    ratio: f64,
    per_command: f64,
    dry: f64,
    viscous: f64,
    per_force: f64,
    weight: f64,
    /// Deceleration of the load by its own friction, and its share of the whole.
    coast: f64,
    share: f64,
    limit: f64,
    creep: f64,
    /// Lead of the motor over its load and its rate; unknown before the first command.
    lead: Option<[f64; 2]>,
}

/// Damping of the contact of a gap.
const DAMPING: f64 = 0.3;
/// Time in which friction stops a load, s.
const HOLDING: f64 = 1e-3;

impl Joint {
    /// From the entry of `backlash` or `roller_slip`.
    pub(crate) fn new(entry: &Entry) -> Self {
        let (dry, coast) = (entry.shape("dry", 0.0), entry.shape("coast", 0.0));
        Self {
            grip: entry.name == "roller_slip",
            half_gap: 0.5 * entry.shape("gap", 0.0),
            contact: TAU * entry.shape("contact_hz", 200.0),
            ratio: entry.shape("ratio", 1.0),
            per_command: entry.shape("per_command", 1.0),
            dry,
            viscous: entry.shape("viscous", 0.0),
            per_force: entry.shape("per_force", 0.0),
            weight: entry.shape("weight", 0.0),
            coast,
            share: if dry > 0.0 { coast / dry } else { 1.0 },
            limit: entry.shape("limit", f64::INFINITY),
            creep: entry.shape("creep", 1e-3),
            lead: None,
        }
    }

    /// Command that moves the motor alone, mean over the row: the term that `inertia_ratio`
    /// multiplies.
    pub(crate) fn term(&mut self, at: &Instant) -> f64 {
        let drive = at.command * self.per_command;
        let [mut lead, mut rate] = self.lead.unwrap_or([drive.signum() * self.half_gap, 0.0]);
        let finest = if self.grip { 1.2e-3 } else { 0.35 / self.contact };
        let steps = (at.step / finest).ceil().clamp(1.0, 400.0);
        let h = at.step / steps;
        let whole = 1.0 + self.ratio;
        let way = if at.speed == 0.0 { 0.0 } else { at.speed.signum() };
        let friction = self.dry * way + self.viscous * at.speed;
        let pulled = (self.per_force * at.external + self.weight * at.tilt + at.bias) / self.ratio;
        let apart = whole * pulled + (1.0 + self.ratio * (1.0 - self.share)) * friction;
        let mut sum = 0.0;
        for _ in 0..steps as usize {
            let load = at.speed - rate;
            let brake = self.coast * (load / (self.coast * HOLDING).max(1e-12)).clamp(-1.0, 1.0)
                + self.share * self.viscous * load;
            let carried = if self.grip {
                let most = self.limit.abs() * self.per_command.abs();
                let free = rate + (whole * drive - apart + brake) * h;
                // Implicit: the grip follows faster than a step is long.
                rate = slide(free / self.creep, whole * most * h / self.creep) * self.creep;
                most * traction(rate / self.creep)
            } else {
                let beyond = lead - lead.clamp(-self.half_gap, self.half_gap);
                let push = self.contact * (self.contact * beyond + 2.0 * DAMPING * rate) / whole;
                // A flank pushes and never pulls.
                let carried = if beyond * push > 0.0 { push } else { 0.0 };
                rate += (whole * (drive - carried) - apart + brake) * h;
                lead += rate * h;
                carried
            };
            sum += drive - carried;
        }
        self.lead = Some([lead, rate]);
        let missed = (1.0 - self.share) * friction + pulled;
        (sum / steps - missed) / self.per_command
    }
}

/// Part of its ceiling that a rolling contact carries, by its creep over half the creep at which
/// all of it slides (Carter).
fn traction(creep: f64) -> f64 {
    if creep.abs() < 2.0 { creep - 0.25 * creep * creep.abs() } else { creep.signum() }
}

/// x with x + most · traction(x) = pushed, by bisection: it grows with x.
fn slide(pushed: f64, most: f64) -> f64 {
    let (mut low, mut high) = (0.0, pushed.abs());
    for _ in 0..48 {
        let x = 0.5 * (low + high);
        if x + most * traction(x) < pushed.abs() {
            low = x;
        } else {
            high = x;
        }
    }
    0.5 * (low + high) * pushed.signum()
}

/// A load on a spring, seen from the motor: s²/(s² + 2ζωs + ω²) of a held force, mean over the row.
#[derive(Clone, Debug)]
pub(crate) struct Resonance {
    omega: f64,
    zeta: f64,
    state: Option<[f64; 2]>,
}

impl Resonance {
    /// From the entry of `drive_compliance`.
    pub(crate) fn new(entry: &Entry) -> Self {
        let zeta = entry.shape("damping", 0.05).clamp(1e-4, 0.99);
        Self { omega: TAU * entry.shape("resonance_hz", 1.0), zeta, state: None }
    }

    /// The term that `inertia_ratio` multiplies, for a force held over `step`.
    pub(crate) fn term(&mut self, force: f64, step: f64) -> f64 {
        let w2 = self.omega * self.omega;
        // At the start the spring carries the standing force.
        let [x, v] = self.state.unwrap_or([force / w2, 0.0]);
        let (decay, damped) = (self.zeta * self.omega, self.omega * (1.0 - self.zeta * self.zeta).sqrt());
        let e = (-decay * step).exp();
        let (sin, cos) = (damped * step).sin_cos();
        // About the place where the spring carries this force.
        let y = x - force / w2;
        let next_y = e * (y * cos + (v + decay * y) / damped * sin);
        let next_v = e * (v * cos - (decay * v + w2 * y) / damped * sin);
        self.state = Some([next_y + force / w2, next_v]);
        (next_v - v) / step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, shape: &[(&str, f64)]) -> Entry {
        let shape = shape.iter().map(|(k, v)| ((*k).to_string(), *v)).collect();
        Entry { name: name.into(), shape, coefficients: Default::default(), table: None }
    }

    #[test]
    fn a_joint_that_carries_all_misses_nothing() {
        let stiff = entry("backlash", &[("gap", 1e-9), ("contact_hz", 200.0), ("per_command", 100.0)]);
        let mut joint = Joint::new(&stiff);
        let at = Instant { command: 1.0, speed: 1.0, step: 1e-3, ..Instant::default() };
        // The load takes its share through the contact: half of the drive with a ratio of one.
        let last = (0..3000).map(|_| joint.term(&at)).last().unwrap();
        assert!(last.abs() < 0.02, "{last}");
        let grip = entry("roller_slip", &[("limit", 0.4), ("per_command", 100.0), ("creep", 0.01)]);
        let mut joint = Joint::new(&grip);
        let last = (0..3000).map(|_| joint.term(&at)).last().unwrap();
        // What is beyond the ceiling goes to the motor alone.
        assert!((last - 0.6).abs() < 0.02, "{last}");
    }

    #[test]
    fn a_spring_follows_the_slow_and_lets_go_of_the_fast() {
        let spring = entry("drive_compliance", &[("resonance_hz", 20.0), ("damping", 0.3)]);
        let gain = |hz: f64| {
            let mut resonance = Resonance::new(&spring);
            let terms: Vec<f64> =
                (0..20_000).map(|i| resonance.term((TAU * hz * f64::from(i) * 1e-4).sin(), 1e-4)).collect();
            terms[10_000..].iter().fold(0.0_f64, |m, x| m.max(x.abs()))
        };
        assert!(gain(1.0) < 0.01 && (gain(800.0) - 1.0).abs() < 0.02, "{} {}", gain(1.0), gain(800.0));
    }
}
