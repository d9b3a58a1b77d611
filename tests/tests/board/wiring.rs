//! The tables of pins in docs/guide/hardware.md, from which the wiring diagrams are drawn, name the
//! pins that the emulated boards drive; its analogue stage does what its text says of it.

use emulator::board::pins::{DISCOVERY, NUCLEO_F429ZI, PartPin, Pins};

fn page() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/guide/hardware.md"))
        .expect("the page")
}

/// Returns the pins in the first cell of the row of `section` whose text contains `words`.
fn pins(section: &str, words: &str) -> Vec<PartPin> {
    let page = page();
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
    assert_eq!(pins(section, "alive"), [board.alive]);
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

/// A complex number.
#[derive(Clone, Copy)]
struct Complex(f64, f64);

impl Complex {
    fn times(self, by: f64) -> Self {
        Self(self.0 * by, self.1 * by)
    }

    fn plus(self, real: f64) -> Self {
        Self(self.0 + real, self.1)
    }

    fn over(self, Self(re, im): Self) -> Self {
        let square = re * re + im * im;
        Self((self.0 * re + self.1 * im) / square, (self.1 * re - self.0 * im) / square)
    }

    fn of(self, Self(re, im): Self) -> Self {
        Self(self.0 * re - self.1 * im, self.0 * im + self.1 * re)
    }
}

/// The page's section on the analogue stage.
struct Stage(String);

impl Stage {
    /// The first number in front of `unit` in the line that contains `words`, as a plain one.
    fn value(&self, words: &str, unit: &str) -> f64 {
        let line = self.0.lines().find(|line| line.contains(words));
        let line = line.unwrap_or_else(|| panic!("no line with \"{words}\""));
        let before = line.split_once(unit).map(|(before, _)| before.trim_end());
        let number = before.and_then(|before| before.rsplit(' ').next()?.parse().ok());
        number.unwrap_or_else(|| panic!("no number of {unit} in \"{line}\""))
    }

    /// Returns the impedance drawn from an input of the amplifier to `place`: R2, with the
    /// capacitor where it is in parallel, at `hertz`.
    fn across(&self, place: &str, r2: f64, hertz: f64) -> Complex {
        let ends_there = |line: &&str| {
            let after = line.split_once("R2").and_then(|(_, after)| after.split_once("──"));
            after.is_some_and(|(_, end)| end.trim_start().starts_with(place))
        };
        let line = self.0.lines().find(ends_there).expect("a drawing");
        let farads = if line.contains("R2 ∥") { self.value("R2 ∥", "pF") * 1e-12 } else { 0.0 };
        Complex(r2, 0.0).over(Complex(1.0, std::f64::consts::TAU * hertz * r2 * farads))
    }

    /// The gains from the switch and from half to the set value.
    fn gains(&self, r1: f64, r2: f64, hertz: f64) -> [Complex; 2] {
        let (to_ground, back) = (self.across("ground", r2, hertz), self.across("set value", r2, hertz));
        let inverting = back.times(-1.0 / r1);
        let divided = to_ground.over(to_ground.plus(r1));
        [divided.of(back.times(1.0 / r1).plus(1.0)), inverting]
    }
}

/// The ideal amplifier's two equations, from the drawing and the values of the page.
#[test]
fn the_analogue_stage_does_what_its_text_says() {
    let page = page();
    let (_, after) = page.split_once("### The analogue stage").expect("its section");
    let stage = Stage(after.split("\n## ").next().unwrap_or_default().to_string());
    let r1 = 1e3 * stage.value("R1, R2", "kΩ and");
    let farads = 1e-12 * stage.value("R2 ∥", "pF");
    for (rail, r2) in
        [(3.0, stage.value("R1, R2", "kΩ for 3.0 V")), (3.3, stage.value("R1, R2", "kΩ for 3.3 V"))]
    {
        let r2 = 1e3 * r2;
        let size = |Complex(re, im): Complex| re.hypot(im);
        let [gain, inverse] = stage.gains(r1, r2, 0.0).map(|gain| gain.0);
        let full = rail / 2.0 * gain;
        assert!((9.9..=10.0).contains(&full), "{full} V at full scale");
        assert!((gain + inverse).abs() < 1e-9, "half and PA4 cancel: {gain}, {inverse}");
        // As far below and above the corner as the converter's steps and the motor's edges are.
        for hertz in [1e3, 1e4, 1e5, 1e6] {
            let [plus, minus] = stage.gains(r1, r2, hertz);
            let common = Complex(plus.0 + minus.0, plus.1 + minus.1);
            assert!(size(common) < 0.01, "{hertz} Hz: what both have in common passes with {}", size(common));
            let low = size(plus) / gain;
            let wanted = 1.0 / (1.0 + (std::f64::consts::TAU * hertz * r2 * farads).powi(2)).sqrt();
            assert!((low - wanted).abs() < 0.01, "{hertz} Hz: {low} of the gain, not {wanted}");
        }
        // DS8626: a pin leaks 1 µA at most.
        let leaked = 1e-6 * stage.value("| switch |", "Ω:") * gain;
        let followers = 2.0 * 1e-3 * stage.value("| followers |", "mV at most") * gain;
        let amplifier = 1e-3 * stage.value("| amplifier |", "mV at most") * (1.0 + gain);
        // Four resistors, each a thousandth off the worst way, on half of the rail.
        let resistors = 4.0 * 1e-3 * gain / (1.0 + gain) * rail / 2.0;
        let zero = leaked + followers + amplifier + resistors;
        println!("| analogue stage on {rail} V | ±{full:.2} V, zero ±{:.0} mV |", 1e3 * zero);
        assert!(zero < 0.1, "{zero} V at the set value while the enable line is low");
    }
    let r2 = 1e3 * stage.value("R1, R2", "kΩ for 3.0 V");
    let (delay, corner) = (1e6 * r2 * farads, 1e-3 / (std::f64::consts::TAU * r2 * farads));
    assert!((stage.value("220 pF across", "µs of delay") - delay).abs() < 0.1, "{delay} µs");
    assert!((stage.value("220 pF across", "kHz") - corner).abs() < 0.1, "{corner} kHz");
    // The monitor: 1.5 V without a current, and 10 V more or less within the rails.
    let [input, up, down] = ["kΩ to the monitor", "kΩ to 3 V", "kΩ to ground"]
        .map(|unit| 1e-3 / stage.value("| monitor of", unit));
    let all = input + up + down;
    assert!((3.0 * up / all - 1.5).abs() < 0.01 && (input / all - 0.15).abs() < 0.001);
}
