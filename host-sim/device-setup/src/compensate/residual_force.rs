//! The force of the mechanism that a hand would feel, measured without a hand: the soft servo of
//! the device moves the roller slowly in and out and then holds it, and the servo's force is the
//! one that a hand would need. Pure calculation.
//!
//! Where the device feeds forward as well, its torque is not the servo's alone. The servo's is
//! computed again by the control core itself, from the same counts.

use control_core::controller::{LargeOrder, Sample, TickInput};
use control_core::excitation::{Excitation, Reference};
use control_core::units::{Counts, Milliradians};
use control_core::{Controller, Plan};
use device_sim::error::Error;

/// Ticks until torque has faded in; they do not count.
const FADED: usize = 5_000;
/// Parts of the travel.
pub const PARTS: usize = 10;

/// Force in N, root mean square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResidualForce {
    /// On the way in.
    pub insertion: f64,
    /// Held at rest.
    pub hold: f64,
    /// On the way out.
    pub withdrawal: f64,
    /// By tenth of the travel, from where it began; both ways together.
    pub by_tenth: [f64; PARTS],
}

impl ResidualForce {
    /// The three phases with their names.
    pub fn phases(&self) -> [(&'static str, f64); 3] {
        [("insertion", self.insertion), ("hold", self.hold), ("withdrawal", self.withdrawal)]
    }

    /// All three together.
    pub fn all(&self) -> f64 {
        ((self.insertion.powi(2) + self.hold.powi(2) + self.withdrawal.powi(2)) / 3.0).sqrt()
    }
}

/// Mean of squares.
#[derive(Clone, Copy, Default)]
struct Squares(f64, f64);

impl Squares {
    fn add(&mut self, x: f64) {
        self.0 += x * x;
        self.1 += 1.0;
    }

    fn root(self) -> f64 {
        (self.0 / self.1.max(1.0)).sqrt()
    }
}

/// From what was played: the turns and the hold, under `plan`.
pub fn measure(
    plan: &Plan,
    turns: (&Excitation, &[Sample]),
    hold: (&Excitation, &[Sample]),
) -> Result<ResidualForce, Error> {
    let (mut inwards, mut outwards, mut held) = (Squares::default(), Squares::default(), Squares::default());
    let mut tenths = [Squares::default(); PARTS];
    let moves = forces(plan, turns.0, turns.1)?;
    let furthest = moves.iter().map(|m| m.place_mm).fold(f64::MIN_POSITIVE, f64::max);
    for step in moves {
        if step.speed > 0.0 {
            inwards.add(step.force)
        } else {
            outwards.add(step.force)
        }
        let tenth = (step.place_mm / furthest * PARTS as f64).clamp(0.0, PARTS as f64 - 1.0);
        tenths[tenth as usize].add(step.force);
    }
    for step in forces(plan, hold.0, hold.1)? {
        held.add(step.force);
    }
    let by_tenth = tenths.map(Squares::root);
    Ok(ResidualForce { insertion: inwards.root(), hold: held.root(), withdrawal: outwards.root(), by_tenth })
}

struct StaircaseStep {
    place_mm: f64,
    speed: f64,
    /// N, the servo's.
    force: f64,
}

/// The servo's force in each tick.
fn forces(plan: &Plan, excitation: &Excitation, samples: &[Sample]) -> Result<Vec<StaircaseStep>, Error> {
    let refuse = |why: control_core::Refusal| Error::input(format_args!("this excitation is refused: {why}"));
    let device = *plan.device();
    // Counts are in the direction of insertion already.
    let plain = control_core::Device {
        encoder_reversed: false,
        motor_reversed: false,
        dac_zero: 0,
        compensation: control_core::compensation::Compensation::NONE,
        ..device
    };
    let plan = Plan::new(&plain, &control_core::Patient::nobody()).map_err(refuse)?;
    let middle = f64::from(plan.zero_torque_code().0);
    let radius = device.roller_radius.0.to_num::<f64>();
    let mnm_per_code = device.full_scale_torque.0.to_num::<f64>() / f64::from(device.dac.span());
    let mm_per_count = plan.mm_per_count().to_num::<f64>();
    let mut controller = Controller::new(plan);
    let mut reference = Reference::new(&excitation.signal);
    let begin = samples.first().map_or(0, |sample| sample.count);
    let mut first = true;
    let mut steps = Vec::with_capacity(samples.len());
    for (at, sample) in samples.iter().enumerate() {
        let input = TickInput { count: Counts(sample.count), tilt: Milliradians(sample.tilt_mrad) };
        if std::mem::take(&mut first) {
            controller.tick(input);
            controller.order(LargeOrder::Excite(Excitation { compensated: false, ..excitation.clone() }));
        }
        controller.heartbeat();
        let output = controller.tick(input);
        let speed = reference.tick().speed.0.to_num();
        if at >= FADED {
            steps.push(StaircaseStep {
                place_mm: f64::from(sample.count - begin) * mm_per_count,
                speed,
                force: (f64::from(output.sample.dac) - middle) * mnm_per_code / radius,
            });
        }
    }
    Ok(steps)
}
