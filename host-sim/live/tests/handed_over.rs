//! The program of the first command hands over what it lacks. `host-sim` and cargo are scripts
//! here, which say what they were asked.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder with the program alone.
fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name).join("release");
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).expect("a folder");
    fs::hard_link(env!("CARGO_BIN_EXE_needle"), dir.join("needle")).expect("the same file system");
    dir
}

fn script(path: &Path, text: &str) {
    fs::write(path, format!("#!/bin/sh\n{text}\n")).expect("written");
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).expect("its mode is set");
}

fn needle(dir: &Path, arguments: &[&str], cargo: Option<&Path>) -> Output {
    let mut command = Command::new(dir.join("needle"));
    command.args(arguments).env_remove("CARGO").env_remove("CARGO_MANIFEST_DIR");
    if let Some(cargo) = cargo {
        command.env("CARGO", cargo).env("CARGO_MANIFEST_DIR", env!("CARGO_MANIFEST_DIR"));
    }
    command.output().expect("it starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn arguments_go_to_the_whole_program_and_its_status_returns() {
    let dir = folder("beside");
    script(&dir.join("host-sim"), "for word in \"$@\"; do echo \"<$word>\"; done; exit 7");
    let output = needle(&dir, &["--quiet", "diagnose", "--out", "a b", "--help"], None);
    assert_eq!(text(&output.stdout), "<--quiet>\n<diagnose>\n<--out>\n<a b>\n<--help>\n");
    assert_eq!(output.status.code(), Some(7));
    let all = needle(&dir, &["--help"], None);
    assert_eq!(text(&all.stdout), "<--help>\n", "the help of all commands");
}

#[test]
fn cargo_builds_the_whole_program_before_it_is_run() {
    let dir = folder("built");
    let cargo = dir.join("cargo");
    // The build makes the program, which is not there before.
    let made = dir.join("host-sim");
    script(
        &cargo,
        &format!("printf '#!/bin/sh\\necho made by: %s\\n' \"$*\" > {0}; chmod +x {0}", made.display()),
    );
    let output = needle(&dir, &["diagnose"], Some(&cargo));
    let said = text(&output.stdout);
    assert!(
        said.starts_with("made by: build --bin host-sim --profile release"),
        "{said} {}",
        text(&output.stderr)
    );
    script(&cargo, "exit 101");
    let failed = needle(&dir, &["diagnose"], Some(&cargo));
    assert_eq!((failed.status.code(), text(&failed.stdout)), (Some(1), String::new()), "not the old one");
}

#[test]
fn a_signal_that_ends_it_ends_the_whole_program() {
    let dir = folder("ended");
    script(&dir.join("host-sim"), "echo $$; exec sleep 60");
    let mut child = Command::new(dir.join("needle"))
        .arg("settle")
        .env_remove("CARGO")
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("it starts");
    let own = child.id().to_string();
    let mut line = String::new();
    let output = child.stdout.take().expect("it is piped");
    std::io::BufRead::read_line(&mut std::io::BufReader::new(output), &mut line).expect("it prints");
    assert_eq!(line.trim(), own, "one process, which the signal meets");
    child.kill().expect("it runs");
    child.wait().expect("it ended");
}

#[test]
fn what_it_has_is_not_handed_over() {
    let dir = folder("own");
    for (arguments, wanted) in
        [(&["score", "--help"][..], "Usage: host-sim score"), (&["profiles", "adult"], "adult")]
    {
        let output = needle(&dir, arguments, None);
        assert!(text(&output.stdout).contains(wanted), "{arguments:?}: {}", text(&output.stderr));
    }
    let missing = needle(&dir, &["diagnose"], None);
    assert_eq!(missing.status.code(), Some(1));
    assert!(text(&missing.stderr).contains("cargo build --release"), "{}", text(&missing.stderr));
}

#[test]
fn every_feature_of_the_whole_program_is_handed_on() {
    let read = |file: &str| {
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).expect("it is there")
    };
    let features = |manifest: &str| -> Vec<String> {
        let table =
            manifest.split("[features]").nth(1).and_then(|rest| rest.split("\n[").next()).expect("features");
        table
            .lines()
            .filter_map(|line| Some(line.split_once(" = ")?.0.to_owned()))
            .filter(|name| !name.starts_with('#'))
            .collect()
    };
    let (whole, own, handed) =
        (features(&read("../Cargo.toml")), features(&read("Cargo.toml")), read("src/delegate.rs"));
    for name in &whole {
        assert!(own.contains(name) && handed.contains(&format!("(\"{name}\", cfg!")), "{name}: {own:?}");
    }
}
