//! The course of a needle in one attempt, from its samples and the device's events: its places, by
//! [`NeedleTrack`], and the structures that it entered. It judges nothing.

use super::gesture::Place;
use super::span::Span;
use control_core::TICK_HZ;
use device_sim::needle::NeedleTrack;
use device_sim::profile::{Beside, Profile};
use link::frames::{Event, EventKind};

/// Ticks between two moments: 1 ms.
const EVERY: u64 = TICK_HZ as u64 / 1_000;

/// The tissue around a needle, as its course is read in it.
#[derive(Clone, Debug)]
pub(crate) struct Surroundings {
    /// A needle outside the patient.
    pub(super) track: NeedleTrack,
    pub(super) skin_tilt_rad: f64,
    pub(super) target_layer: Option<usize>,
    /// The depth of a target that ends to either side, perpendicular to the level skin, mm.
    pub(super) target_depth_mm: Option<f64>,
    /// The far wall of the vessel.
    pub(super) far_wall: Option<u8>,
    /// For each layer, outermost first, whether it has a wall.
    pub(super) walls: Vec<bool>,
    /// Number and name of each layer to be spared.
    pub(super) spared: Vec<(u8, String)>,
    pub(super) beside: Vec<Beside>,
}

impl Surroundings {
    /// Returns those of a patient.
    pub(super) fn new(profile: &Profile) -> Self {
        let goal = profile.goal();
        let ends = goal.as_ref().filter(|goal| goal.reach_mm.is_some() && profile.body.is_none());
        let depth_mm = |number: u8| {
            profile.config.patient.layers.get(usize::from(number)).map(|layer| layer.depth.0.to_num())
        };
        Self {
            track: NeedleTrack::new(profile),
            skin_tilt_rad: profile.skin_tilt_rad(),
            target_depth_mm: ends.and_then(|goal| depth_mm(goal.layer)),
            target_layer: goal.map(|goal| usize::from(goal.layer)),
            far_wall: profile.far_wall(),
            walls: profile.walls(),
            spared: profile.spared.iter().filter_map(|n| Some((*n, profile.layer_name(*n)?))).collect(),
            beside: profile.beside.clone(),
        }
    }
}

/// Something that happened, and when.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Hit {
    pub(crate) tick: u64,
    pub(crate) name: String,
}

/// The course of a needle.
#[derive(Clone, Debug, Default)]
pub(crate) struct Course {
    pub(crate) begin: u64,
    pub(crate) end: u64,
    /// True if the needle has left the skin at the end.
    pub(crate) is_out: bool,
    /// Its places, every millisecond.
    pub(crate) places: Vec<Place>,
    /// True where its line meets the target, every millisecond.
    pub(crate) meets_target: Vec<bool>,
    /// The number of times that the tip passed the target's depth where the target is not.
    pub(crate) passed_beside: u32,
    is_beside: bool,
    /// When the skin gave way.
    pub(crate) skin: Vec<u64>,
    /// Visits of the vessel's lumen, from and to.
    pub(crate) lumen: Vec<(u64, u64)>,
    /// When the vessel's far wall gave way.
    pub(crate) far_wall: Option<u64>,
    /// Structures to be spared that were entered: through their wall, or touched without one.
    pub(crate) hits: Vec<Hit>,
}

impl Course {
    /// Follows the needle of an attempt.
    pub(crate) fn new(span: Span<'_>, around: &Surroundings) -> Self {
        let mut course = Self { begin: span.begin, end: span.end, ..Self::default() };
        let mut track = NeedleTrack::clone(&around.track);
        let mut events = span.stretch.events.iter().filter(|event| event.tick <= span.end).peekable();
        while events.next_if(|event| event.tick < span.begin).is_some() {}
        let mut beside = vec![false; around.beside.len()];
        for tick in (span.begin..span.end).step_by(EVERY as usize) {
            let Some(sample) = span.stretch.samples.get(span.at(tick)) else { break };
            let depth_mm = f64::from(sample.count) * span.stretch.hello.mm_per_count;
            let angle_rad = f64::from(sample.tilt_mrad) * 1e-3 - around.skin_tilt_rad;
            track.move_to(depth_mm, angle_rad);
            while let Some(event) = events.next_if(|event| event.tick < tick + EVERY) {
                track.happen(&event.kind);
                course.happen(event, around, &track);
            }
            course.follow(tick, &track, around);
            for (was_in, structure) in beside.iter_mut().zip(&around.beside) {
                let [x, y] = track.tip_mm();
                let is_in = structure.contains((x, y));
                if is_in && !*was_in {
                    course.hits.push(Hit { tick, name: structure.name.clone() });
                }
                *was_in = is_in;
            }
        }
        events.for_each(|event| course.happen(event, around, &track));
        course
    }

