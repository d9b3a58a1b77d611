//! A diagnosis report as the design reads it: contenders, noise, and the limits.

use diagnosis::report::Report;
use diagnosis::rig::Rig;
use serde::Serialize;
use std::path::Path;

/// Part of each limit that an input may use.
const MARGIN: f64 = 0.8;
/// Contenders below this probability are left out.
const LEAST_PROBABILITY: f64 = 0.01;
/// Steps of a recording from which their mean length is taken.
const FEWEST_STEPS: f64 = 20.0;
/// Least probability of a contender that the report names as the possible truth of a named effect.
const LEAST_OF_CLASS: f64 = 0.05;
/// Part of the way ahead that an input may go behind its start where no recording did: a servo that
/// returns there overshoots.
const LEAST_BACK: f64 = 0.02;
/// The most contenders that are compared.
const MOST_RIVALS: usize = 5;

/// The limits of a machine, in the coordinate of its rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Limits {
    /// Largest distance ahead of where an input begins, rad or m.
    pub travel: f64,
    /// Largest distance behind it, rad or m.
    pub back: f64,
    /// rad/s or m/s.
    pub speed: f64,
    /// N·m or N.
    pub force: f64,
}

impl Limits {
    /// Returns the part of the limits that an input may use.
    pub(crate) fn usable(self) -> Self {
        let Self { travel, back, speed, force } = self;
        Self { travel: MARGIN * travel, back: MARGIN * back, speed: MARGIN * speed, force: MARGIN * force }
    }
}

/// A model that may be the truth.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The effect's name; `none` for the model without it.
    pub name: String,
    /// The effect in words.
    pub words: String,
    /// Probability; those of a case sum to one.
    pub probability: f64,
    /// The whole machine with it.
    pub rig: Rig,
}

/// The start of a design.
#[derive(Clone, Debug)]
pub struct Case {
    /// At least two, the most probable first.
    pub rivals: Vec<Rival>,
    /// Random force that the model leaves beyond the sensor's noise, root mean square, N·m or N.
    pub disturbance: f64,
    /// Bandwidth over which it was measured, Hz.
    pub bandwidth_hz: f64,
    /// Time between two readings that the diagnosis takes apart, s: a row of the recordings, or a
    /// block of a few if they are faster.
    pub reading_s: f64,
    /// The machine's limits.
    pub limits: Limits,
}

impl Case {
    /// Reads the folder that `diagnose` wrote. A limit that is not given is the most that the
    /// report's recordings did (speed, travel) or the rig allows (force).
    ///
    /// # Errors
    /// One sentence: the file, what is wrong with it, what to do.
    pub fn read(
        folder: &Path,
        travel: Option<f64>,
        speed: Option<f64>,
        force: Option<f64>,
    ) -> Result<Self, String> {
        let report = report(folder)?;
        let rivals = rivals(folder, &report)?;
        let rig = &rivals[0].rig;
        let shown = ShownMotion::read(&folder.join("residuals.csv"))?;
        let of_drive = rig.actuator.limit.map(|limit| (limit * rig.actuator.gain).abs());
        let force = force.or(of_drive).ok_or_else(|| {
            format!(
                "{}: the rig declares no limit of the command; give the largest force with --force",
                folder.display()
            )
        })?;
        if travel.is_none() && shown.ahead <= 0.0 {
            return Err(format!(
                "{}: no recording goes ahead of where it began, where an input moves; give the room ahead with --travel",
                folder.display()
            ));
        }
        // If only the recordings give the limits, an input stays within their range: the axis may
        // begin at a stop.
        let limits = Limits {
            travel: travel.unwrap_or(shown.ahead),
            back: travel.unwrap_or(shown.behind.max(LEAST_BACK * shown.ahead)),
            speed: speed.unwrap_or(shown.speed),
            force,
        };
        for (name, value) in [("travel", limits.travel), ("speed", limits.speed), ("force", limits.force)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("--{name} is {value}; it must be a number above zero"));
            }
        }
        let (left, floor) = (report.fit.patched.holdout, report.noise_floor);
        // Counting is simulated by itself; the rest disturbs.
        let disturbance = (left * left - floor * floor).max(0.01 * floor * floor).sqrt();
        let bandwidth_hz = report.residual_bandwidth_hz.max(1.0);
        Ok(Self { rivals, disturbance, bandwidth_hz, reading_s: shown.reading_s, limits })
    }

    /// Sets the probabilities so that they sum to one.
    pub(crate) fn normalise(rivals: &mut Vec<Rival>) {
        rivals.retain(|rival| rival.probability >= LEAST_PROBABILITY);
        rivals.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        rivals.truncate(MOST_RIVALS);
        let whole: f64 = rivals.iter().map(|rival| rival.probability).sum();
        rivals.iter_mut().for_each(|rival| rival.probability /= whole);
    }
}

