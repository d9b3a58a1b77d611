//! The probe's pose, the thickness of its beam, and the needle as it sees it.

/// A place or a direction.
pub type Vector = [f32; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A linear probe on the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// The middle of its face, mm.
    pub centre_mm: Vector,
    /// Its long side against the x axis, rad: 0 sees the needle's plane, π/2 cuts across.
    pub azimuth: f32,
    /// The angle by which its beam leans sideways out of the vertical, rad.
    pub lean: f32,
    /// Width of the image, mm.
    pub width_mm: f32,
    /// Depth of the image, mm.
    pub depth_mm: f32,
    /// Centre frequency, MHz.
    pub mhz: f32,
    /// Depth at which the beam is thinnest, mm.
    pub focus_mm: f32,
    /// Thickness of the beam there, full width at half maximum of the pressure, mm.
    pub thickness_mm: f32,
}

impl Default for Probe {
    /// A 10 MHz vascular probe over the vessel, in the needle's plane.
    fn default() -> Self {
        Self {
            centre_mm: [8.0, 0.0, 0.0],
            azimuth: 0.0,
            lean: 0.0,
            width_mm: 30.0,
            depth_mm: 16.0,
            mhz: 10.0,
            focus_mm: 8.0,
            thickness_mm: 1.2,
        }
    }
}

/// Full width at half maximum of a Gaussian, in standard deviations.
const FWHM: f32 = 2.354_82;

/// The probe's own axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axes {
    pub(crate) centre: Vector,
    /// Along the image.
    pub(crate) lateral: Vector,
    /// Into the body.
    pub(crate) axial: Vector,
    /// Out of the image's plane.
    pub(crate) elevation: Vector,
}

impl Axes {
    /// A place as (lateral, axial, elevation), mm.
    pub(crate) fn of(&self, place: Vector) -> Vector {
        let offset = sub(place, self.centre);
        [dot(offset, self.lateral), dot(offset, self.axial), dot(offset, self.elevation)]
    }

    /// The same for a direction.
    pub(crate) fn turn(&self, direction: Vector) -> Vector {
        [dot(direction, self.lateral), dot(direction, self.axial), dot(direction, self.elevation)]
    }
}

impl Probe {
    /// A probe that can be: what is no number or out of range becomes the nearest that can.
    pub fn checked(&self) -> Self {
        let standard = Self::default();
        let number = |value: f32, or: f32, low: f32, high: f32| {
            if value.is_finite() { value.clamp(low, high) } else { or }
        };
        let place = |axis: usize| number(self.centre_mm[axis], standard.centre_mm[axis], -500.0, 500.0);
        Self {
            centre_mm: [place(0), place(1), place(2)],
            azimuth: number(self.azimuth, 0.0, -10.0, 10.0),
            lean: number(self.lean, 0.0, -1.2, 1.2),
            width_mm: number(self.width_mm, standard.width_mm, 2.0, 200.0),
            depth_mm: number(self.depth_mm, standard.depth_mm, 2.0, 300.0),
            mhz: number(self.mhz, standard.mhz, 1.0, 30.0),
            focus_mm: number(self.focus_mm, standard.focus_mm, 1.0, 300.0),
            thickness_mm: number(self.thickness_mm, standard.thickness_mm, 0.1, 20.0),
        }
    }

    pub(crate) fn axes(&self) -> Axes {
        let (side, ahead) = self.azimuth.sin_cos();
        let (lean, upright) = self.lean.sin_cos();
        let lateral = [ahead, side, 0.0];
        let level = [-side, ahead, 0.0];
        Axes {
            centre: self.centre_mm,
            lateral,
            axial: [level[0] * lean, level[1] * lean, upright],
            elevation: [level[0] * upright, level[1] * upright, -lean],
        }
    }

    /// Its directions of length 1: along the image, into the body, out of the image's plane.
    pub fn directions(&self) -> [Vector; 3] {
        let axes = self.axes();
        [axes.lateral, axes.axial, axes.elevation]
    }

    /// Half the beam's thickness at a depth as the standard deviation of a Gaussian, mm: thinnest
    /// at the focus, and wider away from it as a Gaussian beam of the wavelength is.
    pub(crate) fn beam_sigma_mm(&self, depth_mm: f32) -> f32 {
        let sigma = self.thickness_mm / FWHM;
        let wavelength = 1.54 / self.mhz;
        // Waist of the pressure w₀ = √2·σ, Rayleigh range π·w₀²/λ.
        let rayleigh = std::f32::consts::TAU * sigma * sigma / wavelength;
        sigma * (1.0 + ((depth_mm - self.focus_mm) / rayleigh).powi(2)).sqrt()
    }
}

/// The needle: from its tip backwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// Its tip, mm.
    pub tip_mm: Vector,
    /// Its direction, of length 1.
    pub direction: Vector,
    /// Its outer radius, mm.
    pub radius_mm: f32,
    /// The length of it that is in the body, mm.
    pub inserted_mm: f32,
}

impl Shaft {
    /// True if there is anything of it to be seen.
    pub(crate) fn is_there(&self) -> bool {
        let numbers = self.tip_mm.iter().chain(&self.direction).chain([&self.radius_mm, &self.inserted_mm]);
        numbers.into_iter().all(|number| number.is_finite()) && self.inserted_mm > 0.0 && self.radius_mm > 0.0
    }
}
