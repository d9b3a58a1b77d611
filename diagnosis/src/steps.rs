//! Lost counts: jumps of what the encoder reads that no force could bring about, found in the innovations.

use crate::fit::{Fit, dot};
use crate::solve::{Factor, Square};
use crate::track::{Input, Track};

/// Gain of log-likelihood of a single jump: above every jump that noise makes in a recording.
const PER_JUMP: f64 = 14.0;
/// A jump of position must explain this many times what a jump of speed would: impacts are forces.
const OVER_IMPACT: f64 = 1.3;
/// Most jumps per recording, fewest for it to be a fault, and the reach of a response in blocks.
const MOST: usize = 80;
const FEWEST: usize = 2;
const REACH: usize = 40;
/// Least size, counts: what falls into the middle of a block shows as little as half.
const LEAST: f64 = 0.45;
/// Gain of log-likelihood of a second part of a jump, in the next block.
const PER_PART: f64 = 4.0;
/// How often what is left is looked through again: a large jump hides its neighbours.
const ROUNDS: usize = 3;

/// Travel lost so far per block, from the residual of a fit that knows of no jumps; zero everywhere where too few are seen.
pub(crate) fn find(track: &Track, fit: &Fit, r: usize, residual: &[f64], count: f64) -> Vec<f64> {
    let n = track.blocks();
    let Some(templates) = Templates::new(track, fit, r) else { return vec![0.0; n] };
    let mut jumps: Vec<usize> = Vec::new();
    let mut sizes: Vec<f64> = Vec::new();
    let mut left = residual.to_vec();
    for _ in 0..ROUNDS {
        let before = jumps.len();
        for (j, size) in templates.peaks(track, &left) {
            let is_new = jumps.iter().all(|k| k.abs_diff(j) > 1);
            if jumps.len() < MOST && size.abs() > LEAST * count && is_new {
                jumps.push(j);
            }
        }
        if jumps.len() == before {
            break;
        }
        jumps.sort_unstable();
        (jumps, sizes, left) = together(track, fit, r, residual, &jumps, count);
    }
    let mut lost = vec![0.0; n];
    if jumps.len() < FEWEST {
        return lost;
    }
    let mut parts = Jumps::new(track, fit, r, &jumps);
    parts.split(&sizes, residual);
    for (block, size) in parts.blocks.iter().zip(parts.sizes(residual)) {
        lost[*block..].iter_mut().for_each(|lost| *lost += size);
    }
    lost
}

/// What a jump of position and a jump of speed look like at one place where the axis moves: elsewhere they are nearly the
/// same.
struct Template {
    /// Logarithm of the variance that quantisation has there: the faster, the less, and the sharper the response.
    quantum: f64,
    position: Vec<f64>,
    speed: Vec<f64>,
}

/// Templates from slow motion to fast.
struct Templates(Vec<Template>);

/// Parts of the moving blocks, ordered by quantisation, at which templates are taken.
const TEMPLATES: [f64; 4] = [0.05, 0.35, 0.65, 0.95];

impl Template {
    fn new(track: &Track, fit: &Fit, r: usize, at: usize) -> Self {
        let n = track.blocks();
        let gains = &fit.prepared[r].gains;
        let mut step = vec![0.0; n];
        step[at..].fill(1.0);
        let mut pulse = vec![0.0; n];
        pulse[at - 1] = 1.0 / track.span[at - 1];
        let cut = |input: Input| gains.response(track, &input)[at..at + REACH].to_vec();
        Self {
            quantum: track.quantum[at].ln(),
            position: cut(Input::Sensor(step)),
            speed: cut(Input::Held(pulse)),
        }
    }
}

impl Templates {
    fn new(track: &Track, fit: &Fit, r: usize) -> Option<Self> {
        let n = track.blocks();
        let moves = |j: &usize| !track.rest[*j - 1..*j + REACH].iter().any(|rest| *rest);
        let mut places: Vec<usize> = (1..n.checked_sub(REACH)?).filter(moves).collect();
        if places.is_empty() && n >= 4 * REACH {
            places.push(n / 2);
        }
        places.sort_by(|a, b| track.quantum[*a].total_cmp(&track.quantum[*b]).then(a.cmp(b)));
        let last = places.len().checked_sub(1)?;
        let mut at: Vec<usize> = TEMPLATES.iter().map(|part| places[(part * last as f64) as usize]).collect();
        at.dedup();
        Some(Self(at.into_iter().map(|at| Template::new(track, fit, r, at)).collect()))
    }

