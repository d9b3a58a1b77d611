//! The commands of docs/guide/diagnosis.md and docs/guide/training.md are run exactly as written,
//! and print what the guide says.

use crate::common::{folder, text};
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use std::path::Path;
use std::process::Command;

const TRAINING: &str = include_str!("../../../docs/guide/training.md");
const SETTLE: &str = include_str!("../../../docs/guide/settle.md");
const GUIDE: &str = include_str!("../../../docs/guide/diagnosis.md");
/// The largest difference between a figure of the guide and the printed one, as a ratio.
const FIGURES_WITHIN: f64 = 0.2;

/// The indented blocks of a section of a guide, without their indent.
fn blocks(guide: &str, heading: &str) -> Vec<String> {
    let (_, section) =
        guide.split_once(&format!("{heading}\n")).unwrap_or_else(|| panic!("no section {heading}"));
    let mut out: Vec<String> = Vec::new();
    let mut is_inside = false;
    for line in section.lines().take_while(|line| !line.starts_with("## ")) {
        match line.strip_prefix("    ") {
            Some(code) if is_inside => {
                if let Some(block) = out.last_mut() {
                    *block += &format!("{code}\n");
                }
            }
            Some(code) => out.push(format!("{code}\n")),
            // A block may contain an empty line.
            None if line.is_empty() && is_inside => {
                if let Some(block) = out.last_mut() {
                    block.push('\n');
                }
                continue;
            }
            None => {}
        }
        is_inside = line.starts_with("    ");
    }
    out
}

/// Runs a block of commands in a folder that also replaces /tmp, and returns what they print.
fn run_in(dir: &Path, commands: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_host-sim"));
    let programs = program.parent().expect("it is in a folder");
    let path = format!("{}:{}", text(programs), std::env::var("PATH").unwrap_or_default());
    let script = commands.replace("/tmp/", &format!("{}/", text(dir)));
    let output = Command::new("sh")
        .args(["-e", "-c", &script])
        .current_dir(dir)
        .env("PATH", path)
        .output()
        .expect("there is a shell");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{script}\n{said}");
    String::from_utf8(output.stdout).expect("text")
}

/// Words and figures of a text.
fn words_and_figures(text: &str) -> (Vec<&str>, Vec<f64>) {
    let marks = |c: char| c.is_whitespace() || "[](),;:".contains(c);
    let parts = text.split(marks).map(|part| part.trim_end_matches('.')).filter(|part| !part.is_empty());
    let (figures, words): (Vec<&str>, Vec<&str>) = parts.partition(|part| part.parse::<f64>().is_ok());
    (words, figures.iter().filter_map(|figure| figure.parse().ok()).collect())
}

/// Takes 7 s: a diagnosis of 24 s at 10 kHz, and a design with three rivals.
#[cfg(unix)]
#[test]
fn the_example_of_settle_prints_as_quoted() {
    let dir = folder("guide-settle");
    let blocks = blocks(SETTLE, "## Example");
    let [commands, quoted] = &blocks[..] else { panic!("{} blocks", blocks.len()) };
    let printed = run_in(&dir, commands);
    let here = format!("{}/", text(&dir));
    let printed: Vec<String> = printed.lines().map(|line| line.replace(&here, "/tmp/")).collect();
    let quoted: Vec<&str> = quoted.lines().filter(|line| !line.is_empty()).collect();
    assert!(quoted.len() > 4);
    for line in quoted {
        assert!(printed.iter().any(|other| other.trim() == line.trim()), "{line}\n{printed:#?}");
    }
}

