//! The forces of a patient's age and illness. None of the three papers gives a number, so each rule
//! here is an assumption of ours, and a key that would change nothing is refused.

use super::{Layer, Person, TissueName};

/// Age at which the forces are those of the file, years.
const AGE_YEARS: f64 = 50.0;
/// Ages beyond which the skin changes no more, years.
const AGES_YEARS: [f64; 2] = [20.0, 90.0];
/// Share of the skin's forces that is lost each year. An assumption: the skin gives way at 1.0 N in
/// the profile `adult`, taken as 50 years old, and at 0.7 N in `thin-elderly`, taken as 80.
const LOST_PER_YEAR: f64 = 0.01;

/// The largest compliance that the device takes, mm²/N: a wall as soft as that gives 1 mN after 1
/// mm, and may not become softer.
const SOFTEST_MM2_PER_N: f64 = 1000.0;
/// The least stiffness of a wall that is drawn back from, N/mm.
const SOFTEST_N_PER_MM: f64 = 0.05;

/// An illness and its effect.
struct Pathology {
    name: &'static str,
    tissues: &'static [TissueName],
    /// Factor of the forces of these tissues.
    factor: f64,
}

/// The illnesses that change forces; the factors are assumptions.
const PATHOLOGIES: [Pathology; 2] = [
    // Adhesive capsulitis: the structures around the joint thicken and stiffen.
    Pathology { name: "frozen shoulder", tissues: &[TissueName::Bursa, TissueName::Tendon], factor: 1.3 },
    // Fibrosis: the skin hardens.
    Pathology { name: "scleroderma", tissues: &[TissueName::Skin], factor: 1.5 },
];

/// Scales the forces of `layers` as age and illness say. A key of the person that changes nothing
/// is an error; `by_table` is true if the forces come from a table, which nothing of this changes.
pub(super) fn apply(layers: &mut [Layer], person: &Person, by_table: bool) -> Result<(), String> {
    check_body(layers, person)?;
    if let Some(age_years) = person.age_years {
        let [youngest, oldest] = AGES_YEARS;
        let factor = 1.0 - LOST_PER_YEAR * (age_years.clamp(youngest, oldest) - AGE_YEARS);
        scale(layers, &[TissueName::Skin], factor, by_table)
            .map_err(|why| format!("patient.age_years changes nothing here: {why}; remove it"))?;
    }
    let Some(words) = &person.pathology else { return Ok(()) };
    let Some(pathology) = PATHOLOGIES.iter().find(|known| known.name == words.as_str()) else {
        let known: Vec<&str> = PATHOLOGIES.iter().map(|known| known.name).collect();
        return Err(format!(
            "patient.pathology is \"{words}\", which changes nothing here; use one of {}, or remove it",
            known.join(", ")
        ));
    };
    scale(layers, pathology.tissues, pathology.factor, by_table)
        .map_err(|why| format!("patient.pathology \"{words}\" changes nothing here: {why}; remove it"))
}

/// Refuses weight, height or sex where no layer's thickness follows from them.
fn check_body(layers: &[Layer], person: &Person) -> Result<(), String> {
    let key = match person {
        Person { weight_kg: Some(_), .. } => "weight_kg",
        Person { height_cm: Some(_), .. } => "height_cm",
        Person { sex: Some(_), .. } => "sex",
        _ => return Ok(()),
    };
    if layers.iter().any(|layer| layer.thickness.is_some()) {
        return Ok(());
    }
    Err(format!(
        "patient.{key} changes nothing here: no layer has thickness = \"by-body-mass\"; add that to the fat, or remove it"
    ))
}

/// Scales the forces of each layer of these tissues; an error says why none is changed.
fn scale(layers: &mut [Layer], tissues: &[TissueName], factor: f64, by_table: bool) -> Result<(), String> {
    if by_table {
        return Err("the forces of law.model xr come from its table".into());
    }
    let mut count = 0;
    for layer in layers.iter_mut().filter(|layer| tissues.contains(&layer.tissue)) {
        count += usize::from(scale_layer(layer, factor));
    }
    if count == 0 { Err("no layer that it stiffens or softens has forces".into()) } else { Ok(()) }
}

