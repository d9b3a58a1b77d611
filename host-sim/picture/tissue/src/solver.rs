//! Particles under constraints, moved on in substeps. It knows no anatomy and no needle.

use crate::constraint::{Bending, Constraint, Distance, Point, Tie, Volume, place};
use crate::vector::{add, dot, length, scale, sub};

/// Fastest that a particle may move, mm/s: far above what tissue does, below what would leave the
/// picture in one step.
const FASTEST: f32 = 2_000.0;
/// Farthest that a particle goes from where it was built, mm: more than any tissue between skin and
/// bone does.
const FARTHEST_MM: f32 = 18.0;
/// Colours that a greedy colouring may use; the rest goes unsorted at the end.
const MOST_COLOURS: usize = 64;

/// Constraints of one kind with their multipliers.
#[derive(Clone, Debug)]
struct Group<C> {
    constraints: Vec<C>,
    lambdas: Vec<f32>,
}

impl<C: Constraint + Copy> Group<C> {
    /// Sorted so that neighbours in the list share no particle: the processor then works on several
    /// at once.
    fn new(constraints: Vec<C>, particles: usize) -> Self {
        let mut taken = vec![0_u64; particles];
        let mut colours: Vec<Vec<C>> = vec![];
        let mut rest = vec![];
        for constraint in constraints {
            let used = constraint.particles().fold(0, |used, index| used | taken[index as usize]);
            let colour = (!used).trailing_zeros() as usize;
            if colour >= MOST_COLOURS {
                rest.push(constraint);
                continue;
            }
            for index in constraint.particles() {
                taken[index as usize] |= 1 << colour;
            }
            if colours.len() <= colour {
                colours.resize_with(colour + 1, Vec::new);
            }
            colours[colour].push(constraint);
        }
        let constraints: Vec<C> = colours.into_iter().flatten().chain(rest).collect();
        let lambdas = vec![0.0; constraints.len()];
        Self { constraints, lambdas }
    }

    fn project(&mut self, points: &mut [Point], inverse_dt2: f32) {
        for (constraint, lambda) in self.constraints.iter().zip(&mut self.lambdas) {
            constraint.project(points, lambda, inverse_dt2);
        }
    }

    fn forget(&mut self) {
        self.lambdas.fill(0.0);
    }

    /// Elastic energy in µN·mm; rigid constraints count with `stiffest`.
    fn energy(&self, points: &[Point]) -> f64 {
        let one = |constraint: &C| {
            let (violation, compliance) = constraint.violation(points);
            0.5 * f64::from(violation).powi(2) / f64::from(compliance).max(1e-9)
        };
        self.constraints.iter().map(one).sum()
    }

    /// Adds to `forces` what each constraint does to its particles, −C/α·∇C, µN.
    fn push(&self, points: &[Point], forces: &mut [[f64; 3]]) {
        for constraint in &self.constraints {
            let (violation, compliance) = constraint.violation(points);
            let tension = -f64::from(violation) / f64::from(compliance).max(1e-9);
            constraint.slopes(points, |index, slope| {
                for (sum, part) in forces[index as usize].iter_mut().zip(slope) {
                    *sum += tension * f64::from(part);
                }
            });
        }
    }
}

/// The particles and constraints to simulate, before they move.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Places in mm and inverse masses in 1/g.
    pub points: Vec<Point>,
    /// Distances.
    pub distances: Vec<Distance>,
    /// Volumes.
    pub volumes: Vec<Volume>,
    /// Bending angles.
    pub bendings: Vec<Bending>,
    /// Ties between layers.
    pub ties: Vec<Tie>,
}

/// The division of a step, and its damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Substeps of a step.
    pub substeps: u32,
    /// Iterations over all constraints in a substep.
    pub iterations: u32,
    /// Rate at which motion dies away, 1/s.
    pub damping: f32,
}

/// Particles in motion.
#[derive(Clone, Debug)]
pub struct Solver {
    points: Vec<Point>,
    before: Vec<Point>,
    /// The position at which each particle was built.
    built: Vec<Point>,
    speeds: Vec<[f32; 4]>,
    distances: Group<Distance>,
    volumes: Group<Volume>,
    bendings: Group<Bending>,
    ties: Group<Tie>,
}

impl Solver {
    /// At rest where `parts` says.
    pub fn new(parts: Parts) -> Self {
        let count = parts.points.len();
        Self {
            before: parts.points.clone(),
            built: parts.points.clone(),
            speeds: vec![[0.0; 4]; count],
            points: parts.points,
            distances: Group::new(parts.distances, count),
            volumes: Group::new(parts.volumes, count),
            bendings: Group::new(parts.bendings, count),
            ties: Group::new(parts.ties, count),
        }
    }

