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
