//! `commission --weigh`: a known weight on the needle shows whether the force that the device asks
//! for is the force that it gives. The needle points down and is moved slowly down and up, without
//! the weight and with it: friction acts in both directions and does not show in the mean, and what
//! pulls without the weight too does not show in the difference.

use super::{CommissioningOutcome, CommissioningStep, prove, to_toml};
use crate::bench::{Act, DeviceDialogue, Line};
use control_core::compensation::Compensation;
use control_core::config::Sensors;
use control_core::controller::Sample;
use control_core::event::Fault;
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use control_core::{Device, TICK_HZ};
use device_sim::error::Error;
use fixed::types::{I8F24, I16F16};
use link::commissioning::Record;
use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

const GRAVITY: f64 = 9.81;
/// The way down and up, mm, and its speed, mm/s: a cycle takes 2 s.
const STROKE_MM: f64 = 6.0;
const SPEED_MM_S: f64 = 6.0;
const CYCLE_TICKS: usize = 2 * TICK_HZ as usize;
/// Cycles in which a person lets go of the weight, and cycles that are measured.
const FIRST_CYCLES: usize = 2;
const CYCLES: usize = 3;
/// Further than it sags and moves, mm.
const TRAVEL_MM: i32 = 40;
/// The servo's frequency in rad/s, and its damping ratio without the weight: so soft that a motor
/// of twice its torque does not ring on a speed that is known 6 ms late.
const SERVO_RAD_PER_S: f64 = 40.0;
const DAMPING_RATIO: f64 = 0.5;
/// Time to point the needle down.
const TILTING: Duration = Duration::from_secs(4);
/// The least sine of the tilt, 64°, and the largest change of the tilt between both runs, rad.
const LEAST_SINE: f64 = 0.9;
const SAME_TILT: f64 = 0.05;
/// The torque may be off by this factor either way; more is another mistake than a torque constant.
const LARGEST_FACTOR: f64 = 2.6;
/// A weight lighter than this many times the dry friction is lost in it.
const TIMES_FRICTION: f64 = 3.0;
/// Standard uncertainties: of the needle's tilt against the sensor's, rad, and of the weight with
/// friction that differs by direction, as a share.
const TILT_RAD: f64 = 0.03;
const WEIGHT_SHARE: f64 = 0.005;
/// The largest uncertainty that is kept, two standard deviations, as a share.
const LARGEST_UNCERTAINTY: f64 = 0.1;

/// The weight, and what is to become of the finding.
#[derive(Clone, Copy, Debug)]
pub struct WeighWish {
    /// The weight in g.
    pub grams: f64,
    /// Corrects the torque at full scale where it is wrong; the device is commissioned again then.
    pub correct: bool,
}

/// The result.
#[derive(Clone, Debug)]
pub struct WeighOutcome {
    /// The device's part, as the device has it now, under its seal.
    pub record: Record,
    /// The force that the device gave for each newton that it asked for.
    pub factor: f64,
    /// Two standard deviations of it, as a share.
    pub uncertainty: f64,
    /// True if the torque at full scale was corrected.
    pub is_corrected: bool,
}

impl WeighOutcome {
    /// Returns the result, one line each.
    pub fn lines(&self) -> Vec<String> {
        let full_scale = self.record.device.full_scale_torque.0;
        vec![
            format!(
                "1 N asked for was {:.3} N at the needle, within {:.1} %",
                self.factor,
                self.uncertainty * 1e2
            ),
            if self.is_corrected {
                format!("torque at full scale corrected to {full_scale:.2} mN·m; compensate again")
            } else {
                format!("torque at full scale {full_scale:.2} mN·m is right within that")
            },
        ]
    }

    /// Returns the device's part as a file, with the findings as comments.
    pub fn to_toml(&self, name: &str) -> Result<String, Error> {
        to_toml(name, &self.lines(), &self.record)
    }
}

