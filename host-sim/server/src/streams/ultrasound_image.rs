//! The ultrasound image for streams, computed as in the page: tissue and probe follow the session,
//! whoever looks at a page or not. It costs nothing while nobody watches.

use super::feed::Snapshot;
use device_sim::session::{ProbeView, Scene};
use picture_wasm::drawn::TISSUES;
use picture_wasm::picture::Picture;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tissue::PunctureState;
use tokio::sync::watch;
use ultrasound::{LINES, SAMPLES};

/// From one image to the next: 10 a second.
const PERIOD: Duration = Duration::from_millis(100);
/// The longest step of the tissue, as in the page, in s.
const LONGEST_STEP_S: f32 = 0.05;
/// Samples of the image that become one row of the stream's.
const SAMPLES_PER_ROW: usize = 2;
/// Rows and columns of an image.
pub(super) const ROWS: usize = SAMPLES / SAMPLES_PER_ROW;
pub(super) const COLUMNS: usize = LINES;
/// The probe until a page has moved it: over the vessel, in the needle's plane, as the page begins.
const PROBE: ProbeView = ProbeView {
    along_mm: 13.0,
    across_mm: 0.0,
    azimuth_rad: 0.0,
    lean_rad: 0.0,
    share_in_plane: 0.0,
    tip_seen: false,
};
/// The numbers of a vessel and of its far wall, which [`Picture::new`] reads in addition to those
/// of [`TISSUES`].
const VESSEL: f32 = 7.0;
const FAR_WALL: f32 = 8.0;

/// An image with its place in the axes of the needle's pose: along the skin, across, out of it.
#[derive(Clone, Debug)]
pub(super) struct Image {
    /// Time of the device's clock, in s.
    pub(super) t_s: f64,
    /// Brightness, row after row from the skin down.
    pub(super) pixels: Vec<u8>,
    /// Width and depth, in mm.
    pub(super) size_mm: [f64; 2],
    /// The middle of the probe's face, in mm.
    pub(super) face_mm: [f64; 3],
    /// Unit vectors along the image's rows and down its columns.
    pub(super) across: [f64; 3],
    pub(super) down: [f64; 3],
}

/// The offer of images, which anyone may watch.
#[derive(Clone, Debug)]
pub(super) struct Images(watch::Receiver<Option<Arc<Image>>>);

/// One who watches them.
#[derive(Debug)]
pub(super) struct Watched(watch::Receiver<Option<Arc<Image>>>);

impl Images {
    pub(super) fn watch(&self) -> Watched {
        Watched(self.0.clone())
    }
}

impl Watched {
    /// The newest image, if it has not been taken yet.
    pub(super) fn next(&mut self) -> Option<Arc<Image>> {
        let is_new = self.0.has_changed().unwrap_or(false);
        is_new.then(|| self.0.borrow_and_update().clone()).flatten()
    }
}

/// Begins to compute images, on a thread of its own so that no stream waits; it ends with `newest`.
pub(super) fn begin(newest: watch::Receiver<Snapshot>) -> io::Result<Images> {
    let (publish, images) = watch::channel(None);
    // One receiver is the offer itself, and each client adds one.
    let work = move || {
        let mut imager = Imager::default();
        while newest.has_changed().is_ok() {
            let begin = Instant::now();
            let snapshot = newest.borrow().clone();
            if let Some(image) = imager.follow(&snapshot, publish.receiver_count() > 1) {
                publish.send_replace(Some(Arc::new(image)));
            }
            std::thread::sleep(PERIOD.saturating_sub(begin.elapsed()));
        }
    };
    std::thread::Builder::new().name("ultrasound".into()).spawn(work)?;
    Ok(Images(images))
}

/// The tissue of the present scene, and the events that it has heard of.
#[derive(Default)]
struct Imager {
    scene: Option<Arc<Scene>>,
    picture: Option<Picture>,
    told: u64,
}

impl Imager {
    /// Takes in what has happened; the next image where somebody watches.
    fn follow(&mut self, snapshot: &Snapshot, is_watched: bool) -> Option<Image> {
        let scene = &snapshot.scene.as_ref()?.0;
        if self.scene.as_ref().is_none_or(|known| !Arc::ptr_eq(known, scene)) {
            self.picture = Picture::new(&numbers(scene)).ok();
            self.scene = Some(scene.clone());
        }
        let picture = self.picture.as_mut()?;
        for event in snapshot.events.since(self.told) {
            let state = match event.kind {
                "puncture" | "vessel" | "far_wall" | "flashback" | "in_track" => PunctureState::Inserted,
                "exit" => PunctureState::Away,
                _ => continue,
            };
            event.layer.into_iter().for_each(|layer| picture.tell(usize::from(layer), state));
        }
        self.told = snapshot.events.total();
        let pose = snapshot.pose.as_ref().filter(|_| is_watched)?;
        let seconds = PERIOD.as_secs_f32();
        let steps = (seconds / LONGEST_STEP_S).ceil();
        for _ in 0..steps as usize {
            let origin_mm = snapshot.needle_mm.map(|mm| mm as f32);
            picture.step(seconds / steps, pose.depth_mm as f32, pose.angle_rad as f32, origin_mm);
        }
        let view = snapshot.probe.unwrap_or(PROBE);
        let [along, across, azimuth, lean] =
            [view.along_mm, view.across_mm, view.azimuth_rad, view.lean_rad].map(|part| part as f32);
        picture.hold_probe(along, across, azimuth, lean);
        Some(image(picture, pose.t_s, seconds))
    }
}

