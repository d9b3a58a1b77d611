//! From a section to an image: echoes, scatterers, pulse and beam, envelope, compression.
//!
//! All in baseband (in-phase and quadrature), a line of samples at a time, in arrays that the
//! processor can work on four at once; nothing but a line's first crossings allocates.

use crate::line::{follow_line, meet};
use crate::medium::STEEL;
use crate::plane::{Crossing, cut};
use crate::probe::{Axes, Probe, Shaft};
use crate::pulse::{along, bell, decibels, pulse_gain, pulse_sigma_mm};
use crate::scene::{LINES, SAMPLES, Scene};
use crate::score::InPlane;
use crate::speckle::{column_start, scatterers};

/// Planes that the thickness of the beam is made of: how far beside the image's (standard
/// deviations), and their weight.
const PLANES: [(f32, f32); 3] = [(-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)];
/// A rough interface sends a share of its echo everywhere; the rest only where it faces the probe.
const ROUGH: f32 = 0.15;
/// The power of the cosine by which the smooth part depends on the angle of incidence.
const SMOOTH_POWER: i32 = 12;
/// The echo of an interface gathers coherently over the pulse.
const INTERFACE_GAIN: f32 = 0.5;
/// Pressure of the needle's echo against its reflection: most of it goes elsewhere.
const NEEDLE_GAIN: f32 = 0.35;
/// Reverberations in the needle: how many are drawn, and what each leaves.
const REVERBERATIONS: usize = 3;
const REVERBERATION: f32 = 0.2;
/// Depth of the shadow under a needle in the middle of the beam.
const SHADOW: f32 = 0.85;
/// Distance beside the plane over which the speckle changes, mm.
const COHERENCE_MM: f32 = 0.6;
/// Turn of the probe over which the speckle changes, rad.
const COHERENCE_RAD: f32 = 0.05;

/// The settings of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Gain, dB.
    pub gain_db: f32,
    /// Amplification with depth, dB/cm of depth; makes up for attenuation there and back.
    pub tgc_db_per_cm: f32,
    /// The dynamic range between black and white, 60–100 dB.
    pub range_db: f32,
}

impl Default for Look {
    fn default() -> Self {
        Self { gain_db: 18.0, tgc_db_per_cm: 16.0, range_db: 70.0 }
    }
}

/// Makes images.
#[derive(Clone, Debug)]
pub struct Imager {
    noise: [Vec<f32>; 2],
    crossings: Vec<Vec<Crossing>>,
    /// Energy of the scatterers' echoes, then everything else, line after line.
    energy: Vec<f32>,
    /// Pressure that reaches a sample and comes back, in the image's own plane.
    reach: Vec<f32>,
    iq: [Vec<f32>; 2],
    /// After the pulse.
    pulsed: [Vec<f32>; 2],
    power: Vec<f32>,
    image: Vec<u8>,
    visible: InPlane,
}

impl Default for Imager {
    fn default() -> Self {
        Self::new(1)
    }
}

impl Imager {
    /// With scatterers of their own for every `seed`.
    pub fn new(seed: u64) -> Self {
        let plane = || vec![0.0; LINES * SAMPLES];
        Self {
            noise: scatterers(seed),
            crossings: vec![vec![]; LINES],
            energy: plane(),
            reach: plane(),
            iq: [plane(), plane()],
            pulsed: [plane(), plane()],
            power: plane(),
            image: vec![0; LINES * SAMPLES],
            visible: InPlane::default(),
        }
    }

    /// Makes an image of `scene`: brightness, line after line of [`SAMPLES`].
    pub fn frame(&mut self, probe: &Probe, scene: &Scene<'_>, look: &Look) -> &[u8] {
        let probe = probe.checked();
        let axes = probe.axes();
        self.energy.fill(0.0);
        for (beside, weight) in PLANES {
            let elevation = beside * probe.beam_sigma_mm(probe.focus_mm);
            cut(&axes, elevation, probe.width_mm, scene.meshes, &mut self.crossings);
            self.trace(&probe, scene, weight, beside == 0.0);
        }
        self.scatter(&probe, &axes);
        let shaft = scene.shaft.filter(Shaft::is_there);
        self.visible = shaft.map_or_else(InPlane::default, |shaft| InPlane::of(&probe, &shaft));
        // The image's own plane once more, for what reflects as a mirror.
        cut(&axes, 0.0, probe.width_mm, scene.meshes, &mut self.crossings);
        self.reflect(&probe, scene);
        if let Some(shaft) = shaft {
            self.needle(&probe, &axes, &shaft);
        }
        self.convolve(&probe);
        self.compress(&probe, look);
        &self.image
    }

