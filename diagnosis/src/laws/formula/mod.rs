//! Effects of a user's own: a formula of `v, q, u, t, tilt` and named parameters with bounds, read
//! from TOML and then searched, named, patched and simulated as the built-in ones are.
//!
//! A formula is the force that it adds to the right-hand side, in N·m or N. Parameters that it is
//! linear in become coefficients of terms; the others are shape values, which are searched between
//! their bounds. What a formula is called is known to the whole program once it is read, because
//! names of effects are compared everywhere.

mod as_effect;
mod file;

use super::{EffectName, State};
use exmex::{Express, FlatEx};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::RwLock;

pub(crate) use file::read_effects;

/// The variables of a formula: speed, position from the start of the recording, command, time from
/// its start, tilt.
const VARIABLES: [&str; 5] = ["v", "q", "u", "t", "tilt"];

/// A formula as a file has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaText {
    /// The name that reports use.
    pub title: String,
    /// The force, N·m or N.
    pub formula: String,
    /// Least and largest value of each parameter.
    #[serde(default)]
    pub parameters: BTreeMap<String, [f64; 2]>,
    /// A short noun phrase that says what it is.
    #[serde(default)]
    pub words: String,
}

/// A formula that has been read and checked.
#[derive(Debug)]
pub struct Formula {
    /// As it was read.
    pub text: FormulaText,
    name: &'static str,
    pub(super) words: &'static str,
    expression: FlatEx<f64>,
    /// The source of each of the expression's variables.
    sources: Vec<Source>,
    /// Parameters that it is linear in; `scale` alone if it has no such parameters.
    linear: Vec<String>,
    /// The others, with their bounds.
    shape: Vec<(&'static str, f64, f64)>,
    is_dry: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    Variable(usize),
    Linear(usize),
    Shape(usize),
}

/// Values of the variables, and of all parameters.
type Sample = ([f64; 5], Vec<f64>);

/// The term of a formula that is linear in none of its parameters.
const SCALE: &str = "scale";

static KNOWN: RwLock<Vec<&'static Formula>> = RwLock::new(Vec::new());

/// Identifies a formula that has been read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FormulaId(u16);

impl FormulaId {
    /// The formula.
    pub fn get(self) -> &'static Formula {
        let known = KNOWN.read().unwrap_or_else(std::sync::PoisonError::into_inner);
        known[usize::from(self.0)]
    }
}

/// The formula of a name, the last that was read.
pub(super) fn find(name: &str) -> Option<EffectName> {
    let known = KNOWN.read().unwrap_or_else(std::sync::PoisonError::into_inner);
    let at = known.iter().rposition(|formula| formula.name == name)?;
    u16::try_from(at).ok().map(|at| EffectName::Formula(FormulaId(at)))
}

/// Arbitrary numbers, for trying a formula.
fn trials(count: usize) -> impl Iterator<Item = f64> {
    (1..=count).map(|k| (k as f64 * 0.754_877_666).fract())
}

/// Text that lives as long as the program, as the name of an effect does.
fn leaked(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}

impl Formula {
    /// Reads, checks and registers a formula; the reason where it cannot be used.
    pub fn register(text: FormulaText) -> Result<EffectName, String> {
        let formula = Self::new(text)?;
        let mut known = KNOWN.write().unwrap_or_else(std::sync::PoisonError::into_inner);
        let at = known.iter().position(|k| k.text == formula.text).unwrap_or_else(|| {
            known.push(Box::leak(Box::new(formula)));
            known.len() - 1
        });
        u16::try_from(at)
            .map(|at| EffectName::Formula(FormulaId(at)))
            .map_err(|_| "too many formulas".to_owned())
    }

