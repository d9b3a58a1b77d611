//! A force as a table over one or two variables: what is there and has no name.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span};
use super::shape::{Missing, ShapeKey};
use super::{Effect, EffectName, State, Variable};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A force over a grid, straight between its places and level beyond its ends. A place given twice
/// is a jump.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ForceTable {
    /// The variables: one or two.
    pub over: Vec<Variable>,
    /// Places of each variable, never falling, in its unit.
    pub grid: Vec<Vec<f64>>,
    /// N·m or N at every place; the last variable runs fastest.
    pub force: Vec<f64>,
}

/// Most places of a table.
const MOST_PLACES: usize = 100_000;

impl ForceTable {
    /// Checks that the table can be run; the reason where not.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.over.is_empty() || self.over.len() > 2 {
            return Err("table.over must hold one or two variables".into());
        }
        if self.over.len() == 2 && self.over[0] == self.over[1] {
            return Err("table.over must not hold a variable twice".into());
        }
        if self.grid.len() != self.over.len() {
            return Err("table.grid must hold one list of places for each variable of table.over".into());
        }
        for places in &self.grid {
            let falls = places.windows(2).any(|w| w[0] > w[1]);
            if places.len() < 2 || falls || places[0] == places[places.len() - 1] {
                return Err("each list of table.grid must hold two or more places that do not fall".into());
            }
        }
        let wanted: usize = self.grid.iter().map(Vec::len).product();
        if wanted > MOST_PLACES || self.force.len() != wanted {
            return Err(format!(
                "table.force must hold {wanted} values, one for every place, and at most {MOST_PLACES}"
            ));
        }
        if self.grid.iter().flatten().chain(&self.force).any(|x| !x.is_finite() || x.abs() > 1e30) {
            return Err("the table must hold finite numbers".into());
        }
        Ok(())
    }

    /// Place of a value: the lower neighbour and the part of the way to the next.
    fn place(places: &[f64], value: f64) -> (usize, f64) {
        let above = places.partition_point(|place| *place <= value).clamp(1, places.len() - 1);
        let (a, b) = (places[above - 1], places[above]);
        (above - 1, if b > a { ((value - a) / (b - a)).clamp(0.0, 1.0) } else { 0.5 })
    }

    /// The force at some values, one per variable.
    pub(crate) fn at(&self, values: &[f64]) -> f64 {
        let (i, a) = Self::place(&self.grid[0], values[0]);
        let Some(second) = self.grid.get(1) else {
            return self.force[i] * (1.0 - a) + self.force[i + 1] * a;
        };
        let (j, b) = Self::place(second, values[1]);
        let row = |i: usize| {
            let first = i * second.len() + j;
            self.force[first] * (1.0 - b) + self.force[first + 1] * b
        };
        row(i) * (1.0 - a) + row(i + 1) * a
    }
}

/// A force without a name, with what it remembers.
#[derive(Debug, Clone)]
struct TableLaw {
    table: ForceTable,
    /// Travel of one turn, rad or m.
    turn: f64,
    /// Sign of the velocity, and the time of its last change, s.
    way: f64,
    turned: f64,
}

impl TableLaw {
    /// Values of the variables; `velocity` in place of the state's, whose sign may be asked for at
    /// rest.
    fn values(&self, s: &State, velocity: f64) -> [f64; 2] {
        let value_of = |variable: &Variable| match variable {
            Variable::Speed => velocity,
            Variable::Travel => s.position,
            Variable::Angle => s.position.rem_euclid(self.turn),
            Variable::Command => s.command,
            Variable::SinceReversal => s.time - self.turned,
            Variable::Time => s.time,
        };
        let mut values = [0.0; 2];
        self.table.over.iter().zip(&mut values).for_each(|(variable, value)| *value = value_of(variable));
        values
    }
}

impl ForceLaw for TableLaw {
    fn names(&self) -> Vec<String> {
        vec!["force".into()]
    }
    fn terms(&mut self, s: &State, _velocity: f64, out: &mut [f64]) {
        let way = if s.velocity < 0.0 { -1.0 } else { 1.0 };
        if way != self.way {
            (self.way, self.turned) = (way, s.time);
        }
        // At rest friction is a reaction, and only what does not ask for the speed is known.
        let unknown = s.rest && self.table.over.contains(&Variable::Speed);
        out[0] = if unknown { 0.0 } else { self.table.at(&self.values(s, s.velocity)) };
    }
    /// Half of how much less the force is on the forward side of rest than on the backward one.
    fn dry_part(&self, s: &State) -> f64 {
        let [back, ahead] =
            [-f64::MIN_POSITIVE, f64::MIN_POSITIVE].map(|v| self.table.at(&self.values(s, v)));
        (0.5 * (back - ahead)).max(0.0)
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct Table;

impl EffectLaw for Table {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let table = effect.table.clone()?;
        Some(Box::new(TableLaw { table, turn: effect.turn().unwrap_or(TAU), way: 0.0, turned: 0.0 }))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        const { &[&[ShapeKey::new("turn", Missing::Optional)]] }
    }
}

impl EffectSearch for Table {
    fn is_sought(&self) -> bool {
        false
    }
    /// It is no candidate: what has no name is sought by its form.
    fn grid(&self, _name: EffectName, _span: &Span) -> Vec<Effect> {
        Vec::new()
    }
}

impl EffectReport for Table {
    /// It is drawn, and has no values of its own.
    fn report(&self, _fitted: &Fitted) -> Vec<Reported> {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_places_and_constant_beyond() {
        let table = ForceTable {
            over: vec![Variable::Speed],
            grid: vec![vec![-2.0, 0.0, 0.0, 2.0]],
            force: vec![3.0, 1.0, -1.0, -5.0],
        };
        assert_eq!(table.check(), Ok(()));
        for (speed, force) in
            [(-9.0, 3.0), (-1.0, 2.0), (-1e-12, 1.0), (1e-12, -1.0), (1.0, -3.0), (9.0, -5.0)]
        {
            assert!((table.at(&[speed]) - force).abs() < 1e-9, "{speed}: {}", table.at(&[speed]));
        }
    }

    #[test]
    fn a_table_over_two_variables_is_straight_in_each() {
        let table = ForceTable {
            over: vec![Variable::Travel, Variable::Speed],
            grid: vec![vec![0.0, 1.0], vec![-1.0, 1.0, 3.0]],
            force: vec![0.0, 2.0, 4.0, 10.0, 12.0, 14.0],
        };
        assert_eq!(table.check(), Ok(()));
        assert!((table.at(&[0.5, 0.0]) - 6.0).abs() < 1e-12);
        assert!((table.at(&[2.0, 2.0]) - 13.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_table_is_refused_with_the_reason() {
        let right = ForceTable { over: vec![Variable::Time], grid: vec![vec![0.0, 1.0]], force: vec![1.0, 2.0] };
        let refusal = |change: fn(&mut ForceTable)| {
            let mut table = right.clone();
            change(&mut table);
            table.check().unwrap_err()
        };
        assert!(refusal(|t| t.over.clear()).contains("one or two"));
        assert!(refusal(|t| t.over.push(Variable::Time)).contains("twice"));
        assert!(refusal(|t| t.grid[0] = vec![1.0, 0.0]).contains("fall"));
        assert!(refusal(|t| t.force.push(0.0)).contains("2 values"));
        assert!(refusal(|t| t.force[0] = f64::NAN).contains("finite"));
    }
}
