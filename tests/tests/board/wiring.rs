//! The tables of pins in docs/hardware.md, from which the wiring diagrams are drawn, name the pins
//! that the emulated boards drive.

use tests::board::pins::{DISCOVERY, NUCLEO_F429ZI, PartPin, Pins};

/// Returns the pins in the first cell of the row of `section` whose text contains `words`.
fn pins(section: &str, words: &str) -> Vec<PartPin> {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/hardware.md"))
        .expect("the page");
    let (_, after) = page.split_once(section).expect("its section");
    let table: Vec<&str> = after
        .lines()
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'))
        .collect();
    let row = table
        .iter()
        .find(|row| row.contains(words))
        .unwrap_or_else(|| panic!("{section}: no row with \"{words}\""));
    let cell = row.trim_start_matches('|').split('|').next().unwrap_or_default();
    cell.split(|c: char| !c.is_ascii_alphanumeric()).filter_map(pin).collect()
}

/// Reads `PA15`.
fn pin(word: &str) -> Option<PartPin> {
    let port = word.strip_prefix('P')?.chars().next().filter(char::is_ascii_uppercase)?;
    Some(PartPin { port: port as usize - 'A' as usize, index: word[2..].parse().ok()? })
}

/// Returns the converters' channel of a pin (DS8626, pin table).
fn channel(pin: PartPin) -> u8 {
    match pin.port {
        0 => pin.index,
        1 => 8 + pin.index,
        _ => 10 + pin.index,
    }
}

fn check(section: &str, board: &Pins) {
    assert_eq!(pins(section, "encoder A, B"), board.tracks);
    assert_eq!(pins(section, "amplifier enable"), [board.enable]);
    assert_eq!(pins(section, "emergency stop"), [board.drive_lines[0]]);
    assert_eq!(pins(section, "amplifier ready"), [board.drive_lines[1]]);
    let monitor = pins(section, "current monitor");
    assert_eq!((monitor[0], channel(monitor[1])), (board.drive_lines[2], board.monitor));
    assert_eq!(pins(section, "the encoder's supply"), [board.encoder_supply]);
    assert_eq!(pins(section, "lamps"), board.lamps);
    let inclinometer = pins(section, "analogue inclinometer");
    assert_eq!(channel(inclinometer[0]), board.inclinometer);
    assert_eq!(inclinometer.get(1).copied(), board.strap);
}

#[test]
fn the_page_names_the_pins_of_the_discovery() {
    check("## Wiring", &DISCOVERY);
}

#[test]
fn the_page_names_the_pins_of_the_nucleo() {
    check("## The second board: NUCLEO-F429ZI", &NUCLEO_F429ZI);
}
