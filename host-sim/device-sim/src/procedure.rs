//! A scripted hand: where it wants the needle at every moment and at which angle, from a procedure
//! that a person wrote (TOML). Moves follow the minimum-jerk path `s = 10τ³ − 15τ⁴ + 6τ⁵` (Flash
//! and Hogan 1985, doi:10.1523/JNEUROSCI.05-07-01688.1985), or go at an even speed, as a stage does
//! that measures insertion forces.

pub mod purpose;

use crate::error::Error;
use crate::named_files::{self, Text};
use crate::plant::hand::Grip;
use crate::profile::{self, Entry, Profile, TissueName, check_entry, puncture_path_mm};
use control_core::config::Tissue;
use purpose::Purpose;
use serde::Deserialize;

/// The procedures that come with the program.
pub const BUILT_IN: [(&str, &str); 8] = [
    ("cannulation", include_str!("../../procedures/cannulation/right.toml")),
    ("venepuncture", include_str!("../../procedures/venepuncture.toml")),
    ("slow", include_str!("../../procedures/slow.toml")),
    ("injection", include_str!("../../procedures/injection.toml")),
    ("hold", include_str!("../../procedures/hold.toml")),
    ("shoulder-straight", include_str!("../../procedures/shoulder-straight.toml")),
    ("bursa", include_str!("../../procedures/bursa.toml")),
    ("shoulder-redirected", include_str!("../../procedures/shoulder-redirected.toml")),
];

/// An insertion at an even speed; [`insertion`] writes others like it.
const INSERTION: &str = include_str!("../../procedures/insertion.toml");
/// The depth of such an insertion, perpendicular to the skin, mm.
const INSERTION_DEPTH_MM: f64 = 10.0;

/// A procedure, resolved against a profile: depths are in mm past the zero.
#[derive(Clone, Debug)]
pub struct Procedure {
    /// Its name.
    pub name: String,
    /// The grip of the hand on the needle.
    pub grip: Grip,
    /// The depth at which it begins and every round ends, in mm.
    pub start_mm: f64,
    /// The angle that it begins with, rad; without it, the profile's.
    pub entry_rad: Option<f64>,
    /// One round, s.
    pub round_s: f64,
    /// Its purpose; without one, the needle is to come into the patient's target.
    pub purpose: Option<Purpose>,
    moves: Vec<Move>,
}

/// The place where the hand wants the needle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    /// Past the zero, along the needle, mm.
    pub depth_mm: f64,
    /// mm/s.
    pub speed_mm_s: f64,
    /// The angle by which it is steeper than at the beginning, rad.
    pub turned_rad: f64,
}

#[derive(Clone, Copy, Debug)]
struct Move {
    begin_s: f64,
    seconds: f64,
    from_mm: f64,
    to_mm: f64,
    from_rad: f64,
    to_rad: f64,
    is_even: bool,
    /// The task that the scripted hand does when the move begins.
    task: Option<&'static str>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    name: String,
    start_mm: f64,
    purpose: Option<Purpose>,
    entry_deg: Option<f64>,
    /// The place at which it enters a body; without it, the one in the patient's file.
    along_mm: Option<f64>,
    around_deg: Option<f64>,
    azimuth_deg: Option<f64>,
    hand: HandFile,
    step: Vec<ProcedureStep>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HandFile {
    stiffness_n_per_mm: f64,
    damping_n_s_per_mm: f64,
    tremor_mm: f64,
    seed: u64,
}

/// A step moves to a depth, or past the puncture of a tissue, or by so much, or holds where none is
/// given; smoothly in so many seconds, or at an even speed. On the way it may turn the needle.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProcedureStep {
    name: String,
    seconds: Option<f64>,
    speed_mm_s: Option<f64>,
    to_mm: Option<f64>,
    past: Option<TissueName>,
    #[serde(default)]
    by_mm: f64,
    /// Steeper than at the beginning by so much at the end of the step; without it, as before.
    turned_deg: Option<f64>,
    /// The task that the hand does when the step begins.
    task: Option<String>,
}

impl Procedure {
    /// A built-in procedure by its name, or a file by its path.
    pub fn find(wanted: &str, profile: &Profile) -> Result<Self, Error> {
        Self::parse(&text(wanted)?, profile)
    }

    /// A procedure, and the patient entered where and how it says, if that has a body.
    pub fn entering(wanted: &str, profile: Profile) -> Result<(Self, Profile), Error> {
        let text = text(wanted)?;
        let file: File = named_files::parse(&text)?;
        let entry = Entry {
            along_mm: file.along_mm,
            around_deg: file.around_deg,
            azimuth_deg: file.azimuth_deg,
            angle_deg: file.entry_deg,
            turn_deg: None,
        };
        let is_elsewhere = file.along_mm.or(file.around_deg).or(file.azimuth_deg).is_some();
        let turns = file.entry_deg.is_some() && profile.body.is_some();
        let profile = if is_elsewhere || turns { profile.entered(&entry)? } else { profile };
        Ok((Self::parse(&text, &profile)?, profile))
    }