/// Multiplies a layer's forces at every depth; true if it has any.
fn scale_layer(layer: &mut Layer, factor: f64) -> bool {
    if let Some(wall) = &mut layer.wall {
        for parabola in [&mut wall.elastic, &mut wall.relief] {
            parabola.compliance_mm2_per_n = scaled_compliance(parabola.compliance_mm2_per_n, factor);
            parabola.base_n *= factor;
        }
        let unload = wall.unload_n_per_mm;
        wall.unload_n_per_mm =
            if unload >= SOFTEST_N_PER_MM { (unload * factor).max(SOFTEST_N_PER_MM) } else { unload };
    }
    if let Some(cutting) = &mut layer.cutting {
        cutting.inwards_n *= factor;
        cutting.outwards_n *= factor;
    }
    layer.wall.is_some() || layer.cutting.is_some()
}

/// Returns the compliance at which a wall gives `factor` times the force. One at the softest stays
/// there.
fn scaled_compliance(compliance_mm2_per_n: f64, factor: f64) -> f64 {
    let scaled = compliance_mm2_per_n / factor;
    // What is out of range in the file is refused with the value in the file.
    if compliance_mm2_per_n <= SOFTEST_MM2_PER_N { scaled.min(SOFTEST_MM2_PER_N) } else { scaled }
}

#[cfg(test)]
mod tests {
    use crate::named_files::Text;
    use crate::profile::{BUILT_IN, Profile};
    use control_core::config::{Law, Tissue};

    fn built_in(name: &str) -> &'static str {
        BUILT_IN.iter().find(|(known, _)| *known == name).expect("it is built in").1
    }

    fn parse(text: String) -> Result<Profile, String> {
        Profile::parse(Text { origin: "test.toml".into(), text }).map_err(|why| why.to_string())
    }

    /// The cutting force of a tissue in the shoulder, N.
    fn cutting_n(profile: &Profile, tissue: Tissue) -> f64 {
        let patient = &profile.config.patient;
        let index = patient.layers.iter().position(|layer| layer.tissue == tissue).expect("it has it");
        let Law::Sparte(law) = &patient.law else { panic!("another law") };
        law.cutting[index].inwards.0.to_num()
    }

    fn near(value: f64, wanted: f64) -> bool {
        (value - wanted).abs() < 1e-3
    }

    #[test]
    fn age_changes_the_skins_forces() {
        let shoulder = |age: &str| {
            let text = built_in("shoulder").replace("age_years = 50", &format!("age_years = {age}"));
            cutting_n(&parse(text).expect(age), Tissue::Skin)
        };
        assert!(near(shoulder("50"), 0.8) && near(shoulder("80"), 0.56), "{}", shoulder("80"));
        assert!(near(shoulder("20"), 1.04) && near(shoulder("5"), 1.04), "{}", shoulder("20"));
        let adult = |age: &str| {
            let text = built_in("adult").replace("[patient]", &format!("[patient]\nage_years = {age}"));
            let profile = parse(text).expect(age);
            let scene = profile.scene(crate::session::Source::Virtual, None);
            [0, 2].map(|layer: usize| scene.layers[layer].puncture_force_n.expect("a wall"))
        };
        let ([skin, vessel], [old_skin, old_vessel]) = (adult("50"), adult("80"));
        assert!(near(old_skin, 0.7 * skin) && near(old_vessel, vessel), "{old_skin} N, {old_vessel} N");
    }

    #[test]
    fn an_illness_changes_the_forces_of_its_tissues() {
        let text = built_in("shoulder").replace("[patient]", "[patient]\npathology = \"frozen shoulder\"");
        let ill = parse(text).expect("it may run");
        let well = parse(built_in("shoulder").into()).expect("it may run");
        for (tissue, factor) in [(Tissue::Bursa, 1.3), (Tissue::Tendon, 1.3), (Tissue::Muscle, 1.0)] {
            let (ill_n, well_n) = (cutting_n(&ill, tissue), cutting_n(&well, tissue));
            assert!(near(ill_n, factor * well_n), "{tissue:?}: {ill_n} N, {well_n} N");
        }
    }

    #[test]
    fn a_key_that_changes_nothing_is_refused() {
        for (profile, key, hint) in [
            ("adult", "pathology = \"gout\"", "use one of frozen shoulder, scleroderma"),
            ("adult", "pathology = \"frozen shoulder\"", "no layer that it stiffens"),
            ("adult", "weight_kg = 70.0", "patient.weight_kg changes nothing here"),
            ("adult", "sex = \"male\"", "patient.sex changes nothing here"),
            ("phantom", "age_years = 70", "come from its table"),
        ] {
            let text = built_in(profile).replace("[patient]", &format!("[patient]\n{key}"));
            let said = parse(text).expect_err(key);
            assert!(said.contains(hint) && said.contains("test.toml"), "{key}: {said}");
        }
    }
}
