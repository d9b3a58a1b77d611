//! A trainee's figures, insertion by insertion: time, path, force, punctures, the vessel, angle,
//! smoothness. [`gesture`] is the movement, `course` what it entered, [`smoothness`] a measure of
//! any movement; here they are put together, with the verdict.

pub(crate) mod course;
pub mod gesture;
mod probe;
pub mod smoothness;
mod span;
pub mod target;
pub mod track;

use crate::goal::Goal as Aim;
use crate::verdict::{self, Done, Facts, Verdict};
use control_core::TICK_HZ;
use control_core::config::{Fixture, Law, Tissue};
use control_core::controller::Sample;
use course::{Course, Surroundings};
use device_sim::device::virtual_device::SLOPE_BARRIER;
use device_sim::error::Error;
use device_sim::procedure::purpose::Purpose;
use device_sim::profile::{Goal, Profile};
use gesture::Gesture;
use link::frames::{Event, EventKind};
use recording::read::Recording;
use recording::stretches::{Stretch, stretches};
use serde::{Deserialize, Serialize};
pub use span::Span;
use std::rc::Rc;
use target::Reached;

/// The name of the score in JSON.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Score {
    /// In their order in time.
    pub insertions: Vec<Insertion>,
}

/// One insertion: from the first touch of the outermost layer until the tip has left it, or the
/// recording ends. Where the goal begins with a task, a second hole in the skin is a part of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Insertion {
    /// When it began, s into the recording.
    pub begin_s: f64,
    /// The duration, s.
    pub time_s: f64,
    /// The length of the tip's way, in, out and sideways, mm. Twice the depth is the least.
    pub path_mm: f64,
    /// Deepest place along the needle, mm.
    pub depth_mm: f64,
    /// Largest force that the motor made, N.
    pub peak_force_n: f64,
    /// Walls that gave way.
    pub punctures: u32,
    /// True if the vessel's wall was among them.
    pub vessel: bool,
    /// Depth along the needle at which the vessel was first touched, mm; none where it was not.
    pub vessel_contact_path_mm: Option<f64>,
    /// The distance that the tip went on after the vessel's wall had given way, mm; none if it did
    /// not give way.
    pub overshoot_mm: Option<f64>,
    /// Time in the vessel's lumen, s.
    pub in_lumen_s: f64,
    /// The number of times that blood came into the hub.
    pub flashbacks: u32,
    /// Layers that were open in the needle's own track when it met them again.
    pub met_in_track: u32,
    /// Layers that gave way once more, for instance next to the track.
    pub pierced_again: u32,
    /// True if the needle went through the vessel's far wall.
    pub through_far_wall: bool,
    /// The number of times that something to be spared was touched.
    pub spared_hits: u32,
    /// The result for the patient's target; none if the patient has none.
    pub target: Option<Reached>,
    /// The verdict.
    pub verdict: Verdict,
    /// The names of structures to be spared that were touched.
    pub hit: Vec<String>,
    /// The names of structures to be spared that were not touched.
    pub spared: Vec<String>,
    /// The number of times that the needle was turned beyond the largest angle that the patient's
    /// fixture allows, or came to a barrier of its slope.
    pub barriers: u32,
    /// Largest force across the needle that would have held its direction of entry, N; none where
    /// the patient has no fixture.
    pub largest_lateral_n: Option<f64>,
    /// The number of times that the needle was pushed in: once, and again whenever it was after
    /// having been drawn back by 2 mm.
    pub passes: u32,
    /// Those of them that went in another direction, by 3° or more.
    pub redirections: u32,
    /// Angle to the skin when the first wall gave way, °; none where none did.
    pub angle_deg: Option<f64>,
    /// The same less the profile's entry angle, °.
    pub angle_error_deg: Option<f64>,
    /// Root mean square of the angle less the profile's, every mm of the way counting the same, °.
    pub angle_rms_error_deg: Option<f64>,
    /// Largest of it, with its sign, °.
    pub angle_largest_error_deg: Option<f64>,
    /// Share of the time at which the ultrasound image showed the tip; none where no image was
    /// shown.
    pub tip_seen_share: Option<f64>,
    /// Share of the needle in tissue that lay in the image's plane, its mean over that time.
    pub in_plane_share: Option<f64>,
    /// Spectral arc length of the tip's speed on the way in: about −1.4 where it is one smooth
    /// movement.
    pub smoothness: Option<f64>,
}

