//! On a board: the firmware (`app.rs` the tasks, `board` the wiring, `chip` the microcontroller).
//! On a PC: a launcher that builds the image, flashes it through a debug probe and shows its log,
//! so that `cargo run -p firmware --release` does what it says.
#![cfg_attr(target_os = "none", no_std, no_main)]
// Direct access to registers has its few places, each with its reason; everything else is held to
// the safe language.
#![deny(unsafe_code)]

#[cfg(target_os = "none")]
use defmt_rtt as _;

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "RTIC writes the interrupts' entries")]
mod app;
#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod chip;
#[cfg(target_os = "none")]
mod crash;
#[cfg(target_os = "none")]
mod last_words;

/// The words that the tasks share.
#[cfg(target_os = "none")]
static SHARED: firmware::tasks::shared::Shared =
    firmware::tasks::shared::Shared::new(&last_words::LAST_WORDS);

/// The end of a crash, with the motor safe: word for the next start, and a reset.
#[cfg(target_os = "none")]
fn give_up(crash: &firmware::reset::Crash, _: Option<&core::panic::PanicInfo<'_>>) -> ! {
    last_words::LAST_WORDS.crash(crash);
    cortex_m::peripheral::SCB::sys_reset()
}

// Before each line of the log: milliseconds since the tasks were started. They wrap after 49 days,
// and are 0 in start-up.
#[cfg(target_os = "none")]
defmt::timestamp!("{=u32:ms}", SHARED.supervised_ms.load(core::sync::atomic::Ordering::Relaxed));

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    launcher::run()
}

#[cfg(not(target_os = "none"))]
mod launcher {
    use std::env;
    use std::path::Path;
    use std::process::{Command, ExitCode};

    /// Hands over to cargo, whose runner for the board is probe-rs.
    pub(crate) fn run() -> ExitCode {
        let on_path = |program: &str| {
            env::var_os("PATH").is_some_and(|path| {
                env::split_paths(&path)
                    .any(|folder| folder.join(program).with_extension(env::consts::EXE_EXTENSION).is_file())
            })
        };
        if !on_path("probe-rs") {
            eprintln!(
                "error: flashing needs probe-rs, which is not on the PATH; install it with `cargo install probe-rs-tools \
                 --locked`, or flash without a probe with `cargo xtask flash --dfu`"
            );
            return ExitCode::FAILURE;
        }
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let status = Command::new(cargo)
            .current_dir(top)
            .args(["run", "-p", "firmware", "--profile", "firmware", "--target", "thumbv7em-none-eabihf"])
            .status();
        match status {
            Ok(status) if status.success() => ExitCode::SUCCESS,
            Ok(_) => ExitCode::FAILURE,
            Err(error) => {
                eprintln!("error: cargo could not be started: {error}");
                ExitCode::FAILURE
            }
        }
    }
}