    fn new(text: FormulaText) -> Result<Self, String> {
        let expression = Self::checked(&text)?;
        let words = if text.words.is_empty() { text.title.replace('_', " ") } else { text.words.clone() };
        let bounds = |(name, [low, high]): (&String, &[f64; 2])| (leaked(name.clone()), *low, *high);
        let mut formula = Self {
            name: leaked(text.title.clone()),
            words: leaked(words),
            expression,
            sources: Vec::new(),
            linear: Vec::new(),
            shape: text.parameters.iter().map(bounds).collect(),
            is_dry: false,
            text,
        };
        formula.place();
        formula.is_finite()?;
        formula.find_linear();
        formula.is_dry = formula.turns_with_speed();
        Ok(formula)
    }

    /// Checks the text of a formula and parses its expression; the reason where it cannot be used.
    fn checked(text: &FormulaText) -> Result<FlatEx<f64>, String> {
        if text.title.is_empty() || !text.title.chars().all(|c| c.is_alphanumeric() || c == '_') {
            return Err(format!("the name \"{}\" must be of letters, digits and underscores", text.title));
        }
        if EffectName::ALL.iter().any(|name| name.as_str() == text.title) {
            return Err(format!("{} is the name of a built-in effect; choose another", text.title));
        }
        // Control engineers write sgn.
        let expression = text.formula.replace("sgn(", "signum(");
        let expression = exmex::parse::<f64>(&expression)
            .map_err(|cause| format!("formula \"{}\": {cause}", text.formula))?;
        let parameters: Vec<(&String, &[f64; 2])> = text.parameters.iter().collect();
        for (name, [low, high]) in &parameters {
            if VARIABLES.contains(&name.as_str()) {
                return Err(format!("parameter {name} has the name of a variable; choose another"));
            }
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(format!(
                    "parameter {name} needs two bounds, the lower first, as {name} = [0.1, 10.0]"
                ));
            }
        }
        for used in expression.var_names() {
            if !VARIABLES.contains(&used.as_str()) && !text.parameters.contains_key(used) {
                let own: Vec<&str> = parameters.iter().map(|(name, _)| name.as_str()).collect();
                return Err(format!(
                    "formula \"{}\" has the unknown name {used}; known are {} and the parameters {}",
                    text.formula,
                    VARIABLES.join(", "),
                    if own.is_empty() { "(none)".to_owned() } else { own.join(", ") }
                ));
            }
        }
        if let Some((unused, _)) = parameters.iter().find(|(name, _)| !expression.var_names().contains(name))
        {
            return Err(format!(
                "formula \"{}\" does not use its parameter {unused}; take it out",
                text.formula
            ));
        }
        Ok(expression)
    }

    /// Sets where the expression's variables come from.
    fn place(&mut self) {
        let source = |name: &String| {
            VARIABLES
                .iter()
                .position(|v| v == name)
                .map(Source::Variable)
                .or_else(|| self.linear.iter().position(|l| l == name).map(Source::Linear))
                .or_else(|| self.shape.iter().position(|s| s.0 == name).map(Source::Shape))
                .unwrap_or(Source::Variable(0))
        };
        self.sources = self.expression.var_names().iter().map(source).collect();
    }

    fn evaluate(&self, variables: &[f64; 5], linear: &[f64], shape: &[f64], scratch: &mut Vec<f64>) -> f64 {
        scratch.clear();
        scratch.extend(self.sources.iter().map(|source| match source {
            Source::Variable(i) => variables[*i],
            Source::Linear(i) => linear[*i],
            Source::Shape(i) => shape[*i],
        }));
        self.expression.eval(scratch).unwrap_or(f64::NAN)
    }

    /// States and shape values over several decades and within the bounds.
    fn samples(&self) -> Vec<Sample> {
        let mut from = trials(4000);
        let mut next = || from.next().unwrap_or(0.5);
        let mut out = Vec::new();
        for k in 0..48 {
            let size = 10_f64.powi(k % 4 - 2);
            let mut signed = || size * (2.0 * next() - 1.0);
            let variables = [signed(), signed(), signed(), signed().abs(), signed().clamp(-1.5, 1.5)];
            let shape = self.shape.iter().map(|(_, low, high)| low + (high - low) * next()).collect();
            out.push((variables, shape));
        }
        // Rest, and the bounds themselves.
        for end in [0, 1] {
            let shape = self.shape.iter().map(|(_, low, high)| if end == 0 { *low } else { *high }).collect();
            out.push(([0.0; 5], shape));
        }
        out
    }

    fn is_finite(&self) -> Result<(), String> {
        let mut scratch = Vec::new();
        for (variables, shape) in self.samples() {
            if !self.evaluate(&variables, &[], &shape, &mut scratch).is_finite() {
                let state: Vec<String> =
                    VARIABLES.iter().zip(variables).map(|(n, x)| format!("{n} = {x:.4}")).collect();
                let values: Vec<String> =
                    self.shape.iter().zip(&shape).map(|(s, x)| format!("{} = {x:.4}", s.0)).collect();
                return Err(format!(
                    "formula \"{}\" is not finite at {}",
                    self.text.formula,
                    state.into_iter().chain(values).collect::<Vec<_>>().join(", ")
                ));
            }
        }
        Ok(())
    }

    /// Finds the parameters that the formula is a linear and homogeneous function of, all together.
    fn find_linear(&mut self) {
        let samples = self.samples();
        let mut scratch = Vec::new();
        let mut chosen: Vec<usize> = Vec::new();
        for candidate in 0..self.shape.len() {
            let together: Vec<usize> = chosen.iter().copied().chain([candidate]).collect();
            // Twice and three times all of them together must be twice and three times the force
            // above that without them.
            let is_linear = samples.iter().all(|sample| {
                let mut force_times = |factor: f64| {
                    let set: Vec<(usize, f64)> =
                        together.iter().map(|i| (*i, factor * (1.0 + *i as f64))).collect();
                    self.force_at(sample, &set, &mut scratch)
                };
                let [none, one, two, three] = [0.0, 1.0, 2.0, 3.0].map(&mut force_times);
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (one.abs() + none.abs() + 1e-12);
                close(two - none, 2.0 * (one - none)) && close(three - none, 3.0 * (one - none))
            });
            if is_linear {
                chosen = together;
            }
        }
        let homogeneous = samples.iter().all(|sample| {
            let set: Vec<(usize, f64)> = chosen.iter().map(|i| (*i, 0.0)).collect();
            self.force_at(sample, &set, &mut scratch).abs() < 1e-12
        });
        if chosen.is_empty() || !homogeneous {
            self.linear = Vec::new();
            return;
        }
        self.linear = chosen.iter().map(|i| self.shape[*i].0.to_owned()).collect();
        let linear = self.linear.clone();
        self.shape.retain(|s| !linear.iter().any(|l| l == s.0));
        self.place();
    }

    /// The force at a sample's variables and parameters, some of which are `set` to other values.
    fn force_at(&self, sample: &Sample, set: &[(usize, f64)], scratch: &mut Vec<f64>) -> f64 {
        let mut shape = sample.1.clone();
        set.iter().for_each(|(i, x)| shape[*i] = *x);
        self.evaluate(&sample.0, &[], &shape, scratch)
    }

    /// True if the force jumps to its opposite where the speed turns, as dry friction does.
    fn turns_with_speed(&self) -> bool {
        let linear = vec![1.0; self.linear.len()];
        let mut scratch = Vec::new();
        let shape: Vec<f64> = self.shape.iter().map(|s| 0.5 * (s.1 + s.2)).collect();
        let mut force = |v: f64| self.evaluate(&[v, 0.1, 0.1, 0.1, 0.1], &linear, &shape, &mut scratch);
        let (forward, backward) = (force(1e-12), force(-1e-12));
        forward * backward < 0.0 && (forward + backward).abs() < 1e-3 * forward.abs()
    }

    /// The name in reports.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Names of the terms.
    pub(crate) fn terms(&self) -> Vec<String> {
        if self.linear.is_empty() { vec![SCALE.to_owned()] } else { self.linear.clone() }
    }

    /// Returns the parameters that enter non-linearly, with their bounds.
    pub(super) fn shape(&self) -> &[(&'static str, f64, f64)] {
        &self.shape
    }

    /// True if it uses a variable.
    pub fn uses(&self, variable: &str) -> bool {
        self.expression.var_names().iter().any(|name| name == variable)
    }

    /// The terms at a state with values of the shape in the order of [`Formula::shape`].
    pub(crate) fn values(&self, s: &State, velocity: f64, shape: &[f64], out: &mut [f64]) {
        let mut scratch = Vec::with_capacity(self.sources.len());
        let mut linear = vec![0.0; self.linear.len()];
        let mut force = |velocity: f64, linear: &[f64]| {
            self.evaluate(&[velocity, s.position, s.command, s.time, s.tilt], linear, shape, &mut scratch)
        };
        for (k, term) in out.iter_mut().enumerate() {
            if let Some(own) = linear.get_mut(k) {
                *own = 1.0;
            }
            let value = if velocity == 0.0 {
                // The sign of nothing is nothing: what jumps there is half of either side.
                0.5 * (force(HARDLY, &linear) + force(-HARDLY, &linear))
            } else {
                force(velocity, &linear)
            };
            *term = if value.is_finite() { value } else { 0.0 };
            if let Some(own) = linear.get_mut(k) {
                *own = 0.0;
            }
        }
    }
}

