//! `cargo xtask answers`: the diagnosis of this commit and of an earlier one, on the same
//! recordings, compared to the digit.
//!
//! A commit that changes answers on purpose says so with a line `Answers changed: …` in its
//! message; against a revision these are listed below the comparison. The comparison without
//! `--against` begins there, or at the newest commit that is a day old.

use crate::shell::{self, Error, cargo};
use crate::workspace_build::{ANY_RUST, built};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The line by which a commit says that it changes answers.
const CHANGED: &str = "^Answers changed:";
/// The age of the commit that a night compares with.
const A_NIGHT: &str = "1.day.ago";
/// The option that names the other program.
const AGAINST: &str = "--against";

/// Compares with the program or revision after `--against`; the other arguments are `prove`'s.
pub(crate) fn run(arguments: &[String]) -> Result<(), Error> {
    let (against, rest) = against(arguments)?;
    let before = match against {
        Some(program) if Path::new(program).is_file() => {
            fs::canonicalize(program).map_err(|error| Error::new(format!("{program}: {error}")))?
        }
        Some(revision) => built_at(&commit(revision)?)?,
        None => match last_promise()? {
            Some(commit) => built_at(&commit)?,
            None => {
                eprintln!("the newest commit changes answers on purpose: there is nothing to compare with");
                return Ok(());
            }
        },
    };
    let compared = compare(&before, &rest);
    if let Some(revision) = against.filter(|one| !Path::new(one).is_file()) {
        println!("{}", announced(revision)?);
    }
    compared
}

/// Returns what the commits after `revision` say of the answers that they change, the oldest first.
fn announced(revision: &str) -> Result<String, Error> {
    let range = format!("{revision}..HEAD");
    let log =
        git(&["log", "--reverse", "--no-merges", "--grep", CHANGED, "--format=%x1e%h %s%x1f%b", &range])?;
    let said: Vec<String> = log.split('\u{1e}').filter_map(announcement).collect();
    Ok(format!("{} commits since {revision} change answers on purpose:\n{}", said.len(), said.join("\n")))
}

/// Returns the subject of a commit and what its body says of changed answers.
fn announcement(commit: &str) -> Option<String> {
    let (subject, body) = commit.split_once('\u{1f}')?;
    let (_, said) = body.split_once(CHANGED.trim_start_matches('^'))?;
    let said = said.split("\n\n").next()?.split_whitespace().collect::<Vec<_>>().join(" ");
    Some(format!("{subject}: {said}"))
}

/// Compares with the last commit whose answers this one promises to keep.
pub(crate) fn nightly() -> Result<(), Error> {
    run(&[])
}

/// Separates the value of `--against` from the other arguments.
fn against(arguments: &[String]) -> Result<(Option<&str>, Vec<&String>), Error> {
    let mut against = None;
    let mut rest = Vec::new();
    let mut list = arguments.iter();
    while let Some(argument) = list.next() {
        if argument == AGAINST {
            let value = list.next().ok_or_else(|| {
                Error::usage(format!("{AGAINST} needs the path of a program or a revision of git after it"))
            })?;
            against = Some(value.as_str());
        } else {
            rest.push(argument);
        }
    }
    Ok((against, rest))
}

/// Runs the comparison: both programs diagnose the recordings that `prove` draws.
fn compare(before: &Path, rest: &[&String]) -> Result<(), Error> {
    let after = built(&["--bin", "host-sim"], "host-sim")?;
    let prove = built(&["--bin", "prove"], "prove")?;
    let line = |program: &Path| {
        format!(
            "{} diagnose --rig {{rig}} --fit {{fit}} --holdout {{holdout}} --out {{out}}",
            program.display()
        )
    };
    let mut compare = Command::new(prove);
    compare.arg("--tool").arg(line(&after)).arg("--same-as").arg(line(before)).args(rest);
    shell::run(compare.current_dir(shell::top()))
}

fn git(arguments: &[&str]) -> Result<String, Error> {
    let mut git = Command::new("git");
    Ok(shell::output(git.current_dir(shell::top()).args(arguments))?.trim().to_owned())
}

