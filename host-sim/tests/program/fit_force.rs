//! From insertions to a force table on the command line: Paper 000's experiment with a truth that
//! is known.

use crate::common::{figure, folder, refused, run, run_well, text};
use control_core::controller::Sample;
use recording::read::Recording;
use recording::stretches::stretches;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A layer of the phantom: where it begins, mm, its stiffness, N/mm^1.5, and the energy that it
/// takes to tear it, N·mm.
const LAYERS: [(f64, f64, f64); 2] = [(0.0, 0.30, 0.62), (4.2, 0.55, 0.55)];

/// A phantom by another law than the table's: each layer stores elastic energy, F = k·δ^1.5, and
/// tears when that reaches the energy of a crack. Faster is stiffer (logarithm) and tougher (root),
/// so that a layer tears at another depth, too; what has torn falls off exponentially, and the
/// shaft rubs.
struct Phantom {
    speed: f64,
    angle_deg: f64,
    /// The toughness of this specimen over the mean one's.
    toughness: f64,
}

impl Phantom {
    fn stiffness(&self, k: f64) -> f64 {
        k * (1.0 + 0.12 * self.speed.ln_1p()) * (0.6 + 0.4 * self.angle_deg.to_radians().sin())
    }

    /// Returns the indentation at which a layer tears: its energy is k·δ^2.5/2.5 then.
    fn tears_at(&self, (_, k, energy): (f64, f64, f64)) -> f64 {
        let energy = energy * self.toughness * (1.0 + 0.25 * self.speed.sqrt());
        (2.5 * energy / self.stiffness(k)).powf(0.4)
    }

    fn force_n(&self, depth: f64) -> f64 {
        if depth <= 0.0 {
            return 0.0;
        }
        let mut force = 0.0;
        for layer in LAYERS {
            let (pushed, tears) = (depth - layer.0, self.tears_at(layer));
            if pushed > 0.0 && pushed <= tears {
                force += self.stiffness(layer.1) * pushed.powf(1.5);
            } else if pushed > tears {
                force += self.stiffness(layer.1) * tears.powf(1.5) * (-(pushed - tears) / 0.06).exp();
            }
        }
        let torn = depth - self.tears_at(LAYERS[0]);
        let rubs = if torn > 0.0 { (0.1 + 0.03 * torn) * (1.0 + 0.08 * self.speed) } else { 0.0 };
        force + rubs
    }

    /// The forces at which the layers tear, N.
    fn peaks_n(&self) -> [f64; 2] {
        LAYERS.map(|layer| self.force_n(layer.0 + self.tears_at(layer)))
    }
}

/// The reading of a six-axis sensor of 12 N: white noise of 8 mN, mains of 3 mN, a drift of 5 mN,
/// steps of 3 mN.
struct Sensor {
    random: u64,
}

impl Sensor {
    /// The sum of twelve numbers from 0 to 1, less 6, is nearly normal.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    fn unit(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn read(&mut self, force: f64, time_s: f64) -> f64 {
        let mains = 0.003 * (std::f64::consts::TAU * 50.0 * time_s).sin();
        let drift = 0.005 * (time_s / 5.0).sin();
        ((force + mains + drift + 0.008 * self.normal()) / 0.003).round() * 0.003
    }
}

/// An insertion and a withdrawal at an even speed, 500 rows a second, as a phantom's test stand
/// writes them.
fn insertion(dir: &Path, speed: f64, angle: f64, take: u64) -> PathBuf {
    let mut csv = String::from("time_s,depth_mm,force_n,angle_deg\n");
    let mut sensor = Sensor { random: 44_001 + 97 * take + (1_000.0 * speed + angle) as u64 };
    let phantom = Phantom { speed, angle_deg: angle, toughness: 1.0 + 0.02 * sensor.normal() };
    for n in 0..(2.0 * 15.0 / speed * 500.0) as u32 {
        let t = f64::from(n) / 500.0;
        let along = (speed * t).min(30.0 - speed * t) - 1.0;
        let force = phantom.force_n(along.max(0.0) * angle.to_radians().sin());
        let (depth, force) = (along + 0.003 * sensor.normal(), sensor.read(force, t));
        let _ = writeln!(csv, "{t:.3},{depth:.4},{force:.5},{angle}");
    }
    let file = dir.join(format!("{speed}mms-{angle}deg-{take}.csv"));
    std::fs::write(&file, csv).expect("the folder can be written");
    file
}

/// Perpendicular depth in mm and the motor's force in N on the way in, of an insertion at 5 mm/s.
fn felt(file: &Path, angle_deg: f64) -> Vec<(f64, f64)> {
    let recording = Recording::read(file).expect("it was recorded");
    let stretch = stretches(&recording).into_iter().next().expect("it ran");
    let sine = angle_deg.to_radians().sin();
    let place = |sample: &Sample| f64::from(sample.count) * stretch.hello.mm_per_count * sine;
    let way_in = stretch.samples.iter().take_while(|sample| place(sample) < 9.0);
    way_in
        .map(|sample| (place(sample), stretch.hello.force_n(sample.dac)))
        .filter(|(mm, _)| *mm > 0.0)
        .collect()
}

