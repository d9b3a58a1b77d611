//! Lost counts: jumps of what the encoder reads that no force could bring about, found in the
//! innovations.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Gains;
use crate::fit::linear_fit::Fit;
use numerics::linear::dot;
use numerics::linear::{Factor, Square};

/// The requirements on a jump and on a recording.
#[derive(Clone, Copy)]
pub(crate) struct JumpPrior {
    /// Least gain of log-likelihood of a jump.
    gain: f64,
    /// Its least size, counts.
    least: f64,
    /// Fewest jumps of a recording.
    fewest: usize,
}

impl JumpPrior {
    /// Before it is known that counts get lost: more than any jump that noise makes in a recording,
    /// and more than one.
    pub(crate) const UNKNOWN: Self = Self { gain: 14.0, least: 0.7, fewest: 2 };
    /// The prior once counts are known to get lost, in one block of some hundreds.
    pub(crate) const KNOWN: Self = Self { gain: 8.0, least: 0.55, fewest: 1 };
}

/// A jump of position must explain this many times what a jump of speed would: impacts are forces.
const OVER_IMPACT: f64 = 1.3;
/// Most jumps per recording, and the reach of a response in blocks.
const MOST_JUMPS: usize = 80;
const REACH: usize = 40;
/// Fewest blocks after a jump that distinguish it from an impact.
const FEWEST_AFTER: usize = 6;
/// The number of passes over the residual: a large jump hides its neighbours.
const ROUNDS: usize = 3;

/// The counts that a recording seems to have lost.
pub(crate) struct Losses {
    /// Travel lost so far per block, rad or m; zero everywhere where too few jumps are seen.
    pub(crate) lost: Vec<f64>,
    /// The price of the jump that begins in a block, nats. Nobody knows beforehand when counts get
    /// lost and how many, so every jump is found in the very recording that it explains. The gain
    /// of a jump less this price is at most the gain in likelihood of the recording if each block
    /// is as likely to hold the jump and its size is drawn from a normal distribution of `spread`
    /// (Laplace's approximation of the marginal likelihood). Noise cannot gain by that on the mean.
    pub(crate) price: Vec<f64>,
    /// Sizes of the jumps, rad or m.
    pub(crate) sizes: Vec<f64>,
}

/// Root mean square of sizes, a count at least.
pub(crate) fn spread_of(sizes: &[f64], count: f64) -> f64 {
    let square = sizes.iter().map(|size| size * size).sum::<f64>() / sizes.len().max(1) as f64;
    square.sqrt().max(count)
}

/// Finds the counts that a recording lost in the residual of a fit of it alone without jumps;
/// `spread` is the size of jumps, rad or m, if other recordings show it.
pub(crate) fn find(
    track: &BlockedRecording,
    alone: &Fit,
    count: f64,
    asked: JumpPrior,
    spread: Option<f64>,
) -> Losses {
    let n = track.block_count();
    let (gains, residual) = (&alone.prepared[0].gains, alone.residual(0));
    let mut jumps: Vec<Jump> = Vec::new();
    let mut left = residual.clone();
    for _ in 0..ROUNDS {
        let before = jumps.len();
        for (j, pair) in peaks(track, gains, &left, asked.gain) {
            let is_new = jumps.iter().all(|jump| jump.block.abs_diff(j) > 1);
            if jumps.len() < MOST_JUMPS && pair.size().abs() > asked.least * count && is_new {
                jumps.push(Jump::new(track, gains, j, pair.later()));
            }
        }
        if jumps.len() == before {
            break;
        }
        jumps.sort_by_key(|jump| jump.block);
        let stands = |jump: &Jump| jump.gain() > asked.gain && jump.size.abs() > asked.least * count;
        left = settle(&mut jumps, &residual, stands);
    }
    let mut found = Losses { lost: vec![0.0; n], price: vec![0.0; n], sizes: Vec::new() };
    if jumps.len() < asked.fewest || follows_command(track, &jumps) || follows_angle(track, &jumps) {
        return found;
    }
    found.sizes = jumps.iter().map(|jump| jump.size).collect();
    let spread = spread.unwrap_or_else(|| spread_of(&found.sizes, count));
    for jump in &jumps {
        let Jump { block, later, size, .. } = *jump;
        found.lost[block] += (1.0 - later) * size;
        found.lost[block + 1..].iter_mut().for_each(|lost| *lost += size);
        found.price[block] += jump.price(n, spread);
    }
    found
}

