//! A recording and what simulations make of it as one MCAP file, for Foxglove, Rerun and
//! PlotJuggler: a topic for what was recorded, one for each model, and one for what each is off.

use device_sim::error::Error;
use diagnosis::simulation::comparison::Comparison;
use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};
use recording::protobuf::{self, Fields};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Messages a second on a topic, at most.
const RATE_HZ: f64 = 1000.0;

/// Returns the file: `/recording`, and `/simulation/NAME` and `/residual/NAME` for each model, as
/// Protobuf: position from the first row (simulations start anew from the recorded state every
/// 0.5 s), velocity (of simulations, of the free run) and inertia times acceleration. Times count
/// from the first row.
pub fn mcap(compared: &Comparison) -> Result<Vec<u8>, Error> {
    written(compared)
        .map_err(|cause| Error::failed(format_args!("{}: no MCAP of it ({cause})", compared.file)))
}

fn written(compared: &Comparison) -> Result<Vec<u8>, McapError> {
    let options = WriteOptions::new().profile("").library(recording::version::program());
    let mut writer = Writer::with_options(Cursor::new(Vec::new()), options.compression(None))?;
    // Units are in the names.
    let fields = match compared.kind {
        diagnosis::rig::Kind::Rotary => ["position_rad", "velocity_rad_s", "force_nm"],
        diagnosis::rig::Kind::Linear => ["position_m", "velocity_m_s", "force_n"],
    };
    let schema = protobuf::numbers("needle", "Motion", &fields);
    let schema = writer.add_schema("needle.Motion", "protobuf", &schema)?;
    let none = BTreeMap::new();
    let mut topic = |name: String| writer.add_channel(schema, &name, "protobuf", &none);
    let recording = topic("/recording".into())?;
    let models = compared.models.iter().map(|model| {
        let name = model.model.replace(|c: char| !c.is_alphanumeric(), "_");
        Ok((topic(format!("/simulation/{name}"))?, topic(format!("/residual/{name}"))?))
    });
    let models: Vec<(u16, u16)> = models.collect::<Result<_, McapError>>()?;
    let motion = &compared.motion;
    let rate = motion.time.len() as f64 / motion.seconds().max(1e-9);
    let every = (rate / RATE_HZ).round().max(1.0) as usize;
    for row in (0..motion.time.len()).step_by(every) {
        let mut put = |channel_id: u16, position: f64, velocity: f64, force: f64| {
            let time = (motion.time[row] * 1e9).round() as u64;
            let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
            let message = Fields::default().doubles(&[position, velocity, force]).bytes();
            writer.write_to_known_channel(&header, &message)
        };
        let (position, velocity, force) = (motion.position[row], motion.velocity[row], compared.force[row]);
        put(recording, position, velocity, force)?;
        for (model, (simulation, residual)) in compared.models.iter().zip(&models) {
            // Started anew from the recorded state every few seconds where there is time for it: a
            // free run says little.
            let near = model.afresh.as_ref().map_or(model.free.position[row], |positions| positions[row]);
            put(*simulation, near, model.free.velocity[row], model.force[row])?;
            put(*residual, position - near, velocity - model.free.velocity[row], force - model.force[row])?;
        }
    }
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use diagnosis::recording::Recording;
    use diagnosis::rig::Rig;

    #[test]
    fn the_file_has_what_was_recorded_simulated_and_left() {
        let rig = "format = 1\nname = \"r\"\nkind = \"rotary\"\n[model]\ninertia = 0.1\nviscous = 0.2\n[actuator]\ngain = 1.0\n\
                   command_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 1e4\n";
        let rig = Rig::parse(rig, "r").expect("it is a rig");
        let mut text = String::from("time_s,command,position_counts\n");
        for row in 0..2_000 {
            let t = f64::from(row) * 5e-3;
            text += &format!("{t:.4},{:.5},{:.0}\n", (3.0 * t).cos(), 4_000.0 * (1.5 * t).sin());
        }
        let recording = Recording::parse(&text, "a.csv").expect("it is a recording");
        let compared = Comparison::new(&recording, &[("nominal".to_owned(), rig)], &[0.5]);
        let bytes = mcap(&compared).expect("it can be written");
        let mut topics: BTreeMap<String, Vec<(u64, f64)>> = BTreeMap::new();
        for message in mcap::MessageStream::new(&bytes).expect("it can be read") {
            let message = message.expect("it is whole");
            // A tag, and the first double.
            let position = message.data.get(1..9).expect("a double").try_into().expect("eight bytes");
            let position = f64::from_le_bytes(position);
            topics.entry(message.channel.topic.clone()).or_default().push((message.log_time, position));
        }
        assert_eq!(
            topics.keys().collect::<Vec<_>>(),
            ["/recording", "/residual/nominal", "/simulation/nominal"]
        );
        let at = |topic: &str, row: usize| topics[topic][row];
        assert_eq!((topics["/recording"].len(), at("/recording", 100).0), (2_000, 500_000_000));
        for row in [0, 777, 1_999] {
            let left = at("/recording", row).1 - at("/simulation/nominal", row).1;
            assert!((at("/residual/nominal", row).1 - left).abs() < 1e-12, "row {row}");
        }
    }
}
