//! Running other programs, and failing in one sentence.

use std::env;
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A chore's error: its reason in one sentence, and the exit status.
#[derive(Debug)]
pub(crate) struct Error {
    what: String,
    /// 1: what was to be done failed; 2: unusable input.
    pub(crate) status: u8,
}

impl Error {
    /// Something did not work out.
    pub(crate) fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), status: 1 }
    }

    /// The command line cannot be understood.
    pub(crate) fn usage(what: impl Into<String>) -> Self {
        Self { what: what.into(), status: 2 }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

/// The top of the repository.
pub(crate) fn top() -> PathBuf {
    // Where cargo runs this crate, for clones that share a target folder share its program too.
    let here = env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    let top = Path::new(&here).join("..");
    top.canonicalize().unwrap_or(top)
}

/// Returns the folder in which cargo builds.
pub(crate) fn target() -> PathBuf {
    top().join(env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// The cargo that runs us, at the top of the repository. Its variables about this crate are
/// removed, because they do not concern what we start.
pub(crate) fn cargo() -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(top());
    for (name, _) in env::vars_os() {
        let text = name.to_string_lossy();
        if text.starts_with("CARGO_PKG_") || text.starts_with("CARGO_MANIFEST_") || text == "CARGO_CRATE_NAME"
        {
            command.env_remove(&name);
        }
    }
    command
}

/// True if a program of this name can be started.
pub(crate) fn is_on_path(program: &str) -> bool {
    env::var_os("PATH").is_some_and(|path| {
        env::split_paths(&path)
            .any(|folder| folder.join(program).with_extension(env::consts::EXE_EXTENSION).is_file())
    })
}

/// Runs `command`, says it first, and fails where it fails.
pub(crate) fn run(command: &mut Command) -> Result<(), Error> {
    eprintln!("$ {}", said(command));
    let status = command.status().map_err(|error| could_not_start(command, &error))?;
    if status.success() { Ok(()) } else { Err(Error::new(format!("`{}` failed ({status})", said(command)))) }
}

/// Runs `command` and gives what it printed; its standard error goes to ours.
pub(crate) fn output(command: &mut Command) -> Result<String, Error> {
    let output =
        command.stderr(Stdio::inherit()).output().map_err(|error| could_not_start(command, &error))?;
    if !output.status.success() {
        return Err(Error::new(format!("`{}` failed ({})", said(command), output.status)));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn could_not_start(command: &Command, error: &std::io::Error) -> Error {
    Error::new(format!("`{}` could not be started: {error}", command.get_program().display()))
}

/// The command as a person would type it.
pub(crate) fn said(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    std::iter::once(program)
        .chain(command.get_args())
        .map(OsStr::to_string_lossy)
        .collect::<Vec<_>>()
        .join(" ")
}
