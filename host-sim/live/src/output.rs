//! Messages in addition to the results, and the browser that a program for people without a
//! terminal opens.

use std::io::IsTerminal;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Set while a program is built for people who start it by a double click: `cargo xtask dist`.
const OPENS_BROWSER: bool = option_env!("HOST_SIM_OPENS_BROWSER").is_some();

static QUIET: AtomicBool = AtomicBool::new(false);
static VERBOSE: AtomicBool = AtomicBool::new(false);
static NO_BROWSER: AtomicBool = AtomicBool::new(false);

/// Notes what the command line asks for; what was asked for once stays so.
pub fn set(quiet: bool, verbose: bool, no_browser: bool) {
    QUIET.fetch_or(quiet, Ordering::Relaxed);
    VERBOSE.fetch_or(verbose, Ordering::Relaxed);
    NO_BROWSER.fetch_or(no_browser, Ordering::Relaxed);
}

/// Returns true if only results and errors are printed.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Returns true if each stage is printed with its time.
pub fn is_verbose() -> bool {
    VERBOSE.load(Ordering::Relaxed)
}

/// Returns true if standard output takes colours: a terminal whose user has not set `NO_COLOR`
/// (no-color.org).
fn takes_colours() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Says where a page is, and opens it where this program does so.
pub fn page(what: &str, url: &str) {
    note!("{what} at {url}");
    if OPENS_BROWSER {
        open(url);
    }
}

/// Prints the address of a page for other computers, and the same as a QR code for a camera.
pub(crate) fn page_for_others(url: &str) {
    note!("for tablets and phones: {url}");
    // An address always fits.
    if let Ok(code) = qrcode::QrCode::new(url) {
        let text = code.render::<qrcode::render::unicode::Dense1x2>().build();
        // Black on white, whatever the terminal's own colours are: cameras fail on the negative.
        let (black_on_white, plain) = match takes_colours() {
            true => ("\x1b[30;107m", "\x1b[0m"),
            false => ("", ""),
        };
        for line in text.lines() {
            note!("{black_on_white}{line}{plain}");
        }
    }
}

/// Asks the system for its browser, to show an address or a file, unless the command line says
/// `--no-browser`. If the system has no browser, the printed address remains.
pub fn open(url: &str) {
    if NO_BROWSER.load(Ordering::Relaxed) {
        return;
    }
    let mut command = if cfg!(target_os = "windows") {
        let mut command = Command::new("rundll32");
        command.arg("url.dll,FileProtocolHandler");
        command
    } else if cfg!(target_os = "macos") {
        Command::new("open")
    } else {
        Command::new("xdg-open")
    };
    let quiet = command.arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Ok(mut opener) = quiet.spawn() {
        std::thread::spawn(move || opener.wait());
    }
}