fn report(folder: &Path) -> Result<Report, String> {
    let path = folder.join("diagnosis.json");
    let text = std::fs::read_to_string(&path).map_err(|cause| {
        format!(
            "{}: the report cannot be read ({cause}); give the folder that `host-sim diagnose` wrote",
            path.display()
        )
    })?;
    serde_json::from_str(&text)
        .map_err(|cause| format!("{}: this is not a report ({cause}); diagnose again", path.display()))
}

fn rivals(folder: &Path, report: &Report) -> Result<Vec<Rival>, String> {
    let one = |contender: &diagnosis::report::Contending| {
        let rig = Rig::read(&folder.join(&contender.rig)).map_err(|error| error.to_string())?;
        let (name, words) = match contender.name {
            Some(name) => (name.as_str().to_owned(), name.in_words().to_owned()),
            None => ("none".to_owned(), "none of them".to_owned()),
        };
        Ok(Rival { name, words, probability: contender.probability, rig })
    };
    let mut rivals = report.contenders.iter().map(one).collect::<Result<Vec<_>, String>>()?;
    // However unlikely, a name that the report gives as well is still to be distinguished.
    let is_said = |rival: &&mut Rival| report.effects.iter().any(|effect| is_other(effect, &rival.name));
    for rival in rivals.iter_mut().filter(is_said) {
        rival.probability = rival.probability.max(LEAST_OF_CLASS);
    }
    Case::normalise(&mut rivals);
    if rivals.len() < 2 {
        return Err(format!(
            "{}: no two models contend for a name, so there is nothing to distinguish; the verdict of the report is final",
            folder.join("diagnosis.json").display()
        ));
    }
    Ok(rivals)
}

/// True if the report says that an effect could also be the one of this name.
fn is_other(effect: &diagnosis::report::Named, name: &str) -> bool {
    effect.class.iter().any(|other| other.as_str() == name && *other != effect.name)
}

/// The motion that the report's recordings showed.
struct ShownMotion {
    /// Farthest ahead of where a recording began, and behind it.
    ahead: f64,
    behind: f64,
    speed: f64,
    /// Longest mean time between two residuals of a recording, s.
    reading_s: f64,
}

impl ShownMotion {
    /// Reads the residuals of a report, of which each recording has a speed at each time.
    fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|cause| {
            format!("{}: the residuals cannot be read ({cause}); diagnose again", path.display())
        })?;
        let mut shown = Self { ahead: 0.0, behind: 0.0, speed: 0.0, reading_s: 0.0 };
        let (mut file, mut before, mut place, mut low, mut high) =
            (String::new(), 0.0, 0.0, 0.0_f64, 0.0_f64);
        let (mut begin, mut steps) = (0.0, 0.0);
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let [name, time, velocity, ..] = cells[..] else { continue };
            let (Ok(time), Ok(velocity)) = (time.parse::<f64>(), velocity.parse::<f64>()) else { continue };
            if name != file || time < before {
                (place, low, high) = (0.0, 0.0, 0.0);
                (begin, steps) = (time, 0.0);
                name.clone_into(&mut file);
            } else {
                place += velocity * (time - before);
                steps += 1.0;
            }
            before = time;
            (low, high) = (low.min(place), high.max(place));
            (shown.ahead, shown.behind) = (shown.ahead.max(high), shown.behind.max(-low));
            shown.speed = shown.speed.max(velocity.abs());
            if steps >= FEWEST_STEPS {
                shown.reading_s = shown.reading_s.max((time - begin) / steps);
            }
        }
        Ok(shown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    /// Two recordings: 3 rad ahead and back at 2 rad/s, and 1 rad behind at 0.5 rad/s.
    #[test]
    fn the_room_of_an_input_is_where_the_recordings_were() {
        let mut csv = String::from("file,time_s,velocity,force\n");
        for (file, speed, turn_s, seconds) in [("a.csv", 2.0, 1.5, 3.0), ("b.csv", -0.5, 9.0, 2.0)] {
            for row in 0..=(100.0 * seconds) as u32 {
                let time = f64::from(row) / 100.0;
                let velocity = if time <= turn_s { speed } else { -speed };
                writeln!(csv, "{file},{time},{velocity},0").expect("a string");
            }
        }
        let path = std::env::temp_dir().join(format!("residuals-{}.csv", std::process::id()));
        std::fs::write(&path, csv).expect("there is space");
        let shown = ShownMotion::read(&path).expect("rows");
        std::fs::remove_file(&path).expect("it was written");
        let near = |a: f64, b: f64| (a - b).abs() < 0.05;
        assert!(near(shown.ahead, 3.0) && near(shown.behind, 1.0), "{} {}", shown.ahead, shown.behind);
        assert!(near(shown.speed, 2.0) && (shown.reading_s - 0.01).abs() < 1e-6, "{}", shown.reading_s);
    }
}