/// Weighs on the commissioned device behind `line`; `ask` is called with each step before it is
/// done, and may end it.
pub async fn weigh(
    line: &mut dyn Line,
    wish: &WeighWish,
    mut ask: impl AsyncFnMut(CommissioningStep) -> Result<(), Error>,
) -> Result<WeighOutcome, Error> {
    let mut bench = DeviceDialogue::open(line).await?;
    let device = bench.device().await?;
    may_hang(&device, wish.grams)?;
    ask(CommissioningStep::PointStraightDown).await?;
    bench.settle().await?;
    bench.watch(Act::Tilt(FRAC_PI_2), TILTING, |_| false).await?;
    let bare = strokes(&mut bench, &device, 0.0).await?;
    ask(CommissioningStep::HangWeight(wish.grams)).await?;
    bench.settle().await?;
    let hung = strokes(&mut bench, &device, wish.grams).await?;
    let (factor, uncertainty) = found(&bare, &hung, &device, wish.grams)?;
    let is_right = (factor - 1.0).abs() <= uncertainty;
    let permille = (uncertainty * 1e3).ceil() as u16;
    let record = if is_right {
        let weighed = Device { torque_uncertainty: permille, ..device };
        bench.configure(&weighed).await?;
        bench.record().await?
    } else if wish.correct {
        correct(&mut bench, &device, factor, permille, &mut ask).await?.record
    } else {
        return Err(Error::failed(format_args!(
            "1 N asked for is {factor:.3} N at the needle, within {:.1} %, and nothing was changed; weigh again with --correct to correct the torque at full scale",
            uncertainty * 1e2
        )));
    };
    Ok(WeighOutcome { record, factor, uncertainty, is_corrected: !is_right })
}

/// Checks that the motor carries the weight even if it gives half of what it should.
fn may_hang(device: &Device, grams: f64) -> Result<(), Error> {
    if !device.commissioned {
        return Err(Error::failed("the device has not been commissioned; run host-sim commission first"));
    }
    let limits = &device.limits;
    let radius_mm = device.roller_radius.0.to_num::<f64>();
    let friction_n = device.mechanism.dry_friction.0.to_num::<f64>();
    let most_mnm = limits.torque.0.min(limits.continuous_torque.0).to_num::<f64>();
    let heaviest = 1e3 / GRAVITY * (most_mnm / radius_mm / 2.0 - friction_n);
    let lightest = 1e3 / GRAVITY * TIMES_FRICTION * friction_n;
    if heaviest < lightest {
        return Err(Error::failed(
            "the motor carries no weight that its friction would not hide; reduce the friction of rollers and bearings",
        ));
    }
    if !(lightest..=heaviest).contains(&grams) {
        return Err(Error::input(format_args!(
            "--weigh is {grams} g; with this motor and this friction it must be from {:.0} to {:.0} g",
            lightest.ceil(),
            heaviest.floor()
        )));
    }
    Ok(())
}

/// The slow way down and up, held as softly as a weight of `grams` needs.
fn down_and_up(device: &Device, grams: f64) -> Excitation {
    let bare_kg = device.mechanism.mass.0.to_num::<f64>() * 1e-3;
    let stiffness = (bare_kg + grams * 1e-3) * SERVO_RAD_PER_S.powi(2);
    let damping = 2.0 * DAMPING_RATIO * bare_kg * SERVO_RAD_PER_S;
    let stiffness = Stiffness(I16F16::saturating_from_num(1e-3 * stiffness));
    Excitation {
        signal: Signal::Triangle {
            stroke: Millimetres(I16F16::from_num(STROKE_MM)),
            speed: MillimetresPerSecond(I16F16::from_num(SPEED_MM_S)),
        },
        duration_ms: ((FIRST_CYCLES + CYCLES) * CYCLE_TICKS) as u32 / (TICK_HZ / 1_000),
        servo: Servo {
            stiffness: stiffness.min(device.limits.stiffness),
            damping: Damping(I8F24::saturating_from_num(1e-3 * damping)),
        },
        travel: Millimetres(I16F16::from_num(TRAVEL_MM)),
        compensated: false,
    }
}

/// The mean torque asked for of each measured cycle, mN·m, and the tilt, rad.
struct Strokes {
    torques: [f64; CYCLES],
    tilt: f64,
}

/// Moves the needle with `grams` on it.
async fn strokes(bench: &mut DeviceDialogue<'_>, device: &Device, grams: f64) -> Result<Strokes, Error> {
    bench.act(Act::Hang(grams));
    let excitation = down_and_up(device, grams);
    let longest = Duration::from_millis(u64::from(excitation.duration_ms) + 5_000);
    let played = bench.play_within(&excitation, longest).await;
    bench.act(Act::Hang(0.0));
    match played? {
        (samples, None) => means(&samples, device),
        (_, Some(fault)) => Err(Error::failed(match fault {
            Fault::WrongWay | Fault::Travel | Fault::Overspeed | Fault::EncoderJump if grams == 0.0 => {
                "the needle ran away from the motor; its leads or the encoder's channels were swapped since commissioning, so run host-sim commission again".into()
            }
            Fault::WrongWay | Fault::Travel | Fault::Overspeed | Fault::EncoderJump => {
                "the motor did not hold the needle; see that nothing but the weight pulls at it, hang a lighter one, and weigh again".into()
            }
            fault => format!("{fault}; weigh again"),
        })),
    }
}

