//! The boards that there are images for: what the chores have to know of each. Its pins are in
//! `firmware/src/board`.

use crate::shell::Error;
use std::ops::Range;

/// A board.
pub(crate) struct Board {
    /// As `--board` takes it, which is also its feature in `firmware/Cargo.toml`.
    pub(crate) name: &'static str,
    /// As people call it.
    pub(crate) title: &'static str,
    /// Its microcontroller, as probe-rs calls it.
    pub(crate) chip: &'static str,
    /// Main RAM.
    pub(crate) ram: Range<u32>,
    /// True if `flash --dfu` knows its jumpers.
    pub(crate) has_dfu: bool,
}

/// All of them, the default one first.
pub(crate) const ALL: [Board; 2] = [
    Board {
        name: "discovery",
        title: "STM32F4DISCOVERY",
        chip: "STM32F407VGTx",
        ram: 0x2000_0000..0x2002_0000,
        has_dfu: true,
    },
    Board {
        name: "nucleo-f429zi",
        title: "NUCLEO-F429ZI",
        chip: "STM32F429ZITx",
        ram: 0x2000_0000..0x2003_0000,
        has_dfu: false,
    },
];

/// The board that nobody has to name.
pub(crate) const DEFAULT: &Board = &ALL[0];

impl Board {
    /// True if it is [`DEFAULT`].
    pub(crate) fn is_default(&self) -> bool {
        self.name == DEFAULT.name
    }
}

/// The board that `--board NAME` asks for, else the default one, and the other arguments.
pub(crate) fn chosen(arguments: &[String]) -> Result<(&'static Board, Vec<String>), Error> {
    let mut rest = arguments.to_vec();
    let Some(place) = rest.iter().position(|argument| argument == "--board") else {
        return Ok((DEFAULT, rest));
    };
    rest.remove(place);
    let name = if place < rest.len() { rest.remove(place) } else { String::new() };
    let board = ALL.iter().find(|board| board.name == name).ok_or_else(|| {
        let all: Vec<&str> = ALL.iter().map(|board| board.name).collect();
        Error::usage(format!("--board takes one of {}, not `{name}`", all.join(", ")))
    })?;
    Ok((board, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(words: &str) -> Vec<String> {
        words.split_whitespace().map(String::from).collect()
    }

    /// A chip of another board would be flashed with an image that is not for it.
    #[test]
    fn each_board_has_its_own_runner() {
        let config = include_str!("../../.cargo/config.toml");
        for board in &ALL {
            let (_, alias) =
                config.split_once(&format!("\n{} = [", board.name)).expect("an alias for the board");
            let (alias, _) = alias.split_once("\n]").expect("its end");
            assert!(alias.contains(&format!("\"--features\", \"{}\"", board.name)), "{alias}");
            assert!(alias.contains(&format!("--chip {}'", board.chip)), "{alias}");
        }
    }

    #[test]
    fn a_board_is_taken_out_of_the_arguments() {
        let taken = |words| chosen(&arguments(words)).map(|(board, rest)| (board.name, rest.join(" "))).ok();
        assert_eq!(taken("--dfu"), Some(("discovery", "--dfu".into())));
        assert_eq!(taken("--board nucleo-f429zi --dfu"), Some(("nucleo-f429zi", "--dfu".into())));
        assert_eq!(taken("--board nucleo"), None);
        assert_eq!(taken("--dfu --board"), None);
    }
}