    fn happen(&mut self, event: &Event, around: &Surroundings, track: &NeedleTrack) {
        let (layer, enters) = match event.kind {
            EventKind::Contact { layer } => (layer, false),
            EventKind::Puncture { layer } | EventKind::InTrack { layer } => (layer, true),
            EventKind::Exit { layer: 0 } => {
                self.is_out = event.tick == self.end;
                return;
            }
            _ => return,
        };
        let number = usize::from(layer);
        let has_wall = around.walls.get(number).is_some_and(|has_wall| *has_wall);
        let is_there = track.tops_mm().get(number).is_some_and(Option::is_some);
        if layer == 0 && enters == has_wall && !matches!(event.kind, EventKind::InTrack { .. }) {
            self.skin.push(event.tick);
        }
        if enters == has_wall && is_there && around.far_wall == Some(layer) {
            self.far_wall = self.far_wall.or(Some(event.tick));
        }
        if enters == has_wall
            && is_there
            && let Some((_, name)) = around.spared.iter().find(|(spared, _)| *spared == layer)
        {
            self.hits.push(Hit { tick: event.tick, name: name.clone() });
        }
    }

    fn follow(&mut self, tick: u64, track: &NeedleTrack, around: &Surroundings) {
        self.places.push(Place {
            depth_mm: track.depth_mm(),
            angle_rad: track.angle_rad(),
            origin_mm: track.origin_mm(),
        });
        let is_past = around.target_depth_mm.is_some_and(|depth_mm| track.tip_mm()[1] >= depth_mm);
        let met = around.target_layer.and_then(|number| track.tops_mm().get(number));
        let meets = met.is_some_and(Option::is_some);
        self.passed_beside += u32::from(is_past && !meets && !self.is_beside);
        self.is_beside = is_past && !meets;
        self.meets_target.push(meets);
        let stays = self.lumen.last_mut().filter(|(_, to)| *to == tick);
        match (track.is_in_lumen(), stays) {
            (true, Some((_, to))) => *to = tick + EVERY,
            (true, None) => self.lumen.push((tick, tick + EVERY)),
            (false, _) => {}
        }
    }

    fn index(&self, tick: u64) -> usize {
        let last = self.places.len().saturating_sub(1);
        (tick.saturating_sub(self.begin) / EVERY).min(last as u64) as usize
    }

    /// Returns the needle's place at `tick`.
    pub(crate) fn place(&self, tick: u64) -> Place {
        self.places.get(self.index(tick)).copied().unwrap_or_default()
    }

    /// Returns its places from one tick to another, each with its tick.
    pub(crate) fn between(&self, from: u64, to: u64) -> impl Iterator<Item = (u64, &Place)> + '_ {
        let range = self.index(from)..self.index(to.max(from));
        let first = range.start as u64;
        self.places[range].iter().zip(first..).map(|(place, index)| (self.begin + index * EVERY, place))
    }

    /// True if the line meets the target at `tick`.
    pub(crate) fn meets_target(&self, tick: u64) -> bool {
        self.meets_target.get(self.index(tick)).is_some_and(|meets| *meets)
    }

    /// True if the tip is in the lumen at `tick`.
    pub(crate) fn is_in_lumen(&self, tick: u64) -> bool {
        self.lumen.iter().any(|(from, to)| (*from..*to).contains(&tick))
    }

    /// Returns the time in the lumen, s.
    pub(crate) fn in_lumen_s(&self) -> f64 {
        self.lumen.iter().map(|(from, to)| to - from).sum::<u64>() as f64 / f64::from(TICK_HZ)
    }
}
