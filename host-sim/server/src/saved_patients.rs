//! Patients that people have saved in the page: a TOML file each in one folder, which can be chosen
//! like those of the program.

use device_sim::error::Error;
use device_sim::named_files::Text;
use device_sim::named_files::is_file_name;
use device_sim::profile;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Patients that a list shows; a folder may have more files.
const MOST_LISTED: usize = 200;
/// Size of the largest file taken, in bytes: an edited patient with all its layers has about 3,000.
const LARGEST: u64 = 65_536;
/// Files of one name, distinguished by a number.
const MOST_OF_A_NAME: u32 = 1_000;

/// The folder of the saved patients; it is created with the first.
#[derive(Clone, Debug)]
pub struct SavedPatients {
    folder: PathBuf,
}

impl SavedPatients {
    /// In `folder`, which need not exist.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// Returns their names, in order.
    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.filter_map(|entry| name_of(&entry.path())).take(MOST_LISTED).collect();
        names.sort();
        names
    }

    /// Returns the text of the patient called `name`; none if there is no such file.
    pub fn read(&self, name: &str) -> Option<Result<Text, Error>> {
        let file = self.file(name);
        if !is_file_name(name) || !file.is_file() {
            return None;
        }
        let origin = file.display().to_string();
        let read = || {
            if fs::metadata(&file)?.len() > LARGEST {
                return Err(io::Error::other(format!("it has more than {LARGEST} bytes")));
            }
            fs::read_to_string(&file)
        };
        Some(read().map(|text| Text { origin: origin.clone(), text }).map_err(|cause| {
            Error::input(format_args!("{origin}: the patient cannot be read ({cause}); choose another"))
        }))
    }

    /// Returns `name` or, where a patient has it already, the next of `name-2`, `name-3` and so on.
    pub(crate) fn free_name(&self, name: &str) -> Result<String, Error> {
        let is_free = |name: &str| {
            !profile::BUILT_IN.iter().any(|(known, _)| *known == name) && !self.file(name).exists()
        };
        let mut names =
            (1..=MOST_OF_A_NAME).map(|n| if n == 1 { name.to_owned() } else { format!("{name}-{n}") });
        names.find(|name| is_free(name)).ok_or_else(|| {
            Error::input(format_args!(
                "there are {MOST_OF_A_NAME} patients called {name}; choose another name"
            ))
        })
    }

    /// Writes a new file; its path.
    pub fn write(&self, name: &str, text: &str) -> Result<String, Error> {
        let file = self.file(name);
        let shown = file.display().to_string();
        let written = fs::create_dir_all(&self.folder)
            .and_then(|()| fs::File::create_new(&file))
            .and_then(|mut new| new.write_all(text.as_bytes()));
        written.map(|()| shown.clone()).map_err(|cause| {
            Error::failed(format_args!(
                "{shown}: the patient cannot be saved ({cause}); start the program in a folder that can be written"
            ))
        })
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.toml"))
    }
}

/// The name of the patient in `file`, if it is one of ours.
fn name_of(file: &Path) -> Option<String> {
    let is_toml = file.extension().is_some_and(|end| end == "toml");
    let name = file.file_stem()?.to_str()?;
    (is_toml && is_file_name(name)).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patient_is_written_once_and_found_again() {
        let folder = std::env::temp_dir().join(format!("saved-patients-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        let saved = SavedPatients::new(&folder);
        assert!(saved.names().is_empty() && saved.read("anna").is_none(), "no folder yet");
        assert_eq!(saved.free_name("anna").expect("free"), "anna");
        assert_eq!(saved.free_name("adult").expect("free"), "adult-2", "the program's own stays");
        let file = saved.write("anna", "format = 1\n").expect("written");
        assert!(file.ends_with("anna.toml"));
        assert!(
            saved
                .write("anna", "format = 2\n")
                .expect_err("never replaced")
                .to_string()
                .contains("anna.toml")
        );
        assert_eq!(saved.free_name("anna").expect("free"), "anna-2");
        fs::write(folder.join("notes.txt"), "no patient").expect("writable");
        assert_eq!(saved.names(), ["anna"]);
        assert_eq!(saved.read("anna").expect("there").expect("readable").text, "format = 1\n");
        assert!(saved.read("../anna").is_none(), "no other folder");
        fs::write(folder.join("long.toml"), vec![b'#'; 70_000]).expect("writable");
        let said = saved.read("long").expect("there").expect_err("too long").to_string();
        assert!(said.contains("65536 bytes") && !said.contains('\n'), "{said}");
        fs::remove_dir_all(&folder).expect("it is ours");
    }
}
