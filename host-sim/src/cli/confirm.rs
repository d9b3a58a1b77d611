//! The consent of a person before a motor moves: on the terminal, or in the page of a guide.

use clap::Args;
use device_sim::error::Error;
use live::output;
use server::guide::Guide;
use server::visualizer::{self, Server};
use std::fmt::Display;
use std::io::BufRead;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

/// The longest time between a stop and the end of a question.
const PATIENCE: Duration = Duration::from_millis(50);

/// The options for a person's consent.
#[derive(Args)]
pub(crate) struct ConsentFlags {
    /// The needle is out: do not ask
    #[arg(long)]
    yes: bool,
    /// Show the steps on a page and ask there
    #[arg(long, conflicts_with = "yes")]
    page: bool,
    /// Port of the page on this computer; 0 for any free port
    #[arg(long, default_value_t = 8710, value_name = "N", requires = "page")]
    port: u16,
}

impl ConsentFlags {
    /// Opens the page where one was asked for; `title` is its heading, `stop` ends its waits.
    pub(crate) fn open(&self, title: &str, device: &str, stop: &Arc<AtomicBool>) -> Result<Consent, Error> {
        let guide = if self.page {
            let guide = Guide::new(title, device, stop.clone());
            let server = visualizer::serve_guide(guide.watches(), guide.said(), self.port);
            let server = server.map_err(Error::failed)?;
            output::page("guide", &server.url());
            Some((guide, server))
        } else {
            None
        };
        // Nobody is next to a virtual device.
        Ok(Consent { yes: self.yes || device == "virtual", guide, stop: stop.clone() })
    }
}

/// The person who confirms.
pub(crate) struct Consent {
    yes: bool,
    guide: Option<(Guide, Server)>,
    /// Set by a person who ends the run.
    stop: Arc<AtomicBool>,
}

impl Consent {
    /// The guide, where there is one.
    pub(crate) fn guide(&self) -> Option<Guide> {
        self.guide.as_ref().map(|(guide, _)| guide.clone())
    }

    /// Announces the next step. Waits for a person to agree if the motor `moves`, and always on a
    /// page.
    pub(crate) fn ask(&self, step: &dyn Display, moves: bool) -> Result<(), Error> {
        match &self.guide {
            Some((guide, _)) => guide.ask(step, moves),
            None if moves => confirm(step, self.yes, &self.stop),
            None => {
                eprintln!("{step}");
                Ok(())
            }
        }
    }

    /// Shows on the page what goes on in the last step, or what came of it.
    pub(crate) fn tell(&self, news: &str) {
        if let Some((guide, _)) = &self.guide {
            guide.tell(news);
        }
    }

    /// Shows the result on the page.
    pub(crate) fn end(&self, outcome: Result<Vec<String>, &Error>) {
        if let Some((guide, _)) = &self.guide {
            guide.end(outcome);
        }
    }

    /// Asks that the needle is out, because the motor will move on its own.
    pub(crate) fn needle_is_out(&self) -> Result<(), Error> {
        match &self.guide {
            // Nothing moves before the next step.
            Some((guide, _)) => guide.ask(&NEEDLE_OUT, false),
            None => confirm(&NEEDLE_OUT, self.yes, &self.stop),
        }
    }
}

const NEEDLE_OUT: &str = "the roller will move on its own: take the needle out of the device, and keep hands off unless a step asks for them";

/// Announces `what` and waits for Enter or `stop`; with `yes`, only announces it.
fn confirm(what: &dyn Display, yes: bool, stop: &AtomicBool) -> Result<(), Error> {
    eprintln!("{what}");
    if yes {
        return Ok(());
    }
    eprintln!("press Enter to continue, Ctrl-C to stop");
    // A read of a terminal begins again after a signal, so it waits in a thread of its own.
    let (answers, answer) = mpsc::channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        let read = std::io::stdin().lock().read_line(&mut line);
        let _ = answers.send(read.is_ok_and(|read| read > 0));
    });
    loop {
        match answer.recv_timeout(PATIENCE) {
            Ok(true) => return Ok(()),
            _ if stop.load(Ordering::Relaxed) => {
                return Err(Error::failed("stopped before the movement; nothing moved"));
            }
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            _ => return Err(Error::input("the movement was not confirmed; in a script, add --yes")),
        }
    }
}

/// The same as [`Consent::needle_is_out`] without a page.
pub(crate) fn needle_is_out(yes: bool, stop: &AtomicBool) -> Result<(), Error> {
    confirm(&NEEDLE_OUT, yes, stop)
}
