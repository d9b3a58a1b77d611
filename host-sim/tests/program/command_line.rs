//! The command line as a person meets it: what it prints, what it refuses and how, what survives.

use crate::common::{figure, folder, host_sim, refused, run, run_well, text};
use std::net::TcpListener;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn a_minute_takes_seconds_and_loses_nothing() {
    let dir = folder("minute");
    let mcap = dir.join("a.mcap");
    let begin = Instant::now();
    let stdout = run_well(&["run", "--headless", "--fast", "--seconds", "60", "--record", text(&mcap)]);
    assert!(begin.elapsed() < Duration::from_secs(60), "{:?}", begin.elapsed());
    let last = stdout.lines().last().expect("there is a last line");
    assert!(last.starts_with("samples=600000 frames="), "{last}");
    let order = ["samples=", " frames=", " lost=", " punctures=", " peak_force_n="];
    let places: Vec<_> = order.iter().map(|key| last.find(key).expect(key)).collect();
    assert!(places.is_sorted(), "{last}");
    assert_eq!(
        (figure(&stdout, "lost"), figure(&stdout, "lost_samples"), figure(&stdout, "garbage")),
        (0.0, 0.0, 0.0)
    );
    assert_eq!(figure(&stdout, "punctures"), 2.0 * figure(&stdout, "vessels"));
    assert!(figure(&stdout, "vessels") >= 8.0, "{last}");

    let scored = run_well(&["score", text(&mcap)]);
    assert_eq!(figure(&scored, "punctures"), figure(&stdout, "punctures"));
    assert_eq!(figure(&scored, "vessels"), figure(&scored, "insertions"));
    assert!((figure(&scored, "peak_force_n") - figure(&stdout, "peak_force_n")).abs() < 1e-3);
    // Twice 12.8 mm along the needle, and a tremor on top.
    assert!((25.0..28.0).contains(&figure(&scored, "mean_path_mm")), "{scored}");
    assert!(run_well(&["score", text(&mcap), "--json"]).contains("\"angle_error_deg\""));

    // Into a pipe that is closed at once, as `| head` does.
    let mut child = host_sim(&["score", text(&mcap)]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    drop(child.as_mut().expect("the program starts").stdout.take());
    let output = child.and_then(|child| child.wait_with_output()).expect("it ends");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[test]
fn every_command_of_the_help_has_a_manual_page() {
    let out = folder("man");
    run_well(&["man", "--out", text(&out)]);
    let help = run_well(&["--help"]);
    let commands =
        help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names: Vec<&str> = commands.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.len() > 15 && names.contains(&"diagnose"), "{names:?}");
    for name in names.iter().filter(|name| **name != "help") {
        let page = std::fs::read_to_string(out.join(format!("host-sim-{name}.1"))).expect(name);
        assert!(page.contains(".SH SYNOPSIS") && page.contains("Example"), "{name}: {page}");
    }
    assert!(out.join("host-sim.1").is_file());
    refused(&run(&["man", "--out", "/proc/none"]), 1, &["/proc/none", "choose another --out"]);
}

#[test]
fn verbose_prints_stages_with_their_time_into_a_pipe() {
    let arguments = ["run", "--headless", "--fast", "--seconds", "2"];
    let stderr = |flag: &[&str]| {
        let output = host_sim(&[flag, &arguments].concat()).output().expect("it runs");
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).expect("text")
    };
    assert_eq!(stderr(&[]), "", "nothing in a pipe unless it is asked for");
    let said = stderr(&["-v"]);
    let (time, what) =
        said.lines().next().and_then(|line| line.split_once(" s  ")).expect("a line with its time");
    assert!(time.trim().parse::<f64>().is_ok() && what.starts_with("running: "), "{said}");
    assert!(!said.contains('\x1b'), "no colours and no cursor in a pipe: {said:?}");
    refused(&run(&["-v", "--quiet", "profiles"]), 2, &["cannot be used with"]);
}

