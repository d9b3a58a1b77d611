//! `prove --inject`: known effects concealed in recordings of real machines, the tool and a plain
//! rival on the same cases.

mod banded_recording;
mod carrier;
mod case;
mod conceal;
#[cfg(test)]
mod exact;
mod judge;
#[cfg(test)]
mod maps;
mod plain;
mod plain_laws;
mod regress;
mod rig_file;
mod shapes;
mod table;
mod untouched;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use carrier::{Carrier, Place};
use case::{Drawn, Ground};
use judge::Case;
use untouched::Untouched;

use crate::evidence;
use crate::options::Options;
use crate::pool;
use crate::rng::Rng;
use crate::scratch::Scratch;
use crate::tool::{self, Paths, Tool};

/// The ratios of the effect's residual to that of the tool's own model on the untouched machine.
const FACTORS: [f64; 2] = [3.0, 1.0];
/// Carriers that are tried for an effect before the case is given up.
const ATTEMPTS: usize = 60;
/// The plain rival names from this share of the force error on, in its two rows.
pub(crate) const PLAIN_SHARES: [f64; 2] = [0.15, 0.05];
/// Cases, where `--cases` does not say.
const CASES: usize = 44;

/// A carrier that has a fit.
struct Known {
    place: Place,
    untouched: Untouched,
    /// The findings of the plain rival, once it has been run.
    plain: OnceLock<Vec<plain::Found>>,
    /// Its recordings, once a draw has asked for them; none where they cannot be read.
    ground: OnceLock<Option<Ground>>,
}

impl Known {
    fn new(place: Place, untouched: Untouched) -> Self {
        Self { place, untouched, plain: OnceLock::new(), ground: OnceLock::new() }
    }

    fn ground(&self) -> Option<&Ground> {
        let read = || {
            let carrier = Carrier::read(&self.place.paths).ok()?;
            Some(Ground::new(carrier, self.untouched.answer.bandwidth_hz))
        };
        self.ground.get_or_init(read).as_ref()
    }
}

/// The case to draw.
#[derive(Clone, Debug)]
struct Wish {
    id: usize,
    hidden: &'static str,
    factor: f64,
}

/// Conceals, asks, judges, prints.
///
/// # Errors
/// One sentence: what could not be read, written or run.
pub(crate) fn run(options: &Options, tool: &dyn Tool) -> Result<(), String> {
    let start = Instant::now();
    let places = carrier::find(&options.inject)?;
    let work = options.untouched.clone().unwrap_or_else(|| options.out.join("inject-untouched"));
    let mark = untouched::tool_mark(options.tool.as_deref());
    let fixed = options.untouched.is_some();
    let asked = pool::map(options.jobs, None, "untouched machines", &places, |place| {
        untouched::ask(place, tool, &mark, &work, fixed)
    });
    let (mut known, mut without) = (Vec::new(), Vec::new());
    for (place, untouched) in places.into_iter().zip(asked.into_iter().flatten()) {
        match untouched {
            Ok(untouched) => known.push(Known::new(place, untouched)),
            Err(why) => without.push(format!("{} ({why})", place.id)),
        }
    }
    if known.is_empty() {
        return Err(format!("no carrier has a fit: {}", without.join(", ")));
    }
    let wishes = wishes(options);
    let scratch = Scratch::new()?;
    let report = Report { options, carriers: known.len(), without, planned: wishes.len(), start };
    let work = |wish: &Wish| run_case(wish, &known, options, tool, &scratch.0);
    // A report that cannot be written now is tried again after the next case; the last failure is
    // reported.
    let save = |done: &[Option<CaseResult>]| drop(report.write(done));
    let done = pool::map_and_save(options.jobs, options.budget(), "concealed effects", &wishes, work, save);
    print!("{}", report.write(&done)?);
    Ok(())
}

/// A case, `None` if no carrier holds the effect, or why it could not be run.
type CaseResult = Result<Option<Case>, String>;

/// The parts of a report that no case changes.
struct Report<'a> {
    options: &'a Options,
    carriers: usize,
    /// Carriers without a fit, with the reason.
    without: Vec<String>,
    planned: usize,
    start: Instant,
}

impl Report<'_> {
    /// Writes `inject.json` and `inject.md` about the cases that are done; returns the latter.
    fn write(&self, done: &[Option<CaseResult>]) -> Result<String, String> {
        let done: Vec<Option<&Case>> =
            done.iter().flatten().map(|o| o.as_ref().map(Option::as_ref)).collect::<Result<_, _>>()?;
        let cases: Vec<&Case> = done.iter().flatten().copied().collect();
        let head = format!(
            "{} cases of {}, seed {}, of {} planned ({} that no carrier holds); {} carriers, {} without a fit; {:.0} s.",
            cases.len(),
            self.options.inject.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", "),
            self.options.seed,
            self.planned,
            done.len() - cases.len(),
            self.carriers,
            self.without.len(),
            self.start.elapsed().as_secs_f64()
        );
        let text = table::markdown(&head, &cases, &self.without);
        crate::write_out(self.options, "inject.md", &text)?;
        crate::write_out(self.options, "inject.json", &crate::pretty(&table::json(&head, &cases))?)?;
        Ok(text)
    }
}

