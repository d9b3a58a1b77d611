//! The way of a line's pulse: down through the media, and to the needle.

use crate::medium::{ASSUMED_SPEED, VESSEL_WALL};
use crate::plane::Crossing;
use crate::probe::{Probe, Shaft};
use crate::scene::{SAMPLES, Scene};

/// Speckle of muscle against full reflection, dB.
const MUSCLE_SPECKLE_DB: f32 = -38.0;

/// A stretch of a line in one medium.
pub(crate) struct Piece {
    pub(crate) from: usize,
    pub(crate) to: usize,
    /// Pressure that has reached its beginning and comes back, as a share of what was sent.
    pub(crate) pressure: f32,
    /// The share of the amplitude that remains after a sample, there and back.
    pub(crate) decay: f32,
    /// Energy of the scatterers.
    pub(crate) speckle: f32,
    /// Pressure of the echo of the interface above it, and how much that faces the probe.
    pub(crate) echo: Option<(f32, f32)>,
}

/// Goes down a line from medium to medium. Depths become those that the machine shows, which takes
/// 1540 m/s for all.
pub(crate) fn follow_line(
    probe: &Probe,
    scene: &Scene<'_>,
    crossings: &[Crossing],
    mut take: impl FnMut(Piece),
) {
    let sample_mm = probe.depth_mm / SAMPLES as f32;
    let mut layer = scene.first;
    // A bit for each closed mesh that the line is in; where they overlap, the last one counts.
    let mut inside = 0_u64;
    let (mut depth, mut shown, mut pressure) = (0.0_f32, 0.0_f32, 1.0_f32);
    let mut medium = layer;
    let mut echo: Option<(f32, f32)> = None;
    let bottom = 2.0 * probe.depth_mm;
    for crossing in crossings.iter().map(Some).chain([None]) {
        let end = crossing.map_or(bottom, |crossing| crossing.depth);
        let long = end - depth;
        if long > 0.0 {
            let from = shown;
            shown += long * ASSUMED_SPEED / medium.speed;
            let [first, last] = [from, shown].map(|mm| ((mm / sample_mm) as usize).min(SAMPLES));
            // A sample shown is so long in truth, and passed twice.
            let decay = medium.attenuated(probe.mhz, 2.0 * sample_mm * medium.speed / ASSUMED_SPEED);
            let speckle = 10_f32.powf(0.1 * (MUSCLE_SPECKLE_DB + medium.speckle_db));
            take(Piece { from: first, to: last, pressure, decay, speckle, echo: echo.take() });
            pressure *= medium.attenuated(probe.mhz, 2.0 * long);
            depth = end;
        }
        let Some(crossing) = crossing else { return };
        if shown >= probe.depth_mm {
            return;
        }
        let mesh = &scene.meshes[crossing.mesh];
        match mesh.wall_mm {
            Some(_) => inside ^= 1_u64.unbounded_shl(crossing.mesh as u32),
            None => layer = mesh.behind,
        }
        let innermost = inside.checked_ilog2().and_then(|number| scene.meshes.get(number as usize));
        let next = innermost.map_or(layer, |mesh| mesh.behind);
        let has_wall = mesh.wall_mm.is_some_and(|mm| mm > 0.0);
        if !has_wall && next == medium {
            // A surface under another: nothing changes there.
            continue;
        }
        // A vessel's wall stands out from both sides.
        let met = if has_wall { VESSEL_WALL } else { next };
        let reflected = medium.pressure_reflection(&met);
        let wall = if has_wall { met.pressure_reflection(&next) } else { 0.0 };
        let back = reflected.abs().max(wall.abs());
        echo = Some((pressure * back, crossing.facing));
        // There and back: (1 − R) of the intensity passes each interface each time.
        pressure *= (1.0 - reflected * reflected) * (1.0 - wall * wall);
        medium = next;
    }
}

/// Returns where the beam of a line meets the needle: depth, share of the beam's pressure there,
/// distance behind the tip.
pub(crate) fn meet(
    probe: &Probe,
    lateral: f32,
    tip: [f32; 3],
    ahead: [f32; 3],
    shaft: &Shaft,
) -> Option<(f32, f32, f32)> {
    let beam = (0.6 * 1.54 / probe.mhz).max(shaft.radius_mm);
    let mut sigma = probe.beam_sigma_mm(tip[1]);
    let mut met = None;
    // The thickness depends on the depth, which depends on where it is met.
    for _ in 0..2 {
        let (du, dn) = ((tip[0] - lateral) / beam, tip[2] / sigma);
        let (au, an) = (ahead[0] / beam, ahead[2] / sigma);
        let square = au * au + an * an;
        let behind =
            if square > 1e-9 { ((du * au + dn * an) / square).clamp(0.0, shaft.inserted_mm) } else { 0.0 };
        let (u, n) = (du - behind * au, dn - behind * an);
        let depth = tip[1] - behind * ahead[1];
        met = Some((depth, (-0.5 * (u * u + n * n)).exp(), behind));
        sigma = probe.beam_sigma_mm(depth);
    }
    met
}
