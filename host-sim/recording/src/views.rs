//! Ways to look at a recording, as files next to it: a layout for Foxglove, and a script that opens
//! it in Rerun with its plots.

use device_sim::error::Error;
use std::path::Path;

/// Names and contents.
const FILES: [(&str, &str); 2] = [
    ("foxglove-layout.json", include_str!("views/foxglove-layout.json")),
    ("open-in-rerun.py", include_str!("views/open-in-rerun.py")),
];

/// Writes the files into the folder of a recording that is an MCAP file by its name, where they are
/// not there already.
///
/// # Errors
/// A sentence if the folder cannot be written.
pub fn write_beside(recording: &Path) -> Result<(), Error> {
    let is_mcap = recording.extension().is_some_and(|ending| ending == "mcap");
    for (name, text) in FILES.into_iter().filter(|_| is_mcap) {
        let path = recording.with_file_name(name);
        if path.exists() {
            continue;
        }
        std::fs::write(&path, text).map_err(|cause| {
            let shown = path.display();
            Error::failed(format_args!(
                "{shown}: cannot be written ({cause}); choose another folder or free some space"
            ))
        })?;
    }
    Ok(())
}
