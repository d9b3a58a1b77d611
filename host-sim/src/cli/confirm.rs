//! What a person has to agree to before a motor moves.

use host_sim::failure::Failure;
use std::fmt::Display;
use std::io::BufRead;

/// Says `what` comes and waits for Enter; with `yes`, only says it.
pub(crate) fn confirm(what: &dyn Display, yes: bool) -> Result<(), Failure> {
    eprintln!("{what}");
    if yes {
        return Ok(());
    }
    eprintln!("press Enter to go on, Ctrl-C to end");
    let mut line = String::new();
    match std::io::stdin().lock().read_line(&mut line) {
        Ok(read) if read > 0 => Ok(()),
        _ => Err(Failure::input("nobody agreed to the movement; add --yes where a script runs this")),
    }
}

/// The motor will move by itself: asks that the needle is out.
pub(crate) fn needle_is_out(yes: bool) -> Result<(), Failure> {
    confirm(&"the roller will move by itself: take the needle out of the device, and keep hands off", yes)
}
