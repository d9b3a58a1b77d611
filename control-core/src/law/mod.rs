//! The laws of force: what the needle feels of the anatomy that it has met. Each is a file with
//! what a person configures, what the tick reads of it (`PreparedJog` and so on), what the tick
//! remembers (`Memory`) and the tick itself; a fourth is one more file and one more line at the end
//! of this one. A law knows no device: [`ForceLimits`] says what it may ask for.

use crate::anatomy::Insertion;
use crate::event::State;
use crate::kinematics::Movement;
use crate::math::truncating_product;
use crate::passivity::Elements;
use crate::refusal::Refusal;
use crate::tissue::{Layer, Wall};
use crate::units::{Millimetres, MillimetresPerSecond, Newtons};
use fixed::types::{I2F30, I16F16};
use serde::{Deserialize, Serialize};

/// The needle's motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion<'a> {
    /// The depth of the tip along the needle.
    pub(crate) depth: Millimetres,
    pub(crate) speed: MillimetresPerSecond,
    pub(crate) movement: &'a Movement,
}

/// A layer as the needle meets it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerHit {
    /// Its number in the configuration.
    pub(crate) number: u8,
    pub(crate) layer: Layer,
}

/// The layers in which a law acts, and the limits of its force.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ForceLimits<'a> {
    /// Outermost first; without those of a vessel that the needle passes beside.
    pub(crate) layers: &'a [LayerHit],
    /// The number of layers that are configured.
    pub(crate) configured: usize,
    /// Largest depth along the needle, mm.
    pub(crate) travel: I16F16,
    /// Largest force, N.
    pub(crate) largest: I16F16,
    /// Largest slope, N/mm.
    pub(crate) stiffest: I16F16,
    /// One count of the encoder along the needle, mm.
    pub(crate) count: I16F16,
}

/// A law's response to the tip's place and motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response {
    /// Along the needle, positive against insertion.
    pub(crate) force: Elements,
    pub(crate) state: State,
    /// Across the needle: computed and reported only, because this device cannot push sideways.
    pub(crate) lateral: Newtons,
    /// The needle has just been turned further than tissue lets it.
    pub(crate) barrier: bool,
    /// Nothing was measured here: the force is an estimate.
    pub(crate) estimated: bool,
    /// A bit for the layer that has just given way by this law.
    pub(crate) ruptured: u8,
    /// A bit for each layer that has given way by this law on the needle's way.
    pub(crate) open: u8,
}

impl Response {
    /// The response of no tissue.
    pub(crate) const NONE: Self = Self {
        force: Elements::NONE,
        state: State::Approach,
        lateral: Newtons(I16F16::ZERO),
        barrier: false,
        estimated: false,
        ruptured: 0,
        open: 0,
    };
}

/// `1 − e^{−T/τ}` for T of one tick and τ in ms: with T/τ ≤ 0.02 three terms of the series leave
/// less than 1e-8.
fn follow_share(tau_ms: u16) -> I2F30 {
    let y = I2F30::ONE / i32::from(tau_ms.max(1)) / 10;
    let y2 = y.saturating_mul(y);
    y - y2 / 2 + y2.saturating_mul(y) / 6
}

/// A stiffness of `slope` N/mm makes `force` N over this many mm, given `1/slope`.
fn reach(force: I16F16, inverse_slope: I16F16) -> I16F16 {
    I16F16::from_bits(truncating_product(force.to_bits(), inverse_slope.to_bits(), 16))
}

