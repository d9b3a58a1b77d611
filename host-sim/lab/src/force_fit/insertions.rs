//! Insertions to fit a force to: from the device's own recordings (MCAP) or from anybody's
//! measurements (CSV). Each is cut down to its way in at an even speed, and becomes (perpendicular
//! depth, force) at one speed and one angle.

use control_core::TICK_HZ;
use device_sim::error::Error;
use recording::read::Recording;
use recording::stretches::stretches;
use std::path::Path;

/// A way in that is shorter than this says nothing of a force over depth, mm.
const SHORTEST_MM: f64 = 1.0;
/// A needle drawn back by this much is no longer on its way in, mm.
const DRAWN_BACK_MM: f64 = 1.0;
/// Speed is found over this time, s: long compared with an encoder's step, short compared with a
/// way in.
const SPEED_S: f64 = 0.1;
/// The largest share by which the needle may be slower or faster than the way's median; beyond it
/// is a beginning, an end, or a jump at a puncture.
const EVEN: f64 = 0.5;
/// As many a second are enough for a curve with knots of a quarter of a mm.
const MOST_HZ: f64 = 1_000.0;

/// Larger than any force of a needle, N.
pub(crate) const LARGEST_N: f64 = 60.0;
/// A force at this distance from the skin or farther is the sensor's alone, mm.
const REST_MM: f64 = 0.05;
/// The largest of those, N and as a part of the forces inside.
const REST_N: f64 = 0.2;
const REST_PART: f64 = 0.15;

/// A moment of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// s.
    pub time_s: f64,
    /// The depth of the tip past the entry point, along the needle, mm.
    pub depth_mm: f64,
    /// The angle of the needle to the skin, °.
    pub angle_deg: f64,
    /// Against insertion, N.
    pub force_n: f64,
}

/// One way in at an even speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Insertion {
    /// The file and which insertion of it.
    pub name: String,
    /// Median, mm/s along the needle.
    pub speed_mm_s: f64,
    /// Median, °.
    pub angle_deg: f64,
    /// Perpendicular depth in mm and force in N.
    pub points: Vec<(f64, f64)>,
}

/// The way in which the angle of the needle in a CSV is treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Angle {
    /// A file without it is refused.
    Needed,
    /// It is not read, and 90° everywhere.
    Ignored,
}

/// The stretches of a file, MCAP or CSV by what is in it.
pub fn moments(path: &Path, angle: Angle) -> Result<Vec<Vec<Moment>>, Error> {
    let shown = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|cause| {
        Error::input(format_args!("{shown}: the recording cannot be read ({cause}); check its path"))
    })?;
    if bytes.starts_with(mcap::MAGIC) {
        return Ok(from_recording(&Recording::parse(shown, &bytes)?));
    }
    let text = String::from_utf8(bytes).map_err(|_| {
        Error::input(format_args!("{shown}: neither an MCAP recording nor a CSV file; give one of these"))
    })?;
    Ok(vec![parse_csv(&shown, &text, angle)?])
}

/// All insertions of a file.
pub fn read(path: &Path) -> Result<Vec<Insertion>, Error> {
    let shown = path.display().to_string();
    let series = moments(path, Angle::Needed)?;
    series.iter().try_for_each(|moments| check_force(&shown, moments))?;
    let found: Vec<Insertion> = series
        .iter()
        .flat_map(|moments| ways_in(moments))
        .filter_map(even_part)
        .enumerate()
        .map(|(index, insertion)| Insertion {
            name: format!("{shown}, insertion {}", index + 1),
            ..insertion
        })
        .collect();
    if found.is_empty() {
        return Err(Error::input(format_args!(
            "{shown}: no insertion in it: the depth never goes inwards from 0 by {SHORTEST_MM} mm at an even speed"
        )));
    }
    Ok(found)
}

