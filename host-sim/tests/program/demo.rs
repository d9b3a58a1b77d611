//! The demonstrations that come with the program: what they end in, against the truth in
//! `tests/independent/demo.py`, which made their recordings.

use crate::common::{folder, host_sim, refused, run, run_well, text};
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The repository's folder.
fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn report(which: &str) -> (String, Value) {
    let out = folder(&format!("demo-{which}"));
    let said = run_well(&["demo", which, "--no-browser", "--out", text(&out)]);
    assert!(out.join(which).join("report.html").is_file());
    let json = std::fs::read_to_string(out.join(which).join("diagnosis.json")).expect("it was written");
    (said, serde_json::from_str(&json).expect("it is JSON"))
}

#[test]
fn a_demonstration_finds_the_cogging_that_its_rotor_has() {
    let (said, report) = report("missing");
    let effects = report["effects"].as_array().expect("effects");
    assert_eq!(effects.len(), 1, "{said}");
    assert_eq!(effects[0]["name"], "cogging");
    let amplitude = &effects[0]["parameters"]["order_14"];
    let ends = [0, 1].map(|i| amplitude["ci95"][i].as_f64().expect("an interval"));
    assert!(ends[0] < 0.08 && 0.08 < ends[1], "{amplitude}");
    let error = |model: &str| report["fit"][model]["holdout"].as_f64().expect("a force error");
    assert!(error("patched") < 0.25 * error("refit"), "{said}");
}

/// The points of a curve by its name, in the first plot of `page` over `of`, in the plot's own
/// units.
fn curve(page: &str, of: &str, name: &str) -> Vec<[f64; 2]> {
    let plot = page.split("<svg ").find(|svg| svg.contains(of)).unwrap_or_else(|| panic!("no plot of {of}"));
    let plot = plot.split("</svg>").next().expect("it ends");
    let path = plot.split("<path ").find(|path| path.contains(&format!("data-name=\"{name}\"")));
    let path = path.unwrap_or_else(|| panic!("{name} is not in the plot of {of}"));
    let d = path.split("d=\"M").nth(1).and_then(|rest| rest.split('"').next()).expect("points");
    // "x y" is a point; of "x low V high" and "M x mean H x" the second is a mean.
    let parts = d.split(['M', 'L']).filter(|part| !part.contains('V'));
    parts
        .map(|part| {
            let mut numbers = part.split([' ', 'H']).map(|x| x.parse::<f64>().expect("a number"));
            [0; 2].map(|_| numbers.next().expect("two"))
        })
        .collect()
}

