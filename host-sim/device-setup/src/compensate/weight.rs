//! Finds the weight that pulls at the needle when the device is tilted: the same slow turn to and
//! fro, once level and once tilted, differs in its mean torque by the weight alone. Friction acts
//! in both directions and waves go round, so that neither shows in the mean. Pure calculation.

use super::turns::TURNS;
use control_core::controller::Sample;
use control_core::{Device, TICK_HZ};

/// A tilt that differs by less says too little of a weight, rad.
const LEAST_TILT_RAD: f64 = 0.15;
/// Torque fades in within this, ticks.
const FADED: usize = TICK_HZ as usize / 2;

/// Returns the weight in mN·m at a tilt of 90°, or a sentence why it was not found. `level` and
/// `tilted` are the samples of the same turns.
pub fn find(level: &[Sample], tilted: &[Sample], device: &Device) -> Result<f64, String> {
    let [level, tilted] = [mean(level, device), mean(tilted, device)];
    let apart = tilted.sine - level.sine;
    if apart.abs() < LEAST_TILT_RAD {
        return Err(format!(
            "the weight is not fed forward: it shows only where the device is tilted by {:.0}° or more, and it was by {:.0}°",
            LEAST_TILT_RAD.to_degrees(),
            apart.asin().to_degrees()
        ));
    }
    // A weight that pulls the needle in saves the motor so much.
    Ok((level.torque_mnm - tilted.torque_mnm) / apart)
}

/// The means over a turn.
struct Mean {
    torque_mnm: f64,
    sine: f64,
}

/// The mean over one whole turn of the roller, as long on the way out as on the way in.
fn mean(samples: &[Sample], device: &Device) -> Mean {
    let mnm_per_code = device.full_scale_torque.0.to_num::<f64>() / f64::from(device.dac.span());
    let begin = samples.first().map_or(0, |sample| sample.count);
    let turn = f64::from(device.counts_per_turn);
    // The ends, where it turns back, do not count.
    let margin = (TURNS - 1.0) / 2.0;
    let place = |sample: &Sample| f64::from(sample.count - begin) / turn;
    let furthest =
        (0..samples.len()).max_by(|a, b| place(&samples[*a]).total_cmp(&place(&samples[*b]))).unwrap_or(0);
    let mut ways = [(0.0, 0.0, 0.0_f64); 2];
    for (at, sample) in samples.iter().enumerate().skip(FADED.min(samples.len())) {
        if !(margin..1.0 + margin).contains(&place(sample)) {
            continue;
        }
        let (torque, sine, count) = &mut ways[usize::from(at > furthest)];
        *torque += (f64::from(sample.dac) - f64::from(device.dac.mid_scale())) * mnm_per_code;
        *sine += (f64::from(sample.tilt_mrad) * 1e-3).sin();
        *count += 1.0;
    }
    let half = |value: fn(&(f64, f64, f64)) -> f64| {
        ways.iter().map(|way| value(way) / way.2.max(1.0)).sum::<f64>() / 2.0
    };
    Mean { torque_mnm: half(|way| way.0), sine: half(|way| way.1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow turn to and fro with dry friction, a wave and a weight of 1.5 mN·m.
    fn turn(tilt_rad: f64) -> Vec<Sample> {
        let device = Device::default();
        let per_code = device.full_scale_torque.0.to_num::<f64>() / f64::from(device.dac.span());
        let (ticks, turn) = (66_000_i32, f64::from(device.counts_per_turn));
        (0..2 * ticks)
            .map(|tick| {
                let inwards = tick < ticks;
                let turned =
                    TURNS * f64::from(if inwards { tick } else { 2 * ticks - tick }) / f64::from(ticks);
                let wave = 0.5 * (7.0 * std::f64::consts::TAU * turned + 0.4).sin();
                let torque = if inwards { 0.6 } else { -0.6 } + wave - 1.5 * tilt_rad.sin();
                Sample {
                    count: (turned * turn) as i32,
                    dac: (f64::from(device.dac.mid_scale()) + torque / per_code).round() as u16,
                    state: 6,
                    tilt_mrad: (tilt_rad * 1e3) as i16,
                }
            })
            .collect()
    }

    #[test]
    fn the_weight_shows_between_level_and_tilted() {
        let found = find(&turn(0.0), &turn(0.5), &Device::default()).expect("it was tilted");
        assert!((found - 1.5).abs() < 0.05, "{found}");
        let up = find(&turn(0.0), &turn(-0.4), &Device::default()).expect("it was tilted");
        assert!((up - 1.5).abs() < 0.05, "{up}");
    }

    #[test]
    fn a_device_that_was_not_tilted_shows_no_weight() {
        let why = find(&turn(0.0), &turn(0.05), &Device::default()).expect_err("it was not tilted");
        assert!(why.contains("by 9°") && why.contains("by 3°"), "{why}");
        assert!(find(&[], &[], &Device::default()).is_err());
    }
}
