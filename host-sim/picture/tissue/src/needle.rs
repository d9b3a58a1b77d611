//! The needle in the tissue: a puncture state for every wall, and what it holds on to.
//!
//! A wall is away, touching (the tip pushes it in and carries what lies under it) or inserted (its
//! pierced place is held to the needle's axis and dragged along it). In between, the tissue is held
//! to the shaft at points a little apart. Whatever the needle does, no place is ever wanted farther
//! from its rest than the wall's give, the drag and `TEAR_MM` allow: this keeps the picture
//! bounded.

use crate::constraint::{Anchor, Point, place};
use crate::shaft::Hold;
use crate::vector::{Vector, cross, dot, length, scale, sub};

pub use crate::shaft::Needle;

/// A held place that would be pulled farther aside than this lets go and is taken hold of anew, mm.
pub(crate) const TEAR_MM: f32 = 3.0;
/// Distance between the places along the shaft where tissue is held, mm.
const SHAFT_MM: f32 = 1.2;
/// Most places held along the shaft.
const MOST_HOLDS: usize = 48;
/// A wall that others say still holds gives way this much later than its own depth, mm: the page
/// was opened late.
const LATE_MM: f32 = 2.0;
/// The length back along the needle over which a wall is looked for, mm.
const NEEDLE_MM: f32 = 80.0;

/// The state of a wall towards the needle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PunctureState {
    /// The tip has not met it.
    #[default]
    Away,
    /// The tip pushes it in.
    Touching,
    /// The needle is through it.
    Inserted,
}

/// The rule by which a wall gives way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Punctures {
    /// The picture, by how far the wall is pushed in.
    #[default]
    Geometric,
    /// The device, by its events.
    Told,
}

/// The name of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallName {
    /// The upper surface of a layer, outermost 0.
    Layer(usize),
    /// The vessel's wall towards the skin.
    Near,
    /// The vessel's wall on the other side.
    Far,
}

/// A surface that the needle has to pass.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    pub(crate) name: WallName,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) gives: f32,
    pub(crate) drag: f32,
    state: PunctureState,
    /// The device has said that it gave way.
    given: bool,
    /// The place at which it is touched, and where that place was at first.
    touch: Option<(Anchor, Vector)>,
    hold: Option<Hold>,
    indentation: f32,
}

impl Wall {
    pub(crate) fn new(name: WallName, triangles: Vec<[u32; 3]>, gives: f32, drag: f32) -> Self {
        Self {
            name,
            triangles,
            gives,
            drag,
            state: PunctureState::Away,
            given: false,
            touch: None,
            hold: None,
            indentation: 0.0,
        }
    }

    fn leave(&mut self) {
        self.state = PunctureState::Away;
        self.touch = None;
        self.hold = None;
        self.indentation = 0.0;
    }

    /// Returns the first place at which the needle's axis, up to its tip, passes through it: from
    /// inside if `from_inside`.
    fn crossing(&self, points: &[Point], needle: &Needle) -> Option<Anchor> {
        let from_inside = self.name == WallName::Far;
        let mut first: Option<(f32, Anchor)> = None;
        for triangle in &self.triangles {
            let corners = triangle.map(|index| place(&points[index as usize]));
            let Some((along, weights, inwards)) = meet(corners, needle) else { continue };
            if inwards == from_inside || !(-NEEDLE_MM..=0.0).contains(&along) {
                continue;
            }
            if first.is_none_or(|(best, _)| along < best) {
                let mut corners = [(0, 0.0); 3];
                for (slot, corner) in corners.iter_mut().zip(triangle.iter().copied().zip(weights)) {
                    *slot = corner;
                }
                first = Some((along, Anchor::new(&corners)));
            }
        }
        first.map(|(_, anchor)| anchor)
    }
}