fn commit(revision: &str) -> Result<String, Error> {
    git(&["rev-parse", "--verify", "--quiet", &format!("{revision}^{{commit}}")]).map_err(|_| {
        Error::usage(format!("{AGAINST} takes the path of a program or a revision of git, not `{revision}`"))
    })
}

/// Returns the newer of the newest commit that is a day old and the newest that changes answers on
/// purpose; `None` if that is the newest commit of all.
fn last_promise() -> Result<Option<String>, Error> {
    let newest = |of: &str| git(&["rev-list", "--max-count=1", of, "HEAD"]);
    let (old, changed) = (newest(&format!("--before={A_NIGHT}"))?, newest(&format!("--grep={CHANGED}"))?);
    let is_newer = |one: &str, other: &str| -> Result<bool, Error> {
        Ok(git(&["rev-list", "--count", one, "--not", other])? != "0")
    };
    let base = match (old.as_str(), changed.as_str()) {
        ("", "") => git(&["rev-list", "--max-parents=0", "--max-count=1", "HEAD"])?,
        (old, "") => old.to_owned(),
        ("", changed) => changed.to_owned(),
        (old, changed) => if is_newer(changed, old)? { changed } else { old }.to_owned(),
    };
    Ok((base != git(&["rev-parse", "HEAD"])?).then_some(base))
}

/// Returns the program `host-sim` of a commit, built from a clone of its own into a folder of its
/// own.
fn built_at(commit: &str) -> Result<PathBuf, Error> {
    let folder = shell::target().join("answers");
    let program = folder.join(format!("host-sim-{commit}"));
    if program.is_file() {
        return Ok(program);
    }
    fs::create_dir_all(&folder)
        .map_err(|error| Error::new(format!("{} cannot be created: {error}", folder.display())))?;
    let tree = folder.join("tree");
    remove(&tree)?;
    let tree_name = tree.to_string_lossy();
    git(&["clone", "--quiet", "--shared", "--no-checkout", ".", &tree_name])?;
    git(&["-C", &tree_name, "checkout", "--quiet", "--detach", commit])?;
    let build = folder.join("build");
    let mut cargo = cargo();
    cargo.current_dir(&tree).env("CARGO_TARGET_DIR", &build);
    shell::run(cargo.args(["build", "--quiet", "--release", ANY_RUST, "--bin", "host-sim"]))?;
    remove(&tree)?;
    fs::copy(build.join("release/host-sim"), &program)
        .map_err(|error| Error::new(format!("{} cannot be written: {error}", program.display())))?;
    Ok(program)
}

/// Removes a folder, if there is one.
fn remove(folder: &Path) -> Result<(), Error> {
    match fs::remove_dir_all(folder) {
        Err(error) if folder.exists() => {
            Err(Error::new(format!("{} cannot be removed: {error}", folder.display())))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_program_is_separated_from_the_rest() {
        let arguments = ["--cases", "5", "--against", "HEAD~1", "--jobs", "1"].map(String::from);
        let (found, rest) = against(&arguments).expect("a value follows");
        assert_eq!((found, rest.len()), (Some("HEAD~1"), 4));
        assert_eq!(against(&arguments[..3]).expect_err("no value follows").status, 2);
    }

    #[test]
    fn a_commit_says_what_it_changes_up_to_an_empty_line() {
        let commit = "1234567 Know gears\u{1f}Why.\n\nAnswers changed: a gear of 50\nis named.\n\nMore.\n";
        assert_eq!(announcement(commit).as_deref(), Some("1234567 Know gears: a gear of 50 is named."));
        assert_eq!(announcement("1234567 Know gears\u{1f}Why.\n"), None);
    }

    #[test]
    fn what_is_neither_a_program_nor_a_revision_is_refused() {
        let error = run(&["--against".into(), "no-such-revision".into()]).expect_err("it is neither");
        assert!(error.status == 2 && error.to_string().contains("`no-such-revision`"), "{error}");
    }
}