    /// Moves time on by `dt` s. `hold` moves particles as something outside wants it, once in every
    /// iteration; it is given the particles and 1/dt² of the substep.
    pub fn step(&mut self, dt: f32, pace: Pace, mut hold: impl FnMut(&mut [Point], f32)) {
        let substeps = pace.substeps.max(1);
        let dt = dt / substeps as f32;
        if !(dt.is_finite() && dt > 1e-9) {
            return;
        }
        let inverse_dt2 = 1.0 / (dt * dt);
        // Implicit: stable whatever the damping.
        let keep = 1.0 / (1.0 + pace.damping.max(0.0) * dt);
        for _ in 0..substeps {
            self.predict(dt);
            self.distances.forget();
            self.volumes.forget();
            self.bendings.forget();
            self.ties.forget();
            for _ in 0..pace.iterations.max(1) {
                self.volumes.project(&mut self.points, inverse_dt2);
                self.distances.project(&mut self.points, inverse_dt2);
                self.bendings.project(&mut self.points, inverse_dt2);
                self.ties.project(&mut self.points, inverse_dt2);
                hold(&mut self.points, inverse_dt2);
            }
            self.take_speeds(dt, keep);
            self.bound();
        }
    }

    /// Brings back what a needle that jumps has thrown farther than tissue goes.
    fn bound(&mut self) {
        for ((point, built), speed) in self.points.iter_mut().zip(&self.built).zip(&mut self.speeds) {
            let moved = sub(place(point), place(built));
            let square = dot(moved, moved);
            if square > FARTHEST_MM * FARTHEST_MM {
                let back = add(place(built), scale(moved, FARTHEST_MM / square.sqrt()));
                point[..3].copy_from_slice(&back);
                *speed = [0.0; 4];
            }
        }
    }

    fn predict(&mut self, dt: f32) {
        for ((point, before), speed) in self.points.iter_mut().zip(&mut self.before).zip(&self.speeds) {
            *before = *point;
            for axis in 0..3 {
                point[axis] += speed[axis] * dt;
            }
        }
    }

    fn take_speeds(&mut self, dt: f32, keep: f32) {
        let share = keep / dt;
        for ((point, before), speed) in self.points.iter_mut().zip(&self.before).zip(&mut self.speeds) {
            let moved = sub(place(point), place(before));
            let square = dot(moved, moved) * share * share;
            if square <= FASTEST * FASTEST {
                *speed = [moved[0] * share, moved[1] * share, moved[2] * share, 0.0];
            } else if square.is_finite() {
                let slower = scale(moved, FASTEST * share / square.sqrt());
                *speed = [slower[0], slower[1], slower[2], 0.0];
                let back = add(place(before), scale(slower, dt));
                point[..3].copy_from_slice(&back);
            } else {
                *point = *before;
                *speed = [0.0; 4];
            }
        }
    }

    /// Places in mm and inverse masses in 1/g.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Kinetic and elastic energy in µN·mm (nJ).
    pub fn energy(&self) -> f64 {
        let kinetic = |(point, speed): (&Point, &[f32; 4])| {
            let speed = length([speed[0], speed[1], speed[2]]);
            if point[3] > 0.0 { 0.5 * f64::from(speed).powi(2) / f64::from(point[3]) } else { 0.0 }
        };
        self.points.iter().zip(&self.speeds).map(kinetic).sum::<f64>()
            + self.distances.energy(&self.points)
            + self.volumes.energy(&self.points)
            + self.bendings.energy(&self.points)
            + self.ties.energy(&self.points)
    }

    /// Returns the force of all constraints on each particle, µN: zero at rest, except where
    /// something holds it.
    pub fn forces(&self) -> Vec<[f64; 3]> {
        let mut forces = vec![[0.0; 3]; self.points.len()];
        self.distances.push(&self.points, &mut forces);
        self.volumes.push(&self.points, &mut forces);
        self.bendings.push(&self.points, &mut forces);
        self.ties.push(&self.points, &mut forces);
        forces
    }

    /// Returns the numbers of distances, volumes, bending angles and ties.
    pub fn counts(&self) -> [usize; 4] {
        [
            self.distances.constraints.len(),
            self.volumes.constraints.len(),
            self.bendings.constraints.len(),
            self.ties.constraints.len(),
        ]
    }

    /// The volumes, for those who check them.
    pub fn volumes(&self) -> &[Volume] {
        &self.volumes.constraints
    }

    /// The distances, for those who check them.
    pub fn distances(&self) -> &[Distance] {
        &self.distances.constraints
    }

    /// The bending angles, for those who check them.
    pub fn bendings(&self) -> &[Bending] {
        &self.bendings.constraints
    }

    /// The ties between layers, for those who check them.
    pub fn ties(&self) -> &[Tie] {
        &self.ties.constraints
    }
}