/// The mean over the middle half of the way down and of the way up, cycle by cycle: as many samples
/// of either at the same places.
fn means(samples: &[Sample], device: &Device) -> Result<Strokes, Error> {
    const SHORT: &str = "the device sent fewer samples than it played; weigh again";
    let mnm_per_code = device.full_scale_torque.0.to_num::<f64>() / f64::from(device.dac.span());
    let middle = f64::from(device.dac.mid_scale());
    let leg = CYCLE_TICKS / 2;
    let mut torques = [0.0; CYCLES];
    let (mut tilt, mut count) = (0.0, 0.0);
    for (cycle, torque) in (FIRST_CYCLES..).zip(&mut torques) {
        for from in [cycle * CYCLE_TICKS + leg / 4, cycle * CYCLE_TICKS + leg + leg / 4] {
            let way = samples.get(from..from + leg / 2).ok_or_else(|| Error::failed(SHORT))?;
            let codes: f64 = way.iter().map(|sample| f64::from(sample.dac) - middle).sum();
            *torque += codes * mnm_per_code / leg as f64;
            tilt += way.iter().map(|sample| f64::from(sample.tilt_mrad) * 1e-3).sum::<f64>();
            count += way.len() as f64;
        }
    }
    Ok(Strokes { torques, tilt: tilt / count })
}

/// The force given for each newton asked for, and two standard deviations of it as a share.
fn found(bare: &Strokes, hung: &Strokes, device: &Device, grams: f64) -> Result<(f64, f64), Error> {
    let sine = hung.tilt.sin();
    if sine < LEAST_SINE || (hung.tilt - bare.tilt).abs() > SAME_TILT {
        return Err(Error::failed(format_args!(
            "the needle pointed down by {:.0}° without the weight and by {:.0}° with it; fix it within a degree of 90° and weigh again",
            bare.tilt.to_degrees(),
            hung.tilt.to_degrees()
        )));
    }
    let mean = |of: &Strokes| of.torques.iter().sum::<f64>() / CYCLES as f64;
    let variance = |of: &Strokes| {
        let sum: f64 = of.torques.iter().map(|torque| (torque - mean(of)).powi(2)).sum();
        sum / (CYCLES * (CYCLES - 1)) as f64
    };
    // The weight pulls the needle in, so the motor is asked for that much outwards.
    let carried = mean(bare) - mean(hung);
    let weight = grams * 1e-3 * GRAVITY * sine * device.roller_radius.0.to_num::<f64>();
    if carried < -weight / LARGEST_FACTOR {
        return Err(Error::failed(
            "the weight pulled the needle outwards as the device counts: the roller was turned the wrong way at commissioning; run host-sim commission again",
        ));
    }
    if !(weight / LARGEST_FACTOR..=weight * LARGEST_FACTOR).contains(&carried) {
        return Err(Error::failed(format_args!(
            "{weight:.1} mN·m hang on the needle and the device asked for {carried:.1}: see that the weight is {grams} g, hangs free and that the needle does not slip, and weigh again"
        )));
    }
    let scatter = (variance(bare) + variance(hung)).sqrt() / carried;
    let tilt = TILT_RAD * hung.tilt.cos() / sine + TILT_RAD * TILT_RAD / 2.0;
    let uncertainty = 2.0 * (scatter.powi(2) + tilt.powi(2) + WEIGHT_SHARE.powi(2)).sqrt();
    if uncertainty > LARGEST_UNCERTAINTY {
        return Err(Error::failed(format_args!(
            "the torque scattered by {:.0} % from stroke to stroke; see that the weight hangs still and nothing rubs, and weigh again",
            uncertainty * 1e2
        )));
    }
    Ok((weight / carried, uncertainty))
}

/// Gives the device `factor` times its torque at full scale, and has it prove itself again.
async fn correct(
    bench: &mut DeviceDialogue<'_>,
    before: &Device,
    factor: f64,
    permille: u16,
    ask: &mut impl AsyncFnMut(CommissioningStep) -> Result<(), Error>,
) -> Result<CommissioningOutcome, Error> {
    let full_scale = I16F16::from_num(before.full_scale_torque.0.to_num::<f64>() * factor);
    let mut device = Device {
        commissioned: false,
        full_scale_torque: MillinewtonMetres(full_scale),
        torque_uncertainty: permille,
        // They were found with the wrong torque.
        compensation: Compensation::NONE,
        sensors: Sensors::default(),
        ..*before
    };
    device.limits.torque.0 = device.limits.torque.0.min(full_scale);
    device.limits.stiffness = device.limits.stiffness.min(control_core::stiffest(&device));
    bench.configure(&device).await?;
    prove(bench, &mut device, before.limits.stiffness, ask).await
}
