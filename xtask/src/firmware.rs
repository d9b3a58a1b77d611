//! Builds the flash image and says what it takes.

use crate::elf::Elf;
use crate::setup::{self, TARGET};
use crate::shell::{self, Failure};
use crate::stack;
use std::path::{Path, PathBuf};

/// More is refused: 192 KiB, the project's own bound.
const LARGEST_FLASH: u32 = 192 * 1024;
/// Where the microcontroller has its memories.
const RAM: std::ops::Range<u32> = 0x2000_0000..0x2002_0000;

/// Where the image lies once it is built.
pub(crate) fn path() -> PathBuf {
    shell::target().join(TARGET).join("firmware/firmware")
}

/// Builds the image; its path.
pub(crate) fn build() -> Result<PathBuf, Failure> {
    let toolchain = setup::toolchain()?;
    let mut cargo = setup::cargo_for_board(toolchain, "build");
    shell::run(cargo.args(["-p", "firmware", "--profile", "firmware", "--target", TARGET]))?;
    Ok(path())
}

/// Prints path, flash, RAM and worst stack use; refuses an image that is too large or whose stack may not suffice.
pub(crate) fn report(path: &Path) -> Result<(), Failure> {
    let elf = Elf::read(path)?;
    let (_, image) = elf.flash_image()?;
    let flash = image.len() as u32;
    let in_ram = |address: &u32| RAM.contains(address);
    let ram: u32 = elf.segments()?.iter().filter(|s| in_ram(&s.address)).map(|s| s.memory_size).sum();
    let stack = stack::analyse(&elf)?;
    println!("image {}", path.display());
    println!("flash {flash} bytes of {LARGEST_FLASH}");
    println!(
        "RAM   {ram} bytes of {} (variables; the stack has the core-coupled RAM to itself)",
        RAM.end - RAM.start
    );
    print!("{stack}");
    if flash > LARGEST_FLASH {
        return Err(Failure::new(format!(
            "the image takes {flash} bytes of flash and may take {LARGEST_FLASH}; make it smaller"
        )));
    }
    if stack.worst() > stack.room {
        return Err(Failure::new(format!(
            "the stack may need {} bytes and has {}; make it larger in memory.x",
            stack.worst(),
            stack.room
        )));
    }
    Ok(())
}