    /// Checks the text of a procedure against the tissue of `profile`.
    pub fn parse(source: &Text, profile: &Profile) -> Result<Self, Error> {
        let file: File = named_files::parse(source)?;
        file.resolve(profile).map_err(|what| Error::input(format_args!("{}: {what}", source.origin)))
    }

    /// Returns the number of the step that is going on `seconds` into the procedure.
    pub(crate) fn step_at(&self, seconds: f64) -> usize {
        let in_round = seconds.max(0.0) % self.round_s;
        self.moves.partition_point(|m| m.begin_s <= in_round).saturating_sub(1)
    }

    /// Returns the name of the task that the scripted hand does when a step begins.
    pub(crate) fn task_of(&self, step: usize) -> Option<&'static str> {
        self.moves.get(step)?.task
    }

    /// Returns the place where the hand wants the needle `seconds` into the procedure. Rounds
    /// repeat.
    pub fn target(&self, seconds: f64) -> Target {
        let in_round = seconds.max(0.0) % self.round_s;
        let m = &self.moves[self.step_at(seconds)];
        let share = ((in_round - m.begin_s) / m.seconds).clamp(0.0, 1.0);
        let path = share * share * share * (10.0 + share * (6.0 * share - 15.0));
        let rate = 30.0 * share * share * (1.0 - share) * (1.0 - share) / m.seconds;
        let (way, speed) = if m.is_even { (share, 1.0 / m.seconds) } else { (path, rate) };
        let distance = m.to_mm - m.from_mm;
        Target {
            depth_mm: m.from_mm + distance * way,
            speed_mm_s: distance * speed,
            turned_rad: m.from_rad + (m.to_rad - m.from_rad) * path,
        }
    }
}

/// The procedure of a page, with its list of steps.
const PRACTISED: &str = "cannulation";

/// Returns the procedure with which a page begins in a patient: its own, and where its file names
/// none, a cannulation with its list of steps.
pub fn of_page(profile: &Profile) -> String {
    let own = profile.procedure.as_str();
    if own == profile::USUAL_PROCEDURE { PRACTISED.to_owned() } else { own.to_owned() }
}

/// The text of a built-in procedure by its name, or of a file by its path.
fn text(wanted: &str) -> Result<Text, Error> {
    insertion(wanted).map_or_else(|| named_files::find("procedure", wanted, &BUILT_IN), Ok)
}

/// Returns the task of a step, which must belong to the procedure's purpose.
fn task_named(
    task: Option<&str>,
    step: &str,
    purpose: Option<Purpose>,
) -> Result<Option<&'static str>, String> {
    let Some(wanted) = task else { return Ok(None) };
    let known = purpose.map_or(&[][..], Purpose::tasks);
    known.iter().find(|name| **name == wanted).copied().map(Some).ok_or_else(|| match known {
        [] => format!("step \"{step}\" does task \"{wanted}\", and the procedure has no purpose; add one"),
        _ => format!("step \"{step}\" does task \"{wanted}\"; use one of {}", known.join(", ")),
    })
}

/// The procedure of a name like `insertion-5mms-60deg`; none for another name.
fn insertion(name: &str) -> Option<Text> {
    let (speed, angle) = name.strip_prefix("insertion-")?.strip_suffix("deg")?.split_once("mms-")?;
    let number = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite());
    let (speed, angle) = (number(speed)?, number(angle)?);
    let reach_mm = INSERTION_DEPTH_MM / libm::sin(angle.to_radians());
    let text = INSERTION
        .replace("insertion-3mms-45deg\"", &format!("{name}\""))
        .replace("speed_mm_s = 3.0", &format!("speed_mm_s = {speed:?}"))
        .replace("entry_deg = 45.0", &format!("entry_deg = {angle:?}"))
        .replace("to_mm = 14.14", &format!("to_mm = {reach_mm:.2}"));
    Some(Text { origin: format!("procedure {name}"), text })
}

