//! The choice of the input: segments are added one after another. Each is the one that, together
//! with those before it, best distinguishes the rivals.

use crate::candidates::candidates;
use crate::case::{Case, Rival};
use crate::innovation::{Filter, Gram, Unexpected};
use crate::input::{Input, Segment, Servo};
use crate::predict::Prediction;
use rayon::prelude::*;

/// Nats beyond which only the logarithm of more counts: odds of 5e21, if the noise is as white as
/// it is taken to be.
const ENOUGH_NATS: f64 = 50.0;
/// Relative growth of the criterion for which a segment is added.
const PAYS: f64 = 0.1;
/// Nats below which a pair is not distinguished: odds of 20 to 1.
const LEAST_NATS: f64 = 3.0;
/// Relative differences of the criterion that do not count against a shorter input.
const NEARLY: f64 = 0.03;
/// Inputs that are compared with the chosen one.
const RUNNERS_UP: usize = 4;
/// The most segments of an input.
const MOST_SEGMENTS: usize = 4;

/// The distance of two rivals under an input.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The one that is true.
    pub truth: String,
    /// The one that is refitted to it.
    pub rival: String,
    /// Kullback–Leibler distance, nats: the expected log-odds.
    pub nats: f64,
}

/// An input with the evidence that it is expected to give.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// The input.
    pub input: Input,
    /// Expected worth of the nats between the truth and its nearest rival: nats up to 50, then
    /// their logarithm.
    pub criterion: f64,
    /// Every ordered pair.
    pub pairs: Vec<Pair>,
    /// For the pair that is nearest: its names, and the nats gathered over time (s, nats).
    pub gathered: (String, Vec<(f64, f64)>),
}

impl Alternative {
    /// The ordered pair with the smallest distance.
    pub fn nearest(&self) -> Option<&Pair> {
        self.pairs.iter().min_by(|a, b| a.nats.total_cmp(&b.nats))
    }
}

/// A designed experiment.
#[derive(Clone, Debug)]
pub struct Design {
    /// The case that it was made from.
    pub case: Case,
    /// The chosen input.
    pub chosen: Alternative,
    /// The next best ones, best first.
    pub runners_up: Vec<Alternative>,
    /// Pairs of rivals, by name, that no input within the limits distinguishes.
    pub inseparable: Vec<(String, String)>,
    /// The servo that follows a reference.
    pub servo: Servo,
    /// Segments that were simulated, and those beyond the limits under a rival.
    pub tried: (usize, usize),
    /// The motion of each rival under the chosen input.
    pub predictions: Vec<Prediction>,
}

/// The sums of all ordered pairs under a segment.
#[derive(Clone)]
struct GramTable(Vec<Vec<Option<Gram>>>);

impl GramTable {
    fn plus(&self, other: &Self) -> Self {
        let add = |(a, b): (&Option<Gram>, &Option<Gram>)| Some(a.as_ref()?.plus(b.as_ref()?));
        let row = |(a, b): (&Vec<_>, &Vec<_>)| a.iter().zip(b).map(add).collect();
        Self(self.0.iter().zip(&other.0).map(row).collect())
    }

    /// Distances after the refit; infinite on the diagonal.
    fn nats(&self) -> Vec<Vec<f64>> {
        let one = |gram: &Option<Gram>| gram.as_ref().map_or(f64::INFINITY, |gram| gram.refitted().0);
        self.0.iter().map(|row| row.iter().map(one).collect()).collect()
    }
}

/// The worth of so many nats: themselves, and beyond enough of them as much again for each factor
/// of e.
fn worth(nats: f64) -> f64 {
    if nats <= ENOUGH_NATS { nats } else { ENOUGH_NATS * (1.0 + (nats / ENOUGH_NATS).ln()) }
}

