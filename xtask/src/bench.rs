//! `cargo xtask bench`: runs the measuring programs there are and puts what they print into one table. A program gives a
//! row by printing `name=value`, with a name of [`crate::rows`], or as JSON, `"row": "name", … "value": …`; a peer beside it
//! by `name.peer=who name.peer_value=…`. A row that nothing measures is left out: no number here was written by hand.
//! Lines that a test of the emulated board begins with a bar are printed below the table as they are.

use crate::elf::Elf;
use crate::rows::{Better, ROWS, Row};
use crate::shell::{self, Failure, cargo};
use crate::workspace_build::ANY_RUST;
use crate::{boards, firmware, setup};
use std::collections::{BTreeMap, BTreeSet};
use std::env::consts::EXE_EXTENSION;
use std::fmt::Write as _;
use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Examples that measure: their package and name, and what the rows that they give begin with.
const EXAMPLES: [(&str, &str, &str); 4] = [
    ("firmware", "tick_host", "tick_host"),
    ("host-sim", "plant_speed", "plant_"),
    ("tissue", "xpbd_speed", "xpbd_"),
    ("ultrasound", "ultrasound_speed", "ultrasound_"),
];
/// The crate whose build and dependencies are what a user waits for.
const MAIN: &str = "host-sim";
/// A minute of the device, as fast as it goes.
const STREAM_SECONDS: &str = "60";

/// The beginning of a line of the board's own table.
const BOARD_LINE: &str = "| ";

/// The measured values, by name.
type Values = BTreeMap<String, String>;

/// Measures, prints the table, writes `target/bench.json`. Where `names` has any, only what gives these rows is run.
pub(crate) fn run(names: &[String]) -> Result<(), Failure> {
    if let Some(unknown) = names.iter().find(|name| ROWS.iter().all(|row| row.name != **name)) {
        let all: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
        return Err(Failure::usage(format!(
            "`{unknown}` is not a row of the bench; the rows are: {}",
            all.join(" ")
        )));
    }
    let wants = |rows: &str| names.is_empty() || names.iter().any(|name| name.starts_with(rows));
    let mut values = Values::new();
    let mut troubles = vec![];
    let mut measure = |what: &str, measured: Result<Values, Failure>| match measured {
        Ok(new) => values.extend(new),
        Err(failure) => troubles.push(format!("{what}: {failure}")),
    };
    if wants("build_") {
        measure("build", build_time());
    }
    if wants("packages") {
        measure("packages", packages());
    }
    if wants("firmware_") {
        measure("firmware", image());
    }
    for (package, name, rows) in EXAMPLES {
        if wants(rows) {
            measure(name, example(package, name));
        }
    }
    for (script, rows) in PEERS {
        if wants(rows) {
            measure(script, peer_program(script));
        }
    }
    if wants("stream_") {
        measure("stream", stream());
    }
    if wants("diagnose_") {
        measure("diagnosis", diagnosis());
    }
    let mut board_lines = vec![];
    for module in test_modules()? {
        if measures(&module, wants) {
            measure(&module.name, test_module(&module, &mut board_lines));
        }
    }
    let rows: Vec<(Row, f64, Option<Peer>)> = ROWS
        .into_iter()
        .filter_map(|row| Some((row, values.get(row.name)?.parse().ok()?, peer(&values, row.name))))
        .collect();
    print(&rows);
    println!("\nThe flash image on the emulated board:");
    board_lines.iter().for_each(|line| println!("{line}"));
    let path = shell::target().join("bench.json");
    fs::write(&path, json(&commit(), &rows))
        .map_err(|error| Failure::new(format!("{} cannot be written: {error}", path.display())))?;
    println!("written to {}", path.display());
    if troubles.is_empty() { Ok(()) } else { Err(Failure::new(troubles.join("; "))) }
}

/// The test programs of the crate `tests`: a folder each.
const TEST_PROGRAMS: [&str; 2] = ["board", "page"];

/// A file of tests.
struct TestModule {
    program: &'static str,
    name: String,
    text: String,
}

fn test_modules() -> Result<Vec<TestModule>, Failure> {
    let mut modules = vec![];
    for program in TEST_PROGRAMS {
        let folder = shell::top().join("tests/tests").join(program);
        let unreadable = |error| Failure::new(format!("{} cannot be read: {error}", folder.display()));
        for path in fs::read_dir(&folder).map_err(unreadable)?.flatten().map(|entry| entry.path()) {
            let Some(name) = path.file_stem().and_then(|stem| stem.to_str()) else { continue };
            let is_source = path.extension().is_some_and(|extension| extension == "rs");
            if let (true, Ok(text)) = (is_source, fs::read_to_string(&path)) {
                modules.push(TestModule { program, name: name.into(), text });
            }
        }
    }
    modules.sort_by(|a, b| (a.program, &a.name).cmp(&(b.program, &b.name)));
    Ok(modules)
}