/// Time before a jump in which the command is looked at, s: a belt or a joint gives way at once.
const JUST_BEFORE_S: f64 = 0.02;
/// Mean rank of the command's change before jumps, among all moving blocks, above which jumps
/// follow the command; by chance it is a half.
const FOLLOWS: f64 = 0.8;
/// Fewest jumps whose places say something, and standard errors by which they must.
const TELLING: usize = 6;
const TELLING_Z: f64 = 3.0;

/// True if jumps come just after the command has changed: what is lost is lost whatever the drive
/// does, what a spring in the drive takes up is not.
fn follows_command(track: &BlockedRecording, jumps: &[Jump]) -> bool {
    if jumps.len() < TELLING {
        return false;
    }
    let mean = track.block_mean(&track.rows.command);
    let reach = ((JUST_BEFORE_S * track.block_rate()).round() as usize).max(1);
    let change = |j: usize| {
        let before = &mean[j.saturating_sub(reach + 1)..j.max(1)];
        let fold = |start: f64, pick: fn(f64, f64) -> f64| before.iter().copied().fold(start, pick);
        fold(f64::NEG_INFINITY, f64::max) - fold(f64::INFINITY, f64::min)
    };
    let mut all: Vec<f64> = (1..track.block_count()).filter(|j| !track.motion.rest[*j]).map(change).collect();
    all.sort_by(f64::total_cmp);
    let rank = |x: f64| {
        let (below, up_to) = (all.partition_point(|y| *y < x), all.partition_point(|y| *y <= x));
        0.5 * (below + up_to) as f64 / all.len().max(1) as f64
    };
    let ranks: f64 = jumps.iter().map(|jump| rank(change(jump.block))).sum::<f64>() / jumps.len() as f64;
    // Ranks that are even between zero and one have a variance of a twelfth.
    ranks > FOLLOWS && ranks - 0.5 > TELLING_Z / (12.0 * jumps.len() as f64).sqrt()
}

/// True if jumps come at one angle of the turn: that is a fault of the encoder's scale.
fn follows_angle(track: &BlockedRecording, jumps: &[Jump]) -> bool {
    let Some(turn) = track.blocks.turn.filter(|_| jumps.len() >= TELLING) else { return false };
    let angle = |jump: &Jump| std::f64::consts::TAU * track.motion.x[jump.block] / turn;
    let sum = |of: fn(f64) -> f64| jumps.iter().map(|jump| of(angle(jump))).sum::<f64>() / jumps.len() as f64;
    let travel = track.motion.x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    travel > turn && sum(f64::cos).hypot(sum(f64::sin)) > FOLLOWS
}

/// A response that begins after a number of blocks that are zero.
fn after(blocks: usize, response: Vec<f64>) -> Vec<f64> {
    [vec![0.0; blocks], response].concat()
}

/// Blocks at which the reading clearly jumps, the clearest first.
fn peaks(track: &BlockedRecording, gains: &Gains, residual: &[f64], least_gain: f64) -> Vec<(usize, Pair)> {
    let observed = track.observed();
    let mut found: Vec<(usize, Pair)> = Vec::new();
    let n = residual.len();
    for j in (5..n.saturating_sub(FEWEST_AFTER)).filter(|j| !track.motion.rest[*j]) {
        let window = j - 1..(j + REACH).min(n);
        let left = &residual[window.clone()];
        let jump = |at: usize| after(at - window.start, gains.response_to_jump(&observed, at..window.end));
        let jump = Pair::new(&jump(j), &jump(j + 1), left);
        // What is lost is lost on the way: the reading falls behind the motion.
        if jump.gain <= least_gain || jump.size() * track.motion.v[j] >= 0.0 {
            continue;
        }
        let impact =
            |at: usize| after(at - window.start, gains.response_to_impact(&observed, at..window.end));
        let [before, now, next] = [j - 1, j, j + 1].map(impact);
        let impact = Pair::new(&before, &now, left).gain.max(Pair::new(&now, &next, left).gain);
        if jump.gain > OVER_IMPACT * impact {
            found.push((j, jump));
        }
    }
    found.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain).then(a.0.cmp(&b.0)));
    let mut apart: Vec<(usize, Pair)> = Vec::new();
    for (j, jump) in found {
        if apart.iter().all(|(k, _)| k.abs_diff(j) > REACH / 4) {
            apart.push((j, jump));
        }
    }
    apart
}