/// The effects one after the other, at one size and then the other, in an order that mixes them.
fn wishes(options: &Options) -> Vec<Wish> {
    let mut list: Vec<Wish> = Vec::new();
    let count = options.cases.unwrap_or(CASES);
    let names: Vec<&'static str> = shapes::NAMES
        .into_iter()
        .filter(|n| options.only.as_ref().is_none_or(|text| n.contains(text.as_str())))
        .collect();
    for round in 0.. {
        if names.is_empty() || list.len() >= count {
            break;
        }
        let mut order = names.clone();
        let mut rng = Rng::new(options.seed).fork(&format!("order/{round}"));
        for i in (1..order.len()).rev() {
            order.swap(i, rng.below(i + 1));
        }
        for hidden in order {
            list.push(Wish { id: list.len() + 1, hidden, factor: FACTORS[round % FACTORS.len()] });
        }
    }
    list.truncate(count);
    list
}

/// Draws carriers by chance, every machine alike, until one holds the effect.
fn draw<'a>(
    wish: &Wish,
    known: &'a [Known],
    seed: u64,
) -> Result<Option<(&'a Known, &'a Ground, Drawn)>, String> {
    let mut machines: Vec<&str> = known.iter().map(|k| k.place.machine.as_str()).collect();
    machines.sort_unstable();
    machines.dedup();
    for attempt in 0..ATTEMPTS {
        let mut rng = Rng::new(seed).fork(&format!("case/{}/{}/{attempt}", wish.id, wish.hidden));
        let machine = *rng.pick(&machines);
        let own: Vec<&Known> = known.iter().filter(|k| k.place.machine == machine).collect();
        let chosen = *rng.pick(&own);
        // What the machine has already proves nothing.
        if chosen.untouched.answer.effects.iter().any(|e| e.holds(wish.hidden)) {
            continue;
        }
        let Some(ground) = chosen.ground() else { continue };
        if let Some(drawn) = ground.draw(wish.hidden, wish.factor * chosen.untouched.left, &mut rng) {
            return Ok(Some((chosen, ground, drawn)));
        }
    }
    Ok(None)
}

fn run_case(
    wish: &Wish,
    known: &[Known],
    options: &Options,
    tool: &dyn Tool,
    scratch: &Path,
) -> Result<Option<Case>, String> {
    let Some((chosen, ground, drawn)) = draw(wish, known, options.seed)? else { return Ok(None) };
    let id = format!("{:04}", wish.id);
    let dir = scratch.join(&id);
    let paths = write(&chosen.place.paths, ground, &drawn, &dir)?;
    let out = options.keep.as_ref().map_or_else(|| dir.join("out"), |keep| keep.join(&id));
    let start = Instant::now();
    let answer = tool::ask(tool, &paths, &out);
    let seconds = start.elapsed().as_secs_f64();
    evidence::collect(options, [&id, &chosen.place.machine], &[wish.hidden], &out)?;
    let report = std::fs::read_to_string(out.join("diagnosis.json")).ok();
    let report = report.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
    let plain = |carrier: &Carrier| {
        let least = PLAIN_SHARES.iter().copied().fold(1.0, f64::min);
        plain::select(carrier, least)
    };
    let case = Case {
        id,
        carrier: chosen.place.id.clone(),
        machine: chosen.place.machine.clone(),
        hidden: wish.hidden,
        factor: wish.factor,
        size: drawn.effect.size,
        oracle: drawn.oracle,
        lost: judge::lost(&report, wish.hidden),
        answer,
        own: chosen.untouched.answer.effects.clone(),
        believed: chosen.place.believed.clone(),
        plain: plain(&ground.written(&drawn)),
        plain_own: chosen.plain.get_or_init(|| plain(&ground.carrier)).clone(),
        seconds,
    };
    std::fs::remove_dir_all(&dir).map_err(|e| format!("cannot remove {}: {e}", dir.display()))?;
    Ok(Some(case))
}

/// Writes the files of the case as the tool gets them.
fn write(from: &Paths, ground: &Ground, drawn: &Drawn, dir: &Path) -> Result<Paths, String> {
    let paths = from.copied(dir)?;
    let all = |p: &Paths| -> Vec<PathBuf> { p.fit.iter().chain(&p.holdout).cloned().collect() };
    for ((from, to), changed) in all(from).iter().zip(all(&paths)).zip(&drawn.changed) {
        carrier::write(from, &to, &changed.command, &changed.counts)?;
    }
    let mut rig = ground.carrier.rig.clone();
    if let (Some(coulomb), true) = (rig.coulomb, drawn.coulomb > 0.0) {
        rig.text = rig.text_with("model", "coulomb", coulomb + drawn.coulomb);
    }
    let most = drawn.changed.iter().flat_map(|c| c.command.iter()).fold(0.0_f64, |m, u| m.max(u.abs()));
    if rig.limit.is_some_and(|limit| limit < most) {
        // The drive of this machine takes what it is sent.
        rig.text = rig.text_with("actuator", "limit", 1.05 * most);
    }
    std::fs::write(&paths.rig, &rig.text)
        .map_err(|e| format!("cannot write {}: {e}", paths.rig.display()))?;
    Ok(paths)
}
