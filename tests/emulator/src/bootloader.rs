//! The bootloader that an STM32F407 has in ROM, at the end of a USB cable, with the rules of AN3156
//! and USB DFU 1.1: stricter than silicon where those leave a choice, so that an update that relies
//! on a favour fails here.

use std::ops::{Range, RangeInclusive};

/// The first address of the internal flash.
pub const FLASH: u32 = 0x0800_0000;
/// The name of the interface of the flash, as an F407 says it.
pub const MEMORY: &str = "@Internal Flash  /0x08000000/04*016Kg,01*064Kg,07*128Kg";
/// Bytes of flash.
const FLASH_BYTES: usize = 1 << 20;
/// Bytes that a block may have (AN3156 4.1 and 5.1; AN2662 4.4.1 has the same).
const BLOCK: RangeInclusive<usize> = 2..=2_048;
/// The content of the flash before, everywhere.
pub const OLD: u8 = 0x5A;

/// States (USB DFU 1.1, 6.1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum State {
    Idle = 2,
    DownloadSync = 3,
    DownloadBusy = 4,
    DownloadIdle = 5,
    ManifestSync = 6,
    Manifest = 7,
    UploadIdle = 9,
    Error = 10,
}

/// The job that a download asked for, done at the look that follows.
#[derive(Clone, Debug)]
enum Job {
    SetAddress(u32),
    Erase(u32),
    Write(u32, Vec<u8>),
}

/// The bootloader.
pub struct Bootloader {
    state: State,
    status: u8,
    pointer: u32,
    job: Option<Job>,
    /// Time until the job is done that the other side has not waited yet, in ms.
    busy_ms: u32,
    /// The flash.
    pub flash: Vec<u8>,
    /// A byte of the flash that keeps its value whatever is written.
    pub stuck: Option<usize>,
    /// Neither erases nor writes this sector.
    pub protected: Option<u32>,
    /// Transfers until the cable is pulled.
    pub pulled_after: Option<usize>,
    /// The address at which it has started an image; it is gone from the bus then.
    pub started: Option<u32>,
    /// Transfers that were carried out.
    pub transfers: usize,
}

impl Default for Bootloader {
    fn default() -> Self {
        Self {
            state: State::Idle,
            status: 0,
            pointer: FLASH,
            job: None,
            busy_ms: 0,
            flash: vec![OLD; FLASH_BYTES],
            stuck: None,
            protected: None,
            pulled_after: None,
            started: None,
            transfers: 0,
        }
    }
}

impl Bootloader {
    /// Time passes.
    pub fn wait(&mut self, ms: u32) {
        self.busy_ms = self.busy_ms.saturating_sub(ms);
    }

    /// Plugs it in again: it forgets the commands that it received, but keeps the flash.
    pub fn plug_in_again(&mut self) {
        let flash = std::mem::take(&mut self.flash);
        *self = Self { flash, ..Self::default() };
    }

    /// A control transfer to it.
    pub fn out(&mut self, request: u8, value: u16, data: &[u8]) -> Result<(), String> {
        self.transfer()?;
        match (request, self.state) {
            (1, State::Idle | State::DownloadIdle) if data.is_empty() => self.state = State::ManifestSync,
            (1, State::Idle | State::DownloadIdle) => {
                self.job = Some(self.job_of(value, data)?);
                self.state = State::DownloadSync;
            }
            (4, State::Error) => (self.state, self.status) = (State::Idle, 0),
            (6, State::Idle | State::DownloadIdle | State::UploadIdle) => self.state = State::Idle,
            _ => return self.stall(),
        }
        Ok(())
    }

    /// A control transfer from it.
    pub fn read(&mut self, request: u8, value: u16, length: u16) -> Result<Vec<u8>, String> {
        self.transfer()?;
        match (request, self.state) {
            (3, _) => self.look(),
            (2, State::Idle | State::UploadIdle) if value >= 2 && BLOCK.contains(&usize::from(length)) => {
                self.state = State::UploadIdle;
                let from = (self.address(value, usize::from(length)) - FLASH) as usize;
                Ok(self.flash.get(from..from + usize::from(length)).unwrap_or_default().to_vec())
            }
            _ => self.stall(),
        }
    }

