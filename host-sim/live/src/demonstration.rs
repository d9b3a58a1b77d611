//! The report of a demonstration of the diagnosis, which this crate does not have: the program with
//! all commands makes it.

use device_sim::error::Error;
use std::process::{Command, Stdio};

/// Runs `host-sim demo` and returns its report's page.
pub(crate) fn page() -> Result<String, Error> {
    let out = std::env::temp_dir().join(format!("host-sim-demo-{}", std::process::id()));
    let failed = |cause: &dyn std::fmt::Display| {
        Error::failed(format_args!("the demonstration cannot be made ({cause}); run host-sim demo yourself"))
    };
    let program = std::env::current_exe().map_err(|cause| failed(&cause))?;
    let mut command = Command::new(program);
    command.args(["demo", "missing", "--quiet", "--no-browser", "--out"]).arg(&out).stdin(Stdio::null());
    let done = command.output().map_err(|cause| failed(&cause))?;
    let page = std::fs::read_to_string(out.join("missing/report.html"));
    // A folder that stays is in the system's own for temporary files.
    let _ = std::fs::remove_dir_all(&out);
    if !done.status.success() {
        return Err(failed(&String::from_utf8_lossy(&done.stderr).trim()));
    }
    page.map_err(|cause| failed(&cause))
}