/// Expected worth of the nats between the truth and its nearest rival.
fn criterion(rivals: &[Rival], nats: &[Vec<f64>]) -> f64 {
    let nearest = |row: &Vec<f64>| worth(row.iter().copied().fold(f64::INFINITY, f64::min));
    rivals.iter().zip(nats).map(|(rival, row)| rival.probability * nearest(row)).sum()
}

/// The case with its filter and servo, in which inputs are judged.
struct InputJudge<'a> {
    case: &'a Case,
    filter: Filter,
    servo: Servo,
}

impl InputJudge<'_> {
    /// The motion of each rival; none if one leaves the limits.
    fn motions(&self, input: &Input) -> Option<Vec<Prediction>> {
        let (rivals, usable) = (&self.case.rivals, self.case.limits.usable());
        rivals
            .iter()
            .map(|rival| {
                let motion = Prediction::new(rival, input, self.servo, &usable);
                motion.is_within(&usable, rival.rig.actuator.gain).then_some(motion)
            })
            .collect()
    }

    fn sums(&self, input: &Input) -> Option<GramTable> {
        let motions = self.motions(input)?;
        let rivals = &self.case.rivals;
        let gram = |i: usize, j: usize| {
            let unexpected = || Unexpected::new(&self.filter, &rivals[i], &motions[i], &rivals[j]);
            (i != j).then(|| unexpected().gram())
        };
        let row = |i: usize| (0..rivals.len()).map(|j| gram(i, j)).collect();
        Some(GramTable((0..rivals.len()).map(row).collect()))
    }

    /// Adds segments to a first one while they pay, up to `most_s`, and one that travels if no
    /// segment does.
    fn grown(&self, first: usize, all: &[(Segment, GramTable)], most_s: f64) -> Vec<usize> {
        let value = |sums: &GramTable| criterion(&self.case.rivals, &sums.nats());
        let (mut parts, mut sums) = (vec![first], all[first].1.clone());
        let (mut now, mut seconds) = (value(&sums), all[first].0.seconds);
        let shortest_travel_s = shortest_travel_s(all);
        while parts.len() < MOST_SEGMENTS {
            let with = |(k, (segment, own)): (usize, &(Segment, GramTable))| {
                let travels = segment.signal.travels() || parts.iter().any(|k| all[*k].0.signal.travels());
                let reserve_s = if travels { 0.0 } else { shortest_travel_s };
                let fits = seconds + segment.seconds + reserve_s <= most_s && !parts.contains(&k);
                fits.then(|| (k, value(&sums.plus(own)), segment.seconds))
            };
            let Some((k, next, more_s)) = best(all.iter().enumerate().filter_map(with)) else { break };
            if next < now * (1.0 + PAYS) + 0.1 {
                break;
            }
            sums = sums.plus(&all[k].1);
            (now, seconds) = (next, seconds + more_s);
            parts.push(k);
        }
        if !parts.iter().any(|k| all[*k].0.signal.travels()) {
            let travels = |(k, (segment, own)): (usize, &(Segment, GramTable))| {
                let fits = segment.signal.travels() && seconds + segment.seconds <= most_s;
                fits.then(|| (k, value(&sums.plus(own)), segment.seconds))
            };
            parts.extend(best(all.iter().enumerate().filter_map(travels)).map(|(k, _, _)| k));
        }
        parts
    }

    /// The input as a whole, simulated once more from its start to its end; none if it leaves the
    /// limits.
    fn whole(&self, input: Input) -> Option<(Alternative, Vec<Prediction>)> {
        let motions = self.motions(&input)?;
        // What judges is played with other numbers, and has to stay within the limits too.
        self.motions(&input.varied())?;
        let rivals = &self.case.rivals;
        let (mut pairs, mut nats) = (Vec::new(), vec![vec![f64::INFINITY; rivals.len()]; rivals.len()]);
        let (mut gathered, mut least) = ((String::new(), Vec::new()), f64::INFINITY);
        for (i, truth) in rivals.iter().enumerate() {
            for (j, rival) in rivals.iter().enumerate().filter(|(j, _)| *j != i) {
                let unexpected = Unexpected::new(&self.filter, truth, &motions[i], rival);
                nats[i][j] = unexpected.gram().refitted().0;
                if nats[i][j] < least {
                    least = nats[i][j];
                    let over: Vec<f64> = unexpected.gathered();
                    let block_s = input.seconds() / over.len().max(1) as f64;
                    let points = over.iter().enumerate().map(|(k, n)| (block_s * k as f64, *n)).collect();
                    gathered = (format!("{} against {}", truth.name, rival.name), points);
                }
                pairs.push(Pair { truth: truth.name.clone(), rival: rival.name.clone(), nats: nats[i][j] });
            }
        }
        let criterion = criterion(rivals, &nats);
        Some((Alternative { input, criterion, pairs, gathered }, motions))
    }
}