    /// The last image.
    pub fn image(&self) -> &[u8] {
        &self.image
    }

    /// Intensity of the last image in dB of full reflection, before gain and compression; line
    /// after line.
    pub fn power_db(&self) -> impl Iterator<Item = f32> {
        self.power.iter().map(|power| 10.0 * power.max(1e-30).log10())
    }

    /// Returns how much of the needle the last image shows.
    pub fn visible(&self) -> InPlane {
        self.visible
    }

    /// Follows each line down through the media of one plane of the beam.
    fn trace(&mut self, probe: &Probe, scene: &Scene<'_>, weight: f32, is_own_plane: bool) {
        for (number, crossings) in self.crossings.iter().enumerate() {
            let range = number * SAMPLES..(number + 1) * SAMPLES;
            let energy = &mut self.energy[range.clone()];
            let mut reach = is_own_plane.then(|| &mut self.reach[range.clone()]);
            follow_line(probe, scene, crossings, |piece| {
                let decay = piece.decay * piece.decay;
                let mut value = piece.pressure * piece.pressure * weight * piece.speckle;
                for slot in &mut energy[piece.from..piece.to] {
                    *slot += value;
                    value *= decay;
                }
                if let Some(reach) = &mut reach {
                    let mut value = piece.pressure;
                    for slot in &mut reach[piece.from..piece.to] {
                        *slot = value;
                        value *= piece.decay;
                    }
                }
            });
        }
    }

    /// Scatterers of random strength, fixed in the body, as bright as [`Self::trace`] says.
    fn scatter(&mut self, probe: &Probe, axes: &Axes) {
        let pitch = probe.width_mm / LINES as f32;
        let along = axes.centre[0] * axes.lateral[0] + axes.centre[1] * axes.lateral[1];
        let beside = (axes.centre[0] * axes.elevation[0] + axes.centre[1] * axes.elevation[1]) / COHERENCE_MM;
        let turned = ((probe.azimuth + 1.7 * probe.lean) / COHERENCE_RAD).round() as i64;
        let (cell, share) = (beside.floor(), beside - beside.floor());
        let weights = [(1.0 - share).sqrt(), share.sqrt()];
        for number in 0..LINES {
            let column = ((along / pitch).round() as i64) + number as i64;
            let starts = [0, 1].map(|next| column_start(column, cell as i64 + next, turned));
            let range = number * SAMPLES..(number + 1) * SAMPLES;
            for part in 0..2 {
                let first = &self.noise[part][starts[0]..starts[0] + SAMPLES];
                let second = &self.noise[part][starts[1]..starts[1] + SAMPLES];
                let energy = &self.energy[range.clone()];
                let iq = &mut self.iq[part][range.clone()];
                for (((out, a), b), energy) in iq.iter_mut().zip(first).zip(second).zip(energy) {
                    *out = energy.sqrt() * (weights[0] * a + weights[1] * b);
                }
            }
        }
    }

    /// Echoes of the interfaces, as bright as they face the probe.
    fn reflect(&mut self, probe: &Probe, scene: &Scene<'_>) {
        for (number, crossings) in self.crossings.iter().enumerate() {
            let line = &mut self.iq[0][number * SAMPLES..(number + 1) * SAMPLES];
            follow_line(probe, scene, crossings, |piece| {
                if let Some((echo, facing)) = piece.echo
                    && let Some(slot) = line.get_mut(piece.from)
                {
                    let smooth = (1.0 - ROUGH) * facing.powi(SMOOTH_POWER);
                    *slot += echo * (ROUGH + smooth) * INTERFACE_GAIN * pulse_gain(probe);
                }
            });
        }
    }

