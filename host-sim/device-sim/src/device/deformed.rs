//! The picture's tissue, simulated with the virtual device: it gives the displacement of the
//! surface where the needle goes in. As an option, which is off by default, the force law of Paper
//! 000 counts depth from that surface (its force function takes "position and velocity of the
//! interacting objects" from position-based dynamics).
//!
//! The surface is taken at four points one spacing of the grid around the entry: the pierced place
//! itself goes with the needle, and a depth past it would be zero until the skin gives way. This is
//! an assumption; the paper does not say where it measures.

use crate::profile::Profile;
use control_core::config::{Law, Tissue as Kind};
use control_core::controller::TickOutput;
use control_core::units::Millimetres;
use control_core::{Patient, TICK_HZ};
use fixed::types::I16F16;
use tissue::needle::WallName;
use tissue::{Configuration, Needle, PunctureState, Punctures, Tissue};

/// Ticks from one picture to the next: 62.5 pictures a second.
const PICTURE_TICKS: u32 = TICK_HZ / 125 * 2;
/// Tissue below the vessel, mm.
const BELOW_MM: f32 = 8.0;
/// No flatter needle is counted with, as sin of its angle.
const FLATTEST: f32 = 0.1;

/// Tissue that follows a needle.
#[derive(Clone, Debug)]
pub(super) struct Deformed {
    tissue: Tissue,
    /// The layer of the patient that each wall belongs to.
    layers: [u8; 3],
    /// The points of the skin at rest, mm.
    around: [[f32; 3]; 4],
    ticks: u32,
}

impl Deformed {
    /// Returns the tissue at rest, with the walls of this patient, or a sentence that says why it
    /// cannot be made.
    pub(super) fn new(profile: &Profile) -> Result<Self, String> {
        let patient = &profile.config.patient;
        if !matches!(patient.law, Law::Xr(_)) {
            return Err("only the law xr can count depth from the deformed tissue; add --model xr".into());
        }
        let layers = walls(patient).ok_or(
            "the deformed tissue is Table 1 of paper 000, and this patient has no vessel with a far wall; choose --profile phantom",
        )?;
        let mm =
            |layer: u8| patient.layers.get(usize::from(layer)).map_or(0.0, |l| l.depth.0.to_num::<f32>());
        let [_, near_mm, far_mm] = layers.map(mm);
        // The device says when a wall gives way: the travel here is a bound.
        let configuration = Configuration::table_1(near_mm, far_mm, far_mm + BELOW_MM, [6.0; 3])
            .ok_or("the vessel's walls are not one below the other; correct depth_mm")?;
        let mut tissue = Tissue::new(&configuration).map_err(|refusal| refusal.to_string())?;
        tissue.set_punctures(Punctures::Told);
        let radius = configuration.layers[0].spacing_mm;
        let around = [[radius, 0.0], [-radius, 0.0], [0.0, radius], [0.0, -radius]].map(|[x, y]| [x, y, 0.0]);
        Ok(Self { tissue, layers, around, ticks: 0 })
    }

    /// Follows the device by a tick; sometimes where the surface is now, along the needle past its
    /// rest.
    pub(super) fn follow(&mut self, output: &TickOutput) -> Option<Millimetres> {
        for (wall, layer) in self.layers.into_iter().enumerate() {
            let bit = 1_u8.unbounded_shl(layer.into());
            let changes = &output.transitions;
            if (changes.puncture | changes.in_track) & bit != 0 {
                self.tissue.tell(WallName::Layer(wall), PunctureState::Inserted);
            }
            if changes.exit & bit != 0 {
                self.tissue.tell(WallName::Layer(wall), PunctureState::Away);
            }
        }
        self.ticks = (self.ticks + 1) % PICTURE_TICKS;
        if self.ticks != 0 {
            return None;
        }
        let angle = f32::from(output.angle.0) * 1e-3;
        let needle = Needle::entering(output.depth.0.to_num(), angle, 0.0);
        self.tissue.step(&needle, PICTURE_TICKS as f32 / TICK_HZ as f32);
        let depths =
            self.around.iter().filter_map(|rest| self.tissue.moved(*rest).map(|now| now[2] - rest[2]));
        let down = depths.sum::<f32>() / self.around.len() as f32;
        Some(Millimetres(I16F16::saturating_from_num(down / angle.sin().max(FLATTEST))))
    }
}

/// The layers of skin, vessel and its far wall.
fn walls(patient: &Patient) -> Option<[u8; 3]> {
    let of = |kind| patient.layers.iter().position(|layer| layer.tissue == kind);
    Some([0, of(Kind::Vessel)? as u8, of(Kind::FarWall)? as u8])
}

#[cfg(test)]
mod tests {
    use super::*;
    use control_core::units::{Counts, Milliradians};
    use control_core::{Controller, Order, TickInput};

    /// The forces of an insertion at 5 mm/s from 1 mm before the skin to 12 mm along the needle,
    /// one a tick, N.
    fn forces(is_relative: bool) -> Vec<f64> {
        let profile = Profile::find("phantom").expect("it is built in");
        let mut deformed = Deformed::new(&profile).expect("it can be built");
        let mut core = Controller::new(profile.plan.clone());
        let per_count = core.plan().mm_per_count().to_num::<f64>();
        let tilt = Milliradians((profile.entry_rad * 1e3).round() as i16);
        let tick = |core: &mut Controller, mm: f64| {
            core.order(Order::Heartbeat);
            core.tick(TickInput { count: Counts((mm / per_count).round() as i32), tilt })
        };
        tick(&mut core, -1.0);
        core.order(Order::Start);
        (0..26_000)
            .map(|number| {
                let output = tick(&mut core, -1.0 + 5e-4 * f64::from(number));
                if let Some(displacement) = deformed.follow(&output).filter(|_| is_relative) {
                    core.displace(displacement);
                }
                output.force.0.to_num()
            })
            .collect()
    }

    #[test]
    fn force_comes_later_where_depth_counts_from_a_dented_surface() {
        let [rigid, relative] = [false, true].map(forces);
        let peak = |forces: &[f64]| {
            let largest = forces.iter().copied().fold(0.0, |a: f64, b| a.max(b));
            forces.iter().position(|force| *force == largest).map(|at| (at, largest)).expect("a force")
        };
        let ((early, first), (late, second)) = (peak(&rigid), peak(&relative));
        // 5 mm/s: a millimetre is 2,000 ticks.
        assert!(late > early + 200 && late < early + 6_000, "ticks {early} and {late}");
        assert!((second / first - 1.0).abs() < 0.1, "as strong: {first} N and {second} N");
    }

    #[test]
    fn only_the_table_and_a_vessel_can_be_followed() {
        let adult = Profile::find("adult").expect("it is built in");
        assert!(Deformed::new(&adult).expect_err("another law").contains("--model xr"));
    }
}
