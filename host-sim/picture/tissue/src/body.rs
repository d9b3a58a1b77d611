//! The whole picture: built from a configuration, moved by a needle, read by whoever draws.

use crate::configuration::{Configuration, Refusal};
use crate::constraint::{Anchor, Point, Tie, place};
use crate::lattice::{Extent, Lattice};
use crate::needle::{Insertion, Needle, PunctureState, Punctures, Wall, WallName};
use crate::solver::{Pace, Parts, Solver};
use crate::tube::Tube;
use crate::vector::{Vector, add, cross, scale, sub};

/// Compliance of the ties between layers, mm/µN: stiffer than any layer.
const TIE: f32 = 1e-6;

/// The part of the body that a surface shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The skin on the far side of the needle's plane (y < 0), as one sees it with the insertion to
    /// the right.
    SkinBehind,
    /// The skin on the near side.
    SkinBefore,
    /// The upper surface of a layer, whole.
    Top(usize),
    /// A layer cut along the needle's plane.
    Section(usize),
    /// A layer cut across at the end of the block.
    End(usize),
    /// The vessel's wall.
    Vessel,
}

/// Triangles of particles, facing outwards.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The part that it shows.
    pub part: Part,
    /// Its triangles, by the numbers of particles.
    pub triangles: Vec<[u32; 3]>,
}

/// Tissue in motion.
#[derive(Clone, Debug)]
pub struct Tissue {
    solver: Solver,
    rest: Vec<Point>,
    lattices: Vec<Lattice>,
    surfaces: Vec<Surface>,
    insertion: Insertion,
    pace: Pace,
    normals: Vec<[f32; 4]>,
}

impl Tissue {
    /// Builds what `configuration` says, at rest.
    pub fn new(configuration: &Configuration) -> Result<Self, Refusal> {
        configuration.check()?;
        let c = configuration;
        let mut parts = Parts::default();
        let mut lattices: Vec<Lattice> = vec![];
        let extent = Extent {
            along: c.along_mm,
            half_width: c.half_width_mm,
            limb_radius: c.limb_radius_mm,
            relief: c.relief.as_ref(),
            density: c.density,
        };
        for (number, layer) in c.layers.iter().enumerate() {
            let lattice = Lattice::build(layer, number, extent, &mut parts);
            if let Some(above) = lattices.last() {
                tie_layers(above, &lattice, &mut parts);
            }
            lattices.push(lattice);
        }
        if let Some(lowest) = lattices.last() {
            lowest.hold_bottom(&mut parts);
        }
        let tube = c.vessel.as_ref().map(|vessel| {
            let tube = Tube::build(vessel, extent, &mut parts);
            for particle in tube.particles() {
                let rest = place(&parts.points[particle as usize]);
                if let Some(anchor) = lattices.iter().find_map(|lattice| lattice.anchor(rest)) {
                    parts.ties.push(Tie::at_rest(particle, anchor, TIE, &parts.points));
                }
            }
            tube
        });
        let rest = parts.points.clone();
        let surfaces = surfaces(&lattices, tube.as_ref(), &rest);
        let walls = walls(c, &lattices, &surfaces);
        Ok(Self {
            solver: Solver::new(parts),
            normals: vec![[0.0; 4]; rest.len()],
            rest,
            lattices,
            surfaces,
            insertion: Insertion::new(walls, Punctures::Geometric),
            pace: Pace { substeps: c.substeps, iterations: c.iterations, damping: c.damping },
        })
    }

    /// Sets by what it is decided that a wall gives way.
    pub fn set_punctures(&mut self, punctures: Punctures) {
        self.insertion.set_punctures(punctures);
    }

    /// The device says that a wall gave way ([`PunctureState::Inserted`]) or that the needle has
    /// left it.
    pub fn tell(&mut self, wall: WallName, state: PunctureState) {
        self.insertion.tell(wall, state);
    }

    /// Moves time on by `dt` s (at most 0.1), the needle being where it says. A needle that is no
    /// number stays where it was.
    pub fn step(&mut self, needle: &Needle, dt: f32) {
        if !(dt.is_finite() && dt > 0.0) {
            return;
        }
        let dt = dt.min(0.1);
        let lattices = &self.lattices;
        let material = |rest: Vector| lattices.iter().find_map(|lattice| lattice.anchor(rest));
        self.insertion.follow(*needle, dt, self.solver.points(), &self.rest, material);
        let insertion = &self.insertion;
        self.solver.step(dt, self.pace, |points, inverse_dt2| insertion.hold(points, inverse_dt2));
    }

    /// Every wall, how the needle stands to it, and how far it is pushed in (mm).
    pub fn states(&self) -> impl Iterator<Item = (WallName, PunctureState, f32)> {
        self.insertion.states()
    }