    fn nearest(&self, quantum: f64) -> &Template {
        let distance = |t: &&Template| (t.quantum - quantum.ln()).abs();
        self.0
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .expect("there is at least one template")
    }

    /// Blocks at which a jump of position stands out, with its size, the clearest first.
    fn peaks(&self, track: &Track, residual: &[f64]) -> Vec<(usize, f64)> {
        let mut found: Vec<(f64, usize, f64)> = Vec::new();
        for j in 5..residual.len().saturating_sub(REACH + 2) {
            let Template { position, speed, .. } = self.nearest(track.quantum[j]);
            if track.rest[j] {
                continue;
            }
            let jump = Pair::new(position, &residual[j..=j + REACH]);
            // What is lost is lost on the way: the reading falls behind the motion.
            if jump.gain <= PER_JUMP || jump.size() * track.v[j] >= 0.0 {
                continue;
            }
            let impact = |from: usize| Pair::new(speed, &residual[from..=from + REACH]).gain;
            if jump.gain > OVER_IMPACT * impact(j).max(impact(j + 1)) {
                found.push((jump.gain, j + usize::from(jump.second.abs() > jump.first.abs()), jump.size()));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut apart: Vec<(usize, f64)> = Vec::new();
        for (_, j, size) in found {
            if apart.iter().all(|(k, _)| k.abs_diff(j) > REACH / 4) {
                apart.push((j, size));
            }
        }
        apart
    }
}

/// What falls into a block shows in part in it and whole in the next one: a response from some block on and the same from the
/// next one on, neither against the other.
struct Pair {
    first: f64,
    second: f64,
    /// Of log-likelihood.
    gain: f64,
}

impl Pair {
    /// `left` is longer than the response by the one block that the second comes later.
    fn new(response: &[f64], left: &[f64]) -> Self {
        let n = response.len();
        let square = dot(response, response).max(1e-300);
        let both = dot(&response[..n - 1], &response[1..]);
        let (first, second) = (dot(response, &left[..n]), dot(response, &left[1..]));
        let determinant = square * square - both * both;
        let a = (square * first - both * second) / determinant;
        let b = (square * second - both * first) / determinant;
        if a * b > 0.0 {
            Self { first: a, second: b, gain: 0.5 * (a * first + b * second) }
        } else if first.abs() > second.abs() {
            Self { first: first / square, second: 0.0, gain: 0.5 * first * first / square }
        } else {
            Self { first: 0.0, second: second / square, gain: 0.5 * second * second / square }
        }
    }

    fn size(&self) -> f64 {
        self.first + self.second
    }
}

/// Jumps that are fitted together, with what each does to the residual.
struct Jumps<'a> {
    track: &'a Track,
    fit: &'a Fit,
    r: usize,
    blocks: Vec<usize>,
    responses: Vec<Vec<f64>>,
}

impl<'a> Jumps<'a> {
    fn new(track: &'a Track, fit: &'a Fit, r: usize, blocks: &[usize]) -> Self {
        let mut all = Self { track, fit, r, blocks: Vec::new(), responses: Vec::new() };
        blocks.iter().for_each(|block| all.push(*block));
        all
    }

    /// What a jump by one at `block` does to the residual.
    fn response(&self, block: usize) -> Vec<f64> {
        let mut step = vec![0.0; self.track.blocks()];
        step[block..].fill(1.0);
        self.fit.prepared[self.r].gains.response(self.track, &Input::Sensor(step))
    }

    fn push(&mut self, block: usize) {
        let response = self.response(block);
        self.blocks.push(block);
        self.responses.push(response);
    }

    fn keep(&mut self, stands: &[bool]) {
        let mut kept = stands.iter();
        self.blocks.retain(|_| *kept.next().unwrap_or(&false));
        let mut kept = stands.iter();
        self.responses.retain(|_| *kept.next().unwrap_or(&false));
    }

