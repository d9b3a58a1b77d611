//! The ultrasound picture: a B-mode image of the section under a linear probe, in real time.
//!
//! Layers and a vessel come as triangles, the needle as a line; out comes an image of brightness
//! and how much of the needle lies in the beam. Echoes of interfaces, `((Z₂ − Z₁)/(Z₂ + Z₁))²`,
//! attenuation `10^(−α·f·d/20)` there and back, speckle from scatterers convolved with the pulse
//! and the beam, envelope, logarithmic compression. The beam has a thickness: what lies beside its
//! plane fades, and so the needle is lost that leaves it.
//!
//! It knows no tissue model, no device and no page. Lengths are in mm, frequencies in MHz; x and y
//! lie along the skin, z into the body.

#![forbid(unsafe_code)]

pub mod imager;
mod line;
pub mod medium;
pub mod plane;
pub mod probe;
mod pulse;
pub mod scene;
pub mod score;
mod speckle;

pub use imager::{Imager, Look};
pub use medium::Medium;
pub use plane::Mesh;
pub use probe::{Probe, Shaft};
pub use scene::{LINES, SAMPLES, Scene};
pub use score::{InPlane, InPlaneScore};