/// The needle may pierce the skin again in the same attempt until it has been out for so long: 5 s.
const AGAIN_TICKS: u64 = 5 * TICK_HZ as u64;

/// Returns how often the needle was turned further than the tissue allows, or than the device's
/// slope.
fn barriers(span: Span<'_>) -> u32 {
    let tissue = span.events().filter(|event| event.kind == EventKind::Barrier).count();
    let within = span.stretch.tasks.iter().filter(|task| (span.begin..=span.end).contains(&task.tick));
    (tissue + within.filter(|task| task.name == SLOPE_BARRIER).count()) as u32
}

/// True if the needle came into the vessel in these ticks.
fn enters_vessel(stretch: &Stretch, (begin, end): (u64, u64)) -> bool {
    let mut within = stretch.events.iter().filter(|event| (begin..=end).contains(&event.tick));
    within.any(|event| matches!(event.kind, EventKind::Vessel { .. } | EventKind::Flashback { .. }))
}

/// All insertions of a recording, judged by one profile or each by the one that it was recorded
/// with.
pub fn score(recording: &Recording, by: Option<&Profile>) -> Result<Score, Error> {
    let mut insertions = Vec::new();
    each(recording, by, |span, judge, _| insertions.push(judge.insertion(span)))?;
    Ok(Score { insertions })
}

