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
    build_by(board, || {
        shell::run(setup::cargo_for_board(setup::toolchain()?, "build").args(arguments(board)))
    })
}

/// Builds the image, and the board's own test next to it, as `IMAGE-own-test`.
pub(crate) fn build_with_own_test(board: &Board) -> Result<(), Error> {
    let mut messages = String::new();
    let image = build_by(board, || {
        let mut cargo = setup::cargo_for_board(setup::toolchain()?, "build");
        cargo.args(arguments(board)).args(["--bin", "firmware", "--test", "board"]);
        messages = shell::output(cargo.args(["--quiet", "--message-format", "json-render-diagnostics"]))?;
        Ok(())
    })?;
    // Cargo gives it a name with a hash, and says which.
    let programs = messages.lines().filter_map(|line| line.split_once("\"executable\":\""));
    let mut programs = programs.filter_map(|(_, rest)| rest.split('"').next());
    let program = programs
        .find(|path| Path::new(path).parent().is_some_and(|folder| folder.ends_with("deps")))
        .ok_or_else(|| Error::new("cargo did not say where it left the board's own test"))?;
    let name = image.file_name().unwrap_or_default().to_string_lossy();
    let own_test = image.with_file_name(format!("{name}-own-test"));
    fs::copy(program, &own_test)
        .map(drop)
        .map_err(|error| Error::new(format!("{program} cannot be copied to {}: {error}", own_test.display())))
}

/// Has `cargo` build the image; its path.
fn build_by(board: &Board, cargo: impl FnOnce() -> Result<(), Error>) -> Result<PathBuf, Error> {
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
