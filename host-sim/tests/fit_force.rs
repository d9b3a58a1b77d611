//! From insertions to a force table on the command line: seed 000's experiment with a truth that is known.

mod common;

use common::{figure, folder, refused, run, run_well, text};
use control_core::controller::Sample;
use host_sim::recording::export::stretches;
use host_sim::recording::read::Recording;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// N, at a perpendicular depth in mm: a wall that gives way at 3 mm, stronger the faster and the steeper.
fn truth(depth_mm: f64, speed: f64, angle: f64) -> f64 {
    let base = if depth_mm < 3.0 { depth_mm * depth_mm / 9.0 } else { 0.4 + 0.05 * (depth_mm - 3.0) };
    base * (1.0 + 0.08 * speed) * (0.7 + angle / 100.0)
}

/// An insertion and a withdrawal at an even speed, 200 rows a second, as a phantom's test stand writes them.
fn insertion(dir: &Path, speed: f64, angle: f64) -> PathBuf {
    let mut csv = String::from("time_s,depth_mm,force_n,angle_deg\n");
    for n in 0..(2.0 * 15.0 / speed * 200.0) as u32 {
        let t = f64::from(n) / 200.0;
        let along = (speed * t).min(30.0 - speed * t) - 1.0;
        let force = truth(along.max(0.0) * angle.to_radians().sin(), speed, angle);
        let _ = writeln!(csv, "{t:.3},{along:.4},{force:.5},{angle}");
    }
    let file = dir.join(format!("{speed}mms-{angle}deg.csv"));
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

#[test]
fn a_table_fitted_to_a_phantom_gives_its_forces_back_on_the_device() {
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
        let wanted = by_depth(&felt(
            &files[cells.iter().position(|c| *c == (5, angle)).expect("a cell")],
            f64::from(angle),
        ));
        let got = record(text(&patient), 5, angle, &format!("refitted-{angle}"));
        let got = by_depth(&felt(&got, f64::from(angle)));
        let rms = |values: &mut dyn Iterator<Item = f64>| (values.map(|v| v * v).sum::<f64>() / 18.0).sqrt();
        let (size, error) =
            (rms(&mut wanted.iter().copied()), rms(&mut wanted.iter().zip(&got).map(|(a, b)| a - b)));
        assert!(size > 0.3 && error < 0.1 * size, "{angle}°: {error} N of {size} N: {wanted:?} {got:?}");
    }
}

#[test]
fn the_papers_five_cells_become_a_table_that_tells_the_other_four() {
    let dir = folder("fit-force");
    let cell = |(speed, angle): (f64, f64)| insertion(&dir, speed, angle);
    let seen = [(1.0, 60.0), (3.0, 60.0), (5.0, 60.0), (5.0, 30.0), (5.0, 45.0)].map(cell);
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
    assert!(size > 0.4 && left < 0.1 * size, "{said}");
    let table: toml::Table = std::fs::read_to_string(&out).expect("written").parse().expect("TOML");
    assert_eq!(table["force_table"]["force_n"].as_array().expect("rows").len(), 9);
    let page = std::fs::read_to_string(out.with_extension("html")).expect("written beside it");
    assert!(page.contains("<svg") && !page.contains("http") && page.contains("no data: separable"));

    let both = text(&seen[0]);
    refused(&run(&["fit-force", both, "--holdout", both, "--out", text(&out)]), 2, &["1mms-60deg.csv"]);
    refused(&run(&["fit-force", "/no/such.csv", "--out", text(&out)]), 2, &["/no/such.csv"]);
    let empty = dir.join("empty.csv");
    std::fs::write(&empty, "time_s,depth_mm,force_n\n").expect("written");
    refused(&run(&["fit-force", text(&empty), "--out", text(&out)]), 2, &["empty.csv", "angle_deg"]);
}
