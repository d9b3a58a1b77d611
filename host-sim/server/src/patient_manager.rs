//! Validates and applies patient changes during a run. An edit in the page becomes a checked
//! profile, is requested from the device, and counts once the device has accepted all of it. It
//! sends nothing itself.

use crate::saved_patients::SavedPatients;
use control_core::{Device, Patient};
use device_sim::error::Error;
use device_sim::named_files::Text;
use device_sim::procedure::{self, Procedure};
use device_sim::profile::{self, Profile};
use device_sim::session::{PatientAnswer, PatientStatus, Scene, Source};
use recording::messages::Setup;

/// The patient of a run.
#[derive(Clone, Debug)]
pub struct PatientManager {
    profile: Profile,
    device: Device,
    source: Source,
    /// Name or file of what the scripted hand does, where one does anything.
    procedure: Option<String>,
    setup: Setup,
    saved: Option<SavedPatients>,
    asked: Option<RequestedPatient>,
}

/// A patient that the device has been asked to take.
#[derive(Clone, Debug)]
struct RequestedPatient {
    profile: Profile,
    /// The procedure of the scripted hand in it, if it differs from the default.
    procedure: Option<String>,
    /// The name to save it under.
    save_as: Option<String>,
}

impl PatientManager {
    /// `profile` on `device`; `procedure` is what the scripted hand was asked to do.
    pub fn new(profile: Profile, source: Source, procedure: Option<String>, setup: Setup) -> Self {
        let device = profile.config.device;
        Self { profile, device, source, procedure, setup, saved: None, asked: None }
    }

    /// Lets edited patients be saved, and saved ones be chosen.
    pub fn saving_in(mut self, saved: SavedPatients) -> Self {
        self.saved = Some(saved);
        self
    }

    /// Checks a patient that comes with the program or was saved; what to ask of the device, or in
    /// one sentence why not.
    pub fn choose(&mut self, name: &str) -> Result<Patient, Error> {
        let profile = Profile::parse_for(self.named(name)?, &self.device)?;
        // It brings its own procedure; the scripted hand must find its way in any.
        let is_own = self.procedure.as_ref() == Some(&procedure::of_page(&self.profile));
        let new = if is_own { procedure::of_page(&profile) } else { profile.procedure.clone() };
        let own = self.procedure.is_some().then_some(new);
        self.ask(profile, own, None)
    }

    /// Checks an edited patient, key by key as in a profile's file; what to ask of the device, or
    /// in one sentence why not.
    pub fn edit(&mut self, json: &serde_json::Value) -> Result<Patient, Error> {
        let profile = self.edited(json)?;
        self.ask(profile, None, None)
    }

    /// The same, to be saved under `name`, or a free name like it, once the device has taken it.
    pub fn save(&mut self, name: &str, json: &serde_json::Value) -> Result<Patient, Error> {
        let saved = self.saved.as_ref().ok_or_else(|| {
            Error::input("this program keeps no patients; send it to the device without saving")
        })?;
        let name = saved.free_name(name)?;
        let mut json = json.clone();
        if let Some(key) = json.get_mut("name") {
            *key = name.as_str().into();
        }
        let profile = self.edited(&json)?;
        self.ask(profile, None, Some(name))
    }

    fn ask(
        &mut self,
        profile: Profile,
        procedure: Option<String>,
        save_as: Option<String>,
    ) -> Result<Patient, Error> {
        let wanted = procedure.as_ref().or(self.procedure.as_ref());
        wanted.into_iter().try_for_each(|wanted| hand(wanted, &profile).map(drop))?;
        let patient = profile.config.patient.clone();
        self.asked = Some(RequestedPatient { profile, procedure, save_as });
        Ok(patient)
    }

    /// The text of a patient that can be chosen.
    fn named(&self, name: &str) -> Result<Text, Error> {
        if let Some((_, text)) = profile::BUILT_IN.iter().find(|(known, _)| *known == name) {
            return Ok(Text { origin: format!("profile {name}"), text: (*text).to_owned() });
        }
        self.saved.as_ref().and_then(|saved| saved.read(name)).unwrap_or_else(|| {
            Err(Error::input(format_args!("there is no patient called \"{name}\"; choose one of the list")))
        })
    }