macro_rules! laws {
    ($($(#[$about:meta])+ $name:ident($config:ident, $prepared:ident) => $module:ident),+ $(,)?) => {
        $(mod $module;)+
        $(pub use $module::$config;)+

        /// The law of force, with what is its own.
        #[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[expect(clippy::large_enum_variant, reason = "nothing allocates here")]
        pub enum Law { $($(#[$about])+ $name($config)),+ }

        /// The law that is in force, checked and ready for the tick.
        #[derive(Clone, Debug)]
        #[allow(clippy::large_enum_variant, reason = "nothing allocates here, and a device has one")]
        pub(crate) enum PreparedLaw { $($name($module::$prepared)),+ }

        /// Its memory.
        #[derive(Clone, Debug)]
        pub(crate) enum Memory { $($name($module::Memory)),+ }

        impl Law {
            /// The steepest slope, in N/mm, with which it holds a needle inside tissue, apart from
            /// its walls.
            pub(crate) fn hold(&self) -> I16F16 {
                match self { $(Law::$name(config) => config.hold()),+ }
            }

            /// The largest change of the force, in N/mm, where layers that the tip has touched move
            /// along a needle that rests: it has come through the first of `walls` and presses on
            /// the second. `None` where the force may jump.
            pub(crate) fn steepest(
                &self,
                layers: &[LayerHit],
                walls: (&[Wall], Option<&Wall>),
            ) -> Option<I16F16> {
                match self {
                    Law::Jog(config) => config.steepest(layers, walls),
                    Law::Sparte(_) => Some(sparte::steepest(walls.1)),
                    // Depth counts from the outermost layer, and a track that is left has another
                    // force.
                    Law::Xr(_) => None,
                }
            }

            /// Checks only what depends on where the layers are.
            pub(crate) fn check_depths(&self, limits: &ForceLimits) -> Result<(), Refusal> {
                match self {
                    Law::Jog(_) => jog::check_along(limits),
                    Law::Sparte(_) | Law::Xr(_) => Ok(()),
                }
            }
        }

        impl PreparedLaw {
            /// Checks `law` and prepares it for the tick.
            pub(crate) fn new(law: &Law, limits: &ForceLimits) -> Result<Self, Refusal> {
                match law { $(Law::$name(config) => $module::$prepared::new(config, limits).map(Self::$name)),+ }
            }

            /// A bit for each layer that gives way by this law rather than by a wall of its own.
            pub(crate) fn ruptures(&self) -> u8 {
                match self {
                    PreparedLaw::Xr(prepared) => prepared.ruptures(),
                    PreparedLaw::Jog(_) | PreparedLaw::Sparte(_) => 0,
                }
            }

            /// Follows layer `index`, now that the layers are met at these depths, perpendicular to
            /// the skin; one layer after the other, outermost first.
            pub(crate) fn place(&mut self, depths: &[I16F16], index: usize) {
                if let PreparedLaw::Jog(prepared) = self {
                    prepared.place(depths, index);
                }
            }

            /// The memory of a needle that has never been in this tissue.
            pub(crate) fn memory(&self) -> Memory {
                match self { $(PreparedLaw::$name(_) => Memory::$name($module::Memory::default())),+ }
            }
        }

        impl Memory {
            /// Depth counts from a surface that is displaced by so much along the needle, if the
            /// law can use it.
            pub(crate) fn displace(&mut self, displacement: Millimetres) {
                if let Memory::Xr(memory) = self {
                    memory.displace(displacement);
                }
            }

            /// One tick of `law`, from which `prepared` was made, with a needle that moves so and
            /// has met what `met` says.
            pub(crate) fn tick(
                &mut self,
                law: &Law,
                prepared: &PreparedLaw,
                met: &Insertion,
                motion: Motion,
            ) -> Response {
                match (self, prepared, law) {
                    $((Memory::$name(memory), PreparedLaw::$name(prepared), Law::$name(config)) => {
                        memory.tick(config, prepared, met, motion)
                    })+
                    // A memory is made by its prepared law, and that by its law.
                    _ => Response::NONE,
                }
            }
        }
    };
}

laws! {
    /// Paper 001: the jog effect of each wall, and friction in each layer.
    Jog(FrictionLaw, PreparedJog) => jog,
    /// Paper 002: walls that rise along a polynomial, tracking walls, LuGre friction, a fixture of
    /// the direction.
    Sparte(Sparte, PreparedSparte) => sparte,
    /// Paper 000: a table over depth, speed and angle.
    Xr(ForceTable, PreparedTable) => xr,
}

pub use sparte::{Cutting, Fixture, Lugre};
pub use xr::{MAX_ANGLES, MAX_DEPTHS, MAX_SPEEDS};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_anchor_follows_by_its_share_of_a_tick() {
        for tau_ms in [5_u16, 60, 1_000, 10_000] {
            let exact = -(-0.1 / f64::from(tau_ms)).exp_m1();
            let share = follow_share(tau_ms).to_num::<f64>();
            assert!((share - exact).abs() < 1.2e-8, "{tau_ms} ms: {share} for {exact}");
        }
    }
}
