//! The update over USB with the bootloader that the microcontroller has in ROM: USB DFU 1.1 with
//! ST's extension, as AN3156 has it. The page carries the transfers out; which comes next is
//! decided here.

pub mod file;
pub mod layout;

use device_setup::pause::pause;
use device_sim::error::Error;
use file::Image;
use layout::Layout;
use serde::Serialize;
use std::cell::RefCell;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

/// Bytes of a block (AN3156: 2 to 2,048).
pub const BLOCK: usize = 2_048;
/// The first block of data. A block's place is the address and its number past this one times *its
/// own* length (AN3156 4.1, 5.1), so that all blocks have to be as long as each other.
const FIRST_BLOCK: u16 = 2;
/// Requests (USB DFU 1.1, table 3.2).
const DNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
const GETSTATUS: u8 = 3;
const CLRSTATUS: u8 = 4;
const ABORT: u8 = 6;
/// Bytes of an answer to [`GETSTATUS`].
const STATUS_BYTES: u16 = 6;
/// States (USB DFU 1.1, 6.1.2).
const IDLE: u8 = 2;
const DOWNLOAD_BUSY: u8 = 4;
const DOWNLOAD_IDLE: u8 = 5;
const MANIFEST: u8 = 7;
const ERROR: u8 = 10;
/// ST's commands, in a download of block 0 (AN3156 5.2, 5.3).
const SET_ADDRESS: u8 = 0x21;
const ERASE: u8 = 0x41;
/// Looks at a busy bootloader before it is given up: an erasure takes 2 s, and it says how long to
/// wait.
const LOOKS: u32 = 200;

/// The next thing that the page does.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Next {
    /// A control transfer of class and interface to the bootloader.
    Out {
        /// `bRequest`.
        request: u8,
        /// `wValue`.
        value: u16,
        /// The data.
        data: Vec<u8>,
    },
    /// The same from it.
    In {
        /// `bRequest`.
        request: u8,
        /// `wValue`.
        value: u16,
        /// `wLength`.
        length: u16,
    },
    /// Wait.
    Wait {
        /// So long.
        ms: u32,
    },
    /// The new image is in flash and has been started.
    Done,
    /// It ended before, for this reason.
    Failed {
        /// One sentence.
        why: String,
    },
}

type Dialogue = Pin<Box<dyn Future<Output = Result<(), Error>>>>;

/// An update that is under way.
pub struct Update {
    usb: Usb,
    dialogue: Dialogue,
}

impl Update {
    /// Prepares to write `file`, a DfuSe file, to a bootloader that describes its memory as
    /// `memory`. Refuses what does not fit before anything is erased.
    pub fn new(file: &[u8], memory: &str) -> Result<Self, Error> {
        let image = Image::parse(file)?.in_blocks_of(BLOCK);
        let layout = Layout::parse(memory)?;
        let sectors = layout.sectors_of(&image)?;
        let usb = Usb::default();
        let dialogue = Box::pin(update(usb.clone(), image, sectors));
        Ok(Self { usb, dialogue })
    }

    /// Returns what to do next. An [`Next::Out`], [`Next::In`] or [`Next::Wait`] is answered before
    /// the next call.
    pub fn advance(&mut self) -> Next {
        match self.dialogue.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(Ok(())) => Next::Done,
            Poll::Ready(Err(error)) => Next::Failed { why: error.to_string() },
            Poll::Pending => self.usb.0.borrow_mut().asked.take().unwrap_or(Next::Wait { ms: 1 }),
        }
    }

    /// The result of the transfer: the bytes of an [`Next::In`], or why it failed.
    pub fn answer(&mut self, answer: Result<Vec<u8>, String>) {
        self.usb.0.borrow_mut().answer = Some(answer);
    }

    /// Returns what is being done, and the share of it that is done, 0 to 1.
    pub fn progress(&self) -> (&'static str, f64) {
        self.usb.0.borrow().progress
    }
}

/// The way to the bootloader.
#[derive(Clone, Default)]
struct Usb(Rc<RefCell<Exchange>>);

#[derive(Default)]
struct Exchange {
    asked: Option<Next>,
    answer: Option<Result<Vec<u8>, String>>,
    progress: (&'static str, f64),
}

/// Erases the sectors, writes the image, reads it back, and starts it.
async fn update(usb: Usb, image: Image, sectors: Vec<u32>) -> Result<(), Error> {
    usb.to_idle().await?;
    for (done, address) in sectors.iter().enumerate() {
        usb.shows("erasing", done, sectors.len());
        usb.command(ERASE, *address).await?;
    }
    let total = image.bytes.len().div_ceil(BLOCK);
    let blocks = || image.bytes.chunks(BLOCK).zip(FIRST_BLOCK..).enumerate();
    usb.command(SET_ADDRESS, image.start).await?;
    for (done, (bytes, block)) in blocks() {
        usb.shows("writing", done, total);
        usb.download(block, bytes.to_vec()).await?;
    }
    usb.to_idle().await?;
    usb.command(SET_ADDRESS, image.start).await?;
    usb.to_idle().await?;
    for (done, (bytes, block)) in blocks() {
        usb.shows("reading back", done, total);
        if usb.upload(block).await? != bytes {
            let at = image.start as usize + done * BLOCK;
            return Err(Error::failed(format_args!(
                "the flash at {at:#010x} does not hold what was written to it; update again, and replace the board if it stays so"
            )));
        }
    }
    usb.to_idle().await?;
    usb.shows("starting", 1, 1);
    usb.command(SET_ADDRESS, image.start).await?;
    usb.leave().await
}

impl Usb {
    fn shows(&self, what: &'static str, done: usize, total: usize) {
        self.0.borrow_mut().progress = (what, done as f64 / total.max(1) as f64);
    }