#[cfg(unix)]
#[test]
fn the_first_commands_run_unchanged() {
    let dir = folder("guide-log");
    // A torque-controlled joint with friction that nobody wrote down, logged twice at 200 Hz.
    let truth = Rig::parse(
        "format = 1\nkind = \"rotary\"\n[model]\ninertia = 0.17\nviscous = 0.08\ncoulomb = 0.25\n[actuator]\ngain = 1.0\n\
         command_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 1e5\n",
        "the joint",
    )
    .expect("it is a rig");
    let mut log = String::from("t,theta,tau\n");
    for begin in [0.0, 22.0] {
        let mut plant = Plant::new(&truth);
        for row in 0..4000 {
            let t = f64::from(row) * 5e-3;
            let torque =
                1.2 * (1.4 * t + begin).sin() + 0.8 * (3.8 * t + begin).sin() + 0.5 * (12.0 * t).sin();
            log += &format!("{:.4},{:.4},{torque:.5}\n", begin + t, plant.position().to_degrees());
            for _ in 0..50 {
                plant.step(torque, Surroundings::default(), 1e-4);
            }
        }
    }
    std::fs::write(dir.join("log.csv"), log).expect("written");
    let commands = &blocks(GUIDE, "# From your recordings to your simulator")[0];
    assert_eq!(commands.matches("host-sim ").count(), 4, "{commands}");
    let said = run_in(&dir, commands);
    assert!(said.contains("dry friction (99 % sure)"), "{said}");
    for file in ["report/report.html", "simulated/simulation.html", "mujoco/patched-rig.xml"] {
        assert!(dir.join(file).exists(), "{file} is missing: {said}");
    }
}

#[cfg(unix)]
#[test]
#[ignore = "nightly: two diagnoses and an experiment, 30 s"]
fn the_worked_example_finds_the_effect_and_prints_as_quoted() {
    let dir = folder("guide-example");
    let blocks = blocks(GUIDE, "## A complete example");
    let [commands, printed] = &blocks[..] else { panic!("{blocks:?}") };
    let said = run_in(&dir, commands);
    let (words, figures) = words_and_figures(printed);
    // The guide leaves lines out, and breaks one where it gets long.
    let lines: Vec<&str> = said.lines().filter(|line| line_is_quoted(line, printed)).collect();
    let said = lines.join("\n");
    let (said_words, said_figures) = words_and_figures(&said);
    assert_eq!(words, said_words, "the guide quotes\n{printed}and the program prints\n{said}");
    assert_eq!(figures.len(), said_figures.len(), "{said}");
    for (quoted, now) in figures.iter().zip(&said_figures) {
        assert!(
            (quoted - now).abs() <= FIGURES_WITHIN * now.abs(),
            "the guide says {quoted}, now it is {now}:\n{said}"
        );
    }
    let patched = Rig::read(&dir.join("report/patched-rig.toml")).expect("it is a rig");
    let found = patched.effects.iter().find(|e| e.name.as_str() == "eddy_brake").expect("it was found");
    assert!((found.coefficient("peak") / 4e-4 - 1.0).abs() < 0.05, "{found:?}");
    assert!(dir.join("report/patched-rig.xml").exists() && dir.join("simulated/simulation.html").exists());
}

/// True if the guide quotes a line, identified by its first words.
fn line_is_quoted(line: &str, quoted: &str) -> bool {
    let begin: Vec<&str> = line.split_whitespace().take(4).collect();
    let begin = begin.join(" ");
    quoted.lines().any(|line| line.split_whitespace().collect::<Vec<_>>().join(" ").starts_with(&begin))
}

#[cfg(unix)]
#[test]
fn the_commands_of_the_training_guide_run_unchanged() {
    let dir = folder("guide-training");
    let commands = &blocks(TRAINING, "# Training: patients, procedures, scores, debrief, papers")[0];
    let commands = commands.replace("cargo run --release -- ", "host-sim ");
    assert_eq!(commands.matches("host-sim ").count(), 6, "{commands}");
    let said = run_in(&dir, &commands);
    for file in
        ["debrief/debrief.html", "papers/paper-000.html", "papers/paper-001.html", "papers/paper-002.html"]
    {
        assert!(dir.join(file).exists(), "{file} is missing: {said}");
    }
    // Five rounds of the procedure a recording; the debrief compares the first with the last.
    let score = said.lines().find(|line| line.starts_with("insertions=")).expect("the score's last line");
    let debrief = said.lines().find(|line| line.contains("debrief.html")).expect("the debrief's line");
    assert!(score.starts_with("insertions=5 "), "{score}");
    assert!(debrief.ends_with("insertions=10"), "{debrief}");
    let page = std::fs::read_to_string(dir.join("debrief/debrief.html")).expect("it can be read");
    for name in ["monday.mcap, insertion 1", "friday.mcap, insertion 5"] {
        assert!(page.contains(name), "{name} is not compared");
    }
}
