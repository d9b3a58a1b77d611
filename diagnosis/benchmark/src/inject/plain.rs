//! The plain rival: forward selection by least squares on shares of the force error, as an engineer
//! writes it in an evening. A law counts by the smaller of its reductions on stretches left out of
//! the fit and on the held-out recordings, and only if its size is the same on both within a factor
//! of two; the one that takes most goes in. Laws of the command act on the command that the model
//! so far predicts, never on the recorded one, which holds the noise that is to be explained.

use std::rc::Rc;

use super::banded_recording::{BandedRecording, band};
use super::carrier::Carrier;
use super::plain_laws::{Candidate, candidates};
use super::regress::{Block, left_on, left_out, solve};

/// Laws that go in at most.
const MOST_LAWS: usize = 3;
/// Size on the held-out recordings over that on the others: within this factor.
const SAME_SIZE: f64 = 2.0;

/// A law that went in, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) name: &'static str,
    /// Share of the force error that it took.
    pub(crate) share: f64,
}

/// The columns of one law on every recording, those to fit on first.
struct Tried {
    name: &'static str,
    columns: Vec<Vec<Vec<f64>>>,
    /// Every recording has a phase of its own: two columns that only a recording's own coefficients
    /// may combine.
    periodic: bool,
}

/// Selects laws while the best takes `least` of the force error.
pub(crate) fn select(carrier: &Carrier, least: f64) -> Vec<Found> {
    let sights: Vec<BandedRecording> =
        carrier.recordings().map(|r| BandedRecording::of(r, &carrier.rig, band(r))).collect();
    let fits = carrier.fits.len();
    let mut taken: Vec<Rc<Tried>> = Vec::new();
    let mut found: Vec<Found> = Vec::new();
    let all = candidates(carrier, &sights);
    // What does not rest on the predicted command is the same in every round.
    let mut kept: Vec<Option<Rc<Tried>>> = all.iter().map(|_| None).collect();
    if sights.iter().any(|s| s.rows() < 40) {
        return found;
    }
    while found.len() < MOST_LAWS {
        let base = blocks(&sights, fits, &taken);
        let coefficients = solve(&base[..fits]);
        let errors = (left_out(&base[..fits]), held_out(&base[fits..], &coefficients, &taken, &sights));
        let predicted = predictions(&sights, &coefficients);
        let mut all_enough: Vec<(Found, Rc<Tried>)> = Vec::new();
        for (candidate, kept) in all.iter().zip(&mut kept) {
            if found.iter().any(|f| f.name == candidate.name) {
                continue;
            }
            let tried = match kept {
                Some(tried) => Rc::clone(tried),
                None => Rc::new(columns(candidate, &sights, &predicted)),
            };
            if !candidate.by_command {
                *kept = Some(Rc::clone(&tried));
            }
            let Some(share) = share(&sights, fits, &taken, &tried, errors) else { continue };
            if share < least {
                continue;
            }
            all_enough.push((Found { name: tried.name, share }, tried));
        }
        let most = all_enough.into_iter().max_by(|a, b| a.0.share.total_cmp(&b.0.share));
        let Some((next, tried)) = most else { break };
        found.push(next);
        taken.push(tried);
    }
    found
}

fn columns(candidate: &Candidate, sights: &[BandedRecording], predicted: &[Vec<f64>]) -> Tried {
    let of = |(sight, drive): (&BandedRecording, &Vec<f64>)| {
        (candidate.columns)(sight, drive).iter().map(|c| sight.see(c)).collect()
    };
    Tried {
        name: candidate.name,
        columns: sights.iter().zip(predicted).map(of).collect(),
        periodic: candidate.periodic,
    }
}

/// Nominal columns and those of the laws; a periodic law has two columns for every recording to fit
/// on.
fn blocks(sights: &[BandedRecording], fits: usize, laws: &[Rc<Tried>]) -> Vec<Block> {
    let one = |(r, sight): (usize, &BandedRecording)| {
        let mut columns = sight.nominal.clone();
        for law in laws {
            if !law.periodic {
                columns.extend(law.columns[r].iter().cloned());
                continue;
            }
            for own in 0..fits {
                let zero = || vec![0.0; sight.rows()];
                columns.extend(law.columns[r].iter().map(|c| if own == r { c.clone() } else { zero() }));
            }
        }
        Block { columns, target: sight.target.clone() }
    };
    sights.iter().enumerate().map(one).collect()
}

/// Rms left on the held-out recordings: the phase of a periodic law is found there, its amplitude
/// is not.
fn held_out(holdouts: &[Block], coefficients: &[f64], laws: &[Rc<Tried>], sights: &[BandedRecording]) -> f64 {
    let mut blocks: Vec<Block> = holdouts.to_vec();
    let mut at = sights[0].nominal.len();
    let fits = sights.len() - holdouts.len();
    for law in laws {
        if !law.periodic {
            at += law.columns[0].len();
            continue;
        }
        let amplitude =
            (0..fits).map(|r| coefficients[at + 2 * r].hypot(coefficients[at + 2 * r + 1])).sum::<f64>()
                / fits as f64;
        at += 2 * fits;
        for (i, block) in blocks.iter_mut().enumerate() {
            let pair = &law.columns[fits + i];
            let own = Block { columns: pair.clone(), target: block.left(coefficients) };
            let phase = solve(std::slice::from_ref(&own));
            let scale = amplitude / phase[0].hypot(phase[1]).max(1e-300);
            for (c, column) in phase.iter().zip(pair) {
                block.target.iter_mut().zip(column).for_each(|(t, x)| *t -= scale * c * x);
            }
        }
    }
    left_on(&blocks, coefficients)
}

