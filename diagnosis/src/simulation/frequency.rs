//! Frequency responses of a recording and of simulations of it: speed over command.

use super::Motion;
use crate::data::recording::Recording;
use numerics::even_grid::{cells, cubic};
use numerics::spectrum::{Band, response};
use std::f64::consts::PI;

/// Power of the command against its strongest band's from which a band counts as excited: 40 dB.
const EXCITED: f64 = 1e-4;
/// Power of the recorded speed against that of reading whole counts from which it counts as seen:
/// 10 dB. Below, a controller's command follows the reading and not the motion.
const SEEN: f64 = 10.0;

/// The speed's response to the command, in rad/s or m/s for one unit of command, in the bands that
/// the command excites and in which the encoder sees the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponse {
    /// As recorded.
    pub recorded: Vec<Band>,
    /// That of each model's free run under the recorded command, with its name, in the same bands;
    /// a model that runs away has none.
    pub models: Vec<(String, Vec<Band>)>,
}

impl FrequencyResponse {
    /// The responses of a recording, whose counts are `count` apart, and of the positions that
    /// models run to, rad or m; none where the recording is too short or shows no band.
    pub(super) fn new(
        recording: &Recording,
        motion: &Motion,
        count: f64,
        models: &[(&str, &[f64])],
    ) -> Option<Self> {
        let rows = motion.time.len();
        let step = motion.seconds() / rows.saturating_sub(1).max(1) as f64;
        if rows < 3 || step <= 0.0 {
            return None;
        }
        let at: Vec<f64> = (0..rows).map(|i| i as f64 * step).collect();
        let middles: Vec<f64> = at.iter().map(|t| t + 0.5 * step).collect();
        let command = cells(&motion.time, &recording.command, &middles, step);
        let response_to = |position: &[f64]| {
            let even = cubic(&motion.time, position, &at);
            let speed: Vec<f64> = even.windows(2).map(|pair| (pair[1] - pair[0]) / step).collect();
            response(&command, &speed, 1.0 / step)
        };
        let recorded = response_to(&motion.position);
        let most = recorded.iter().map(|band| band.input).fold(0.0, f64::max);
        let shows = |band: &Band| {
            let [re, im] = band.response;
            let speed = (re * re + im * im) * band.input / band.coherence.max(1e-12);
            // Reading has a variance of a twelfth of a squared count; a speed takes two of them.
            let slope = 2.0 * (PI * band.hertz * step).sin() / step;
            let reading = count * count / 6.0 * step * slope * slope;
            band.input > EXCITED * most && speed > SEEN * reading
        };
        let shown: Vec<bool> = recorded.iter().map(shows).collect();
        let excited = |bands: Vec<Band>| -> Vec<Band> {
            bands.into_iter().zip(&shown).filter_map(|(band, is_shown)| is_shown.then_some(band)).collect()
        };
        let far = 10.0 * motion.travel();
        let stays = |position: &[f64]| position.len() == rows && position.iter().all(|x| x.abs() < far);
        let models = models
            .iter()
            .map(|(name, position)| {
                let bands = if stays(position) { excited(response_to(position)) } else { Vec::new() };
                ((*name).to_owned(), bands)
            })
            .collect();
        let recorded = excited(recorded);
        (!recorded.is_empty()).then_some(Self { recorded, models })
    }
}

#[cfg(test)]
mod tests {
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::simulation::comparison::Comparison;
    use crate::simulation::{Plant, Surroundings};
    use std::f64::consts::TAU;

    #[test]
    fn the_response_is_that_of_inertia_and_friction() {
        let (inertia, viscous) = (2e-3, 2e-2);
        let [truth, wrong] = [1.0, 2.0].map(|by| Rig::of_values(by * inertia, viscous, 0.0));
        let mut plant = Plant::new(&truth);
        let mut csv = String::from("time_s,command,position_counts\n");
        for row in 0..12_000 {
            let t = f64::from(row) * 5e-3;
            // A slow sweep from 0.2 to 10 Hz, there and back.
            let command =
                0.05 * (TAU * (0.2 * t + 4.9 * (t - 30.0 / TAU * 2.0 * (TAU * t / 60.0).sin()))).sin();
            csv += &format!("{t:.4},{command:.6},{}\n", plant.counts());
            for _ in 0..50 {
                plant.step(command, Surroundings::default(), 1e-4);
            }
        }
        let recording = Recording::parse(&csv, "bench.csv").expect("it keeps the contract");
        let gain = truth.actuator.gain;
        let models = [("nominal".to_owned(), wrong), ("patched".to_owned(), truth)];
        let compared = Comparison::new(&recording, &models, &[]);
        let found = compared.response.expect("it is long enough");
        let all =
            [(&found.recorded, inertia), (&found.models[0].1, 2.0 * inertia), (&found.models[1].1, inertia)];
        for (bands, inertia) in all {
            let seen: Vec<_> =
                bands.iter().filter(|b| (0.5..8.0).contains(&b.hertz) && b.coherence > 0.95).collect();
            assert!(seen.len() > 12, "{bands:?}");
            for band in seen {
                let w = TAU * band.hertz;
                let [re, im] = band.response;
                let size = gain / (w * inertia).hypot(viscous);
                let phase = -(w * inertia / viscous).atan();
                // Of few averages at a coherence of 0.95 to 0.99.
                assert!((re.hypot(im) / size - 1.0).abs() < 0.1, "{band:?}: {size}");
                assert!((im.atan2(re) - phase).abs() < 0.1, "{band:?}: {phase}");
            }
        }
    }
}