    async fn transfer(&self, next: Next) -> Result<Vec<u8>, Error> {
        self.0.borrow_mut().asked = Some(next);
        loop {
            pause().await;
            if let Some(answer) = self.0.borrow_mut().answer.take() {
                return answer.map_err(|why| {
                    Error::failed(format_args!(
                        "the bootloader did not answer ({why}); plug it in again in its DFU mode and update again"
                    ))
                });
            }
        }
    }

    async fn out(&self, request: u8, value: u16, data: Vec<u8>) -> Result<(), Error> {
        self.transfer(Next::Out { request, value, data }).await.map(drop)
    }

    /// Its status (USB DFU 1.1, 6.1.2): status, how long to wait in ms, state.
    async fn status(&self) -> Result<(u8, u32, u8), Error> {
        let next = Next::In { request: GETSTATUS, value: 0, length: STATUS_BYTES };
        match self.transfer(next).await?[..] {
            [status, low, middle, high, state, _] => {
                Ok((status, u32::from_le_bytes([low, middle, high, 0]), state))
            }
            _ => Err(Error::failed("the bootloader's status is not six bytes; this is no STM32 in DFU mode")),
        }
    }

    /// Brings it to dfuIDLE from wherever an earlier update left it.
    async fn to_idle(&self) -> Result<(), Error> {
        let (_, _, state) = self.status().await?;
        match state {
            IDLE => return Ok(()),
            ERROR => self.out(CLRSTATUS, 0, Vec::new()).await?,
            _ => self.out(ABORT, 0, Vec::new()).await?,
        }
        match self.status().await? {
            (_, _, IDLE) => Ok(()),
            (_, _, state) => Err(Error::failed(format_args!(
                "the bootloader stays in state {state}; plug it in again in its DFU mode and update again"
            ))),
        }
    }

    async fn command(&self, command: u8, address: u32) -> Result<(), Error> {
        let mut data = vec![command];
        data.extend(address.to_le_bytes());
        self.download(0, data).await
    }

    /// Gives it a block and waits until it has done what that asks for: the first look starts it
    /// (AN3156 5).
    async fn download(&self, block: u16, data: Vec<u8>) -> Result<(), Error> {
        self.out(DNLOAD, block, data).await?;
        for _ in 0..LOOKS {
            match self.status().await? {
                (_, ms, DOWNLOAD_BUSY) => self.transfer(Next::Wait { ms }).await.map(drop)?,
                (_, _, DOWNLOAD_IDLE) => return Ok(()),
                (status, _, _) => {
                    self.out(CLRSTATUS, 0, Vec::new()).await?;
                    return Err(Error::failed(format_args!(
                        "the bootloader refused a block: {}; update again",
                        reason(status)
                    )));
                }
            }
        }
        Err(Error::failed("the bootloader stays busy; plug it in again in its DFU mode and update again"))
    }

    async fn upload(&self, block: u16) -> Result<Vec<u8>, Error> {
        self.transfer(Next::In { request: UPLOAD, value: block, length: BLOCK as u16 }).await
    }

    /// An empty block ends the update; the bootloader goes to the image with the look that follows
    /// (AN3156 5.5), and is gone from the bus.
    async fn leave(&self) -> Result<(), Error> {
        self.out(DNLOAD, FIRST_BLOCK, Vec::new()).await?;
        match self.status().await {
            Ok((_, _, MANIFEST)) | Err(_) => Ok(()),
            Ok((status, _, _)) => Err(Error::failed(format_args!(
                "the image was written and the bootloader does not start it: {}; reset the board",
                reason(status)
            ))),
        }
    }
}

/// A status in words (USB DFU 1.1, 6.1.2, as AN3156 uses it).
fn reason(status: u8) -> String {
    match status {
        1 => "the address is not in its memory (errTARGET)".into(),
        2 => "the image is for another device (errFILE)".into(),
        3 => "it could not write (errWRITE)".into(),
        4 => "it could not erase (errERASE)".into(),
        8 => "the address is not one that it may write (errADDRESS)".into(),
        11 => "the flash is protected (errVENDOR)".into(),
        other => format!("status {other}"),
    }
}
