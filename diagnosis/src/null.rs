//! The null: the nominal structure refitted within its uncertainty, with the noise and the smoothed motion that go with it.

use crate::fit::Fit;
use crate::kalman::{Noise, smooth};
use crate::model::{Model, Nominal};
use crate::noise::{self, Colour};
use crate::track::{Total, Track};

/// Rests are dilated by this many blocks: the sign is uncertain next to a reversal.
const MARGIN: usize = 1;

/// Smooths the motion of every recording under a model's input and marks where the axis rests.
pub(crate) fn resmooth(tracks: &mut [Track], totals: &[Total], noise: &Noise) {
    for (track, total) in tracks.iter_mut().zip(totals) {
        let state = smooth(track, noise, total);
        let mut sd: Vec<f64> =
            state.v_sd.iter().zip(&track.rest).filter(|(_, rest)| !**rest).map(|(sd, _)| *sd).collect();
        if sd.len() < 10 {
            sd = state.v_sd.clone();
        }
        sd.sort_by(f64::total_cmp);
        let typical = sd[sd.len() / 2];
        let mut speeds: Vec<f64> = state.v.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        // A quarter of the fast speed is moving, whatever the noise estimate says.
        let fast = speeds[speeds.len() * 95 / 100];
        let floor = (2.5 * typical).min(0.25 * fast).max(1e-6 * fast);
        let slow: Vec<bool> = state.v.iter().map(|v| v.abs() < floor).collect();
        let n = slow.len();
        track.rest = (0..n)
            .map(|j| {
                let (a, b) = (j.saturating_sub(MARGIN), (j + MARGIN).min(n - 1));
                slow[a..=b].iter().any(|slow| *slow) || state.v[a] * state.v[b] <= 0.0
            })
            .collect();
        track.speed_floor = floor;
        track.x = state.x;
        track.v = state.v;
    }
}

/// Finds noise, motion and refitted values together, a few times round, from a first look without friction.
pub(crate) fn settle(nominal: &Nominal, tracks: &mut [Track]) -> (Noise, Fit) {
    let (mut square, mut rows) = (0.0, 0.0);
    for track in &*tracks {
        square += track.command.iter().map(|u| u * u).sum::<f64>();
        rows += track.command.len() as f64;
    }
    let scale = nominal.gain().abs() * (square / rows).sqrt().max(1e-12);
    let mut noise = noise::guess(tracks, scale);
    let totals: Vec<Total> = tracks
        .iter()
        .map(|track| {
            let mut total = Total::zero(track.blocks());
            track.rows_input(&track.command).add_to(&mut total, track, nominal.gain());
            total
        })
        .collect();
    noise = noise::estimate(tracks, &totals, &noise, scale, Colour::Slow);
    resmooth(tracks, &totals, &noise);
    let model = Model::default();
    let mut fit = Fit::new(&model, nominal, tracks, &noise);
    for _ in 0..2 {
        let totals = fit.totals(tracks);
        noise = noise::estimate(tracks, &totals, &noise, scale, Colour::Slow);
        resmooth(tracks, &totals, &noise);
        fit = Fit::new(&model, nominal, tracks, &noise);
    }
    (noise, fit)
}

#[cfg(test)]
mod look {
    use crate::{recording::Recording, rig::Rig};
    #[test]
    fn look() {
        for (name, fit, held) in [
            ("emps", vec!["train"], vec!["pulses"]),
            ("emps", vec!["pulses"], vec!["train"]),
            ("anticogging", vec!["tenth_rev_per_s_a", "tenth_rev_per_s_b"], vec!["slower_0_03_rev_per_s"]),
        ] {
            let dir = std::path::Path::new("/work/shared/recordings").join(name);
            let rig = Rig::read(&dir.join("rig.toml")).unwrap();
            let start = std::time::Instant::now();
            let read = |f: &Vec<&str>| {
                f.iter().map(|f| Recording::read(&dir.join(format!("{f}.csv"))).unwrap()).collect::<Vec<_>>()
            };
            let s = crate::pipeline::search(&rig, &read(&fit), &read(&held), &|_, _| ()).unwrap();
            println!("=== {name} {fit:?} {:?}", start.elapsed());
            for f in &s.found {
                println!(
                    "{} {:?} {:?} fit {:?} held {:?}",
                    f.effect.name, f.effect.shape, f.rivals, f.fit, f.holdout
                );
            }
            for l in &s.lost {
                println!("lost {l:?}");
            }
            println!("{:?} {:?}", s.last.fit.theta(0), s.last.noise);
            let t = crate::pipeline::table(&s);
            println!(
                "{:?} fit {:.2}% {:.2}% held {:.2}% {:.2}%",
                t,
                100.0 * t[2].0 / t[0].0,
                100.0 * t[3].0 / t[0].0,
                100.0 * t[2].1 / t[0].1,
                100.0 * t[3].1 / t[0].1
            );
        }
    }
}
