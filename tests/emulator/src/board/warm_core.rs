//! Cores that have run before: what the emulator once translated of an image serves every later
//! board with that image.
//!
//! Four fifths of the time of a short test went into translating thousands of blocks of the image
//! anew. A core's state can be loaded into a core that has run, and what it translated stays
//! (`Processor::load`); memory is mapped anew for each board. The emulator's own reset drops what
//! was translated, so a reset is a load here, too.

use rigless::device::Level;
use rigless::emulator::{CoreBus, Error, Exit, InterruptLine, Processor, Queued};
use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut, Range};
use std::sync::{Mutex, PoisonError};

/// The part's memory that programs write to: what was translated of it is of the board that ran
/// (RM0090 2.3).
const RAM: [Range<u64>; 2] = [0x1000_0000..0x1001_0000, 0x2000_0000..0x2003_0000];
/// The part's flash, at its address and where it begins the address space.
const CODE: [Range<u64>; 2] = [0x0000_0000..0x0020_0000, 0x0800_0000..0x0820_0000];

/// The image that a core has translated: a hash of its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ImageKey(u64);

impl ImageKey {
    pub(super) fn of(bytes: &[u8]) -> Self {
        use std::hash::{DefaultHasher, Hasher};
        let mut hash = DefaultHasher::new();
        hash.write(bytes);
        Self(hash.finish())
    }

    /// The same where the emulator wants a longer hash.
    pub(super) fn digest(self) -> [u8; 32] {
        let mut digest = [0; 32];
        digest[..8].copy_from_slice(&self.0.to_le_bytes());
        digest
    }
}

static IDLE: Mutex<BTreeMap<ImageKey, Vec<Core>>> = Mutex::new(BTreeMap::new());

/// A core with what it takes to begin again.
#[derive(Debug)]
struct Core {
    processor: Box<dyn Processor>,
    /// Its state before it ran.
    fresh: Vec<u8>,
    /// Memory that it is mapped to while no board runs.
    parking: Parking,
}

/// A core on loan to a board; dropped, it waits for the next board with the same image.
#[derive(Debug)]
pub(super) struct WarmCore {
    core: Option<Core>,
    image: ImageKey,
    /// The board's requests that outlive its state.
    routed: Vec<u64>,
    breakpoints: Vec<u64>,
    mapped: Vec<(u64, u64)>,
    /// The interrupt lines that are high, which a reset of the core does not change.
    high: Vec<InterruptLine>,
    has_run: bool,
    /// True if code in flash was written over since, so that its translations may be of another
    /// image.
    is_tainted: bool,
}

