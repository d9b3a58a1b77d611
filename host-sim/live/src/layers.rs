//! `layers`: what a needle meets on a straight line into a body.

use clap::Args;
use device_sim::error::Error;
use device_sim::profile::{Entry, InBody, Profile};
use serde_json::json;

/// List what a needle meets on a straight line into a body: structures with mm along the needle,
/// and the layers that the device gets
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim layers --profile forearm --along 10 --around 5 --angle 45"))]
pub struct Layers {
    /// A patient with a [body]: shoulder-joint, forearm, knee, hip, or a TOML file
    #[arg(long, default_value = "forearm")]
    profile: String,
    /// The point of entry along the limb, away from the trunk, in mm; without it, as the patient's
    /// file says, like the rest
    #[arg(long, value_name = "MM")]
    along: Option<f64>,
    /// The point of entry around the limb from its top, in degrees
    #[arg(long, value_name = "DEGREES")]
    around: Option<f64>,
    /// The needle's direction seen from above, 0 being along the limb, in degrees
    #[arg(long, value_name = "DEGREES")]
    azimuth: Option<f64>,
    /// The needle's inclination below the horizontal, 5 to 90 degrees
    #[arg(long, value_name = "DEGREES")]
    angle: Option<f64>,
    /// The turn of the limb about its axis, in degrees
    #[arg(long, value_name = "DEGREES")]
    turn: Option<f64>,
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl Layers {
    pub(crate) fn run(self) -> Result<(), Error> {
        let entry = Entry {
            along_mm: self.along,
            around_deg: self.around,
            azimuth_deg: self.azimuth,
            turn_deg: self.turn,
            angle_deg: self.angle,
        };
        let profile = Profile::find(&self.profile)?.entered(&entry)?;
        let Some(body) = &profile.body else { return Ok(()) };
        if self.json {
            println!("{}", as_json(&profile, body));
        } else {
            print(&profile, body);
        }
        Ok(())
    }
}

/// The depths of the device's layers along the needle, mm, by their names.
fn device_layers(profile: &Profile) -> impl Iterator<Item = (String, f64)> + '_ {
    let sine = profile.entry_rad.sin();
    profile.config.patient.layers.iter().zip(0_u8..).map(move |(layer, number)| {
        (profile.layer_name(number).unwrap_or_default(), layer.depth.0.to_num::<f64>() / sine)
    })
}

fn as_json(profile: &Profile, body: &InBody) -> serde_json::Value {
    let met = body.pieces.iter().map(|piece| {
        let structure = body.body.structures[piece.structure].name;
        json!({ "structure": structure, "from_mm": piece.from_mm, "to_mm": piece.to_mm })
    });
    let device = device_layers(profile).map(|(name, from_mm)| json!({ "layer": name, "from_mm": from_mm }));
    json!({
        "site": body.site.name(),
        "angle_to_skin_deg": body.line.angle_deg,
        "met": met.collect::<Vec<_>>(),
        "device": device.collect::<Vec<_>>(),
    })
}

fn print(profile: &Profile, body: &InBody) {
    println!("{}, {:.1} degrees to the skin at entry", body.site.name(), body.line.angle_deg);
    for piece in &body.pieces {
        let name = body.body.structures[piece.structure].name;
        println!("{:7.2} to {:6.2} mm  {name}", piece.from_mm, piece.to_mm);
    }
    let device: Vec<_> = device_layers(profile).map(|(name, mm)| format!("{name} {mm:.2} mm")).collect();
    println!("the device gets: {}", device.join(", "));
}