    /// The needle: a bright line where the beam meets it, echoes of echoes under it, and a shadow.
    fn needle(&mut self, probe: &Probe, axes: &Axes, shaft: &Shaft) {
        let tip = axes.of(shaft.tip_mm);
        let ahead = axes.turn(shaft.direction);
        let sample_mm = probe.depth_mm / SAMPLES as f32;
        // A needle across the beam throws its echo back, one along it elsewhere.
        let facing = (1.0 - ahead[1] * ahead[1]).max(0.0).sqrt().powi(4).max(0.05);
        let strength = STEEL.pressure_reflection(&crate::medium::MUSCLE).abs() * NEEDLE_GAIN * facing;
        for number in 0..LINES {
            let lateral = ((number as f32 + 0.5) / LINES as f32 - 0.5) * probe.width_mm;
            let Some((depth, weight, behind)) = meet(probe, lateral, tip, ahead, shaft) else { continue };
            let at = ((depth - shaft.radius_mm) / sample_mm).round();
            if weight < 1e-3 || !(0.0..SAMPLES as f32).contains(&at) {
                continue;
            }
            let at = at as usize;
            let start = number * SAMPLES;
            let reach = self.reach[start + at];
            let [in_phase, quadrature] = &mut self.iq;
            let lines = [&mut in_phase[start..start + SAMPLES], &mut quadrature[start..start + SAMPLES]];
            let shadow = 1.0 - SHADOW * weight;
            for line in lines {
                for sample in &mut line[at + 1..] {
                    *sample *= shadow;
                }
            }
            // The ground tip has edges that face every way.
            let edge = if behind < 1.0 { 1.6 } else { 1.0 };
            let mut echo = strength * weight * reach * edge * pulse_gain(probe);
            let between = (2.0 * shaft.radius_mm / sample_mm * 1.2).max(1.0);
            for count in 0..=REVERBERATIONS {
                if let Some(sample) = in_phase.get_mut(start + at + (count as f32 * between) as usize)
                    && at + ((count as f32 * between) as usize) < SAMPLES
                {
                    *sample += echo;
                }
                echo *= REVERBERATION;
            }
        }
    }

    /// The pulse along each line, the beam across the lines.
    fn convolve(&mut self, probe: &Probe) {
        let sample_mm = probe.depth_mm / SAMPLES as f32;
        let pitch = probe.width_mm / LINES as f32;
        // Two periods long; the beam is as wide as a wavelength at twice its aperture's depth.
        let pulse = bell::<6>(pulse_sigma_mm(probe) / sample_mm);
        let beam = bell::<4>(1.6 * 1.54 / probe.mhz / pitch);
        for part in 0..2 {
            for (source, out) in
                self.iq[part].chunks_exact(SAMPLES).zip(self.pulsed[part].chunks_exact_mut(SAMPLES))
            {
                along(source, out, &pulse);
            }
        }
        for number in 0..LINES {
            let power = &mut self.power[number * SAMPLES..(number + 1) * SAMPLES];
            let mut sums = [[0.0_f32; SAMPLES]; 2];
            for (sum, pulsed) in sums.iter_mut().zip(&self.pulsed) {
                for (tap, weight) in beam.iter().enumerate() {
                    for neighbour in [number.checked_sub(tap), Some(number + tap).filter(|_| tap > 0)] {
                        let Some(neighbour) = neighbour.filter(|line| *line < LINES) else { continue };
                        let line = &pulsed[neighbour * SAMPLES..(neighbour + 1) * SAMPLES];
                        for (slot, value) in sum.iter_mut().zip(line) {
                            *slot += weight * value;
                        }
                    }
                }
            }
            let [in_phase, quadrature] = &sums;
            for ((power, i), q) in power.iter_mut().zip(in_phase).zip(quadrature) {
                *power = i * i + q * q;
            }
        }
    }

    fn compress(&mut self, probe: &Probe, look: &Look) {
        let number = |value: f32, or: f32| if value.is_finite() { value } else { or };
        let range = number(look.range_db, 70.0).clamp(20.0, 120.0);
        let per_sample = number(look.tgc_db_per_cm, 0.0) * 0.1 * probe.depth_mm / SAMPLES as f32;
        let (scale, gain) = (255.0 / range, number(look.gain_db, 0.0) + range);
        for (powers, out) in self.power.chunks_exact(SAMPLES).zip(self.image.chunks_exact_mut(SAMPLES)) {
            for (sample, (power, grey)) in powers.iter().zip(out).enumerate() {
                let db = decibels(*power) + gain + per_sample * sample as f32;
                *grey = (db * scale).clamp(0.0, 255.0) as u8;
            }
        }
    }
}