    /// An edited patient, checked.
    fn edited(&self, json: &serde_json::Value) -> Result<Profile, Error> {
        let text = toml::to_string(json).map_err(|cause| {
            Error::input(format_args!("the edited patient is not a profile ({cause}); correct it"))
        })?;
        Profile::parse_for(Text { origin: "the edited patient".into(), text }, &self.device)
    }

    /// Applies what was asked, once the device has taken it; `None` if nothing was asked. A patient
    /// that was to be saved is written: the answer has the file, or the reason why it could not be
    /// written.
    pub fn taken(&mut self) -> Option<PatientAnswer> {
        let RequestedPatient { mut profile, procedure, save_as } = self.asked.take()?;
        let mut answer = PatientAnswer { taken: true, ..PatientAnswer::default() };
        if let (Some(saved), Some(name)) = (&self.saved, save_as) {
            match saved.write(&name, &format!("# Edited and saved in the page.\n{}", profile.source.text)) {
                Ok(file) => {
                    profile.source.origin.clone_from(&file);
                    answer.saved = Some(file);
                }
                Err(why) => answer.reason = why.to_string(),
            }
        }
        if procedure.is_some() {
            self.procedure = procedure;
        }
        self.setup.profile_toml = profile.source.text.clone();
        self.setup.profile_origin = profile.source.origin.clone();
        self.profile = profile;
        // Where no hand is simulated, the patient's own procedure says what a person has to do.
        let own = || Procedure::find(&self.profile.procedure, &self.profile).ok();
        self.setup.purpose = self.procedure().or_else(own).and_then(|procedure| procedure.purpose);
        if let Some(procedure) = self.procedure() {
            self.setup.procedure = Some(procedure.name);
        }
        Some(answer)
    }

    /// The device has refused it.
    pub fn refused(&mut self) {
        self.asked = None;
    }

    /// Returns the scene of the active patient.
    pub fn scene(&self) -> Scene {
        let procedure = self.setup.procedure.clone();
        self.profile.scene(self.source.clone(), procedure)
    }

    /// Returns the procedure of the scripted hand in the active patient.
    pub fn procedure(&self) -> Option<Procedure> {
        self.procedure.as_ref().and_then(|wanted| hand(wanted, &self.profile).ok())
    }

    /// The patient that counts.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// For the recording.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// For the page.
    pub fn status(&self, answer: Option<PatientAnswer>) -> PatientStatus {
        let built_in = profile::BUILT_IN.iter().map(|(name, _)| (*name).to_owned());
        PatientStatus {
            names: built_in.chain(self.saved.iter().flat_map(SavedPatients::names)).collect(),
            can_save: self.saved.is_some(),
            // What has been parsed as a profile is TOML, and TOML is JSON but for its dates.
            profile: toml::from_str(&self.profile.source.text).unwrap_or_default(),
            purpose: self.setup.purpose,
            answer,
        }
    }
}