/// Returns the length of the shortest segment that travels, s; infinite if no segment travels.
fn shortest_travel_s(all: &[(Segment, GramTable)]) -> f64 {
    let travelling = all.iter().filter(|(segment, _)| segment.signal.travels());
    travelling.map(|(segment, _)| segment.seconds).fold(f64::INFINITY, f64::min)
}

/// The best of some, the shortest of those that are nearly as good.
fn best(all: impl Iterator<Item = (usize, f64, f64)>) -> Option<(usize, f64, f64)> {
    let all: Vec<_> = all.collect();
    let most = all.iter().map(|one| one.1).fold(f64::NEG_INFINITY, f64::max);
    let near = all.into_iter().filter(|one| one.1 >= most * (1.0 - NEARLY));
    near.min_by(|a, b| a.2.total_cmp(&b.2).then(b.1.total_cmp(&a.1)))
}

/// Designs the input of at most `most_s` that best distinguishes the rivals of a case; `seed` draws
/// the library.
///
/// # Errors
/// One sentence if every input of the library leaves the limits.
pub fn design(case: &Case, most_s: f64, seed: u64) -> Result<Design, String> {
    let servo = Servo::within(case.rivals[0].rig.model.inertia, &case.limits.usable());
    let bench = InputJudge { case, filter: Filter::new(case), servo };
    let segments: Vec<Segment> =
        candidates(case, seed).into_iter().filter(|segment| segment.seconds <= most_s).collect();
    let tried = segments.len();
    let beyond = |which: &str| {
        let Limit { travel, speed, force } = words(case);
        format!(
            "all {which} of the library leave 80 % of the limits (travel {travel}, speed {speed}, force {force}) under a rival; give wider ones with --travel, --speed or --force"
        )
    };
    let judged = |segment: Segment| {
        let input = Input { segments: vec![segment.clone()] };
        bench.sums(&input).map(|sums| (segment, sums))
    };
    let all: Vec<(Segment, GramTable)> = segments.into_par_iter().filter_map(judged).collect();
    // A diagnosis refuses recordings of an axis at rest.
    if !all.is_empty() && !all.iter().any(|(segment, _)| segment.signal.travels()) {
        return Err(beyond("staircases and strokes, without which the axis hardly moves,"));
    }
    let mut firsts: Vec<(usize, f64)> =
        all.iter().enumerate().map(|(k, (_, sums))| (k, criterion(&case.rivals, &sums.nats()))).collect();
    // What does not travel itself leaves time for what does.
    let travels = |k: usize| all[k].0.signal.travels();
    let shortest_s = shortest_travel_s(&all);
    firsts.retain(|(k, _)| travels(*k) || all[*k].0.seconds + shortest_s <= most_s);
    firsts.sort_by(|a, b| b.1.total_cmp(&a.1).then(all[a.0].0.seconds.total_cmp(&all[b.0].0.seconds)));
    let grown = |(first, _): &(usize, f64)| {
        let mut parts = bench.grown(*first, &all, most_s);
        // Segments begin where the one before ended, so that together they may travel further than
        // each alone.
        while parts.iter().any(|k| travels(*k)) {
            let segments = parts.iter().map(|k| all[*k].0.clone()).collect();
            if let Some(whole) = bench.whole(Input { segments }) {
                return Some(whole);
            }
            parts.pop();
        }
        None
    };
    let mut whole: Vec<(Alternative, Vec<Prediction>)> =
        firsts.par_iter().take(RUNNERS_UP + 1).filter_map(grown).collect();
    let order = best(whole.iter().enumerate().map(|(k, (a, _))| (k, a.criterion, a.input.seconds())))
        .ok_or_else(|| beyond(&format!("{tried} inputs")))?;
    let (chosen, predictions) = whole.remove(order.0);
    let mut runners_up: Vec<Alternative> = whole.into_iter().map(|(alternative, _)| alternative).collect();
    runners_up.sort_by(|a, b| b.criterion.total_cmp(&a.criterion));
    let inseparable = inseparable(case, &all, &chosen);
    let out_of_limits = tried - all.len();
    let case = case.clone();
    Ok(Design { case, chosen, runners_up, inseparable, servo, tried: (tried, out_of_limits), predictions })
}