impl WarmCore {
    /// A core that has run the image before if one is idle, otherwise one that `make` makes.
    ///
    /// # Errors
    ///
    /// If `make` fails.
    pub(super) fn lend(
        image: ImageKey,
        make: impl FnOnce() -> Result<Box<dyn Processor>, Error>,
    ) -> Result<Self, Error> {
        let idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner).get_mut(&image).and_then(Vec::pop);
        let core = match idle {
            Some(mut core) => {
                core.processor.load(&core.fresh)?;
                core
            }
            None => {
                let processor = make()?;
                let fresh = processor.save();
                Core { processor, fresh, parking: Parking::default() }
            }
        };
        Ok(Self {
            core: Some(core),
            image,
            routed: Vec::new(),
            breakpoints: Vec::new(),
            mapped: Vec::new(),
            high: Vec::new(),
            has_run: false,
            is_tainted: false,
        })
    }

    /// Runs it, as [`Processor::run`].
    pub(super) fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        self.has_run = true;
        self.deref_mut().run(budget, bus)
    }

    /// Resets it, and keeps what it translated unless code was written over. Its count of retired
    /// instructions begins again then: the answer is where it stood, and 0 if it goes on.
    pub(super) fn reset(&mut self) -> u64 {
        let is_tainted = self.is_tainted;
        let core = self.core.as_mut().expect("lent until it is dropped");
        let retired = core.processor.retired();
        if is_tainted || core.processor.load(&core.fresh).is_err() {
            core.processor.reset();
            return 0;
        }
        core.processor.take_reset_request();
        for line in &self.high {
            core.processor.ask(Queued::Line(*line, Level::High));
        }
        retired
    }

    /// Asks the core, as [`Processor::ask`], unless it need not know.
    pub(super) fn ask(&mut self, queued: Queued) {
        if self.must_know(queued) {
            self.deref_mut().ask(queued);
        }
    }

    /// Notes what a board asks of the core. False if it is the image on its way to the flash,
    /// before the first instruction: the core has run the same one.
    pub(super) fn must_know(&mut self, queued: Queued) -> bool {
        match queued {
            Queued::Route(page) => self.routed.push(page),
            Queued::Invalidate(from, to) if CODE.iter().any(|code| from < code.end && code.start < to) => {
                self.is_tainted |= self.has_run;
                return self.has_run;
            }
            Queued::Line(line, level) => {
                self.high.retain(|high| *high != line);
                self.high.extend((level == Level::High).then_some(line));
            }
            Queued::Invalidate(..) | Queued::Unroute(_) | Queued::Return => {}
        }
        true
    }

    /// The interrupt lines that are high, as bytes: a board that starts from another's state has to
    /// know them.
    pub(super) fn save_lines(&self) -> Vec<u8> {
        let indices = self.high.iter().map(|line| line.index());
        std::iter::once(self.high.len() as u16).chain(indices).flat_map(u16::to_le_bytes).collect()
    }

    /// Takes what [`Self::save_lines`] made from the front of `bytes`, and returns the rest.
    pub(super) fn load_lines<'a>(&mut self, bytes: &'a [u8]) -> Option<&'a [u8]> {
        let (count, rest) = bytes.split_first_chunk()?;
        let (lines, rest) = rest.split_at_checked(2 * usize::from(u16::from_le_bytes(*count)))?;
        let indices = lines.chunks_exact(2).map(|index| u16::from_le_bytes([index[0], index[1]]));
        self.high = indices.map(InterruptLine::new).collect::<Option<_>>()?;
        Some(rest)
    }

    pub(super) fn add_breakpoint(&mut self, address: u64) -> bool {
        let is_there = self.deref_mut().add_breakpoint(address);
        self.breakpoints.extend(is_there.then_some(address));
        is_there
    }

    pub(super) fn remove_breakpoint(&mut self, address: u64) {
        if let Some(at) = self.breakpoints.iter().position(|one| *one == address) {
            self.breakpoints.swap_remove(at);
        }
        self.deref_mut().remove_breakpoint(address);
    }

    /// Maps memory, as [`Processor::map`].
    ///
    /// # Safety
    ///
    /// As there, until this is dropped.
    #[allow(unsafe_code, reason = "hands on what the runner promised")]
    pub(super) unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        self.mapped.push((start, length));
        // SAFETY: the caller's promise; `park` maps the pages elsewhere before it ends.
        unsafe { self.deref_mut().map(start, length, host, writable) }
    }
}

impl Deref for WarmCore {
    type Target = dyn Processor;

    fn deref(&self) -> &Self::Target {
        &*self.core.as_ref().expect("lent until it is dropped").processor
    }
}

impl DerefMut for WarmCore {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut *self.core.as_mut().expect("lent until it is dropped").processor
    }
}

impl Drop for WarmCore {
    fn drop(&mut self) {
        let Some(mut core) = self.core.take() else { return };
        if self.is_tainted || std::thread::panicking() {
            return;
        }
        let processor = &mut *core.processor;
        for address in self.breakpoints.drain(..) {
            processor.remove_breakpoint(address);
        }
        for page in self.routed.drain(..) {
            processor.ask(Queued::Unroute(page));
        }
        for Range { start, end } in RAM {
            processor.ask(Queued::Invalidate(start, end));
        }
        processor.take_reset_request();
        core.parking.park(processor, &self.mapped);
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.entry(self.image).or_default().push(core);
    }
}

/// Memory of the size of a part's, that nothing reads.
#[derive(Debug, Default)]
struct Parking(Vec<Page>);

/// The runner's alignment of memory.
#[derive(Debug, Clone)]
#[repr(align(4096))]
struct Page {
    _bytes: [u8; 4096],
}

impl Parking {
    /// Maps what was mapped to memory that lives as long as the core.
    #[allow(unsafe_code, reason = "the emulator's core takes memory by its address")]
    fn park(&mut self, processor: &mut dyn Processor, mapped: &[(u64, u64)]) {
        let pages = |length: u64| usize::try_from(length / 4096).expect("a part's memory fits");
        let most = mapped.iter().map(|(_, length)| pages(*length)).max().unwrap_or_default();
        // Grown once, by the first board; every board of an image has the same memory.
        assert!(self.0.is_empty() || self.0.len() >= most, "mapped memory may not move");
        self.0.resize(most.max(self.0.len()), Page { _bytes: [0; 4096] });
        for (start, length) in mapped {
            // SAFETY: whole pages, aligned as `Page` is, which live as long as the processor that
            // uses them and are not written.
            unsafe { processor.map(*start, *length, self.0.as_mut_ptr().cast(), false) };
        }
    }
}
