//! The tissues by the names of a profile's file.

use control_core::config::Tissue;
use serde::Deserialize;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum TissueName {
    Skin,
    Fat,
    Muscle,
    Vessel,
    Other,
    Bursa,
    Tendon,
    Cartilage,
    FarWall,
}

impl TissueName {
    /// Returns its name in a file.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Skin => "skin",
            Self::Fat => "fat",
            Self::Muscle => "muscle",
            Self::Vessel => "vessel",
            Self::Other => "other",
            Self::Bursa => "bursa",
            Self::Tendon => "tendon",
            Self::Cartilage => "cartilage",
            Self::FarWall => "far-wall",
        }
    }
}

impl From<TissueName> for Tissue {
    fn from(name: TissueName) -> Self {
        match name {
            TissueName::Skin => Tissue::Skin,
            TissueName::Fat => Tissue::Fat,
            TissueName::Muscle => Tissue::Muscle,
            TissueName::Vessel => Tissue::Vessel,
            TissueName::Other => Tissue::Other,
            TissueName::Bursa => Tissue::Bursa,
            TissueName::Tendon => Tissue::Tendon,
            TissueName::Cartilage => Tissue::Cartilage,
            TissueName::FarWall => Tissue::FarWall,
        }
    }
}