/// Limits in words.
struct Limit {
    travel: String,
    speed: String,
    force: String,
}

fn words(case: &Case) -> Limit {
    let (kind, limits) = (case.rivals[0].rig.kind, &case.limits);
    Limit {
        travel: match (crate::input::short(limits.travel), crate::input::short(limits.back)) {
            (travel, back) if travel == back => format!("{travel} {}", kind.length()),
            (travel, back) => format!("{travel} {} ahead, {back} back", kind.length()),
        },
        speed: format!("{} {}/s", crate::input::short(limits.speed), kind.length()),
        force: format!("{} {}", crate::input::short(limits.force), kind.force()),
    }
}

/// Pairs that neither a segment of the library nor the chosen input distinguishes.
fn inseparable(case: &Case, all: &[(Segment, GramTable)], chosen: &Alternative) -> Vec<(String, String)> {
    let nats: Vec<Vec<Vec<f64>>> = all.iter().map(|(_, sums)| sums.nats()).collect();
    let of_chosen = |a: &str, b: &str| {
        let is_pair =
            |pair: &&Pair| (pair.truth == a && pair.rival == b) || (pair.truth == b && pair.rival == a);
        chosen.pairs.iter().filter(is_pair).map(|pair| pair.nats).fold(f64::INFINITY, f64::min)
    };
    let mut out = Vec::new();
    for i in 0..case.rivals.len() {
        for j in i + 1..case.rivals.len() {
            let (a, b) = (&case.rivals[i].name, &case.rivals[j].name);
            let most = nats.iter().map(|n| n[i][j].min(n[j][i])).fold(of_chosen(a, b), f64::max);
            if most < LEAST_NATS {
                out.push((a.clone(), b.clone()));
            }
        }
    }
    out
}

impl Design {
    /// A sentence without its full stop: the pairs that no input distinguishes; none if there are
    /// none.
    pub fn limits_in_words(&self) -> Option<String> {
        let pairs: Vec<String> = self.inseparable.iter().map(|(a, b)| format!("{a} from {b}")).collect();
        (!pairs.is_empty()).then(|| {
            format!(
                "Within these limits no input of the library tells {} with odds of 20 to 1",
                pairs.join(", or ")
            )
        })
    }

    /// True if some pair of rivals is distinguished.
    pub fn decides(&self) -> bool {
        let pairs = self.case.rivals.len() * (self.case.rivals.len() - 1) / 2;
        self.inseparable.len() < pairs
    }
}

/// Odds of so many nats, in words.
pub(crate) fn odds(nats: f64) -> String {
    match nats {
        n if n > 13.8 => "over a million to 1".to_owned(),
        n => format!("{} to 1", crate::input::short(n.exp().min(1e6).round())),
    }
}