/// True if the tests print rows, of which their text names one as a word or in JSON, or lines of the board's own table.
fn measures(TestModule { text, .. }: &TestModule, wants: impl Fn(&str) -> bool) -> bool {
    (text.contains(&format!("\"{BOARD_LINE}")) && wants(BOARD_LINE))
        || ROWS.iter().filter(|row| wants(row.name)).any(|row| {
            text.contains(&format!("{}=", row.name)) || text.contains(&format!("\"{}\"", row.name))
        })
}

/// The lines of the board's own table; whatever the test runner wrote before a line is not part of it.
fn board_lines_in(text: &str) -> impl Iterator<Item = String> {
    text.lines().filter_map(|line| Some(line.get(line.find(BOARD_LINE)?..)?.to_string()))
}

/// `name=value` among the words of `text`, and rows in JSON, where the table knows the name.
fn values_in(text: &str) -> Values {
    let known = |name: &str| ROWS.iter().any(|row| Some(row.name) == name.split('.').next());
    let mut values: Values = text
        .split_whitespace()
        .filter_map(|word| word.split_once('='))
        .filter(|(name, _)| known(name))
        .map(|(name, value)| (name.to_string(), value.to_string()))
        .collect();
    let words: Vec<&str> = text.split_whitespace().map(|word| word.trim_end_matches([',', '}'])).collect();
    let mut row = None;
    for pair in words.windows(2) {
        match pair {
            ["\"row\":", name] => row = Some(name.trim_matches('"')).filter(|name| known(name)),
            ["\"value\":", value] => {
                values.extend(row.take().map(|name| (name.to_string(), value.to_string())));
            }
            _ => {}
        }
    }
    values
}

fn example(package: &str, name: &str) -> Result<Values, Failure> {
    let mut run = cargo();
    run.args(["run", "--release", "--quiet", ANY_RUST, "-p", package, "--example", name]);
    shell::output(&mut run).map(|text| values_in(&text))
}

fn test_module(module: &TestModule, board_lines: &mut Vec<String>) -> Result<Values, Failure> {
    let mut run = cargo();
    run.env("FIRMWARE_ELF", firmware::path(boards::DEFAULT));
    run.args(["test", "--release", "--quiet", ANY_RUST, "--workspace", "--test", module.program, "--"]);
    run.args(["--nocapture", &format!("{}::", module.name)]);
    // A test that fails its bound has printed what it measured.
    let output = run
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| Failure::new(format!("cargo could not be started: {error}")))?;
    let text = String::from_utf8_lossy(&output.stdout);
    board_lines.extend(board_lines_in(&text));
    Ok(values_in(&text))
}

/// Time of the main crate's build from nothing, in a folder of its own.
fn build_time() -> Result<Values, Failure> {
    let folder = shell::target().join("bench-build");
    let forget = || {
        // Not there is as good.
        let _ = fs::remove_dir_all(&folder);
    };
    // What can be fetched is fetched before: the network is nobody's build time.
    shell::run(cargo().args(["fetch", "--quiet"]))?;
    forget();
    let begin = Instant::now();
    let built = shell::run(cargo().env("CARGO_TARGET_DIR", &folder).args([
        "build",
        "--release",
        "--quiet",
        "-p",
        MAIN,
    ]));
    let seconds = begin.elapsed().as_secs_f64();
    forget();
    built.map(|()| Values::from([("build_s".into(), format!("{seconds:.1}"))]))
}

/// Packages that the main crate's build needs, itself included.
fn packages() -> Result<Values, Failure> {
    let mut tree = cargo();
    tree.args(["tree", "--quiet", "-p", MAIN, "-e", "normal,build", "--prefix", "none", "--format", "{p}"]);
    let text = shell::output(&mut tree)?;
    let packages: BTreeSet<&str> = text.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    Ok(Values::from([("packages".into(), packages.len().to_string())]))
}

fn image() -> Result<Values, Failure> {
    let (_, bytes) = Elf::read(&firmware::build(boards::DEFAULT)?)?.flash_image()?;
    Ok(Values::from([("firmware_flash_bytes".into(), bytes.len().to_string())]))
}