    /// The place of a block: ((wBlockNum − 2) × wTransferSize) + Address_Pointer, "where
    /// wTransferSize is the length of the requested data buffer": of this block, and not of those
    /// before it.
    fn address(&self, block: u16, length: usize) -> u32 {
        self.pointer + (u32::from(block) - 2) * length as u32
    }

    fn transfer(&mut self) -> Result<(), String> {
        let is_pulled = self.pulled_after.is_some_and(|after| self.transfers >= after);
        if is_pulled || self.started.is_some() {
            return Err("the device was disconnected".into());
        }
        self.transfers += 1;
        Ok(())
    }

    fn stall<T>(&mut self) -> Result<T, String> {
        (self.state, self.status) = (State::Error, 15);
        Err("the transfer was stalled".into())
    }

    fn job_of(&mut self, value: u16, data: &[u8]) -> Result<Job, String> {
        match (value, data) {
            (0, [0x21, address @ ..]) => Ok(Job::SetAddress(number(address))),
            (0, [0x41, address @ ..]) if address.len() == 4 => Ok(Job::Erase(number(address))),
            (2.., _) if BLOCK.contains(&data.len()) => {
                Ok(Job::Write(self.address(value, data.len()), data.to_vec()))
            }
            _ => self.stall(),
        }
    }

    /// GETSTATUS: begins what waits, and may come again only once that is done.
    fn look(&mut self) -> Result<Vec<u8>, String> {
        match self.state {
            State::DownloadSync => {
                self.busy_ms = match &self.job {
                    Some(Job::Erase(_)) => 500,
                    _ => 10,
                };
                self.state = State::DownloadBusy;
            }
            State::DownloadBusy if self.busy_ms > 0 => return self.stall(),
            State::DownloadBusy => {
                self.status = self.job.take().map_or(0, |job| self.carry_out(job));
                self.state = if self.status == 0 { State::DownloadIdle } else { State::Error };
            }
            State::ManifestSync => {
                self.state = State::Manifest;
                self.started = Some(self.pointer);
            }
            _ => {}
        }
        let [low, middle, high, _] = self.busy_ms.to_le_bytes();
        Ok(vec![self.status, low, middle, high, self.state as u8, 0])
    }

    /// The status that a job ends with.
    fn carry_out(&mut self, job: Job) -> u8 {
        match job {
            Job::SetAddress(address) if sector_of(address).is_none() => return 1,
            Job::SetAddress(address) => self.pointer = address,
            Job::Erase(address) => match sector_of(address) {
                None => return 1,
                Some(sector) if self.protected == Some(FLASH + sector.start as u32) => return 11,
                Some(sector) => self.flash[sector].fill(0xFF),
            },
            Job::Write(address, data) => return self.write(address, &data),
        }
        0
    }

    /// Flash that is not erased takes nothing.
    fn write(&mut self, address: u32, data: &[u8]) -> u8 {
        let from = address.wrapping_sub(FLASH) as usize;
        let Some(place) = self.flash.get_mut(from..from + data.len()) else { return 1 };
        if place.iter().any(|byte| *byte != 0xFF) {
            return 3;
        }
        place.copy_from_slice(data);
        if let Some(stuck) = self.stuck.filter(|stuck| (from..from + data.len()).contains(stuck)) {
            self.flash[stuck] = OLD;
        }
        0
    }
}

/// The sector of the flash that holds an address.
pub fn sector_of(address: u32) -> Option<Range<usize>> {
    let sizes = [16, 16, 16, 16, 64, 128, 128, 128, 128, 128, 128, 128];
    let offset = address.checked_sub(FLASH)? as usize;
    let mut start = 0;
    sizes.into_iter().find_map(|kib| {
        let sector = start..start + (kib << 10);
        start = sector.end;
        sector.contains(&offset).then_some(sector)
    })
}

fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}