/// Refuses a force that no needle meets: in another unit, with its sign turned, or with a zero that
/// was not taken off.
fn check_force(file: &str, moments: &[Moment]) -> Result<(), Error> {
    let forces =
        |inside: bool| moments.iter().filter(move |m| (m.depth_mm > 0.0) == inside).map(|m| m.force_n);
    let outside = || moments.iter().filter(|m| m.depth_mm < -REST_MM).map(|m| m.force_n);
    let rest = median(outside()).unwrap_or(0.0);
    let (low, high) = forces(true).fold((0.0_f64, 0.0_f64), |(l, h), f| (l.min(f), h.max(f)));
    let refused = |why: String| Err(Error::input(format_args!("{file}: {why}")));
    if (high - rest).max(rest - low) > LARGEST_N {
        return Err(too_large(file, if high > -low { high } else { low }));
    }
    if rest.abs() > REST_N.max(REST_PART * (high - low)) {
        return refused(format!(
            "force_n is {rest:.2} N before the needle touches; subtract it from all rows"
        ));
    }
    if median(forces(true)).is_some_and(|middle| middle < 0.0) && -low > 2.0 * high {
        return refused(
            "the force is negative throughout; force_n is positive against insertion, so turn its sign"
                .into(),
        );
    }
    Ok(())
}

/// Refuses a force of `far` N, beyond [`LARGEST_N`].
pub(crate) fn too_large(file: &str, far: f64) -> Error {
    Error::input(format_args!(
        "{file}: force_n reaches {far:.0}, more than any needle meets in N; if it is in mN, divide it by 1000"
    ))
}

fn from_recording(recording: &Recording) -> Vec<Vec<Moment>> {
    let stretches = stretches(recording);
    let moments = stretches.iter().map(|stretch| {
        let hello = &stretch.hello;
        let rows = stretch.samples.iter().enumerate();
        rows.map(|(tick, sample)| Moment {
            time_s: tick as f64 / f64::from(TICK_HZ),
            depth_mm: f64::from(sample.count) * hello.mm_per_count,
            angle_deg: (f64::from(sample.tilt_mrad) * 1e-3).to_degrees(),
            force_n: hello.force_n(sample.dac),
        })
        .collect()
    });
    moments.collect()
}

/// `time_s,depth_mm,force_n` and, where it is needed, `angle_deg` or `tilt_rad`, in any order;
/// other columns are ignored.
fn parse_csv(file: &str, text: &str, angle: Angle) -> Result<Vec<Moment>, Error> {
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or("", |(_, line)| line).trim_start_matches('\u{feff}');
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let column = |name: &str| names.iter().position(|n| *n == name);
    let needed = |name: &str| {
        column(name).ok_or_else(|| {
            Error::input(format_args!(
                "{file}, line 1: has no column {name}; time_s, depth_mm, force_n{} are needed",
                if angle == Angle::Needed { " and angle_deg" } else { "" }
            ))
        })
    };
    let (time, depth, force) = (needed("time_s")?, needed("depth_mm")?, needed("force_n")?);
    let angle = match column("tilt_rad") {
        _ if angle == Angle::Ignored => None,
        Some(tilt) if column("angle_deg").is_none() => Some((tilt, 180.0 / std::f64::consts::PI)),
        _ => Some((needed("angle_deg")?, 1.0)),
    };
    let mut moments: Vec<Moment> = Vec::new();
    for (index, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |column: usize| {
            let field = fields.get(column).map_or("", |f| f.trim());
            let value = field.parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| {
                let name = names[column];
                Error::input(format_args!(
                    "{file}, line {}: {name} is \"{field}\"; it must be a number",
                    index + 1
                ))
            })
        };
        let moment = Moment {
            time_s: number(time)?,
            depth_mm: number(depth)?,
            force_n: number(force)?,
            angle_deg: match angle {
                Some((column, to_degrees)) => number(column)? * to_degrees,
                None => 90.0,
            },
        };
        if moments.last().is_some_and(|last| last.time_s >= moment.time_s) {
            return Err(Error::input(format_args!(
                "{file}, line {}: time_s does not increase; rows must be in their order in time",
                index + 1
            )));
        }
        moments.push(moment);
    }
    Ok(moments)
}

/// Cut where the tip crosses the entry point inwards and where it turns back.
fn ways_in(moments: &[Moment]) -> Vec<&[Moment]> {
    let (mut ways, mut begin, mut deepest) = (Vec::new(), None, 0);
    for (index, moment) in moments.iter().enumerate() {
        match begin {
            None if moment.depth_mm >= 0.0 && index > 0 && moments[index - 1].depth_mm < 0.0 => {
                (begin, deepest) = (Some(index), index);
            }
            // A recording may begin at the skin.
            None if index == 0 && (0.0..0.5).contains(&moment.depth_mm) => begin = Some(0),
            Some(first) => {
                if moment.depth_mm > moments[deepest].depth_mm {
                    deepest = index;
                }
                if moment.depth_mm < moments[deepest].depth_mm - DRAWN_BACK_MM || moment.depth_mm < -0.1 {
                    ways.push(&moments[first..=deepest]);
                    begin = None;
                }
            }
            None => {}
        }
    }
    ways.extend(begin.map(|first| &moments[first..=deepest]));
    ways.retain(|way| way.last().map_or(0.0, |m| m.depth_mm) - way[0].depth_mm >= SHORTEST_MM);
    ways
}