    /// Sizes that leave the least, all fitted at once.
    fn sizes(&self, residual: &[f64]) -> Vec<f64> {
        let count = self.blocks.len();
        let mut m = Square::zero(count);
        for (a, i) in self.responses.iter().enumerate() {
            for (b, j) in self.responses.iter().enumerate().take(a + 1) {
                let product = dot(i, j);
                m.add(a, b, product);
                if a != b {
                    m.add(b, a, product);
                }
            }
        }
        let right: Vec<f64> = self.responses.iter().map(|response| dot(response, residual)).collect();
        Factor::new(&m).solve(&right)
    }

    fn left(&self, sizes: &[f64], residual: &[f64]) -> Vec<f64> {
        let mut left = residual.to_vec();
        for (response, size) in self.responses.iter().zip(sizes) {
            left.iter_mut().zip(response).for_each(|(left, x)| *left -= size * x);
        }
        left
    }

    /// A jump within a block shows in part in that block and whole in the next one: gives each jump a second part in the
    /// neighbour that explains more, where one does.
    fn split(&mut self, sizes: &[f64], residual: &[f64]) {
        let left = self.left(sizes, residual);
        let places: Vec<(usize, f64)> = self.blocks.iter().copied().zip(sizes.iter().copied()).collect();
        for (i, (block, size)) in places.into_iter().enumerate() {
            let mut best: Option<(f64, usize)> = None;
            for neighbour in [block - 1, block + 1] {
                if self.blocks.contains(&neighbour) {
                    continue;
                }
                let other = self.response(neighbour);
                // Moves a part of the jump to the neighbour, a part between none and all of it.
                let moved: Vec<f64> = other.iter().zip(&self.responses[i]).map(|(a, b)| a - b).collect();
                let (along, square) = (dot(&moved, &left), dot(&moved, &moved));
                let gain = 0.5 * along * along / square.max(1e-300);
                if along * size > 0.0 && gain > PER_PART && best.is_none_or(|(most, _)| gain > most) {
                    best = Some((gain, neighbour));
                }
            }
            if let Some((_, neighbour)) = best {
                self.push(neighbour);
            }
        }
    }
}

/// Fits the sizes of all jumps at once and drops those that do not stand: places, sizes, and the residual without them.
fn together(
    track: &Track,
    fit: &Fit,
    r: usize,
    residual: &[f64],
    jumps: &[usize],
    count: f64,
) -> (Vec<usize>, Vec<f64>, Vec<f64>) {
    let mut all = Jumps::new(track, fit, r, jumps);
    let stands = |(size, response): (&f64, &Vec<f64>)| {
        0.5 * size * size * dot(response, response) > PER_JUMP && size.abs() > LEAST * count
    };
    let stand: Vec<bool> = all.sizes(residual).iter().zip(&all.responses).map(stands).collect();
    all.keep(&stand);
    let sizes = all.sizes(residual);
    let left = all.left(&sizes, residual);
    (all.blocks, sizes, left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_within_a_block_is_one_in_two_parts_and_parts_that_oppose_each_other_are_none() {
        let response = [1.0, -0.6, 0.1, 0.0];
        let left = |a: f64, b: f64| -> Vec<f64> {
            let at = |i: usize| {
                a * response.get(i).unwrap_or(&0.0) + b * i.checked_sub(1).map_or(0.0, |i| response[i])
            };
            (0..=response.len()).map(at).collect()
        };
        let half = Pair::new(&response, &left(2.0, 2.0));
        let all: f64 = left(2.0, 2.0).iter().map(|x| x * x).sum();
        assert!((half.size() - 4.0).abs() < 1e-9 && (half.gain - 0.5 * all).abs() < 1e-9);
        let opposed = Pair::new(&response, &left(3.0, -1.0));
        assert!(
            opposed.second == 0.0 && opposed.gain < 0.5 * left(3.0, -1.0).iter().map(|x| x * x).sum::<f64>()
        );
        assert!(Pair::new(&response, &left(0.0, 5.0)).second > 4.9);
    }
}