/// A speed that is hardly one.
const HARDLY: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    fn read(formula: &str, parameters: &[(&str, [f64; 2])]) -> Result<Formula, String> {
        Formula::new(FormulaText {
            title: "own".into(),
            formula: formula.into(),
            parameters: parameters.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
            words: String::new(),
        })
    }

    #[test]
    fn linear_parameters_of_a_formula_become_terms() {
        let formula =
            read("-a*tanh(v/b) - c*q^3", &[("a", [0.0, 1.0]), ("b", [0.1, 10.0]), ("c", [0.0, 5.0])])
                .unwrap();
        assert_eq!(formula.terms(), ["a", "c"]);
        assert_eq!(formula.shape(), [("b", 0.1, 10.0)]);
        let mut out = [0.0; 2];
        formula.values(&State { position: 3.0, ..State::default() }, 2.0, &[4.0], &mut out);
        assert!((out[0] + 0.5_f64.tanh()).abs() < 1e-12 && (out[1] + 27.0).abs() < 1e-12, "{out:?}");
        assert!(!formula.is_dry);
        let dry = read("-c*sgn(v)", &[("c", [0.0, 1.0])]).unwrap();
        assert!(dry.is_dry);
        assert_eq!(read("sin(w*t)", &[("w", [1.0, 9.0])]).unwrap().terms(), ["scale"]);
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_its_place() {
        let said = |formula: &str, parameters: &[(&str, [f64; 2])]| read(formula, parameters).unwrap_err();
        let unknown = said("-a*w", &[("a", [0.0, 1.0])]);
        assert!(
            unknown.contains("unknown name w; known are v, q, u, t, tilt and the parameters a"),
            "{unknown}"
        );
        let infinite = said("a/v", &[("a", [1.0, 2.0])]);
        assert!(infinite.contains("is not finite at v = 0.0000"), "{infinite}");
        assert!(said("a*ln(q)", &[("a", [1.0, 2.0])]).contains("is not finite"));
        assert!(said("a*v", &[("a", [2.0, 1.0])]).contains("needs two bounds"));
        assert!(said("a*v*(", &[("a", [1.0, 2.0])]).contains("formula \"a*v*(\""));
        assert!(said("v", &[("a", [1.0, 2.0])]).contains("does not use its parameter a"));
        let file = "[[effect]]\nname = \"x\"\nformula = \"b*v\"\n";
        assert!(
            read_effects(file, "F.toml")
                .unwrap_err()
                .starts_with("F.toml, effect x: formula \"b*v\" has the unknown name b")
        );
        assert!(read_effects("[[effect]]\nname = 3\n", "F.toml").unwrap_err().starts_with("F.toml, line 2"));
    }
}