#[test]
fn the_same_run_gives_the_same_csv() {
    let dir = folder("same");
    let csv = |name: &str| {
        let mcap = dir.join(format!("{name}.mcap"));
        run_well(&["run", "--headless", "--fast", "--seconds", "7", "--record", text(&mcap)]);
        let out = dir.join(name);
        run_well(&["export", text(&mcap), "--out", text(&out)]);
        std::fs::read(out.join("recording.csv")).expect("it was exported")
    };
    let first = csv("one");
    assert!(first.len() > 1_000_000);
    assert!(first == csv("two"), "the same procedure and seed, the same bytes");
}

#[test]
fn every_slowness_of_the_hand_punctures_twice_an_insertion() {
    for (procedure, seconds) in [("venepuncture", "12"), ("slow", "28")] {
        let stdout =
            run_well(&["run", "--headless", "--fast", "--seconds", seconds, "--procedure", procedure]);
        assert_eq!(
            (figure(&stdout, "punctures"), figure(&stdout, "vessels")),
            (4.0, 2.0),
            "{procedure}: {stdout}"
        );
    }
}

#[test]
fn bad_input_is_one_line_and_status_two() {
    let dir = folder("bad");
    let broken = dir.join("broken.toml");
    std::fs::write(&broken, "format = 1\nname = \"x\nentry_deg = 30\n").expect("written");
    let broken = text(&broken);
    let noise = dir.join("noise.mcap");
    std::fs::write(&noise, [7_u8; 4000]).expect("written");
    let noise = text(&noise);
    let head = ["run", "--headless", "--fast", "--seconds", "1"];
    let with = |more: &[&str]| run(&[&head[..], more].concat());
    refused(&with(&["--profile", "giant"]), 2, &["giant", "adult"]);
    refused(&with(&["--profile", broken]), 2, &["broken.toml", "line 2"]);
    refused(&with(&["--profile", "/no/such.toml"]), 2, &["/no/such.toml"]);
    refused(&with(&["--procedure", "juggle"]), 2, &["juggle", "venepuncture"]);
    refused(&with(&["--procedure", broken]), 2, &["broken.toml", "line 2"]);
    refused(&with(&["--record", "/no/such/folder/a.mcap"]), 2, &["/no/such/folder/a.mcap", "--record"]);
    refused(&with(&["--model", "xr", "--profile", "adult"]), 2, &["adult", "law.model is jog", "phantom"]);
    refused(&with(&["--model", "magic"]), 2, &["magic"]);
    refused(&with(&["--device", "/dev/no-such-port"]), 2, &["--fast"]);
    refused(&run(&["run", "--headless", "--seconds", "nan"]), 2, &["seconds"]);
    refused(&run(&["run", "--headless", "--seconds", "-1"]), 2, &["--seconds is -1", "0.0001"]);
    refused(&run(&["run", "--headless", "--angle", "-5"]), 2, &["--angle is -5", "from 5 to 90"]);
    refused(&run(&["run", "--headless", "--fast"]), 2, &["--seconds"]);
    refused(
        &run(&["run", "--headless", "--seconds", "1", "--device", "/dev/no-such-port"]),
        2,
        &["/dev/no-such-port"],
    );
    refused(&run(&["fly"]), 2, &["fly"]);
    refused(&run(&["run", "--sideways"]), 2, &["--sideways"]);
    refused(&run(&["run", "--port", "70000"]), 2, &["70000"]);
    for command in [["score", noise], ["replay", noise]] {
        refused(&run(&command), 2, &["noise.mcap", "not an MCAP recording"]);
    }
    refused(&run(&["score", "/no/such.mcap"]), 2, &["/no/such.mcap"]);
    refused(&run(&["export", noise, "--out", text(&dir)]), 2, &["noise.mcap"]);
    refused(&run(&["export", noise]), 2, &["--out"]);
}