impl File {
    fn resolve(&self, profile: &Profile) -> Result<Procedure, String> {
        if self.format != 1 {
            return Err(format!("format is {}; this program reads format 1", self.format));
        }
        let travel = profile.config.device.limits.travel.0.to_num::<f64>();
        within("start_mm", self.start_mm, -travel, travel)?;
        self.entry_deg.map_or(Ok(()), |deg| check_entry("entry_deg", deg, profile.slope))?;
        within("stiffness_n_per_mm", self.hand.stiffness_n_per_mm, 0.05, 10.0)?;
        within("damping_n_s_per_mm", self.hand.damping_n_s_per_mm, 0.0, 0.1)?;
        within("tremor_mm", self.hand.tremor_mm, 0.0, 2.0)?;
        let entry_rad = self.entry_deg.map_or(profile.entry_rad, f64::to_radians);
        let (mut moves, mut at, mut turned_deg, mut begin_s) = (Vec::new(), self.start_mm, 0.0, 0.0);
        for step in &self.step {
            let to_deg = step.turned_deg.unwrap_or(turned_deg);
            within(&format!("turned_deg of step \"{}\"", step.name), to_deg, -90.0, 90.0)?;
            let to_mm = step.target(profile, at, entry_rad + to_deg.to_radians())?;
            within(&format!("the depth of step \"{}\" in mm", step.name), to_mm, -travel, travel)?;
            let (seconds, is_even) = step.time(to_mm - at)?;
            within(&format!("seconds of step \"{}\"", step.name), seconds, 0.05, 3_600.0)?;
            // Faster than a hand goes, and than the grip of the roller can follow.
            within(&format!("mm/s of step \"{}\"", step.name), (to_mm - at).abs() / seconds, 0.0, 500.0)?;
            let (from_rad, to_rad) = (f64::to_radians(turned_deg), to_deg.to_radians());
            let task = task_named(step.task.as_deref(), &step.name, self.purpose)?;
            moves.push(Move { begin_s, seconds, from_mm: at, to_mm, from_rad, to_rad, is_even, task });
            begin_s += seconds;
            (at, turned_deg) = (to_mm, to_deg);
        }
        if moves.is_empty() || (at - self.start_mm).abs() > 1e-6 || turned_deg != 0.0 {
            return Err(
                "the last step must end at start_mm with turned_deg = 0, because rounds repeat; add a step"
                    .into(),
            );
        }
        let grip = Grip {
            stiffness_n_per_m: self.hand.stiffness_n_per_mm * 1e3,
            damping_n_s_per_m: self.hand.damping_n_s_per_mm * 1e3,
            tremor_rms_m: self.hand.tremor_mm * 1e-3,
            seed: self.hand.seed,
        };
        Ok(Procedure {
            name: self.name.clone(),
            grip,
            start_mm: self.start_mm,
            entry_rad: self.entry_deg.map(f64::to_radians),
            round_s: begin_s,
            purpose: self.purpose,
            moves,
        })
    }
}

impl ProcedureStep {
    /// Returns the time to go `way_mm`, s, and true if at an even speed.
    fn time(&self, way_mm: f64) -> Result<(f64, bool), String> {
        match (self.seconds, self.speed_mm_s) {
            (Some(seconds), None) => Ok((seconds, false)),
            (None, Some(speed)) => {
                within(&format!("speed_mm_s of step \"{}\"", self.name), speed, 0.01, 500.0)?;
                Ok((way_mm.abs() / speed, true))
            }
            _ => Err(format!("step \"{}\" needs either seconds or speed_mm_s", self.name)),
        }
    }

    /// Returns the place where it ends, with the needle at `angle_rad` to the skin.
    fn target(&self, profile: &Profile, at_mm: f64, angle_rad: f64) -> Result<f64, String> {
        match (self.to_mm, self.past) {
            (Some(_), Some(_)) => {
                Err(format!("step \"{}\" has both to_mm and past; keep one of them", self.name))
            }
            (Some(to_mm), None) => Ok(to_mm + self.by_mm),
            (None, None) => Ok(at_mm + self.by_mm),
            (None, Some(past)) => {
                let tissue = Tissue::from(past);
                let layers = &profile.config.patient.layers;
                // The line through a body may miss the tissue: then the hand goes to the last
                // layer.
                let last = layers.last().filter(|_| profile.body.is_some());
                let layer = layers.iter().find(|l| l.tissue == tissue).or(last).ok_or_else(|| {
                    format!(
                        "step \"{}\" goes past a tissue that profile {} does not have; use to_mm",
                        self.name, profile.name
                    )
                })?;
                // One without a wall that gives way is passed where it begins.
                let begins_mm = layer.depth.0.to_num::<f64>() / libm::sin(angle_rad);
                Ok(puncture_path_mm(layer, angle_rad).unwrap_or(begins_mm) + self.by_mm)
            }
        }
    }
}

fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), String> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(format!("{key} is {value}; it must be from {low} to {high}"))
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
        for (name, _) in BUILT_IN.iter().filter(|(name, _)| !name.starts_with("shoulder") && *name != "bursa")
        {
            let procedure = Procedure::find(name, &adult()).expect("it is built in");
            let step = 1e-4;
            let mut before = procedure.target(0.0);
            for tick in 1..(procedure.round_s / step) as u32 * 2 {
                let now = procedure.target(f64::from(tick) * step);
                let slope = (now.depth_mm - before.depth_mm) / step;
                let mean = f64::midpoint(now.speed_mm_s, before.speed_mm_s);
                // Where a stage starts or stops there is a step in its speed, and half of it within
                // one tick.
                let jump = (now.speed_mm_s - before.speed_mm_s).abs();
                assert!((slope - mean).abs() < 0.01 + jump, "{name}: {slope} mm/s at tick {tick}");
                before = now;
            }
        }
    }

    #[test]
    fn a_stage_keeps_its_speed_and_a_turn_ends_where_it_began() {
        let text = "format = 1\nname = \"x\"\nstart_mm = -2.0\n[hand]\nstiffness_n_per_mm = 10.0\n\
             damping_n_s_per_mm = 0.05\ntremor_mm = 0.0\nseed = 1\n\
             [[step]]\nname = \"in\"\nto_mm = 10.0\nspeed_mm_s = 3.0\n\
             [[step]]\nname = \"turn\"\nby_mm = -4.0\nseconds = 1.0\nturned_deg = 12.0\n\
             [[step]]\nname = \"out\"\nto_mm = -2.0\nseconds = 2.0\nturned_deg = 0.0\n";
        let source = Text { origin: "p.toml".into(), text: text.into() };
        let procedure = Procedure::parse(&source, &adult()).expect("well formed");
        assert!((procedure.round_s - 7.0).abs() < 1e-9);
        for tenth in 1..40 {
            let target = procedure.target(f64::from(tenth) * 0.1);
            assert!((target.speed_mm_s - 3.0).abs() < 1e-9 && target.turned_rad == 0.0);
            assert!((target.depth_mm + 2.0 - 0.3 * f64::from(tenth)).abs() < 1e-9);
        }
        let turned = procedure.target(5.0);
        assert!((turned.depth_mm - 6.0).abs() < 1e-6 && (turned.turned_rad.to_degrees() - 12.0).abs() < 1e-6);
        assert!(procedure.target(6.999_999).turned_rad.abs() < 1e-6);
    }

    #[test]
    fn an_insertion_is_called_by_its_speed_and_angle() {
        let one = Procedure::find("insertion-5mms-30deg", &adult()).expect("well named");
        assert_eq!(one.name, "insertion-5mms-30deg");
        assert!((one.entry_rad.expect("its own").to_degrees() - 30.0).abs() < 1e-9);
        let (begin, end) = (one.target(0.51), one.target(0.5 + 20.99 / 5.0));
        assert!((begin.speed_mm_s - 5.0).abs() < 1e-9 && (end.depth_mm - 20.0).abs() < 0.1, "{end:?}");
        for wrong in
            ["insertion-0mms-30deg", "insertion-3mms-0deg", "insertion-xmms-30deg", "insertion-3mms-120deg"]
        {
            assert!(Procedure::find(wrong, &adult()).is_err(), "{wrong}");
        }
    }

    #[test]
    fn mistakes_are_refused_by_name() {
        let good = BUILT_IN[1].1;
        for (wrong, hint) in [
            (good.replace("past = \"vessel\"", "past = \"bursa\""), "does not have"),
            (good.replace("seconds = 2.0", "seconds = 0.0"), "insert"),
            (good.replace("seconds = 2.0", "seconds = nan"), "insert"),
            (good.replace("to_mm = -6.0", "to_mm = -7.0"), "rounds repeat"),
            (good.replace("to_mm = -0.5", "to_mm = 400.0"), "approach"),
            (good.replace("tremor_mm = 0.03 ", "tremor_mm = 30.0 "), "tremor_mm"),
            (good.replace("name = \"hold\"", "nome = \"hold\""), "nome"),
            (good.replace("seconds = 2.0", "seconds = 2.0\nspeed_mm_s = 3.0"), "insert"),
            (good.replace("seconds = 2.0", "speed_mm_s = -3.0"), "speed_mm_s"),
            (good.replace("seconds = 1.5", "seconds = 1.5\nturned_deg = 5.0"), "turned_deg = 0"),
            (good.replace("seconds = 2.0", "seconds = 2.0\nturned_deg = 500.0"), "turned_deg"),
            (
                good.replace("task = \"tourniquet_on\"", "task = \"dance\""),
                "use one of tourniquet_on, tourniquet_off",
            ),
            (good.replace("purpose = \"blood-draw\"\n", ""), "has no purpose"),
            (good.replace("purpose = \"blood-draw\"", "purpose = \"dance\""), "dance"),
        ] {
            let source = Text { origin: "p.toml".into(), text: wrong };
            let said = Procedure::parse(&source, &adult()).expect_err(hint).to_string();
            assert!(said.contains(hint) && said.contains("p.toml") && !said.contains('\n'), "{said}");
        }
    }
}
