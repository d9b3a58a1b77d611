//! A trainee's figures, insertion by insertion: time, path, force, punctures, the vessel, angle,
//! smoothness. [`gesture`] is the movement, [`vessel`] what it did to the vessel, [`smoothness`] a
//! measure of any movement; here they are put together.

pub mod gesture;
mod probe;
pub mod smoothness;
pub mod target;
pub mod tasks;
pub mod track;
pub mod vessel;

use control_core::TICK_HZ;
use control_core::config::{Fixture, Law, Tissue};
use control_core::controller::Sample;
use device_sim::error::Error;
use device_sim::procedure::task::Task;
use device_sim::profile::{Beside, Goal, Profile};
use gesture::{Gesture, Place};
use link::frames::{Event, EventKind};
use recording::read::Recording;
use recording::stretches::{Stretch, stretches};
use serde::{Deserialize, Serialize};
use std::rc::Rc;
use target::Reached;
use tasks::{LayerName, Tasks};
use vessel::Targets;

/// The name of the score in JSON.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Score {
    /// In their order in time.
    pub insertions: Vec<Insertion>,
}

/// One insertion: from the first touch of the outermost layer until the tip has left it, or the
/// recording ends.
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
    /// The results of the procedure's tasks; none if it has none.
    pub tasks: Option<Tasks>,
    /// The names of structures to be spared that were touched.
    pub hit: Vec<String>,
    /// The names of structures to be spared that were not touched.
    pub spared: Vec<String>,
    /// The number of times that the needle was turned beyond the largest angle that the patient's
    /// fixture allows.
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

/// Ticks of an insertion and where they are.
#[derive(Clone, Copy, Debug)]
pub struct Span<'a> {
    /// The whole that it is a part of.
    pub stretch: &'a Stretch,
    /// First tick.
    pub begin: u64,
    /// Tick after the last.
    pub end: u64,
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
        let judge = Judge::new(&profile, &setup.tasks, zero_tick);
        spans(stretch).into_iter().for_each(|span| see(span, &judge, &profile));
    }
    Ok(())
}

/// Insertions of a stretch: from the touch of layer 0 to leaving it.
pub fn spans(stretch: &Stretch) -> Vec<Span<'_>> {
    let span = |begin: u64, end: u64| Span { stretch, begin, end: end.max(begin) };
    let (mut spans, mut begun) = (Vec::new(), None);
    for event in &stretch.events {
        match event.kind {
            EventKind::Contact { layer: 0 } => begun = begun.or(Some(event.tick)),
            EventKind::Exit { layer: 0 } => spans.extend(begun.take().map(|begin| span(begin, event.tick))),
            _ => {}
        }
    }
    spans.extend(begun.map(|begin| span(begin, stretch.end_tick())));
    spans
}

impl Span<'_> {
    /// The movement of its tip; `skin_tilt_rad` is what the tilt reads with the needle laid on the
    /// skin.
    pub fn gesture(&self, skin_tilt_rad: f64) -> Gesture {
        let hello = &self.stretch.hello;
        let places = self.samples().iter().map(|sample| Place {
            depth_mm: f64::from(sample.count) * hello.mm_per_count,
            angle_rad: f64::from(sample.tilt_mrad) * 1e-3 - skin_tilt_rad,
        });
        Gesture::new(f64::from(TICK_HZ), places)
    }

    /// Its samples, 10 kHz.
    pub fn samples(&self) -> &[Sample] {
        &self.stretch.samples[self.at(self.begin)..self.at(self.end)]
    }

    fn at(&self, tick: u64) -> usize {
        (tick.clamp(self.stretch.first_tick, self.stretch.end_tick()) - self.stretch.first_tick) as usize
    }

    /// Events in it.
    pub fn events(&self) -> impl Iterator<Item = &Event> + '_ {
        self.stretch.events.iter().filter(|e| (self.begin..=self.end).contains(&e.tick))
    }

    /// Depth along the needle at `tick`, mm.
    pub fn depth_mm(&self, tick: u64) -> Option<f64> {
        let sample = self.stretch.samples.get(self.at(tick))?;
        Some(f64::from(sample.count) * self.stretch.hello.mm_per_count)
    }
}

/// The figures by which insertions are judged.
#[derive(Clone, Debug)]
pub struct Judge {
    entry_rad: f64,
    skin_tilt_rad: f64,
    targets: Targets,
    goal: Option<Goal>,
    tasks: Vec<Task>,
    /// Names of the layers, outermost first.
    layers: Vec<LayerName>,
    /// Number and name of each layer to be spared.
    spared: Vec<(u8, String)>,
    beside: Vec<Beside>,
    fixture: Option<Fixture>,
    zero_tick: u64,
}

