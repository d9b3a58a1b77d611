//! A real board in the browser, over WebSerial and WebUSB, behind functions of plain numbers, bytes
//! and JSON texts. `page/` is the other side: it opens ports, carries bytes and shows what it
//! receives, and decides nothing.
//!
//! The names are exported unmangled, which the language counts as unsafe; there is no other unsafe
//! code.

pub mod dfu;
pub mod session;
pub mod view;
pub mod work;

use device_sim::page::guide::GuideAnswer;
use dfu::Update;
use session::Session;
use std::cell::RefCell;
use std::time::Duration;
use work::Task;

thread_local! {
    static HEARD: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static SAID: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static SESSION: RefCell<Session> = RefCell::default();
    static UPDATE: RefCell<Option<Update>> = const { RefCell::new(None) };
}

fn heard<T>(count: u32, then: impl FnOnce(&[u8]) -> T) -> T {
    HEARD.with_borrow(|heard| then(&heard[..(count as usize).min(heard.len())]))
}

fn say(bytes: &[u8]) -> u32 {
    SAID.with_borrow_mut(|said| {
        said.clear();
        said.extend(bytes);
        said.len() as u32
    })
}

fn say_error(done: Result<(), String>) -> u32 {
    say(done.err().unwrap_or_default().as_bytes())
}

fn time(now_ms: f64) -> Duration {
    Duration::try_from_secs_f64(now_ms * 1e-3).unwrap_or_default()
}

/// Makes room for `count` bytes of the page. Returns their address.
#[unsafe(no_mangle)]
pub extern "C" fn board_input(count: u32) -> usize {
    HEARD.with_borrow_mut(|heard| {
        heard.resize(count as usize, 0);
        heard.as_ptr() as usize
    })
}

/// Returns the address of what was said last.
#[unsafe(no_mangle)]
pub extern "C" fn board_said() -> usize {
    SAID.with_borrow(|said| said.as_ptr() as usize)
}

/// A port was opened, or closed: whatever belonged to the one before is forgotten.
#[unsafe(no_mangle)]
pub extern "C" fn board_reset() {
    SESSION.replace(Session::default());
}

/// Takes `count` bytes of the port, `now_ms` after it was opened. Returns the length of the bytes
/// to send.
#[unsafe(no_mangle)]
pub extern "C" fn board_exchange(count: u32, now_ms: f64) -> u32 {
    SESSION.with_borrow_mut(|session| heard(count, |bytes| say(session.exchange(time(now_ms), bytes))))
}

/// Returns the length of the messages for the page, one JSON text a line.
#[unsafe(no_mangle)]
pub extern "C" fn board_tell(now_ms: f64) -> u32 {
    SESSION.with_borrow(|session| say(session.tell(time(now_ms)).as_bytes()))
}

/// A person has pressed Stop.
#[unsafe(no_mangle)]
pub extern "C" fn board_stop() {
    SESSION.with_borrow_mut(Session::stop);
}

/// A person has looked at the device, and clears its fault.
#[unsafe(no_mangle)]
pub extern "C" fn board_clear() {
    SESSION.with_borrow_mut(Session::clear);
}

/// Begins the task in `count` bytes of JSON. Returns the length of why not, or 0.
#[unsafe(no_mangle)]
pub extern "C" fn board_begin(count: u32) -> u32 {
    let task = heard(count, |bytes| serde_json::from_slice::<Task>(bytes));
    let done = task.map_err(|why| why.to_string()).and_then(|task| {
        SESSION.with_borrow_mut(|session| session.begin(task)).map_err(|error| error.to_string())
    });
    say_error(done)
}

/// Takes the guide's answer in `count` bytes of JSON. Returns the length of what is wrong with it,
/// or 0.
#[unsafe(no_mangle)]
pub extern "C" fn board_answer(count: u32) -> u32 {
    let answer = heard(count, |bytes| serde_json::from_slice::<GuideAnswer>(bytes));
    let done = answer.map(|answer| SESSION.with_borrow_mut(|session| session.answer(answer)));
    say_error(done.map_err(|why| why.to_string()))
}

/// Returns the length of the device's part as a file, or 0 before a work has ended well.
#[unsafe(no_mangle)]
pub extern "C" fn board_file() -> u32 {
    SESSION.with_borrow(|session| say(session.file().unwrap_or_default().as_bytes()))
}

/// Prepares an update: `count` bytes are the name of the bootloader's interface, a zero, and the
/// DfuSe file. Returns the length of why not, or 0.
#[unsafe(no_mangle)]
pub extern "C" fn dfu_begin(count: u32) -> u32 {
    let update = heard(count, |bytes| {
        let (memory, file) = bytes.split_at(bytes.iter().position(|byte| *byte == 0).unwrap_or(0));
        Update::new(file.get(1..).unwrap_or_default(), &String::from_utf8_lossy(memory))
    });
    say_error(
        update
            .map(|update| {
                UPDATE.replace(Some(update));
            })
            .map_err(|error| error.to_string()),
    )
}

/// Returns the length of what to do next, as JSON, with its progress.
#[unsafe(no_mangle)]
pub extern "C" fn dfu_next() -> u32 {
    UPDATE.with_borrow_mut(|update| {
        let Some(update) = update else { return say(b"") };
        let next = update.advance();
        let (doing, share) = update.progress();
        say(serde_json::json!({ "next": next, "doing": doing, "share": share }).to_string().as_bytes())
    })
}

/// The transfer was carried out; `count` bytes came.
#[unsafe(no_mangle)]
pub extern "C" fn dfu_answer(count: u32) {
    let bytes = heard(count, <[u8]>::to_vec);
    UPDATE.with_borrow_mut(|update| {
        update.as_mut().into_iter().for_each(|update| update.answer(Ok(bytes.clone())))
    });
}

/// The transfer failed; `count` bytes say why.
#[unsafe(no_mangle)]
pub extern "C" fn dfu_failed(count: u32) {
    let why = heard(count, |bytes| String::from_utf8_lossy(bytes).into_owned());
    UPDATE.with_borrow_mut(|update| {
        update.as_mut().into_iter().for_each(|update| update.answer(Err(why.clone())))
    });
}
