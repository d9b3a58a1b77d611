//! From insertions to a force table on the command line: seed 000's experiment with a truth that is known.

mod common;

use common::{figure, folder, refused, run, run_well, text};
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
