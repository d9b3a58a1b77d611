//! The virtual device in the browser: the firmware's own control core on the plant, held by the
//! scripted or a person's hand, behind functions of plain numbers and JSON texts. The page without
//! a server (`cargo xtask site`) runs it in place of the WebSocket; `page/link.js` is the other
//! side and speaks the same messages.
//!
//! The device itself is the crate `device-sim`, as host-sim has it: it gives the same bits here as
//! there, which `cargo xtask test site` checks.
//!
//! The names are exported as they stand, which the language counts as unsafe; there is no other
//! unsafe code.

pub mod simulation;

use simulation::Simulation;
use std::cell::RefCell;

/// Longest text taken from the page, in bytes.
const LONGEST: usize = 4_096;

thread_local! {
    static HEARD: RefCell<Vec<u8>> = RefCell::new(vec![0; LONGEST]);
    static SAID: RefCell<String> = const { RefCell::new(String::new()) };
    static SIMULATION: RefCell<Option<Simulation>> = const { RefCell::new(None) };
}

fn heard(count: u32) -> String {
    HEARD.with_borrow(|heard| String::from_utf8_lossy(&heard[..(count as usize).min(LONGEST)]).into_owned())
}

fn say(text: String) -> u32 {
    let count = text.len() as u32;
    SAID.with_borrow_mut(|said| *said = text);
    count
}

/// Returns the address at which the page writes a text: 4,096 bytes.
#[unsafe(no_mangle)]
pub extern "C" fn input() -> usize {
    HEARD.with_borrow(|heard| heard.as_ptr() as usize)
}

/// Returns the address of the last text for the page.
#[unsafe(no_mangle)]
pub extern "C" fn said() -> usize {
    SAID.with_borrow(|said| said.as_ptr() as usize)
}

/// Starts the device with the built-in profile whose name is in the first `count` bytes of
/// [`input`]; the length of what is said: nothing where it started, else why not.
#[unsafe(no_mangle)]
pub extern "C" fn start(count: u32) -> u32 {
    match Simulation::new(&heard(count)) {
        Ok(new) => {
            SIMULATION.with_borrow_mut(|simulation| *simulation = Some(new));
            say(String::new())
        }
        Err(error) => say(error.to_string()),
    }
}

/// Moves time on by at least `ticks` ticks of 100 µs.
#[unsafe(no_mangle)]
pub extern "C" fn advance(ticks: u32) {
    SIMULATION.with_borrow_mut(|simulation| {
        if let Some(simulation) = simulation {
            simulation.advance(u64::from(ticks));
        }
    });
}

/// Takes a message of the page; the length of what is said: nothing, or what is wrong with it.
#[unsafe(no_mangle)]
pub extern "C" fn receive(count: u32) -> u32 {
    let text = heard(count);
    let done =
        SIMULATION.with_borrow_mut(|simulation| simulation.as_mut().map_or(Ok(()), |s| s.receive(&text)));
    say(done.err().unwrap_or_default())
}

/// All messages since the last call, one a line; their length.
#[unsafe(no_mangle)]
pub extern "C" fn tell() -> u32 {
    say(SIMULATION
        .with_borrow_mut(|simulation| simulation.as_mut().map_or_else(String::new, Simulation::tell)))
}

/// A hash of every byte that the device has sent over its link.
#[unsafe(no_mangle)]
pub extern "C" fn digest() -> u64 {
    SIMULATION.with_borrow(|simulation| simulation.as_ref().map_or(0, Simulation::digest))
}
