//! The boards, a folder each, chosen by a feature of the crate of the same name (`build.rs` refuses
//! none and two). A folder says which pin does what, where the clock comes from and what its
//! ceilings are, and holds the board's `memory.x` where that is not the one at the top of the
//! repository. Only the folders name pins.

#[cfg(feature = "discovery")]
mod discovery;
#[cfg(feature = "discovery")]
pub(crate) use discovery::Discovery as Wires;

#[cfg(feature = "nucleo-f429zi")]
mod nucleo_f429zi;
#[cfg(feature = "nucleo-f429zi")]
pub(crate) use nucleo_f429zi::NucleoF429zi as Wires;

/// The board of this image.
pub(crate) type Current = crate::chip::Stm32F4<Wires>;