/// Other people's solvers on the same tasks, in Python, and the rows that they stand beside.
const PEERS: [(&str, &str); 2] = [("soft_body.py", "xpbd_"), ("bmode.py", "ultrasound_")];
/// The Python packages that the peers need.
const PEERS_PACKAGES: [&str; 2] = ["numpy==2.4.6", "mujoco==4.0.0"];

/// Runs one of them: it prints the row that it stands beside.
fn peer_program(script: &str) -> Result<Values, Failure> {
    let python = setup::python(&PEERS_PACKAGES)?;
    let mut command = Command::new(&python);
    // MuJoCo leaves a log of its warnings where it runs. One core, as ours.
    command.current_dir(shell::target());
    command.env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1");
    shell::output(command.arg(shell::top().join("xtask/peers").join(script))).map(|text| values_in(&text))
}

/// The whole way of a sample: plant, control law, frame, bytes, frame again, tallies.
fn stream() -> Result<Values, Failure> {
    let run = |seconds| {
        let mut run = cargo();
        run.args([
            "run",
            "--release",
            "--quiet",
            "-p",
            MAIN,
            "--",
            "run",
            "--headless",
            "--fast",
            "--seconds",
            seconds,
        ]);
        run
    };
    // Built and warm.
    shell::output(&mut run("1"))?;
    let begin = Instant::now();
    let text = shell::output(&mut run(STREAM_SECONDS))?;
    let seconds = begin.elapsed().as_secs_f64();
    let samples =
        text.split_whitespace().rev().find_map(|word| word.strip_prefix("samples=")?.parse::<f64>().ok());
    let samples =
        samples.ok_or_else(|| Failure::new("`run --headless` did not print the number of samples"))?;
    Ok(Values::from([("stream_samples_per_s".into(), format!("{:.0}", samples / seconds))]))
}

/// Time and memory of a diagnosis: about a minute of recording to fit, another one to judge, made by the virtual device.
fn diagnosis() -> Result<Values, Failure> {
    let folder = shell::target().join("bench-recordings");
    let run = || {
        let mut run = cargo();
        run.args(["run", "--release", "--quiet", "-p", MAIN, "--"]);
        run
    };
    shell::run(run().arg("characterise").arg("--out").arg(&folder))?;
    // The program itself and not cargo around it: the memory is to be its own.
    let mut diagnose = Command::new(shell::target().join("release").join(MAIN).with_extension(EXE_EXTENSION));
    diagnose.current_dir(shell::top()).arg("diagnose").arg("--rig").arg(folder.join("rig.toml"));
    diagnose.arg("--fit").arg(folder.join("fit.csv")).arg("--holdout").arg(folder.join("holdout.csv"));
    diagnose.arg("--out").arg(folder.join("diagnosis")).stdout(Stdio::null());
    let begin = Instant::now();
    let mut child =
        diagnose.spawn().map_err(|error| Failure::new(format!("{MAIN} could not be started: {error}")))?;
    let status_file = format!("/proc/{}/status", child.id());
    let mut peak_kib = None;
    let status = loop {
        // Gone with the process; the last look counts.
        peak_kib = fs::read_to_string(&status_file).ok().as_deref().and_then(peak_of).or(peak_kib);
        match child.try_wait() {
            Ok(None) => std::thread::sleep(Duration::from_millis(20)),
            Ok(Some(status)) => break status,
            Err(error) => return Err(Failure::new(format!("the diagnosis was lost: {error}"))),
        }
    };
    let seconds = begin.elapsed().as_secs_f64();
    if !status.success() {
        return Err(Failure::new(format!("the diagnosis failed ({status})")));
    }
    let mut values = Values::from([("diagnose_60s_s".into(), format!("{seconds:.2}"))]);
    values.extend(peak_kib.map(|kib| ("diagnose_peak_mib".into(), format!("{:.0}", kib / 1024.0))));
    Ok(values)
}

/// The most memory that a process has had, in KiB, from Linux' own account of it.
fn peak_of(status: &str) -> Option<f64> {
    status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok())
}

/// Somebody else's number for the same thing.
struct Peer {
    who: String,
    value: f64,
}

fn peer(values: &Values, row: &str) -> Option<Peer> {
    let who = values.get(&format!("{row}.peer"))?.clone();
    let value = values.get(&format!("{row}.peer_value"))?.parse().ok()?;
    Some(Peer { who, value })
}

fn commit() -> String {
    let mut git = Command::new("git");
    git.current_dir(shell::top()).args(["rev-parse", "HEAD"]).stderr(Stdio::null());
    shell::output(&mut git).map_or_else(|_| "unknown".into(), |text| text.trim().to_string())
}