/// A jump within a block shows in part in it and whole in the next one: a response from some block
/// on and the same from the next one on, neither against the other.
struct Pair {
    first: f64,
    second: f64,
    /// The gain in log-likelihood.
    gain: f64,
}

impl Pair {
    /// Fits a response and a later one to the residual `left`.
    fn new(response: &[f64], later: &[f64], left: &[f64]) -> Self {
        let (square, square_later) = (dot(response, response).max(1e-300), dot(later, later).max(1e-300));
        let both = dot(response, later);
        let (first, second) = (dot(response, left), dot(later, left));
        let determinant = square * square_later - both * both;
        let a = (square_later * first - both * second) / determinant;
        let b = (square * second - both * first) / determinant;
        if a * b > 0.0 {
            Self { first: a, second: b, gain: 0.5 * (a * first + b * second) }
        } else if first * first / square > second * second / square_later {
            Self { first: first / square, second: 0.0, gain: 0.5 * first * first / square }
        } else {
            Self { first: 0.0, second: second / square_later, gain: 0.5 * second * second / square_later }
        }
    }

    fn size(&self) -> f64 {
        self.first + self.second
    }

    /// Part of it that shows a block later.
    fn later(&self) -> f64 {
        if self.size() == 0.0 { 0.0 } else { self.second / self.size() }
    }
}

/// A jump with what it does to the residual.
struct Jump {
    block: usize,
    /// Part of it that shows a block later.
    later: f64,
    size: f64,
    /// To a jump by one at the block and at the next one.
    responses: [Vec<f64>; 2],
}

impl Jump {
    fn new(track: &BlockedRecording, gains: &Gains, block: usize, later: f64) -> Self {
        let n = track.block_count();
        let observed = track.observed();
        let responses = [block, block + 1].map(|at| after(at, gains.response_to_jump(&observed, at..n)));
        Self { block, later, size: 0.0, responses }
    }

    fn response(&self) -> Vec<f64> {
        let [now, next] = &self.responses;
        now.iter().zip(next).map(|(now, next)| (1.0 - self.later) * now + self.later * next).collect()
    }

    /// Returns the gain in log-likelihood.
    fn gain(&self) -> f64 {
        let response = self.response();
        0.5 * self.size * self.size * dot(&response, &response)
    }

    /// See [`Losses::price`].
    fn price(&self, blocks: usize, spread: f64) -> f64 {
        let response = self.response();
        let information = dot(&response, &response);
        (blocks as f64).ln()
            + 0.5 * (information * spread * spread).ln_1p()
            + 0.5 * (self.size / spread).powi(2)
    }
}

/// Fits all sizes at once, looks again where within its block each jump is, drops those that are
/// not confirmed, and fits again; gives the rest of the residual.
fn settle(jumps: &mut Vec<Jump>, residual: &[f64], stands: impl Fn(&Jump) -> bool) -> Vec<f64> {
    let left = fit_sizes(jumps, residual);
    for jump in jumps.iter_mut() {
        let with: Vec<f64> = left.iter().zip(jump.response()).map(|(left, x)| left + jump.size * x).collect();
        jump.later = Pair::new(&jump.responses[0], &jump.responses[1], &with).later();
    }
    fit_sizes(jumps, residual);
    jumps.retain(stands);
    fit_sizes(jumps, residual)
}

/// Sizes that leave the least, all fitted at once, and what they leave.
fn fit_sizes(jumps: &mut [Jump], residual: &[f64]) -> Vec<f64> {
    let responses: Vec<Vec<f64>> = jumps.iter().map(Jump::response).collect();
    let mut m = Square::zero(responses.len());
    for (a, i) in responses.iter().enumerate() {
        for (b, j) in responses.iter().enumerate().take(a + 1) {
            let product = dot(i, j);
            m.add(a, b, product);
            if a != b {
                m.add(b, a, product);
            }
        }
    }
    let right: Vec<f64> = responses.iter().map(|response| dot(response, residual)).collect();
    let mut left = residual.to_vec();
    for ((jump, size), response) in jumps.iter_mut().zip(Factor::new(&m).solve(&right)).zip(&responses) {
        jump.size = size;
        left.iter_mut().zip(response).for_each(|(left, x)| *left -= size * x);
    }
    left
}

#[cfg(test)]
mod tests;