#[test]
fn misspelt_missing_and_empty_input_is_named_with_a_remedy() {
    let dir = folder("words");
    refused(&run(&["import", "a.csv", "--inertai", "0.1", "--out", "o"]), 2, &["--inertai", "--inertia"]);
    refused(&run(&["compensate", "--report", "r"]), 2, &["--out <DIR> is missing", "compensate --help"]);
    let rig = dir.join("rig.toml");
    let text_of_rig = "format = 1\nkind = \"rotary\"\n[model]\ninertai = 0.1\n[actuator]\ngain = 1.0\ncommand_unit = \"A\"\n\
                       [encoder]\ncounts_per_unit = 100.0\n";
    std::fs::write(&rig, text_of_rig).expect("written");
    let arguments = ["simulate", "--rig", text(&rig), "--recording", "a.csv", "--out", "o"];
    refused(&run(&arguments), 2, &["inertai is not a key", "do you mean [model] inertia"]);
    // Before the scripted hand touches the skin.
    let outside = dir.join("outside.mcap");
    let said =
        run_well(&["run", "--headless", "--fast", "--quiet", "--seconds", "0.5", "--record", text(&outside)]);
    assert!(said.contains("samples=5000"), "results are no chatter: {said}");
    refused(&run(&["score", text(&outside)]), 2, &["outside.mcap", "no insertion", "record one first"]);
}

#[test]
fn a_recording_is_found_without_its_extension() {
    let dir = folder("without-extension");
    for day in ["monday", "friday"] {
        let file = dir.join(format!("{day}.mcap"));
        run_well(&["run", "--headless", "--fast", "--quiet", "--seconds", "6", "--record", text(&file)]);
    }
    let (monday, friday, out) = (dir.join("monday"), dir.join("friday"), dir.join("debrief"));
    let said = run_well(&["debrief", text(&monday), text(&friday), "--out", text(&out)]);
    assert!(said.trim_end().ends_with("insertions=2"), "{said}");
    refused(&run(&["score", text(&dir.join("tuesday"))]), 2, &["tuesday", "check its path"]);
}

#[test]
fn a_port_in_use_is_one_line_and_status_one() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("there is a free port");
    let port = taken.local_addr().expect("it is bound").port().to_string();
    refused(&run(&["run", "--seconds", "1", "--port", &port]), 1, &[&port, "in use", "--port"]);
}

#[test]
fn every_command_has_help_with_an_example() {
    assert!(run_well(&["--help"]).contains("Example"));
    for command in
        ["run", "replay", "export", "score", "commission", "characterise", "import", "diagnose", "simulate"]
    {
        let help = run_well(&[command, "--help"]);
        assert!(help.contains(&format!("host-sim {command}")) && help.contains("Example"), "{help}");
    }
}

/// Completes `host-sim sc` and `host-sim score --x` as bash does.
#[cfg(unix)]
#[test]
fn bash_completes_commands_and_options() {
    let script = folder("completions").join("host-sim.bash");
    std::fs::write(&script, run_well(&["completions", "bash"])).expect("the folder can be written");
    for (words, last, wanted) in [("host-sim sc", "sc", "score"), ("host-sim score --x", "--x", "--xapi")] {
        let count = words.split(' ').count() - 1;
        let ask = format!(
            "source {}; COMP_WORDS=({words}); COMP_CWORD={count}; _host__sim host-sim {last} host-sim; echo \"${{COMPREPLY[@]}}\"",
            text(&script)
        );
        let output = Command::new("bash").args(["-c", &ask]).output().expect("there is bash");
        assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), wanted, "{words}");
    }
    refused(&run(&["completions", "tcsh"]), 2, &["tcsh", "bash"]);
}