/// Returns where a needle's axis meets a triangle: mm past the tip, weights of the corners, whether
/// it goes in there (against the triangle's normal). Möller and Trumbore 1997.
fn meet(p: [Vector; 3], needle: &Needle) -> Option<(f32, [f32; 3], bool)> {
    let (e1, e2) = (sub(p[1], p[0]), sub(p[2], p[0]));
    let h = cross(needle.direction, e2);
    let determinant = dot(e1, h);
    if determinant.abs() < 1e-9 {
        return None;
    }
    let s = sub(needle.tip, p[0]);
    let u = dot(s, h) / determinant;
    let q = cross(s, e1);
    let v = dot(needle.direction, q) / determinant;
    let slack = 1e-4;
    if u < -slack || v < -slack || u + v > 1.0 + slack {
        return None;
    }
    Some((dot(e2, q) / determinant, [1.0 - u - v, u, v], determinant > 0.0))
}

/// A place and where the needle wants it.
#[derive(Clone, Copy, Debug)]
struct Target {
    anchor: Anchor,
    wanted: Vector,
    /// Only pushed along this direction, where there is one; a tip does not pull.
    only_push: Option<Vector>,
}

/// The needle and everything that it touches or holds.
#[derive(Clone, Debug)]
pub(crate) struct Insertion {
    pub(crate) walls: Vec<Wall>,
    punctures: Punctures,
    needle: Option<Needle>,
    shaft: Vec<Hold>,
    targets: Vec<Target>,
}

impl Insertion {
    pub(crate) fn new(walls: Vec<Wall>, punctures: Punctures) -> Self {
        let targets = Vec::with_capacity(MOST_HOLDS + walls.len());
        Self { walls, punctures, needle: None, shaft: Vec::with_capacity(MOST_HOLDS), targets }
    }

    pub(crate) fn set_punctures(&mut self, punctures: Punctures) {
        self.punctures = punctures;
    }

    /// The device says that a wall gave way, or that the needle has left it.
    pub(crate) fn tell(&mut self, name: WallName, state: PunctureState) {
        if let Some(wall) = self.walls.iter_mut().find(|wall| wall.name == name) {
            wall.given = state == PunctureState::Inserted;
        }
    }

    pub(crate) fn states(&self) -> impl Iterator<Item = (WallName, PunctureState, f32)> {
        self.walls.iter().map(|wall| (wall.name, wall.state, wall.indentation))
    }

    pub(crate) fn touched(&self) -> Option<Anchor> {
        self.walls.first().and_then(|wall| wall.touch).map(|(anchor, _)| anchor)
    }

    /// Follows the needle to where it is now; `material` finds the tissue that was at a place at
    /// rest.
    pub(crate) fn follow(
        &mut self,
        needle: Needle,
        dt: f32,
        points: &[Point],
        rest: &[Point],
        material: impl Fn(Vector) -> Option<Anchor>,
    ) {
        let Some(needle) = needle.checked() else { return };
        let before = self.needle.replace(needle).unwrap_or(needle);
        let advance = dot(sub(needle.tip, before.tip), needle.direction);
        for number in 0..self.walls.len() {
            let open = self.is_open(self.walls[number].name);
            let wall = &mut self.walls[number];
            step_wall(wall, open, self.punctures, (&needle, advance, dt), points, rest);
        }
        let in_tissue = self.walls.first().is_some_and(|wall| wall.state == PunctureState::Inserted);
        for hold in &mut self.shaft {
            hold.follow(advance, dt);
        }
        self.shaft.retain(|hold| in_tissue && !hold.is_left(&needle) && hold.target(&needle).1 <= TEAR_MM);
        if in_tissue {
            self.hold_on(&needle, points, rest, material);
        }
        self.aim(&needle);
    }

    /// True if everything before a wall has been passed.
    fn is_open(&self, name: WallName) -> bool {
        let before = match name {
            WallName::Layer(0) => return true,
            WallName::Layer(number) => WallName::Layer(number - 1),
            WallName::Near => WallName::Layer(0),
            WallName::Far => WallName::Near,
        };
        self.walls.iter().any(|wall| wall.name == before && wall.state == PunctureState::Inserted)
    }