/// Distance of two curves, root mean square over the places of the first.
fn apart(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let near =
        |x: f64| b.iter().min_by(|p, q| (p[0] - x).abs().total_cmp(&(q[0] - x).abs())).expect("points")[1];
    (a.iter().map(|[x, y]| (y - near(*x)).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn in_the_report_the_found_law_is_nearest_to_the_recording() {
    let out = folder("demo-plots");
    run_well(&["demo", "missing", "--no-browser", "--out", text(&out)]);
    let page = std::fs::read_to_string(out.join("missing/report.html")).expect("it was written");
    let angle = "residual force, N·m over angle";
    let of = |name: &str| curve(&page, angle, name);
    let (law, held_out) = (of("torque periodic in the angle"), of("held out"));
    assert!(law.len() > 25 && held_out.len() > 25);
    let rival = of("torque periodic in the angle and proportional to the command");
    assert!(apart(&held_out, &law) < 0.2 * apart(&held_out, &rival));
    for quantity in ["magnitude, dB of 1 rad/s per N·m", "phase, degrees"] {
        let of = |name: &str| curve(&page, &format!("{quantity} over frequency"), name);
        let recorded = of("recorded");
        let [before, after] =
            ["the simulation as it is", "with what was found"].map(|name| apart(&recorded, &of(name)));
        assert!(after < 0.3 * before, "{quantity}: {after} after, {before} before");
    }
}

/// A recording of a screw under a position loop, as EMPS has them, with 20 N of dry friction.
fn screw(path: &Path, speed: f64) {
    let rig = std::fs::read_to_string(top().join("host-sim/demo/emps/rig.toml")).expect("it is there");
    let rig = rig.replace("viscous = 410.0", "viscous = 210.0\ncoulomb = 20.0");
    let mut plant = Plant::new(&Rig::parse(&rig, "the screw").expect("it is a rig"));
    let mut csv = String::from("time_s,command,position_counts\n");
    let mut before = 0.0;
    for row in 0..10_000 {
        let t = f64::from(row) * 1e-3;
        let wanted = 0.1 * (speed * t).sin() + 0.02 * (3.7 * speed * t).sin();
        let position = plant.position();
        let command = (4000.0 * (wanted - position) - 80.0 * (position - before) * 1e3) / 35.15;
        before = position;
        let command = command.clamp(-10.0, 10.0);
        csv += &format!("{t:.3},{command:.6},{}\n", plant.counts());
        for _ in 0..10 {
            plant.step(command, Surroundings::default(), 1e-4);
        }
    }
    std::fs::write(path, csv).expect("written");
}

#[test]
fn a_real_machine_is_read_from_a_folder_of_the_user() {
    let dir = folder("demo-emps");
    let (data, out) = (dir.join("data"), dir.join("out"));
    std::fs::create_dir_all(&data).expect("made");
    let arguments = ["demo", "emps", text(&data), "--no-browser", "--out", text(&out)];
    refused(&run(&arguments), 2, &["neither DATA_EMPS.mat nor train.csv", "nonlinearbenchmark.org"]);
    screw(&data.join("train.csv"), 1.3);
    screw(&data.join("pulses.csv"), 1.6);
    run_well(&arguments);
    let json = std::fs::read_to_string(out.join("emps/diagnosis.json")).expect("it was written");
    let report: Value = serde_json::from_str(&json).expect("it is JSON");
    let effects = report["effects"].as_array().expect("effects");
    let found = effects.iter().find(|one| one["name"] == "coulomb_friction");
    let value = found.unwrap_or_else(|| panic!("{json}"))["parameters"]["coulomb"]["value"].as_f64();
    assert!((value.expect("a number") - 20.0).abs() < 1.0, "{value:?}");
}

/// The body of what the page's server answers.
fn fetched(from: &str, path: &str) -> String {
    let host = from.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(host).expect("it listens");
    let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("it takes a request");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("it answers with text");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head and a body");
    assert!(head.starts_with("HTTP/1.1 200"), "{answer}");
    body.to_owned()
}

#[test]
fn the_page_opens_the_report_of_the_demonstration() {
    let out = folder("demo-page");
    run_well(&["demo", "missing", "--no-browser", "--out", text(&out)]);
    let report = std::fs::read_to_string(out.join("missing/report.html")).expect("it was written");
    let mut server = host_sim(&["run", "--port", "0", "--seconds", "60", "--no-browser"]);
    let mut server = server.stdout(Stdio::piped()).spawn().expect("it starts");
    let lines = BufReader::new(server.stdout.take().expect("piped")).lines();
    let address =
        lines.map_while(Result::ok).find_map(|line| Some(line.split_once("visualizer at ")?.1.to_owned()));
    let address = address.expect("an address");
    let page = fetched(&address, "/");
    let link = page.split("id=\"diagnosis\" href=\"").nth(1).and_then(|rest| rest.split('"').next());
    let opened = fetched(&address, &format!("/{}", link.expect("a link")));
    server.kill().expect("it runs");
    server.wait().expect("it ends");
    // The footer has the date and where the files are.
    let body = |page: &str| page.split("<footer>").next().expect("a page").to_owned();
    assert_eq!(body(&opened), body(&report));
}

#[test]
fn at_one_speed_a_demonstration_cannot_tell() {
    let (said, report) = report("cannot-tell");
    assert_eq!(report["verdict"], "insufficient_excitation", "{said}");
    assert!(report["effects"].as_array().expect("effects").is_empty());
    assert!(!report["record_next"].as_str().expect("advice").is_empty(), "{said}");
}

#[test]
fn the_recordings_are_those_of_the_plant_to_the_byte() {
    let made = folder("demo-made");
    let script = top().join("tests/independent/demo.py");
    let status = Command::new("python3").arg(script).arg(&made).status().expect("there is python3");
    assert!(status.success());
    for which in ["missing", "cannot-tell"] {
        for file in ["rig.toml", "fit-a.csv", "fit-b.csv", "holdout.csv"] {
            let [kept, made] =
                [top().join("host-sim/demo"), made.clone()].map(|dir| dir.join(which).join(file));
            let read = |path: &Path| std::fs::read(path).expect("it can be read");
            assert!(read(&kept) == read(&made), "{which}/{file} is not what tests/independent/demo.py makes");
        }
    }
}

#[test]
fn a_check_says_in_seconds_what_the_recordings_cannot_show() {
    let check = |which: &str| {
        let file = |name: &str| top().join("host-sim/demo").join(which).join(name).display().to_string();
        let [rig, a, b, held] = ["rig.toml", "fit-a.csv", "fit-b.csv", "holdout.csv"].map(file);
        run_well(&["check", "--rig", &rig, "--fit", &a, "--fit", &b, "--holdout", &held])
    };
    let lively = check("missing");
    // 8 s of 250 rows a second; less than a turn of travel.
    assert!(lively.contains("fit-a.csv: 8 s at 250 rows a second"), "{lively}");
    assert!(!lively.contains("about one speed"), "{lively}");
    let steady = check("cannot-tell");
    assert!(steady.contains("viscous friction and dry friction cannot be distinguished"), "{steady}");
    assert!(steady.contains("about one speed") && steady.contains("record next: a staircase"), "{steady}");
}