/// An image of `picture`. There the third axis points into the skin, here out of it.
fn image(picture: &mut Picture, t_s: f64, seconds: f32) -> Image {
    let probe = *picture.probe();
    let [lateral, axial, _] = probe.directions();
    let out = |[along, across, down]: [f32; 3]| [along, across, -down].map(f64::from);
    let lines = picture.image(seconds, 0.0);
    let mut pixels = vec![0; ROWS * COLUMNS];
    for (column, line) in lines.chunks_exact(SAMPLES).enumerate() {
        for (row, samples) in line.chunks_exact(SAMPLES_PER_ROW).enumerate() {
            let sum: usize = samples.iter().map(|sample| usize::from(*sample)).sum();
            pixels[row * COLUMNS + column] = (sum / SAMPLES_PER_ROW) as u8;
        }
    }
    Image {
        t_s,
        pixels,
        size_mm: [probe.width_mm, probe.depth_mm].map(f64::from),
        face_mm: out(probe.centre_mm),
        across: out(lateral),
        down: out(axial),
    }
}

/// The anatomy as [`Picture::new`] reads it, and as the page hands it over.
fn numbers(scene: &Scene) -> Vec<f32> {
    let mut numbers = vec![scene.layers.len() as f32];
    for layer in &scene.layers {
        let named = TISSUES.iter().position(|name| *name == layer.name).unwrap_or(0) as f32;
        let kind = if layer.is_vessel {
            VESSEL
        } else if layer.is_far_wall {
            FAR_WALL
        } else {
            named
        };
        let travel = layer.puncture_travel_mm.unwrap_or(-1.0);
        numbers.extend([kind, layer.depth_mm as f32, travel as f32, layer.friction_n_per_mm as f32]);
    }
    let vessel = scene.vessel.map_or([f32::NAN, 0.0], |v| [v.width_mm as f32, v.offset_mm as f32]);
    let angle = scene.tilt_rad - scene.skin_tilt_rad;
    numbers.extend(vessel);
    numbers.extend([angle as f32, scene.needle.diameter_mm as f32]);
    match &scene.body {
        None => numbers.push(0.0),
        Some(body) => {
            let place = [
                body.along_mm,
                body.around_deg,
                body.azimuth_deg,
                body.turn_deg,
                body.incline_deg,
                body.fat_mm,
            ];
            numbers.extend([2.0, body.site as f32]);
            numbers.extend(place.map(|part| part as f32));
        }
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::streams::feed::{NeedlePose, SharedScene};
    use device_sim::page::messages;
    use device_sim::profile::{BUILT_IN, Profile};
    use device_sim::session::Source;

    fn snapshot(profile: &str, depth_mm: f64) -> Snapshot {
        let profile = Profile::find(profile).expect("built in");
        let pose = messages::Pose { depth_mm, angle_rad: 0.5, tilt_rad: 0.5, ..messages::Pose::default() };
        Snapshot {
            pose: Some(NeedlePose::from(&pose)),
            scene: Some(SharedScene(Arc::new(profile.scene(Source::Virtual, None)))),
            ..Snapshot::default()
        }
    }

    #[test]
    fn each_patient_has_an_image_with_its_place() {
        for (name, _) in BUILT_IN {
            let image = Imager::default().follow(&snapshot(name, -5.0), true).expect(name);
            assert_eq!(image.pixels.len(), ROWS * COLUMNS);
            let (dark, bright) = image.pixels.iter().fold((255, 0), |(d, b), p| (d.min(*p), b.max(*p)));
            assert!(dark < 20 && bright > 100, "{name}: {dark} to {bright}");
            let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            assert!(dot(image.across, image.down).abs() < 1e-6 && image.down[2] < -0.5, "{name}: {image:?}");
        }
    }

    #[test]
    fn the_image_shows_the_vessel_where_it_is() {
        // The lumen of the adult, 4.8 to 7.8 mm deep, is dark and the fat above it is not.
        let image = Imager::default().follow(&snapshot("adult", -5.0), true).expect("an image");
        let mean = |from_mm: f64, to_mm: f64| {
            let rows = [from_mm, to_mm].map(|mm| (mm / image.size_mm[1] * ROWS as f64) as usize);
            let part = &image.pixels[rows[0] * COLUMNS..rows[1] * COLUMNS];
            part.iter().map(|p| f64::from(*p)).sum::<f64>() / part.len() as f64
        };
        assert!(
            mean(5.4, 7.2) < 0.5 * mean(2.6, 4.2),
            "{} in blood, {} in fat",
            mean(5.4, 7.2),
            mean(2.6, 4.2)
        );
    }

    #[test]
    fn nothing_is_computed_while_nobody_watches() {
        assert!(Imager::default().follow(&snapshot("adult", -5.0), false).is_none());
        assert!(Imager::default().follow(&Snapshot::default(), true).is_none(), "no scene yet");
    }
}
