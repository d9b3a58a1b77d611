//! A scripted hand: where it wants the needle at every moment, from a procedure that a person wrote (TOML). Moves follow the
//! minimum-jerk path `s = 10τ³ − 15τ⁴ + 6τ⁵` (Flash and Hogan 1985, doi:10.1523/JNEUROSCI.05-07-01688.1985).

use crate::failure::Failure;
use crate::library::{self, Text};
use crate::plant::hand::Grip;
use crate::profile::{Profile, TissueName, puncture_path_mm};
use control_core::config::Tissue;
use serde::Deserialize;

/// The procedures that come with the program.
pub const BUILT_IN: [(&str, &str); 2] = [
    ("venepuncture", include_str!("../procedures/venepuncture.toml")),
    ("slow", include_str!("../procedures/slow.toml")),
];

/// A procedure, resolved against a profile: depths are in mm past the zero.
#[derive(Clone, Debug)]
pub struct Procedure {
    /// What it is called.
    pub name: String,
    /// How the hand holds the needle.
    pub grip: Grip,
    /// Where it begins and where every round ends, in mm.
    pub start_mm: f64,
    /// One round, s.
    pub round_s: f64,
    moves: Vec<Move>,
}

#[derive(Clone, Copy, Debug)]
struct Move {
    begin_s: f64,
    seconds: f64,
    from_mm: f64,
    to_mm: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    name: String,
    start_mm: f64,
    hand: HandFile,
    step: Vec<Step>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HandFile {
    stiffness_n_per_mm: f64,
    damping_n_s_per_mm: f64,
    tremor_mm: f64,
    seed: u64,
}

/// A step moves to a depth, or past the puncture of a tissue, or holds where neither is given.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    name: String,
    seconds: f64,
    to_mm: Option<f64>,
    past: Option<TissueName>,
    #[serde(default)]
    by_mm: f64,
}

impl Procedure {
    /// A built-in procedure by its name, or a file by its path.
    pub fn find(wanted: &str, profile: &Profile) -> Result<Self, Failure> {
        Self::parse(&library::find("procedure", wanted, &BUILT_IN)?, profile)
    }

    /// Checks the text of a procedure against the tissue of `profile`.
    pub fn parse(source: &Text, profile: &Profile) -> Result<Self, Failure> {
        let file: File = library::parse(source)?;
        file.resolve(profile).map_err(|what| Failure::input(format_args!("{}: {what}", source.origin)))
    }

    /// Where the hand wants the needle `seconds` into the procedure: depth in mm and speed in mm/s. Rounds repeat.
    pub fn target(&self, seconds: f64) -> (f64, f64) {
        let in_round = seconds.max(0.0) % self.round_s;
        let current = self.moves.partition_point(|m| m.begin_s <= in_round).saturating_sub(1);
        let m = &self.moves[current];
        let share = ((in_round - m.begin_s) / m.seconds).clamp(0.0, 1.0);
        let path = share * share * share * (10.0 + share * (6.0 * share - 15.0));
        let rate = 30.0 * share * share * (1.0 - share) * (1.0 - share) / m.seconds;
        let distance = m.to_mm - m.from_mm;
        (m.from_mm + distance * path, distance * rate)
    }
}

