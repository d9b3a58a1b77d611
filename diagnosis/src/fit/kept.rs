//! Results that a recording keeps from one fit to the next, because a search fits thousands of
//! models that differ in one effect. Each use checks that they still hold.

use crate::fit::blocks::Rows;
use crate::fit::filter::{Gains, Noise};
use crate::fit::input::Input;
use crate::laws::Effect;
use numerics::linear::Square;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Sets of nominal columns that are kept for a recording, and inputs of effects.
const SETS: usize = 4;
const INPUTS: usize = 8;
/// The most blocks of a recording of which anything is kept.
const MOST_BLOCKS: usize = 40_000;

/// The motion that a model sees in a recording, block by block.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BlockMotion {
    /// Position and velocity at the middle of each block: from the smoother where the recording is
    /// fitted, from the filter where it judges.
    pub(crate) x: Vec<f64>,
    pub(crate) v: Vec<f64>,
    /// Blocks where the axis rests or the sign of its speed is not known.
    pub(crate) rest: Vec<bool>,
    /// Blocks in which the filter allows any force: at rest, and at a reversal, because the row in
    /// which friction changes its sign and what a solver makes of that row are in no recording.
    pub(crate) any_force: Vec<bool>,
    /// Blocks in the middle of a rest: friction is a reaction there and cancels every input.
    pub(crate) stuck: Vec<bool>,
    /// Speed below which its sign is not known.
    pub(crate) speed_floor: f64,
}

/// A part of a block on one side of a reversal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Side {
    /// Its part of the block's length.
    pub(crate) part: f64,
    /// Mean velocity over it, rad/s or m/s.
    pub(crate) velocity: f64,
}

impl BlockMotion {
    /// Returns both sides of a reversal within a block; none where the axis does not turn back
    /// there, or rests.
    pub(crate) fn sides(&self, block: usize) -> Option<[Side; 2]> {
        let last = self.v.len() - 1;
        let near = [block.saturating_sub(1), (block + 1).min(last)];
        let [start, end] = near.map(|other| 0.5 * (self.v[block] + self.v[other]));
        if self.rest[block] || start * end >= 0.0 {
            return None;
        }
        let before = start / (start - end);
        Some([Side { part: before, velocity: 0.5 * start }, Side { part: 1.0 - before, velocity: 0.5 * end }])
    }
}

/// The nominal columns of a recording under one noise, with all that they rest on.
#[derive(Debug)]
pub(crate) struct Whitened {
    pub(super) noise: Noise,
    pub(super) any_force: Vec<bool>,
    pub(super) stuck: Vec<bool>,
    pub(super) inputs: Vec<Input>,
    /// Coefficients about which residuals are taken.
    pub(super) reference: Vec<f64>,
    pub(super) gains: Gains,
    pub(super) residual: Vec<f64>,
    pub(super) responses: Vec<Vec<f64>>,
    /// Per segment: inner products of the responses, the residual last.
    pub(super) segments: Vec<Square>,
}

/// The inputs of effects in one motion and under one command.
#[derive(Debug, Clone, Default)]
struct Inputs {
    of: Option<(BlockMotion, Arc<Rows>)>,
    /// Each effect, the standing acceleration with it, and its inputs; the last used first.
    known: Vec<(Effect, f64, Arc<Vec<Input>>)>,
}

/// The results that one recording keeps.
#[derive(Debug, Default)]
pub(crate) struct ColumnCache {
    sets: Mutex<Vec<Arc<Whitened>>>,
    inputs: Mutex<Inputs>,
}

impl Clone for ColumnCache {
    fn clone(&self) -> Self {
        Self { sets: Mutex::new(lock(&self.sets).clone()), inputs: Mutex::new(lock(&self.inputs).clone()) }
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ColumnCache {
    /// A set of nominal columns that holds, or else a new one.
    pub(super) fn columns(
        &self,
        holds: impl Fn(&Whitened) -> bool,
        new: impl FnOnce() -> Whitened,
    ) -> Arc<Whitened> {
        let sets = lock(&self.sets).clone();
        if let Some(known) = sets.into_iter().find(|one| holds(one)) {
            return known;
        }
        let new = Arc::new(new());
        if new.residual.len() <= MOST_BLOCKS {
            let mut sets = lock(&self.sets);
            sets.truncate(SETS - 1);
            sets.insert(0, Arc::clone(&new));
        }
        new
    }

    /// The inputs of an effect in a motion and under the command of some rows: as they are known,
    /// or else new.
    pub(super) fn inputs(
        &self,
        (motion, rows): (&BlockMotion, &Arc<Rows>),
        (effect, bias): (&Effect, f64),
        new: impl FnOnce() -> Vec<Input>,
    ) -> Vec<Input> {
        let is_same = |of: &(BlockMotion, Arc<Rows>)| Arc::ptr_eq(&of.1, rows) && of.0 == *motion;
        let known = {
            let mut inputs = lock(&self.inputs);
            if !inputs.of.as_ref().is_some_and(is_same) {
                *inputs = Inputs { of: Some((motion.clone(), Arc::clone(rows))), known: Vec::new() };
            }
            let place = inputs.known.iter().position(|(other, by, _)| other == effect && *by == bias);
            place.map(|place| {
                inputs.known[..=place].rotate_right(1);
                Arc::clone(&inputs.known[0].2)
            })
        };
        if let Some(known) = known {
            return Vec::clone(&known);
        }
        let new = new();
        if motion.v.len() <= MOST_BLOCKS {
            let mut inputs = lock(&self.inputs);
            inputs.known.truncate(INPUTS - 1);
            inputs.known.insert(0, (effect.clone(), bias, Arc::new(new.clone())));
        }
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversal_divides_its_block_where_the_speed_is_zero() {
        let mut motion = BlockMotion {
            x: vec![0.0; 5],
            // Zero a quarter into the block in the middle, at a constant acceleration.
            v: vec![-1.75, -0.75, 0.25, 1.25, 2.25],
            rest: vec![false; 5],
            any_force: vec![false; 5],
            stuck: vec![false; 5],
            speed_floor: 0.0,
        };
        let [before, after] = motion.sides(2).expect("it turns back there");
        assert_eq!((before.part, before.velocity), (0.25, -0.125));
        assert_eq!((after.part, after.velocity), (0.75, 0.375));
        assert!([0, 1, 3, 4].into_iter().all(|block| motion.sides(block).is_none()));
        motion.rest[2] = true;
        assert!(motion.sides(2).is_none());
    }
}