/// Shows every insertion of a recording with its judge and its patient to `see`.
pub fn each(
    recording: &Recording,
    by: Option<&Profile>,
    mut see: impl FnMut(Span<'_>, &Judge, &Rc<Profile>),
) -> Result<(), Error> {
    let stretches = stretches(recording);
    let zero_tick = stretches.first().map_or(0, |s| s.first_tick);
    let given = by.map(|profile| Rc::new(profile.clone()));
    for stretch in &stretches {
        let profile = match &given {
            Some(profile) => profile.clone(),
            None => Rc::new(recording.profile_of(stretch.setup.as_ref().unwrap_or(&recording.setup))?),
        };
        let setup = stretch.setup.as_ref().unwrap_or(&recording.setup);
        let judge = Judge::new(&profile, setup.purpose, zero_tick);
        judge.spans(stretch).into_iter().for_each(|(span, _)| see(span, &judge, &profile));
    }
    Ok(())
}

/// Visits of the skin in a stretch: from the touch of layer 0 to leaving it. The last may not have
/// ended.
fn visits(stretch: &Stretch) -> Vec<(u64, Option<u64>)> {
    let (mut visits, mut begun) = (Vec::new(), None);
    for event in &stretch.events {
        match event.kind {
            EventKind::Contact { layer: 0 } => begun = begun.or(Some(event.tick)),
            EventKind::Exit { layer: 0 } => {
                visits.extend(begun.take().map(|begin| (begin, Some(event.tick.max(begin)))));
            }
            _ => {}
        }
    }
    visits.extend(begun.map(|begin| (begin, None)));
    visits
}

/// The figures by which insertions are judged.
#[derive(Clone, Debug)]
pub struct Judge {
    entry_rad: f64,
    aim: Aim,
    surroundings: Surroundings,
    vessel: Option<u8>,
    goal: Option<Goal>,
    fixture: Option<Fixture>,
    zero_tick: u64,
}

impl Judge {
    /// Times count from here on.
    pub(crate) fn count_from(&mut self, zero_tick: u64) {
        self.zero_tick = zero_tick;
    }

    /// Returns the goal that it judges by.
    pub(crate) fn aim(&self) -> &Aim {
        &self.aim
    }

    /// By `profile` and the purpose of the procedure; times count from `zero_tick`.
    pub fn new(profile: &Profile, purpose: Option<Purpose>, zero_tick: u64) -> Self {
        let layers = &profile.config.patient.layers;
        Self {
            entry_rad: profile.entry_rad,
            aim: Aim::of(profile, purpose),
            surroundings: Surroundings::new(profile),
            vessel: layers.iter().position(|l| l.tissue == Tissue::Vessel).map(|at| at as u8),
            goal: profile.goal(),
            fixture: match &profile.config.patient.law {
                Law::Sparte(law) => Some(law.fixture),
                Law::Jog(_) | Law::Xr(_) => None,
            },
            zero_tick,
        }
    }

    /// Returns the largest lateral force over `samples`, N; the first sample is at the entry.
    fn lateral_n(&self, samples: &[Sample]) -> Option<f64> {
        let (fixture, entry) = (self.fixture?, samples.first()?);
        let off = |sample: &Sample| (i32::from(sample.tilt_mrad) - i32::from(entry.tilt_mrad)).abs();
        let most = samples.iter().map(off).max()?.min(i32::from(fixture.largest.0));
        Some(f64::from(most) * fixture.per_mrad.0.to_num::<f64>())
    }

    /// The attempts of a stretch, and whether each has ended. Where the goal begins with a task,
    /// the needle may leave the skin and pierce it again in one attempt: until it has come into the
    /// vein, the task is done anew, or `AGAIN_TICKS` have passed.
    pub fn spans<'a>(&self, stretch: &'a Stretch) -> Vec<(Span<'a>, bool)> {
        let mut attempts: Vec<(u64, u64, bool)> = Vec::new();
        let now = stretch.end_tick();
        let begins_anew = |from: u64, to: u64| {
            let first = self.aim.steps.first().and_then(|step| step.task());
            stretch
                .tasks
                .iter()
                .any(|task| Some(task.name.as_str()) == first && (from..to).contains(&task.tick))
        };
        for (begin, end) in visits(stretch) {
            match attempts.last_mut() {
                Some((_, last, ended))
                    if !*ended && !begins_anew(*last, begin) && begin < *last + AGAIN_TICKS =>
                {
                    *last = end.unwrap_or(now);
                }
                _ => attempts.push((begin, end.unwrap_or(now), false)),
            }
            let Some((from, last, ended)) = attempts.last_mut() else { continue };
            *ended =
                end.is_some() && (!self.aim.begins_with_task() || enters_vessel(stretch, (*from, *last)));
        }
        let later = attempts.iter().map(|(begin, ..)| *begin).skip(1).chain([u64::MAX]).collect::<Vec<_>>();
        let is_out = visits(stretch).last().is_some_and(|(_, end)| end.is_some());
        let whole = attempts.into_iter().zip(later).map(|((begin, end, ended), next)| {
            let waited = is_out && (now >= end + AGAIN_TICKS || begins_anew(end, now));
            (Span { stretch, begin, end }, ended || next != u64::MAX || waited)
        });
        whole.collect()
    }

    /// Returns what became of the target, and the visits of it.
    fn target(&self, span: Span<'_>, course: &Course) -> Option<(Reached, Vec<(u64, u64)>)> {
        let (events, ticks) = (&span.stretch.events, (span.begin, span.end));
        let goal = self.goal.as_ref()?;
        let is_there = |tick| course.meets_target(tick);
        let (mut reached, visits) = target::walk(events, ticks, goal, is_there, 1.0 / f64::from(TICK_HZ));
        reached.passed_beside = reached.passed_beside.max(course.passed_beside);
        Some((reached, visits))
    }

    /// Returns the tasks that were done for an attempt: since the needle left the skin the last
    /// time, and from the first one of the goal on if that was done before.
    fn done(&self, span: Span<'_>) -> Vec<Done> {
        let is_end = |event: &&Event| event.tick < span.begin && event.kind == EventKind::Exit { layer: 0 };
        let since = span.stretch.events.iter().rfind(is_end).map_or(0, |event| event.tick + 1);
        let told = span.stretch.tasks.iter().filter(|task| (since..=span.end).contains(&task.tick));
        let done: Vec<Done> = told.map(|task| Done { name: task.name.clone(), tick: task.tick }).collect();
        let first = self.aim.steps.first().and_then(|step| step.task());
        let is_first = |one: &Done| one.tick < span.begin && Some(one.name.as_str()) == first;
        let from = done.iter().position(is_first);
        let from = from.unwrap_or_else(|| done.iter().take_while(|one| one.tick < span.begin).count());
        done.into_iter().skip(from).collect()
    }

    /// The verdict on an attempt, which may be going on.
    pub fn verdict(&self, span: Span<'_>) -> Verdict {
        let course = Course::new(span, &self.surroundings);
        self.judged(span, &course, self.target(span, &course).as_ref())
    }

    fn judged(
        &self,
        span: Span<'_>,
        course: &Course,
        target: Option<&(Reached, Vec<(u64, u64)>)>,
    ) -> Verdict {
        let target = target.map(|(reached, visits)| (reached.outcome, &visits[..]));
        verdict::judge(&self.aim, &Facts { course, done: &self.done(span), target })
    }

    /// The movement of an attempt.
    pub fn gesture(&self, span: Span<'_>) -> Gesture {
        Gesture::new(1_000.0, Course::new(span, &self.surroundings).places)
    }

    /// Returns when the vessel was first touched.
    fn contact(&self, span: Span<'_>) -> Option<u64> {
        let layer = self.vessel?;
        let mut events = span.events();
        events.find(|event| event.kind == EventKind::Contact { layer }).map(|event| event.tick)
    }

    /// Returns how often something to be spared was touched, and the names of what was and was not.
    fn hits(&self, span: Span<'_>, gesture: &Gesture) -> (u32, Vec<String>, Vec<String>) {
        let Surroundings { spared: layers, beside, .. } = &self.surroundings;
        let touched =
            |e: &&Event| layers.iter().any(|(layer, _)| e.kind == EventKind::Contact { layer: *layer });
        let touches = span.events().filter(touched).count() as u32;
        let ticks = (span.begin, span.end);
        let (mut hit, mut spared) = target::hit_and_spared(&span.stretch.events, ticks, layers);
        let beside_hits = target::beside_hits(&gesture.places, beside, &mut hit, &mut spared);
        (touches + beside_hits, hit, spared)
    }

    /// The figures of one insertion.
    pub fn insertion(&self, span: Span<'_>) -> Insertion {
        let course = Course::new(span, &self.surroundings);
        let (begin, end) = (span.begin, span.end);
        let samples = span.samples();
        let hello = &span.stretch.hello;
        let gesture = Gesture::new(1_000.0, course.places.iter().copied());
        let deepest = samples.iter().map(|s| s.count).max().unwrap_or(0);
        let depth_mm = f64::from(deepest) * hello.mm_per_count;
        let given = || span.events().filter(|e| matches!(e.kind, EventKind::Puncture { .. }));
        let contact = self.contact(span);
        let entry = course.lumen.first().map(|(from, _)| *from);
        let target = self.target(span, &course);
        let verdict = self.judged(span, &course, target.as_ref());
        let (spared_hits, hit, spared) = self.hits(span, &gesture);
        let seen = probe::seen(&span.stretch.probes, (begin, end));
        let again = track::met_again(&span.stretch.events, (begin, end));
        let inside = given().next().map_or(&[][..], |e| &span.stretch.samples[span.at(e.tick)..span.at(end)]);
        let first = inside.first();
        let angle_rad = first.map(|s| f64::from(s.tilt_mrad) * 1e-3 - self.surroundings.skin_tilt_rad);
        let wanted_rad = self.entry_rad;
        let along = gesture.angle_error(wanted_rad);
        let passes = gesture.passes();
        let seconds = |ticks: u64| ticks as f64 / f64::from(TICK_HZ);
        let entry_mm = entry.and_then(|tick| span.depth_mm(tick));
        Insertion {
            begin_s: seconds(begin.saturating_sub(self.zero_tick)),
            time_s: seconds(end - begin),
            path_mm: gesture.path_mm(),
            depth_mm,
            peak_force_n: samples.iter().map(|s| hello.force_n(s.dac).abs()).fold(0.0, f64::max),
            punctures: given().count() as u32,
            vessel: entry.is_some(),
            vessel_contact_path_mm: contact.and_then(|tick| span.depth_mm(tick)),
            overshoot_mm: entry_mm.map(|entry| (depth_mm - entry).max(0.0)),
            in_lumen_s: course.in_lumen_s(),
            flashbacks: course.lumen.len() as u32,
            met_in_track: again.in_track,
            pierced_again: again.whole,
            through_far_wall: course.far_wall.is_some(),
            spared_hits,
            target: target.map(|(reached, _)| reached),
            verdict,
            hit,
            spared,
            barriers: barriers(span),
            largest_lateral_n: self.lateral_n(inside),
            passes: passes.passes,
            redirections: passes.redirections,
            angle_deg: angle_rad.map(f64::to_degrees),
            angle_error_deg: angle_rad.map(|rad| (rad - wanted_rad).to_degrees()),
            angle_rms_error_deg: along.map(|error| error.rms_deg),
            angle_largest_error_deg: along.map(|error| error.largest_deg),
            tip_seen_share: seen.map(|seen| seen.tip_share),
            in_plane_share: seen.map(|seen| seen.in_plane_share),
            smoothness: smoothness::spectral_arc_length(
                &gesture.speed_mm_s(gesture.way_in()),
                gesture::RATE_HZ,
            ),
        }
    }
}