impl File {
    fn resolve(&self, profile: &Profile) -> Result<Procedure, String> {
        if self.format != 1 {
            return Err(format!("format is {}; this program reads format 1", self.format));
        }
        let travel = profile.config.device.limits.travel.0.to_num::<f64>();
        within("start_mm", self.start_mm, -travel, travel)?;
        within("stiffness_n_per_mm", self.hand.stiffness_n_per_mm, 0.05, 10.0)?;
        within("damping_n_s_per_mm", self.hand.damping_n_s_per_mm, 0.0, 0.1)?;
        within("tremor_mm", self.hand.tremor_mm, 0.0, 2.0)?;
        let (mut moves, mut at, mut begin_s) = (Vec::new(), self.start_mm, 0.0);
        for step in &self.step {
            let to_mm = step.target(profile, at)?;
            within(&format!("the depth of step \"{}\" in mm", step.name), to_mm, -travel, travel)?;
            within(&format!("seconds of step \"{}\"", step.name), step.seconds, 0.05, 3_600.0)?;
            // Faster than a hand goes, and than the grip of the roller can follow.
            within(
                &format!("mm/s of step \"{}\"", step.name),
                (to_mm - at).abs() / step.seconds,
                0.0,
                500.0,
            )?;
            moves.push(Move { begin_s, seconds: step.seconds, from_mm: at, to_mm });
            begin_s += step.seconds;
            at = to_mm;
        }
        if moves.is_empty() || (at - self.start_mm).abs() > 1e-6 {
            return Err("the last step must end at start_mm, because rounds repeat; add a step".into());
        }
        let grip = Grip {
            stiffness_n_per_m: self.hand.stiffness_n_per_mm * 1e3,
            damping_n_s_per_m: self.hand.damping_n_s_per_mm * 1e3,
            tremor_rms_m: self.hand.tremor_mm * 1e-3,
            seed: self.hand.seed,
        };
        Ok(Procedure { name: self.name.clone(), grip, start_mm: self.start_mm, round_s: begin_s, moves })
    }
}

impl Step {
    fn target(&self, profile: &Profile, at_mm: f64) -> Result<f64, String> {
        match (self.to_mm, self.past) {
            (Some(_), Some(_)) => {
                Err(format!("step \"{}\" has both to_mm and past; keep one of them", self.name))
            }
            (Some(to_mm), None) => Ok(to_mm + self.by_mm),
            (None, None) => Ok(at_mm),
            (None, Some(past)) => {
                let tissue = Tissue::from(past);
                let wall = profile
                    .config
                    .patient
                    .layers
                    .iter()
                    .filter(|l| l.tissue == tissue)
                    .find_map(|layer| puncture_path_mm(layer, profile.entry_rad));
                wall.map(|depth| depth + self.by_mm).ok_or_else(|| {
                    format!(
                        "step \"{}\" goes past a wall that profile {} does not have; use to_mm",
                        self.name, profile.name
                    )
                })
            }
        }
    }
}

fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), String> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(format!("{key} is {value}; it must lie from {low} to {high}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adult() -> Profile {
        Profile::find("adult").expect("it is built in")
    }

    #[test]
    fn the_path_is_smooth_and_its_speed_is_its_slope() {
        for (name, _) in BUILT_IN {
            let procedure = Procedure::find(name, &adult()).expect("it is built in");
            let step = 1e-4;
            let mut before = procedure.target(0.0);
            for tick in 1..(procedure.round_s / step) as u32 * 2 {
                let now = procedure.target(f64::from(tick) * step);
                let slope = (now.0 - before.0) / step;
                assert!(
                    (slope - (now.1 + before.1) / 2.0).abs() < 0.01,
                    "{name}: {slope} mm/s at tick {tick}"
                );
                before = now;
            }
        }
    }

    #[test]
    fn mistakes_are_refused_by_name() {
        let good = BUILT_IN[0].1;
        for (wrong, hint) in [
            (good.replace("past = \"vessel\"", "past = \"fat\""), "does not have"),
            (good.replace("seconds = 2.0", "seconds = 0.0"), "insert"),
            (good.replace("seconds = 2.0", "seconds = nan"), "insert"),
            (good.replace("to_mm = -6.0", "to_mm = -7.0"), "rounds repeat"),
            (good.replace("to_mm = -0.5", "to_mm = 400.0"), "approach"),
            (good.replace("tremor_mm = 0.03 ", "tremor_mm = 30.0 "), "tremor_mm"),
            (good.replace("name = \"hold\"", "nome = \"hold\""), "nome"),
        ] {
            let source = Text { origin: "p.toml".into(), text: wrong };
            let said = Procedure::parse(&source, &adult()).expect_err(hint).to_string();
            assert!(said.contains(hint) && said.contains("p.toml") && !said.contains('\n'), "{said}");
        }
    }
}