/// Returns the requested procedure or, if it makes no sense in this patient, the one that the
/// patient's file names.
fn hand(wanted: &str, profile: &Profile) -> Result<Procedure, Error> {
    Procedure::find(wanted, profile)
        .or_else(|cause| Procedure::find(&profile.procedure, profile).map_err(|_| cause))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patients() -> PatientManager {
        let profile = Profile::find("adult").expect("it is built in");
        let setup = Setup {
            program: String::new(),
            source: "virtual".into(),
            profile_toml: profile.source.text.clone(),
            profile_origin: String::new(),
            procedure: Some("venepuncture".into()),
            device_toml: None,
            purpose: None,
        };
        PatientManager::new(profile, Source::Virtual, Some("venepuncture".into()), setup)
    }

    #[test]
    fn an_edited_patient_counts_once_the_device_has_taken_it() {
        let mut patients = patients();
        let mut json = patients.status(None).profile;
        let force_before = patients.scene().layers[0].friction_n_per_mm;
        json["layer"][0]["friction_n_per_mm"] = serde_json::json!(0.03);
        let patient = patients.edit(&json).expect("it may run");
        assert!((patient.layers[0].friction.0.to_num::<f64>() - 0.03).abs() < 1e-4);
        assert_eq!(patients.scene().layers[0].friction_n_per_mm, force_before, "not yet");
        assert!(patients.taken().is_some() && patients.taken().is_none(), "once");
        assert!((patients.scene().layers[0].friction_n_per_mm - 0.03).abs() < 1e-4);
        assert!(patients.setup().profile_toml.contains("0.03"), "the recording is told");
        patients.choose("firm-skin").expect("built in");
        patients.refused();
        assert!(patients.taken().is_none(), "what was refused never counts");
        patients.choose("firm-skin").expect("built in");
        assert!(patients.taken().is_some());
        assert_eq!(patients.scene().profile, "firm-skin");
        patients.choose("shoulder").expect("built in");
        assert!(patients.taken().is_some());
        assert_eq!(
            patients.setup().procedure.as_deref(),
            Some("shoulder-straight"),
            "it brings its procedure"
        );
    }

    #[test]
    fn a_saved_patient_can_be_chosen_in_another_run() {
        let folder = std::env::temp_dir().join(format!("patients-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let mut first = patients();
        let mut json = first.status(None).profile;
        json["layer"][2]["depth_mm"] = serde_json::json!(6.0);
        let said = first.save("anna", &json).expect_err("there is no folder").to_string();
        assert!(said.contains("keeps no patients"), "{said}");
        let mut first = patients().saving_in(SavedPatients::new(&folder));
        assert!(first.status(None).can_save);
        first.save("anna", &json).expect("it may run");
        assert!(!first.status(None).names.contains(&"anna".into()), "the device has not taken it");
        let file = first.taken().expect("asked").saved.expect("saved");
        assert!(file.ends_with("anna.toml") && first.setup().profile_origin == file);
        first.save("anna", &json).expect("it may run");
        let second = first.taken().expect("asked").saved.expect("saved");
        assert!(second.ends_with("anna-2.toml"), "{second}");
        let mut later = patients().saving_in(SavedPatients::new(&folder));
        assert!(later.status(None).names.ends_with(&["anna".into(), "anna-2".into()]));
        later.choose("anna-2").expect("in the list");
        assert!(later.taken().is_some_and(|answer| answer.saved.is_none()));
        assert_eq!(later.scene().profile, "anna-2");
        assert!((later.scene().layers[2].depth_mm - 6.0).abs() < 1e-4);
        std::fs::remove_dir_all(&folder).expect("it is ours");
    }

    #[test]
    fn what_cannot_be_is_refused_in_one_sentence() {
        let mut patients = patients();
        let good = patients.status(None).profile;
        let with = |pointer: &str, value: serde_json::Value| {
            let mut json = good.clone();
            *json.pointer_mut(pointer).expect("it is there") = value;
            json
        };
        for (edited, hint) in [
            (with("/layer/0/friction_n_per_mm", serde_json::json!("much")), "friction_n_per_mm"),
            (with("/layer/0/friction_n_per_mm", serde_json::json!(-1.0)), "friction_n_per_mm is -1"),
            (with("/name", serde_json::json!(7)), "string"),
            (with("/layer", serde_json::json!([])), "layer"),
            (serde_json::json!(null), "patient"),
        ] {
            let said = patients.edit(&edited).expect_err(hint).to_string();
            assert!(said.contains(hint) && !said.contains('\n'), "{hint}: {said}");
            assert!(patients.taken().is_none());
        }
        let said = patients.choose("giant").expect_err("unknown").to_string();
        assert!(said.contains("giant") && !said.contains('\n') && patients.taken().is_none(), "{said}");
    }
}