/// Mean force of each half mm.
fn by_depth(felt: &[(f64, f64)]) -> Vec<f64> {
    let mean = |bin: usize| {
        let of_bin: Vec<f64> =
            felt.iter().filter(|(mm, _)| (mm * 2.0) as usize == bin).map(|(_, n)| *n).collect();
        of_bin.iter().sum::<f64>() / of_bin.len() as f64
    };
    (0..18).map(mean).collect()
}

/// The largest force between two depths.
fn peak(felt: &[(f64, f64)], from: f64, to: f64) -> f64 {
    felt.iter().filter(|(mm, _)| (from..to).contains(mm)).map(|(_, n)| *n).fold(0.0, f64::max)
}

#[test]
fn a_table_fitted_to_a_phantom_reproduces_its_forces() {
    let dir = folder("fit-force-phantom");
    let record = |profile: &str, speed: u32, angle: u32, name: &str| {
        let file = dir.join(format!("{name}.mcap"));
        let procedure = format!("insertion-{speed}mms-{angle}deg");
        // One way in, and a part of the way out.
        let seconds = (20 / speed + 3).to_string();
        let head = ["run", "--headless", "--fast", "--profile", profile, "--record", text(&file)];
        run_well(&[&head[..], &["--seconds", &seconds, "--procedure", &procedure]].concat());
        file
    };
    let cells = [(1, 60), (3, 60), (5, 60), (5, 30), (5, 45)];
    let files = cells.map(|(v, a)| record("phantom", v, a, &format!("{v}-{a}")));
    let table = dir.join("table.toml");
    let arguments =
        [&["fit-force"], &files.each_ref().map(|f| text(f))[..], &["--out", text(&table)]].concat();
    run_well(&arguments);

    // The phantom's file with this table instead of its own.
    let phantom = Path::new(env!("CARGO_MANIFEST_DIR")).join("profiles/phantom.toml");
    let phantom = std::fs::read_to_string(phantom).expect("it is there");
    let (head, rest) = phantom.split_once("[force_table]").expect("its table");
    let layers = &rest[rest.find("[[layer]]").expect("its layers")..];
    let fitted = std::fs::read_to_string(&table).expect("written");
    let patient = dir.join("refitted.toml");
    std::fs::write(&patient, format!("{head}{fitted}\n{layers}")).expect("written");
    for angle in [30, 45, 60] {
        let original = &files[cells.iter().position(|c| *c == (5, angle)).expect("a cell")];
        let wanted_points = felt(original, f64::from(angle));
        let again = record(text(&patient), 5, angle, &format!("refitted-{angle}"));
        let got_points = felt(&again, f64::from(angle));
        let (wanted, got) = (by_depth(&wanted_points), by_depth(&got_points));
        let rms = |values: &mut dyn Iterator<Item = f64>| (values.map(|v| v * v).sum::<f64>() / 18.0).sqrt();
        let (size, error) =
            (rms(&mut wanted.iter().copied()), rms(&mut wanted.iter().zip(&got).map(|(a, b)| a - b)));
        assert!(size > 0.3 && error < 0.03 * size, "{angle}°: {error} N of {size} N: {wanted:?} {got:?}");
        for (from, to) in [(1.9, 3.0), (4.3, 5.4), (7.5, 8.6)] {
            let (wanted, got) = (peak(&wanted_points, from, to), peak(&got_points, from, to));
            assert!(
                (got / wanted - 1.0).abs() < 0.03,
                "{angle}°, {from} to {to} mm: {got} N, not {wanted} N"
            );
        }
    }
}

/// Numbers of a list, or of a list of lists, of the written table.
fn rows(table: &toml::Table, key: &str) -> Vec<Vec<f64>> {
    let numbers = |row: &toml::Value| {
        let row = row.as_array().expect("a row");
        row.iter().map(|n| n.as_float().or(n.as_integer().map(|n| n as f64)).expect("a number")).collect()
    };
    table["force_table"][key].as_array().expect("rows").iter().map(numbers).collect()
}

/// Straight lines between the knots of a written row.
fn written_force(depths: &[f64], forces: &[f64], depth: f64) -> f64 {
    let next = depths.partition_point(|knot| *knot <= depth).clamp(1, depths.len() - 1);
    let share = ((depth - depths[next - 1]) / (depths[next] - depths[next - 1])).clamp(0.0, 1.0);
    forces[next - 1] + share * (forces[next] - forces[next - 1])
}

const FIVE_CELLS: [(f64, f64); 5] = [(1.0, 60.0), (3.0, 60.0), (5.0, 60.0), (5.0, 30.0), (5.0, 45.0)];