/// A limit on the size of files simulates a full disk: the write fails in the same place.
#[cfg(unix)]
#[test]
fn after_a_full_disk_the_recording_so_far_can_be_read() {
    let dir = folder("full");
    let mcap = dir.join("a.mcap");
    let program = env!("CARGO_BIN_EXE_host-sim");
    // 2 MiB; the signal ignored, so that the write fails as on a full disk.
    let script = format!(
        "trap '' XFSZ; ulimit -f 4096; exec '{program}' run --headless --fast --seconds 60 --record '{}'",
        text(&mcap)
    );
    let output = Command::new("sh").args(["-c", &script]).output().expect("there is a shell");
    refused(&output, 1, &["a.mcap", "recording stopped after", "can be read"]);
    let size = std::fs::metadata(&mcap).expect("it is there").len();
    assert!(size > 1_000_000, "{size} bytes");

    let scored = run(&["score", text(&mcap)]);
    assert!(scored.status.success());
    assert!(String::from_utf8_lossy(&scored.stderr).contains("ends early"));
    run_well(&["export", text(&mcap), "--out", text(&dir)]);
    let csv = std::fs::read_to_string(dir.join("recording.csv")).expect("it was exported");
    // 25 MB are 60 s, so 2 MiB are 4.9 s; no more than a quarter of a second is lost.
    assert!(csv.lines().count() > 46_500, "{} rows", csv.lines().count());

    refused(
        &run(&["run", "--headless", "--fast", "--seconds", "1", "--record", "/dev/full"]),
        1,
        &["/dev/full", "recording stopped"],
    );
}

#[cfg(unix)]
#[test]
fn killed_recordings_are_readable_interrupted_ones_complete() {
    let dir = folder("killed");
    for (signal, is_whole) in [("KILL", false), ("INT", true)] {
        let mcap = dir.join(format!("{signal}.mcap"));
        let child = host_sim(&["run", "--headless", "--record", text(&mcap)])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        std::thread::sleep(Duration::from_millis(2_500));
        let kill = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status();
        assert!(kill.expect("there is a kill").success());
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.success(), is_whole);
        if is_whole {
            let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
            assert!(figure(&stdout, "samples") > 15_000.0, "{stdout}");
        }
        let out = dir.join(signal);
        let exported = run(&["export", text(&mcap), "--out", text(&out)]);
        assert!(exported.status.success());
        assert_eq!(exported.stderr.is_empty(), is_whole, "a cut is said, and only a cut");
        let csv = std::fs::read_to_string(out.join("recording.csv")).expect("it was exported");
        assert!(csv.lines().count() > 15_000, "{signal}: {} rows", csv.lines().count());
    }
}

/// A computer that is too busy for the program slows the virtual device and its PC alike: nobody
/// went silent.
#[cfg(unix)]
#[test]
fn a_program_that_pauses_goes_on_where_it_was() {
    let child = host_sim(&["run", "--headless", "--seconds", "4"]).stdout(Stdio::piped()).spawn();
    let child = child.expect("the program starts");
    for _ in 0..3 {
        for (signal, ms) in [("STOP", 400), ("CONT", 300)] {
            std::thread::sleep(Duration::from_millis(ms));
            let kill = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status();
            assert!(kill.expect("there is a kill").success());
        }
    }
    let output = child.wait_with_output().expect("it ends");
    let stdout = String::from_utf8(output.stdout).expect("text");
    assert_eq!((figure(&stdout, "samples"), figure(&stdout, "lost_samples")), (40_000.0, 0.0), "{stdout}");
    // Torque stayed on: the needle got as far as it does undisturbed.
    assert_eq!((figure(&stdout, "faults"), figure(&stdout, "punctures")), (0.0, 2.0), "{stdout}");
}

#[test]
fn a_recording_plays_at_its_pace_and_gives_every_sample() {
    let dir = folder("replay");
    let mcap = dir.join("a.mcap");
    run_well(&["run", "--headless", "--fast", "--seconds", "2", "--record", text(&mcap)]);
    let begin = Instant::now();
    let stdout = run_well(&["replay", text(&mcap), "--once", "--port", "0"]);
    assert_eq!(figure(&stdout, "samples"), 20_000.0);
    let taken = begin.elapsed().as_secs_f64();
    // Not sooner; a busy machine may be later.
    assert!((1.9..60.0).contains(&taken), "2 s took {taken} s");
}