fn print(rows: &[(Row, f64, Option<Peer>)]) {
    println!("{:<28}{:>14}  {:<20}{:>12}  peer", "row", "value", "unit", "wanted");
    for (row, value, peer) in rows {
        let wanted = match (row.wanted, row.better) {
            (Some(wanted), Better::Lower) => format!("<= {wanted}"),
            (Some(wanted), Better::Higher) => format!(">= {wanted}"),
            (None, _) => String::new(),
        };
        let peer = peer.as_ref().map_or(String::new(), |peer| format!("{} {}", peer.who, peer.value));
        println!("{:<28}{value:>14}  {:<20}{wanted:>12}  {peer}", row.name, row.unit);
    }
}

fn json(commit: &str, rows: &[(Row, f64, Option<Peer>)]) -> String {
    let number =
        |value: Option<f64>| value.filter(|v| v.is_finite()).map_or("null".into(), |v| v.to_string());
    let mut text = format!("{{ \"commit\": {}, \"rows\": [", quoted(commit));
    for (index, (row, value, peer)) in rows.iter().enumerate() {
        let better = if row.better == Better::Lower { "lower" } else { "higher" };
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{}\n  {{ \"row\": {}, \"value\": {}, \"unit\": {}, \"wanted\": {}, \"better\": \"{better}\", \"peer\": {}, \
             \"peer_value\": {} }}",
            if index == 0 { "" } else { "," },
            quoted(row.name),
            number(Some(*value)),
            quoted(row.unit),
            number(row.wanted),
            peer.as_ref().map_or("null".into(), |peer| quoted(&peer.who)),
            number(peer.as_ref().map(|peer| peer.value)),
        );
    }
    text.push_str("\n] }\n");
    text
}

fn quoted(text: &str) -> String {
    let escaped: String = text
        .chars()
        .flat_map(|c| match c {
            '"' | '\\' => vec!['\\', c],
            c if c.is_control() => vec![' '],
            c => vec![c],
        })
        .collect();
    format!("\"{escaped}\"")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_among_words_and_others_are_not() {
        let values =
            values_in("ran: tick_host_ns=81.5 other=3\ntick_host_ns.peer=idsp tick_host_ns.peer_value=90 x");
        assert_eq!(values.len(), 3);
        assert_eq!(values["tick_host_ns"], "81.5");
        let peer = peer(&values, "tick_host_ns").unwrap();
        assert_eq!((peer.who.as_str(), peer.value), ("idsp", 90.0));
    }

    #[test]
    fn rows_are_found_in_json() {
        let text = "{ \"rows\": [ { \"peer\": null, \"row\": \"page_mb\", \"unit\": \"MB\", \"value\": 0.25 },\n\
                    { \"row\": \"other\", \"value\": 3 }, { \"row\": \"build_s\", \"value\": 61, \"peer\": null } ] }";
        let values = values_in(text);
        assert_eq!(
            values,
            Values::from([("page_mb", "0.25"), ("build_s", "61")].map(|(n, v)| (n.into(), v.into())))
        );
    }

    #[test]
    fn the_lines_of_the_board_are_found_behind_the_runners_dots() {
        let lines: Vec<String> = board_lines_in("..| jump | 0.1 ms |\nnothing\n| stack | 1 of 2 |").collect();
        assert_eq!(lines, ["| jump | 0.1 ms |", "| stack | 1 of 2 |"]);
    }

    #[test]
    fn memory_is_read_from_the_account() {
        assert_eq!(peak_of("Name:\tx\nVmPeak:\t   9 kB\nVmHWM:\t   51200 kB\n"), Some(51_200.0));
    }

    #[test]
    fn the_file_is_what_the_contract_says() {
        let peer = Some(Peer { who: "a \"b\"".into(), value: 2.0 });
        let text = json("c", &[(ROWS[0], 612.0, None), (ROWS[2], 1.5, peer)]);
        let expected = "{ \"commit\": \"c\", \"rows\": [\n  { \"row\": \"tick_instructions_longest\", \"value\": 612, \
                        \"unit\": \"instructions\", \"wanted\": 840, \"better\": \"lower\", \"peer\": null, \"peer_value\": \
                        null },\n  { \"row\": \"tick_host_ns\", \"value\": 1.5, \"unit\": \"ns\", \"wanted\": null, \
                        \"better\": \"lower\", \"peer\": \"a \\\"b\\\"\", \"peer_value\": 2 }\n] }\n";
        assert_eq!(text, expected);
    }
}
