//! The beginning and the end of a program: its command line is read; help goes to standard output,
//! an error is one line and an exit status, 1 if the request failed, 2 for unusable input.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, Parser};
use device_sim::error::Error;
use std::process::ExitCode;

/// Reads the command line. Every option takes a negative number, so that what refuses one says the
/// range and not that `-1` is no option.
pub fn parse<T: Parser>() -> Result<T, clap::Error> {
    let signed = |arg: Arg| {
        let takes_one = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_one)
    };
    let all_signed = |command: Command| command.mut_args(signed);
    let mut command = all_signed(T::command()).mut_subcommands(all_signed);
    let mut matches = command.try_get_matches_from_mut(std::env::args_os())?;
    T::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut command))
}

/// Carries out a command line that was parsed, and returns the program's exit status.
pub fn finish<T>(parsed: Result<T, clap::Error>, run: impl FnOnce(T) -> Result<(), Error>) -> ExitCode {
    let result = match parsed {
        Ok(command) => run(command),
        Err(error) if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            // Help may go into a closed pipe.
            let _ = error.print();
            return ExitCode::SUCCESS;
        }
        Err(error) => Err(usage(&error)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("host-sim: {error}");
            ExitCode::from(error.status())
        }
    }
}

/// Returns the parser's message, in one sentence.
fn usage(error: &clap::Error) -> Error {
    let drawn = error.to_string();
    // The last line of help that the parser names: of the command that was asked for.
    let help = drawn.lines().find_map(|line| line.trim().strip_prefix("Usage: ")).map_or(
        "host-sim --help".into(),
        |usage| {
            let command: Vec<&str> =
                usage.split_whitespace().take_while(|word| !word.starts_with(['-', '<', '['])).collect();
            format!("{} --help", command.join(" "))
        },
    );
    if let Some(ContextValue::Strings(missing)) =
        error.get(ContextKind::InvalidArg).filter(|_| error.kind() == ErrorKind::MissingRequiredArgument)
    {
        let (what, them) = if missing.len() == 1 { ("is", "it") } else { ("are", "them") };
        return Error::input(format_args!(
            "{} {what} missing; add {them}, see {help}",
            missing.join(" and ")
        ));
    }
    let said: Vec<&str> = drawn
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"))
        .filter(|line| !line.is_empty())
        .map(|line| line.trim_start_matches("tip: "))
        .collect();
    let said = said.join("; ");
    Error::input(format_args!("{}; see {help}", said.trim_start_matches("error: ")))
}