    /// Places of the particles in mm; the fourth number is the inverse mass in 1/g.
    pub fn points(&self) -> &[Point] {
        self.solver.points()
    }

    /// The same before anything moved.
    pub fn rest(&self) -> &[Point] {
        &self.rest
    }

    /// Returns the surfaces to draw.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Normals of skin, tops of layers and vessel at every particle, not of length 1; the sections
    /// are flat and have none.
    pub fn normals(&mut self) -> &[[f32; 4]] {
        let points = self.solver.points();
        self.normals.fill([0.0; 4]);
        let smooth = |part: Part| matches!(part, Part::Top(0) | Part::Vessel);
        for surface in self.surfaces.iter().filter(|surface| smooth(surface.part)) {
            for triangle in &surface.triangles {
                let [a, b, c] = triangle.map(|index| place(&points[index as usize]));
                let normal = cross(sub(b, a), sub(c, a));
                for index in triangle {
                    let sum = &mut self.normals[*index as usize];
                    for axis in 0..3 {
                        sum[axis] += normal[axis];
                    }
                }
            }
        }
        &self.normals
    }

    /// Returns the present position of the tissue that was at `rest`; `None` outside the block.
    pub fn moved(&self, rest: Vector) -> Option<Vector> {
        self.lattices
            .iter()
            .find_map(|lattice| lattice.anchor(rest))
            .map(|anchor| anchor.place(self.solver.points()))
    }

    /// Returns the place that the tip pushes in, if it has pierced nothing.
    pub fn touched(&self) -> Option<Anchor> {
        self.insertion.touched()
    }

    /// Returns the solver, for measurements.
    pub fn solver(&self) -> &Solver {
        &self.solver
    }
}

/// Ties the lower surface of one layer to the upper one of the next: the particles of the finer one
/// to their places in the other, so that none hangs free.
fn tie_layers(above: &Lattice, below: &Lattice, parts: &mut Parts) {
    let upper_is_finer = above.nx * above.ny > below.nx * below.ny;
    let (from, onto, row) = if upper_is_finer { (above, below, above.nz - 1) } else { (below, above, 0) };
    for j in 0..from.ny {
        for i in 0..from.nx {
            let particle = from.at(i, j, row);
            if let Some(anchor) = onto.anchor(place(&parts.points[particle as usize])) {
                parts.ties.push(Tie::at_rest(particle, anchor, TIE, &parts.points));
            }
        }
    }
}

fn surfaces(lattices: &[Lattice], tube: Option<&Tube>, rest: &[Point]) -> Vec<Surface> {
    let mut surfaces = vec![];
    for (number, lattice) in lattices.iter().enumerate() {
        let top = lattice.row_triangles(0);
        if number == 0 {
            let middle = |triangle: &[u32; 3]| {
                let sum = triangle.iter().fold([0.0; 3], |sum, i| add(sum, place(&rest[*i as usize])));
                scale(sum, 1.0 / 3.0)[1]
            };
            let (behind, before) = top.iter().partition(|triangle| middle(triangle) < 0.0);
            surfaces.push(Surface { part: Part::SkinBehind, triangles: behind });
            surfaces.push(Surface { part: Part::SkinBefore, triangles: before });
        }
        surfaces.push(Surface { part: Part::Top(number), triangles: top });
        surfaces.push(Surface {
            part: Part::Section(number),
            triangles: lattice.line_triangles(lattice.middle()),
        });
        let mut ends = lattice.column_triangles(0);
        ends.extend(lattice.column_triangles(lattice.nx - 1));
        surfaces.push(Surface { part: Part::End(number), triangles: ends });
    }
    if let Some(tube) = tube {
        surfaces.push(Surface { part: Part::Vessel, triangles: tube.triangles(rest) });
    }
    surfaces
}

fn walls(c: &Configuration, lattices: &[Lattice], surfaces: &[Surface]) -> Vec<Wall> {
    let mut walls: Vec<Wall> = c
        .layers
        .iter()
        .zip(lattices)
        .enumerate()
        .map(|(number, (layer, lattice))| {
            Wall::new(WallName::Layer(number), lattice.row_triangles(0), layer.gives_mm, layer.drag_mm)
        })
        .collect();
    if let Some(vessel) = &c.vessel
        && let Some(surface) = surfaces.iter().find(|surface| surface.part == Part::Vessel)
    {
        let wall = |name, gives| Wall::new(name, surface.triangles.clone(), gives, vessel.drag_mm);
        walls.push(wall(WallName::Near, vessel.near_gives_mm));
        walls.push(wall(WallName::Far, vessel.far_gives_mm));
    }
    walls
}
