//! Flashes a board: through its debug probe, or over USB with the bootloader that every STM32F407
//! has in ROM.

use crate::boards::{self, Board};
use crate::elf::Elf;
use crate::shell::{self, Error};
use crate::{firmware, setup};
use std::fs;
use std::process::Command;

/// The bootloader's numbers on USB.
const BOOTLOADER: &str = "0483:df11";

/// `cargo xtask flash [--board NAME] [--dfu]`.
pub(crate) fn run(arguments: &[String]) -> Result<(), Error> {
    let (board, rest) = boards::chosen(arguments)?;
    match &rest[..] {
        [] => by_probe(board),
        [flag] if flag == "--dfu" && board.has_dfu => by_usb(board),
        [flag] if flag == "--dfu" => Err(Error::usage(format!(
            "the {} is flashed through the debug probe on it; leave --dfu out",
            board.title
        ))),
        [other, ..] => Err(Error::usage(format!(
            "`{other}` is not understood; `cargo xtask flash` takes only --board NAME and --dfu"
        ))),
    }
}

fn by_probe(board: &Board) -> Result<(), Error> {
    let image = firmware::build(board)?;
    if !shell::is_on_path("probe-rs") {
        return Err(Error::new(
            "flashing needs probe-rs, which is not on the PATH; install it with `cargo install probe-rs-tools --locked`, or \
             flash without a probe with `cargo xtask flash --dfu`",
        ));
    }
    shell::run(Command::new("probe-rs").args(["download", "--chip", board.chip]).arg(&image))?;
    shell::run(Command::new("probe-rs").args(["reset", "--chip", board.chip]))
}

fn by_usb(board: &Board) -> Result<(), Error> {
    let elf = firmware::build(board)?;
    let (start, bytes) = Elf::read(&elf)?.flash_image()?;
    let image = elf.with_extension("bin");
    fs::write(&image, bytes)
        .map_err(|error| Error::new(format!("{} cannot be written: {error}", image.display())))?;
    println!(
        "Flashing over USB, without a probe (torque is off as long as the bootloader runs):\n\
         1. connect BOOT0 to VDD (two pins side by side on header P2) and press the black reset button;\n\
         2. connect the micro-USB connector CN5 to this PC;\n\
         3. this command writes {} ({start:#010x});\n\
         4. take the connection off again and press reset.",
        image.display()
    );
    if !shell::is_on_path("dfu-util") {
        setup::install(&["dfu-util"], "flashing over USB")?;
    }
    let place = format!("{start:#010x}:leave");
    shell::run(Command::new("dfu-util").args(["-a", "0", "-d", BOOTLOADER, "-s", &place, "-D"]).arg(&image))
        .map_err(|_| {
            Error::new("dfu-util did not reach the bootloader; check the BOOT0 connection, the cable and step 1, and run it again")
        })
}
