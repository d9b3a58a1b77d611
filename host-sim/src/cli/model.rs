//! `host-sim model`.

use anatomy::{Body, Role, Triangle};
use clap::Args;
use convert::export::write;

use device_sim::error::Error;
use device_sim::profile::Profile;
use live::{examples, say};
use std::io::{self, Write};
use std::path::PathBuf;

/// Write the skin of a patient's limb, or a vein, as an STL file to be printed.
///
/// The patient is one with a body in three dimensions. The file is binary and in mm: x along the
/// limb away from the trunk, z down, the limb's axis at y = z = 0, so that skin and vein fit
/// together.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim model --profile forearm --structure vein --out vein.stl"))]
pub(crate) struct Model {
    /// The patient
    #[arg(long, value_name = "NAME|FILE")]
    profile: String,
    /// A layer or a tube of the body: skin, muscle, vein …
    #[arg(long, value_name = "NAME", default_value = "skin")]
    structure: String,
    /// The file
    #[arg(long, value_name = "F.stl")]
    out: PathBuf,
}

impl Model {
    pub(crate) fn run(self) -> Result<(), Error> {
        let profile = Profile::find(&self.profile)?;
        let within = profile.body.ok_or_else(|| {
            Error::input(format_args!(
                "{}: has level layers and no body; give a patient with [body], such as forearm",
                self.profile
            ))
        })?;
        let number = structure(&within.body, &self.structure)?;
        let triangles = within.body.surface(number, within.site.along_mm());
        write(&self.out, |out| stl(out, &triangles))?;
        let [from, to] = within.site.along_mm();
        say!("{}", self.out.display());
        say!("triangles={} along_mm={from}..{to}", triangles.len());
        Ok(())
    }
}

/// The number of the structure with a name.
fn structure(body: &Body, name: &str) -> Result<usize, Error> {
    let have = || body.structures.iter().enumerate().filter(|(_, own)| own.role != Role::Inside);
    have().find(|(_, own)| own.name == name).map(|(number, _)| number).ok_or_else(|| {
        let names: Vec<&str> = have().map(|(_, own)| own.name).collect();
        Error::input(format_args!("--structure {name}: this body has {}; give one of them", names.join(", ")))
    })
}

/// Binary STL: 80 bytes of anything, the number of facets, and for each a normal, three corners in
/// single precision and two bytes of nothing. A normal of zero is to be computed by the reader.
fn stl(out: &mut dyn Write, triangles: &[Triangle]) -> io::Result<()> {
    let mut header = [b' '; 80];
    header[..8].copy_from_slice(b"host-sim");
    out.write_all(&header)?;
    let count = u32::try_from(triangles.len()).map_err(io::Error::other)?;
    out.write_all(&count.to_le_bytes())?;
    for triangle in triangles {
        let corners = triangle.iter().flatten().map(|mm| *mm as f32);
        for number in [0.0_f32; 3].into_iter().chain(corners) {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}
