//! The properties of a tissue that sound meets: impedance, attenuation, speed and scatterers.

/// A tissue, or steel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Characteristic impedance, MRayl.
    pub impedance: f32,
    /// Attenuation, dB/cm/MHz, one way.
    pub attenuation: f32,
    /// Speed of sound, m/s.
    pub speed: f32,
    /// Brightness of its speckle against muscle's, dB: ours, from how such images look.
    pub speckle_db: f32,
}

/// Speed that every machine assumes, m/s.
pub(crate) const ASSUMED_SPEED: f32 = 1540.0;

/// Impedance, attenuation and speed of blood, fat, muscle and bone: textbook values.
pub const BLOOD: Medium = Medium { impedance: 1.61, attenuation: 0.18, speed: 1570.0, speckle_db: -34.0 };
/// See [`BLOOD`].
pub const FAT: Medium = Medium { impedance: 1.38, attenuation: 0.63, speed: 1450.0, speckle_db: -8.0 };
/// See [`BLOOD`].
pub const MUSCLE: Medium = Medium { impedance: 1.70, attenuation: 1.09, speed: 1580.0, speckle_db: 0.0 };
/// See [`BLOOD`].
pub const BONE: Medium = Medium { impedance: 7.80, attenuation: 5.0, speed: 4080.0, speckle_db: 3.0 };
/// Skin: density 1109 kg/m³ × 1624 m/s; our assumption.
pub const SKIN: Medium = Medium { impedance: 1.80, attenuation: 1.8, speed: 1624.0, speckle_db: 5.0 };
/// Tendon: our assumption, between muscle and skin.
pub(crate) const TENDON: Medium =
    Medium { impedance: 1.84, attenuation: 1.5, speed: 1650.0, speckle_db: 7.0 };
/// The wall of a vessel: our assumption, a little harder than muscle.
pub(crate) const VESSEL_WALL: Medium =
    Medium { impedance: 1.78, attenuation: 0.9, speed: 1580.0, speckle_db: 6.0 };
/// Steel of a needle.
pub const STEEL: Medium = Medium { impedance: 45.0, attenuation: 0.1, speed: 5800.0, speckle_db: 0.0 };

impl Medium {
    /// The tissue of this name in a profile; muscle where there is no such.
    pub fn named(name: &str) -> Self {
        match name {
            "skin" => SKIN,
            "fat" | "bursa" => FAT,
            "tendon" => TENDON,
            "bone" | "cartilage" => BONE,
            "vessel" | "blood" => BLOOD,
            _ => MUSCLE,
        }
    }

    /// Share of the pressure that comes back from the interface to `other`; squared it is the share
    /// of the intensity.
    pub(crate) fn pressure_reflection(&self, other: &Medium) -> f32 {
        (other.impedance - self.impedance) / (other.impedance + self.impedance)
    }

    /// Share of the intensity that comes back from the interface to `other`: `((Z₂ − Z₁)/(Z₂ +
    /// Z₁))²`.
    pub fn reflection(&self, other: &Medium) -> f32 {
        self.pressure_reflection(other).powi(2)
    }

    /// Pressure that is left after `path_mm` at `mhz`: `10^(−α·f·d/20)`.
    pub fn attenuated(&self, mhz: f32, path_mm: f32) -> f32 {
        10_f32.powf(-self.attenuation * mhz * path_mm * 0.1 / 20.0)
    }
}
