//! Quantities with their unit in the type. Plain data: arithmetic stays with whoever knows what it
//! means.

use core::fmt;
use fixed::types::{I8F24, I16F16};
use serde::{Deserialize, Serialize};

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident($inner:ty), $unit:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        pub struct $name(pub $inner);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
    };
}

quantity!(
    /// Encoder counts, positive in the insertion direction. Absolute counts wrap at the ends of
    /// `i32`.
    Counts(i32),
    "counts"
);
quantity!(
    /// A length along the needle in mm; resolution 15 nm.
    Millimetres(I16F16),
    "mm"
);
quantity!(
    /// Speed along the needle in mm/s, positive when inserting.
    MillimetresPerSecond(I16F16),
    "mm/s"
);
quantity!(
    /// Force on the needle in N, positive when it resists insertion; resolution 15 µN.
    Newtons(I16F16),
    "N"
);
quantity!(
    /// Motor torque in mN·m, positive in the insertion direction.
    MillinewtonMetres(I16F16),
    "mN·m"
);
quantity!(
    /// Stiffness in N/mm.
    Stiffness(I16F16),
    "N/mm"
);
quantity!(
    /// Mass in g.
    Grams(I16F16),
    "g"
);
quantity!(
    /// Viscous damping in N·s/mm; 0.02 N·s/m is 0.000 02 here.
    Damping(I8F24),
    "N·s/mm"
);
quantity!(
    /// Compliance `a` of the jog effect in mm²/N (Paper 001, eq. 1).
    JogCompliance(I16F16),
    "mm²/N"
);
quantity!(
    /// Friction limit gained for each mm of needle inside a layer, in N/mm.
    FrictionPerMillimetre(I16F16),
    "N/mm"
);
quantity!(
    /// Inclination of the insertion axis below the horizontal in mrad.
    Milliradians(i16),
    "mrad"
);
quantity!(
    /// The code for the converter; mid-scale is zero torque.
    DacCode(u16),
    "DAC code"
);