    /// Takes hold of the tissue around the tip, where the last hold is far enough back.
    fn hold_on(
        &mut self,
        needle: &Needle,
        points: &[Point],
        rest: &[Point],
        material: impl Fn(Vector) -> Option<Anchor>,
    ) {
        let near = |hold: &Hold| dot(sub(needle.tip, hold.target(needle).0), needle.direction) < SHAFT_MM;
        if self.shaft.len() >= MOST_HOLDS || self.shaft.iter().any(near) {
            return;
        }
        // The tissue at the tip: looked for at the tip, then where the displacement found there
        // says.
        let mut wanted = needle.tip;
        let mut found = None;
        for _ in 0..3 {
            let Some(anchor) = material(wanted) else { return };
            wanted = sub(needle.tip, sub(anchor.place(points), anchor.place(rest)));
            found = Some(anchor);
        }
        if let Some(anchor) = found {
            let drag = self.walls.first().map_or(0.5, |wall| wall.drag);
            self.shaft.push(Hold::new(anchor, rest, needle, drag, LATE_MM));
        }
    }

    fn aim(&mut self, needle: &Needle) {
        self.targets.clear();
        for hold in self.shaft.iter().chain(self.walls.iter().filter_map(|wall| wall.hold.as_ref())) {
            self.targets.push(Target { anchor: hold.anchor, wanted: hold.target(needle).0, only_push: None });
        }
        for (anchor, _) in self.walls.iter().filter_map(|wall| wall.touch.as_ref()) {
            self.targets.push(Target {
                anchor: *anchor,
                wanted: needle.tip,
                only_push: Some(needle.direction),
            });
        }
    }

    /// Holds what is held; for the solver, once in every iteration.
    pub(crate) fn hold(&self, points: &mut [Point], inverse_dt2: f32) {
        for target in &self.targets {
            if let Some(push) = target.only_push
                && dot(sub(target.wanted, target.anchor.place(points)), push) <= 0.0
            {
                continue;
            }
            target.anchor.hold(points, target.wanted, 0.0, inverse_dt2);
        }
    }
}

/// Moves the state of one wall on. `motion`: the needle, how far it went along itself (mm), in what
/// time (s).
fn step_wall(
    wall: &mut Wall,
    open: bool,
    punctures: Punctures,
    (needle, advance, dt): (&Needle, f32, f32),
    points: &[Point],
    rest: &[Point],
) {
    if !open {
        wall.leave();
        return;
    }
    if let Some(hold) = &mut wall.hold {
        hold.follow(advance, dt);
        if hold.is_left(needle) {
            wall.given = false;
            wall.leave();
            return;
        }
        if hold.target(needle).1 <= TEAR_MM {
            return;
        }
        // Torn: the needle is still through it, at another place.
        wall.hold = None;
        wall.given = true;
        wall.state = PunctureState::Away;
    }
    if let Some((_, home)) = wall.touch {
        let offset = sub(needle.tip, home);
        wall.indentation = dot(offset, needle.direction);
        let aside = length(sub(offset, scale(needle.direction, wall.indentation)));
        if wall.indentation <= 0.0 || aside > TEAR_MM {
            wall.leave();
        }
    }
    if wall.touch.is_none() {
        let Some(anchor) = wall.crossing(points, needle) else { return };
        let home = anchor.place(points);
        wall.state = PunctureState::Touching;
        wall.indentation = dot(sub(needle.tip, home), needle.direction);
        wall.touch = Some((anchor, home));
    }
    let gives = wall.gives + if punctures == Punctures::Told { LATE_MM } else { 0.0 };
    if (wall.given || wall.indentation >= gives)
        && let Some((anchor, _)) = wall.touch.take()
    {
        wall.state = PunctureState::Inserted;
        wall.hold = Some(Hold::new(anchor, rest, needle, wall.drag, wall.gives + LATE_MM));
        wall.indentation = 0.0;
    }
}