/// The part of a way in that has an even speed, thinned out.
fn even_part(way: &[Moment]) -> Option<Insertion> {
    let seconds = way.last()?.time_s - way.first()?.time_s;
    let rate_hz = way.len() as f64 / seconds;
    let window = ((SPEED_S * rate_hz) as usize).clamp(1, way.len() - 1);
    let speed_at = |index: usize| {
        let from = index.saturating_sub(window / 2).min(way.len() - 1 - window);
        let (a, b) = (&way[from], &way[from + window]);
        (b.depth_mm - a.depth_mm) / (b.time_s - a.time_s)
    };
    let keep = ((rate_hz / MOST_HZ) as usize).max(1);
    let speeds: Vec<(usize, f64)> =
        (0..way.len()).step_by(keep).map(|index| (index, speed_at(index))).collect();
    // A rest between two layers must not become the median.
    let moving = speeds.iter().map(|s| s.1).filter(|v| *v > 0.05);
    let speed_mm_s = median(moving)?;
    let even: Vec<&Moment> = speeds
        .iter()
        .filter(|(_, v)| (v / speed_mm_s - 1.0).abs() <= EVEN)
        .map(|(index, _)| &way[*index])
        .collect();
    let angle_deg = median(even.iter().map(|m| m.angle_deg))?;
    let points = even.iter().map(|m| (m.depth_mm * m.angle_deg.to_radians().sin(), m.force_n)).collect();
    Some(Insertion { name: String::new(), speed_mm_s, angle_deg, points })
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    /// At `speed` mm/s in to 10 mm, a rest, and out; twice.
    fn csv(speed: f64, angle: &str) -> String {
        let mut text = String::from("angle_deg,time_s,remark,depth_mm,force_n\n");
        let round = 22.0 / speed + 1.0;
        for n in 0..(2.0 * round * 200.0) as usize {
            let t = n as f64 / 200.0;
            let into = t % round;
            let depth = -1.0 + speed * into.min(11.0 / speed) - speed * (into - 11.0 / speed - 1.0).max(0.0);
            let _ = writeln!(text, "{angle},{t:.3},x,{depth:.4},{:.5}", 0.1 * depth.max(0.0));
        }
        text
    }

    #[test]
    fn every_way_in_is_found_with_its_speed_and_angle() {
        let moments = parse_csv("a.csv", &csv(3.0, "30"), Angle::Needed).expect("well formed");
        let found: Vec<Insertion> = ways_in(&moments).into_iter().filter_map(even_part).collect();
        assert_eq!(found.len(), 2);
        for one in found {
            assert!((one.speed_mm_s - 3.0).abs() < 0.05, "{}", one.speed_mm_s);
            assert_eq!(one.angle_deg, 30.0);
            // Perpendicular: half of the way along a needle at 30°.
            let deepest = one.points.iter().map(|p| p.0).fold(0.0, f64::max);
            assert!((4.8..5.01).contains(&deepest), "{deepest}");
            assert!(one.points.iter().all(|(d, f)| (f - 0.2 * d).abs() < 1e-3));
        }
    }

    #[test]
    fn mistakes_are_reported_with_file_and_line() {
        let good = csv(5.0, "45");
        for (wrong, hints) in [
            (good.replacen("depth_mm", "deep_mm", 1), ["line 1", "depth_mm"]),
            (good.replacen("45,0.005,x", "45,fast,x", 1), ["line 3", "time_s"]),
            (good.replacen("45,0.005,x", "45,0.000,x", 1), ["line 3", "increase"]),
            (good.replacen("45,0.010,", "nan,0.010,", 1), ["line 4", "angle_deg"]),
            (good.replacen("45,0.010,x,", "45,0.010,x", 1), ["line 4", "force_n"]),
        ] {
            let said = parse_csv("a.csv", &wrong, Angle::Needed).expect_err(hints[1]).to_string();
            assert!(hints.iter().all(|hint| said.contains(hint)) && said.contains("a.csv"), "{said}");
        }
    }
}
