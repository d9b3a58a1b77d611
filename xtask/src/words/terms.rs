//! The terms of the project, each with the words that are not used for the same thing, and names
//! that files do not have.

/// A term: one word for one thing, from code to report. `docs/guide/glossary.md` explains more of them.
pub(super) struct Term {
    pub(super) term: &'static str,
    pub(super) meaning: &'static str,
    /// Other words for it, in lower case, one blank apart.
    pub(super) not: &'static [&'static str],
}

const fn term(term: &'static str, meaning: &'static str, not: &'static [&'static str]) -> Term {
    Term { term, meaning, not }
}

/// A word is added only where it always means the term: "latency" of flash is no delay of a
/// command, and a "pole" of a motor no pole of a filter.
pub(super) const TERMS: &[Term] = &[
    term(
        "deadband",
        "commands around zero that do nothing",
        &["dead band", "dead bands", "dead-band", "dead zone", "dead zones"],
    ),
    term("holdout", "recordings that no fit and no choice used", &["hold-out", "hold-outs"]),
    term("held-out", "of the holdout", &["out-of-sample", "test set", "validation set"]),
    term(
        "sampling rate",
        "rows a second",
        &["sample rate", "sample rates", "sampling frequency", "sample frequency"],
    ),
    term("standard deviation", "the square root of a variance", &["std dev", "stddev", "std deviation"]),
    term("log-likelihood", "the logarithm of a likelihood, in nats", &["log likelihood", "loglikelihood"]),
    term(
        "interval",
        "two bounds that hold a value with a stated probability",
        &["wilson range", "wilson bounds", "confidence range", "error bar", "error bars"],
    ),
    term(
        "dry friction",
        "a force against the motion that does not grow with speed",
        &["coulomb friction", "solid friction"],
    ),
    term("backlash", "a gap within which one part moves without the other", &["free play", "back-lash"]),
    term("presliding", "motion before dry friction has its full force", &["pre-sliding"]),
    term("torque constant", "torque per current of a motor", &["motor constant"]),
    term("count", "a quarter of an encoder's line", &["encoder tick", "encoder ticks", "encoder increments"]),
    term("set value", "the force that the amplifier is asked for", &["set point", "set points", "set-point"]),
    term("feedforward", "a force that is added without measuring", &["feed-forward"]),
    term("timeout", "the time after which a message counts as missing", &["time-out", "time-outs"]),
    term("heartbeat", "the message by which the PC says that it is there", &["heart beat"]),
    term("emergency stop", "the button that switches the amplifier off", &["e-stop", "estop", "kill switch"]),
    term("checksum", "a number that reveals a damaged record", &["check sum", "check-sum"]),
    term("bootloader", "the program that writes an image", &["boot loader", "boot-loader"]),
    term("watchdog", "the timer that resets a board whose tick is late", &["watch dog", "watch-dog"]),
    term("setup", "everything that is done once, before", &["set-up"]),
    term("folder", "a place for files", &["directory", "directories"]),
    term("file name", "the name of a file", &["filename", "filenames", "file-name"]),
    term("dataset", "recordings that were published together", &["data set", "data sets", "data-set"]),
    term("probe", "the part of an ultrasound machine on the skin", &["transducer", "scan head"]),
    term("inclination", "the needle's angle below the horizontal", &["insertion angle", "needle pitch"]),
    term("puncture", "the needle goes through a wall", &["breakthrough", "pop-through"]),
    term("trainee", "the person who holds the needle", &["student", "learner"]),
];

/// Names that files and folders do not have, each with what says more.
pub(super) const FILE_NAMES: &[(&str, &str)] = &[
    ("written", "writer"),
    ("felt", "residual_force"),
    ("told", "messages"),
    ("telling", "publisher"),
    ("sheet", "html_report"),
    ("station", "run_loop"),
    ("conductor", "sequencer"),
    ("tally", "run_stats"),
    ("bedside", "patient_manager"),
    ("rehearsal", "virtual_run"),
    ("pace", "realtime_clock"),
    ("library", "the noun of its elements"),
    ("opponent", "the rival's noun"),
    ("belief", "expected_answer"),
    ("brought", "external_cases"),
    ("draft", "case_builder"),
    ("reported", "report_residuals"),
    ("sums", "metrics"),
    ("proxy", "anchor"),
    ("golden", "sentence_snapshots, or the method's name"),
    ("misc", "the noun of its content"),
    ("utils", "the noun of its content"),
    ("helpers", "the noun of its content"),
];