impl Judge {
    /// By `profile` and the tasks of the procedure; times count from `zero_tick`.
    pub fn new(profile: &Profile, tasks: &[Task], zero_tick: u64) -> Self {
        let layers = &profile.config.patient.layers;
        let number = |wanted: Tissue| layers.iter().position(|l| l.tissue == wanted).map(|at| at as u8);
        Self {
            entry_rad: profile.entry_rad,
            skin_tilt_rad: profile.skin_tilt_rad(),
            targets: Targets {
                vessel: number(Tissue::Vessel),
                far_wall: number(Tissue::FarWall),
                spared: profile.spared.clone(),
            },
            goal: profile.goal(),
            tasks: tasks.to_vec(),
            layers: tasks::layer_names(profile),
            spared: profile.spared.iter().filter_map(|n| Some((*n, profile.layer_name(*n)?))).collect(),
            beside: profile.beside.clone(),
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

    /// Returns where the tip was along the skin at `tick`, mm.
    fn along_mm(&self, span: Span<'_>, tick: u64) -> Option<f64> {
        let sample = span.stretch.samples.get(span.at(tick))?;
        let angle_rad = f64::from(sample.tilt_mrad) * 1e-3 - self.skin_tilt_rad;
        Some(f64::from(sample.count) * span.stretch.hello.mm_per_count * angle_rad.cos())
    }

    /// Returns what became of the target, and the visits of it.
    fn target(&self, span: Span<'_>) -> Option<(Reached, Vec<(u64, u64)>)> {
        let along_mm = |tick| self.along_mm(span, tick);
        let (events, ticks) = (&span.stretch.events, (span.begin, span.end));
        let goal = self.goal.as_ref()?;
        Some(target::walk(events, ticks, goal, along_mm, 1.0 / f64::from(TICK_HZ)))
    }

    /// The figures of one insertion.
    pub fn insertion(&self, span: Span<'_>) -> Insertion {
        let (begin, end) = (span.begin, span.end);
        let samples = span.samples();
        let hello = &span.stretch.hello;
        let gesture = span.gesture(self.skin_tilt_rad);
        let deepest = samples.iter().map(|s| s.count).max().unwrap_or(0);
        let depth_mm = f64::from(deepest) * hello.mm_per_count;
        let given = || span.events().filter(|e| matches!(e.kind, EventKind::Puncture { .. }));
        let passage = vessel::passage(&span.stretch.events, (begin, end), &self.targets);
        let (target, visits) = self.target(span).unzip();
        let (mut hit, mut spared) = target::hit_and_spared(&span.stretch.events, (begin, end), &self.spared);
        let beside_hits = target::beside_hits(&gesture.places, &self.beside, &mut hit, &mut spared);
        let seen = probe::seen(&span.stretch.probes, (begin, end));
        let again = track::met_again(&span.stretch.events, (begin, end));
        let inside = given().next().map_or(&[][..], |e| &span.stretch.samples[span.at(e.tick)..span.at(end)]);
        let first = inside.first();
        let angle_rad = first.map(|s| f64::from(s.tilt_mrad) * 1e-3 - self.skin_tilt_rad);
        let wanted_rad = self.entry_rad;
        let along = gesture.angle_error(wanted_rad);
        let passes = gesture.passes();
        let seconds = |ticks: u64| ticks as f64 / f64::from(TICK_HZ);
        let entry_mm = passage.entry_tick.and_then(|tick| span.depth_mm(tick));
        Insertion {
            begin_s: seconds(begin.saturating_sub(self.zero_tick)),
            time_s: seconds(end - begin),
            path_mm: gesture.path_mm(),
            depth_mm,
            peak_force_n: samples.iter().map(|s| hello.force_n(s.dac).abs()).fold(0.0, f64::max),
            punctures: given().count() as u32,
            vessel: passage.entry_tick.is_some(),
            vessel_contact_path_mm: passage.contact_tick.and_then(|tick| span.depth_mm(tick)),
            overshoot_mm: entry_mm.map(|entry| (depth_mm - entry).max(0.0)),
            in_lumen_s: seconds(passage.in_lumen_ticks),
            flashbacks: passage.flashbacks,
            met_in_track: again.in_track,
            pierced_again: again.whole,
            through_far_wall: passage.through_far_wall,
            spared_hits: passage.spared_hits + beside_hits,
            target,
            tasks: self.tasks(span, &visits.unwrap_or_default()),
            hit,
            spared,
            barriers: span.events().filter(|e| e.kind == EventKind::Barrier).count() as u32,
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