/// The smaller of the two shares of the force error that a law takes; nothing where its sizes do
/// not agree.
fn share(
    sights: &[BandedRecording],
    fits: usize,
    taken: &[Rc<Tried>],
    tried: &Rc<Tried>,
    before: (f64, f64),
) -> Option<f64> {
    let mut laws = taken.to_vec();
    laws.push(Rc::clone(tried));
    let base = blocks(sights, fits, &laws);
    let coefficients = solve(&base[..fits]);
    let nominal = base[0].columns.len() - if tried.periodic { 2 * fits } else { tried.columns[0].len() };
    // The held-out recordings alone, with a phase of their own.
    let alone: Vec<Block> = (fits..sights.len())
        .map(|r| {
            let mut columns = sights[r].nominal.clone();
            for law in &laws {
                columns.extend(law.columns[r].iter().cloned());
            }
            Block { columns, target: sights[r].target.clone() }
        })
        .collect();
    let there = solve(&alone[..if tried.periodic { 1 } else { alone.len() }]);
    let size = |c: &[f64]| if tried.periodic { c[0].hypot(c[1]) } else { c[0] };
    let (a, b) = (size(&coefficients[nominal..]), size(&there[there.len() - tried.columns[0].len()..]));
    let ratio = if a == 0.0 { 0.0 } else { b / a };
    if !(1.0 / SAME_SIZE..=SAME_SIZE).contains(&ratio) {
        return None;
    }
    let left = 1.0 - left_out(&base[..fits]) / before.0;
    let held = 1.0 - held_out(&base[fits..], &coefficients, &laws, sights) / before.1;
    let least = left.min(held);
    least.is_finite().then_some(least)
}

/// The drive's force that the nominal model alone asks for, on every recording's grid: the forces
/// of the laws so far are small compared with it.
fn predictions(sights: &[BandedRecording], coefficients: &[f64]) -> Vec<Vec<f64>> {
    sights
        .iter()
        .map(|sight| {
            let mut drive = vec![sight.mean_drive(); sight.time.len()];
            for (c, column) in coefficients.iter().zip(&sight.nominal_grid) {
                drive.iter_mut().zip(column).for_each(|(d, x)| *d += c * x);
            }
            drive
        })
        .collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::rig_file::RigFile;
    use super::*;
    use crate::dynamics::recording::Recording;
    use crate::rng::Rng;

    /// An axis of inertia 2 and dry friction 0.5 that swings, with a force more and noise.
    fn recording(seed: u64, extra: impl Fn(f64, f64) -> f64) -> Recording {
        let mut rng = Rng::new(seed);
        let mut r = Recording::default();
        for i in 0..8000 {
            let t = i as f64 * 2e-3;
            let (a, b) = (1.7 + 0.1 * seed as f64, 4.1);
            let q = 3.0 * (a * t).sin() + 0.7 * (b * t).sin();
            let v = 3.0 * a * (a * t).cos() + 0.7 * b * (b * t).cos();
            let acceleration = -3.0 * a * a * (a * t).sin() - 0.7 * b * b * (b * t).sin();
            r.time.push(t);
            r.counts.push((q * 1e5).round());
            // Held from its stamp on: half a row early is the middle of what it has to be.
            r.command.push(2.0 * acceleration + 0.5 * v.signum() - extra(q, v) + 0.3 * rng.normal());
        }
        (r.tilt, r.force) = (vec![0.0; 8000], vec![0.0; 8000]);
        r
    }

    pub(crate) fn carrier(extra: impl Fn(f64, f64) -> f64 + Copy) -> Carrier {
        let text = "kind = \"rotary\"\n[model]\ninertia = 2.0\ncoulomb = 0.5\nviscous = 0.0\n[actuator]\ngain = 1.0\n\
            [encoder]\ncounts_per_unit = 1e5\n";
        Carrier {
            rig: RigFile::parse(text).unwrap(),
            fits: vec![recording(1, extra)],
            holdouts: vec![recording(2, extra)],
        }
    }

    fn names(extra: impl Fn(f64, f64) -> f64 + Copy) -> Vec<&'static str> {
        select(&carrier(extra), 0.15).iter().map(|found| found.name).collect()
    }

    #[test]
    fn a_drag_and_a_spring_are_found_and_nothing_is_not() {
        assert_eq!(names(|_, v| -0.1 * v * v.abs()), ["quadratic_drag"]);
        assert_eq!(names(|q, _| -1.5 * q), ["position_spring"]);
        assert!(names(|_, _| 0.0).is_empty());
    }

    #[test]
    fn a_wave_with_a_phase_of_its_own_in_every_recording_is_cogging() {
        assert_eq!(names(|q, _| 1.2 * (7.0 * q + 0.4).sin()), ["cogging"]);
    }
}