#[test]
fn a_written_table_meets_a_phantoms_peaks_within_3_percent() {
    let dir = folder("fit-force-strange");
    let takes = |from: u64| {
        FIVE_CELLS.iter().flat_map(move |(v, a)| (from..from + 3).map(move |take| (*v, *a, take)))
    };
    let file = |(v, a, take): (f64, f64, u64)| insertion(&dir, v, a, take);
    let (seen, unseen): (Vec<_>, Vec<_>) = (takes(0).map(file).collect(), takes(10).map(file).collect());
    let out = dir.join("table.toml");
    let mut arguments = vec!["fit-force"];
    arguments.extend(seen.iter().map(|file| text(file)));
    arguments.extend(unseen.iter().flat_map(|file| ["--holdout", text(file)]));
    arguments.extend(["--out", text(&out)]);
    let said = run_well(&arguments);
    let table: toml::Table = std::fs::read_to_string(&out).expect("written").parse().expect("TOML");
    let (depths, forces) = (rows(&table, "depths_mm"), rows(&table, "force_n"));
    let gives_way = table["force_table"]["gives_way"].as_array().expect("knots");
    assert_eq!((gives_way.len(), depths.len(), figure(&said, "gives_way")), (2, 9, 2.0), "{said}");
    // The written file holds the peaks of the mean specimen, in force and in depth.
    let cell = |v: f64, a: f64| (((v - 1.0) / 2.0) as usize) * 3 + ((a - 30.0) / 15.0) as usize;
    for (v, a) in FIVE_CELLS {
        let mean = Phantom { speed: v, angle_deg: a, toughness: 1.0 };
        for ((knot, peak), layer) in gives_way.iter().zip(mean.peaks_n()).zip(LAYERS) {
            let knot = knot.as_integer().expect("a knot") as usize;
            let (at, n) = (depths[cell(v, a)][knot], forces[cell(v, a)][knot]);
            assert!((n / peak - 1.0).abs() < 0.03, "{v} mm/s, {a}°: {n} N, not {peak} N");
            let tears = layer.0 + mean.tears_at(layer);
            assert!((at - tears).abs() < 0.06, "{v} mm/s, {a}°: at {at} mm, not {tears} mm");
        }
    }
    // What the header says is what this file leaves of the insertions that it was judged by:
    // evaluated here, point by point.
    let squares: Vec<f64> = (unseen.iter().zip(takes(10)))
        .map(|(file, (v, a, _))| {
            let csv = std::fs::read_to_string(file).expect("written above");
            let (mut sum, mut count) = (0.0, 0.0);
            for line in csv.lines().skip(1) {
                let numbers: Vec<f64> = line.split(',').map(|n| n.parse().expect("a number")).collect();
                // The way in, without its first and its last tenth of a second.
                if (1.0 / v + 0.1..15.0 / v - 0.1).contains(&numbers[0]) {
                    let at = numbers[1] * a.to_radians().sin();
                    sum += (numbers[2] - written_force(&depths[cell(v, a)], &forces[cell(v, a)], at)).powi(2);
                    count += 1.0;
                }
            }
            sum / count
        })
        .collect();
    let left = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    let told = figure(&said, "unseen_rms_n");
    assert!((told / left - 1.0).abs() < 0.1, "{told} N reported, {left} N left by the file");
    // Specimens tear at depths that differ; off the tears little more than the sensor's noise is
    // left.
    assert!(told < 0.06, "{told} N");
    assert!(figure(&said, "worst_peak_percent") < 10.0, "{said}");
}

#[test]
fn the_papers_five_cells_predict_the_other_four() {
    let dir = folder("fit-force");
    let cell = |(speed, angle): (f64, f64)| insertion(&dir, speed, angle, 0);
    let seen = FIVE_CELLS.map(cell);
    let unseen = [(1.0, 30.0), (1.0, 45.0), (3.0, 30.0), (3.0, 45.0)].map(cell);
    let out = dir.join("table.toml");
    let mut arguments = vec!["fit-force"];
    arguments.extend(seen.iter().map(|file| text(file)));
    arguments.extend(unseen.iter().flat_map(|file| ["--holdout", text(file)]));
    arguments.extend(["--out", text(&out)]);
    let said = run_well(&arguments);
    let figures = ["cells", "measured", "judged"].map(|key| figure(&said, key));
    assert_eq!(figures, [9.0, 5.0, 4.0], "{said}");
    assert!(said.contains("no data at 1.0 mm/s and 30°: taken as separable"), "{said}");
    let (size, left) = (figure(&said, "force_rms_n"), figure(&said, "unseen_rms_n"));
    assert!(size > 0.3 && left < 0.2 * size, "{said}");
    let table: toml::Table = std::fs::read_to_string(&out).expect("written").parse().expect("TOML");
    assert_eq!(table["force_table"]["force_n"].as_array().expect("rows").len(), 9);
    let page = std::fs::read_to_string(out.with_extension("html")).expect("written beside it");
    assert!(page.contains("<svg") && !page.contains("http") && page.contains("no data: separable"));

    let both = text(&seen[0]);
    refused(&run(&["fit-force", both, "--holdout", both, "--out", text(&out)]), 2, &["1mms-60deg-0.csv"]);
    refused(&run(&["fit-force", "/no/such.csv", "--out", text(&out)]), 2, &["/no/such.csv"]);
    let empty = dir.join("empty.csv");
    std::fs::write(&empty, "time_s,depth_mm,force_n\n").expect("written");
    refused(&run(&["fit-force", text(&empty), "--out", text(&out)]), 2, &["empty.csv", "angle_deg"]);
}
