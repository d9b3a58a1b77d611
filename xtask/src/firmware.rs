//! Builds the flash image and says what it takes.

use crate::boards::{self, Board};
use crate::elf::Elf;
use crate::setup::{self, TARGET};
use crate::shell::{self, Error};
use crate::stack;
use std::fs;
use std::path::{Path, PathBuf};

/// More is refused: 192 KiB, the project's own bound.
const LARGEST_FLASH: u32 = 192 * 1024;

/// Returns the path of the built image: the default board's is where cargo leaves it.
pub(crate) fn path(board: &Board) -> PathBuf {
    let name = if board.is_default() { "firmware" } else { board.name };
    shell::target().join(TARGET).join("firmware").join(name)
}

/// The arguments by which cargo builds something of the firmware for the board.
pub(crate) fn arguments(board: &Board) -> [&str; 9] {
    [
        "-p",
        "firmware",
        "--profile",
        "firmware",
        "--target",
        TARGET,
        "--no-default-features",
        "--features",
        board.name,
    ]
}

/// Builds the image; its path.
pub(crate) fn build(board: &Board) -> Result<PathBuf, Error> {
    let cargo = || shell::run(setup::cargo_for_board(setup::toolchain()?, "build").args(arguments(board)));
    let image = path(board);
    if board.is_default() {
        cargo()?;
        return Ok(image);
    }
    // Cargo gives the images of all boards one name, which stays the default board's.
    let of_cargo = path(boards::DEFAULT);
    let aside = of_cargo.with_extension("aside");
    let is_aside = fs::rename(&of_cargo, &aside).is_ok();
    let built = cargo().and_then(|()| moved(&of_cargo, &image));
    if is_aside {
        moved(&aside, &of_cargo)?;
    }
    built.map(|()| image)
}

fn moved(from: &Path, to: &Path) -> Result<(), Error> {
    fs::rename(from, to).map_err(|error| {
        Error::new(format!("{} cannot be moved to {}: {error}", from.display(), to.display()))
    })
}

/// Prints path, flash, RAM and worst stack use; refuses an image that is too large or whose stack
/// may not suffice.
pub(crate) fn report(board: &Board, path: &Path) -> Result<(), Error> {
    let elf = Elf::read(path)?;
    let (_, image) = elf.flash_image()?;
    let flash = image.len() as u32;
    let in_ram = |address: &u32| board.ram.contains(address);
    let ram: u32 = elf.segments()?.iter().filter(|s| in_ram(&s.address)).map(|s| s.memory_size).sum();
    let stack = stack::analyse(&elf)?;
    println!("image {} for the {}", path.display(), board.title);
    println!("flash {flash} bytes of {LARGEST_FLASH}");
    println!(
        "RAM   {ram} bytes of {} (variables; the stack has the core-coupled RAM to itself)",
        board.ram.len()
    );
    print!("{stack}");
    if flash > LARGEST_FLASH {
        return Err(Error::new(format!(
            "the image takes {flash} bytes of flash and may take {LARGEST_FLASH}; make it smaller"
        )));
    }
    if stack.worst() > stack.room {
        return Err(Error::new(format!(
            "the stack may need {} bytes and has {}; make it larger in the board's memory.x",
            stack.worst(),
            stack.room
        )));
    }
    Ok(())
}
