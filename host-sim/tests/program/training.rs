//! A teacher's tasks on the command line: scores, a debrief, patients, the papers.

use crate::common::{figure, folder, refused, run, run_well, text};
use serde_json::Value;

/// Insertions of a minute of a procedure, as `score --json` gives them.
fn scored(name: &str, arguments: &[&str]) -> (std::path::PathBuf, Vec<Value>) {
    let file = folder(name).join("a.mcap");
    let head = ["run", "--headless", "--fast", "--record", text(&file)];
    run_well(&[&head[..], arguments].concat());
    let json: Value = serde_json::from_str(&run_well(&["score", text(&file), "--json"])).expect("JSON");
    let insertions = json["insertions"].as_array().expect("insertions").clone();
    (file, insertions)
}

#[test]
fn a_venepuncture_is_scored_and_debriefed() {
    let (file, insertions) = scored("scored", &["--seconds", "12", "--angle", "45"]);
    assert_eq!(insertions.len(), 2);
    for one in &insertions {
        let number = |key: &str| one[key].as_f64().unwrap_or_else(|| panic!("{key} in {one}"));
        assert!((number("angle_deg") - 45.0).abs() < 0.1 && number("angle_rms_error_deg") < 15.1, "{one}");
        // 4.8 mm at 45°; the skin that was pushed in has sprung back to a part.
        assert!((6.7..7.6).contains(&number("vessel_contact_path_mm")), "{one}");
        // The procedure holds it there for 1 s, and comes and goes gently.
        assert!((1.5..2.5).contains(&number("in_lumen_s")), "{one}");
        assert_eq!((&one["through_far_wall"], &one["vessel"]), (&Value::Bool(false), &Value::Bool(true)));
        assert_eq!(
            (number("passes"), number("redirections"), number("flashbacks")),
            (1.0, 0.0, 1.0),
            "{one}"
        );
        // One minimum-jerk movement that two punctures disturb.
        assert!((-5.0..-1.4).contains(&number("smoothness")), "{one}");
        assert!(number("path_mm") > 2.0 * number("depth_mm") - 1.0, "{one}");
    }
    let out = folder("debriefed");
    let said = run_well(&["debrief", text(&file), text(&file), "--out", text(&out)]);
    assert!((figure(&said, "insertions") - 4.0).abs() < 1e-9, "{said}");
    let page = std::fs::read_to_string(out.join("debrief.html")).expect("written");
    for words in ["in the vein for", "through the far wall", "4.8 mm", "<svg", "change"] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("http") && !page.contains("NaN"));
    refused(&run(&["debrief", "/no/such.mcap", "--out", text(&out)]), 2, &["/no/such.mcap"]);
}

/// But for names, no words of a debrief in another language are as in English.
#[test]
fn a_debrief_is_in_german_and_in_french() {
    let (file, _) = scored("languages", &["--seconds", "12"]);
    let words = |language: &str| {
        let out = folder(&format!("debrief-{language}"));
        run_well(&["debrief", text(&file), text(&file), "--language", language, "--out", text(&out)]);
        let page = std::fs::read_to_string(out.join("debrief.html")).expect("written");
        let (_, body) = page.split_once("</style>").expect("a style");
        let texts = body.split('>').filter_map(|part| part.split_once('<')).map(|(text, _)| text.to_owned());
        texts.filter(|text| text.chars().any(char::is_alphabetic)).collect::<Vec<_>>()
    };
    let english = words("en");
    assert!(english.len() > 60, "{english:?}");
    for (language, same) in [("de", &["5 mm"][..]), ("fr", &["5 mm", "Angle", "force, N"])] {
        let others = words(language);
        assert_eq!(others.len(), english.len(), "{language}");
        for (ours, theirs) in english.iter().zip(&others) {
            let is_name = ours.contains(".mcap") || same.contains(&ours.as_str());
            assert!(ours != theirs || is_name, "{language}: {ours}");
        }
    }
    refused(&run(&["debrief", text(&file), "--language", "pl", "--out", "x"]), 2, &["--language", "pl"]);
}

/// A needle driven through the far wall and off the patient's angle, compared with the scripted
/// venepuncture.
#[test]
fn a_trainee_is_compared_with_an_expert() {
    let (novice, _) = scored("novice", &["--seconds", "6", "--procedure", "insertion-5mms-60deg"]);
    let (expert, _) = scored("expert", &["--seconds", "12"]);
    let out = folder("expert-debrief");
    run_well(&["debrief", text(&novice), "--expert", text(&expert), "--out", text(&out)]);
    let page = std::fs::read_to_string(out.join("debrief.html")).expect("written");
    let row = |words: &str| {
        let row = page.split("<tr>").find(|row| row.contains(words));
        row.unwrap_or_else(|| panic!("no row {words}")).to_owned()
    };
    // The expert's column is the first.
    assert!(page.find("expert/a.mcap").expect("named") < page.find("novice/a.mcap").expect("named"));
    for words in ["through the far wall<", "angle error along the way"] {
        assert!(row(words).contains("worse"), "{}", row(words));
    }
    assert!(!row("walls that gave way").contains("worse"), "that depends on the goal");
    refused(
        &run(&["debrief", text(&novice), "--expert", "/no/such.mcap", "--out", text(&out)]),
        2,
        &["/no/such.mcap"],
    );
}

#[test]
fn a_score_is_written_as_xapi_statements() {
    let (file, insertions) = scored("xapi", &["--seconds", "12"]);
    let score = ["score", text(&file), "--xapi", "--actor", "trainee@example.org"];
    let statements: Value = serde_json::from_str(&run_well(&score)).expect("JSON");
    let statements = statements.as_array().expect("an array");
    assert_eq!((statements.len(), insertions.len()), (2, 2));
    for (statement, one) in statements.iter().zip(&insertions) {
        let mut keys: Vec<&String> = statement.as_object().expect("an object").keys().collect();
        keys.sort();
        assert_eq!(keys, ["actor", "context", "id", "object", "result", "timestamp", "verb", "version"]);
        assert_eq!(statement["actor"]["mbox"], "mailto:trainee@example.org");
        let result = &statement["result"];
        assert_eq!((&result["success"], &result["completion"]), (&true.into(), &true.into()), "{statement}");
        let duration = result["duration"].as_str().expect("a duration");
        let seconds: f64 = duration
            .strip_prefix("PT")
            .and_then(|d| d.strip_suffix('S'))
            .expect("ISO 8601")
            .parse()
            .expect("s");
        assert!((seconds - one["time_s"].as_f64().expect("a number")).abs() < 0.006, "{duration} {one}");
        let extensions = result["extensions"].as_object().expect("an object");
        assert!(extensions.keys().all(|key| key.starts_with("urn:needle-insertion:")));
        assert_eq!(extensions["urn:needle-insertion:figure:peak_force_n"], one["peak_force_n"]);
    }
    refused(&run(&["score", text(&file), "--xapi", "--actor", "nobody@"]), 2, &["--actor", "nobody@"]);
    assert_ne!(statements[0]["id"], statements[1]["id"]);
    let again: Value = serde_json::from_str(&run_well(&score)).expect("JSON");
    assert_eq!(again[0]["id"], statements[0]["id"], "a store takes it once");
    refused(&run(&["score", text(&file), "--xapi"]), 2, &["--actor"]);
}

#[test]
fn a_needle_that_goes_through_or_is_turned_is_reported() {
    // 10 mm under the skin: beyond the far wall at 7.8 mm.
    let (_, through) = scored("through", &["--seconds", "6", "--procedure", "insertion-5mms-60deg"]);
    assert_eq!(through[0]["through_far_wall"], Value::Bool(true), "{through:?}");
    assert_eq!(through[0]["punctures"], 3);
    let dir = folder("turned");
    let turned = dir.join("turned.toml");
    let text_of = "format = 1\nname = \"turned\"\nstart_mm = -2.0\n[hand]\nstiffness_n_per_mm = 3.0\ndamping_n_s_per_mm = 0.02\n\
         tremor_mm = 0.0\nseed = 1\n[[step]]\nname = \"wait\"\nseconds = 0.5\n[[step]]\nname = \"in\"\nto_mm = 9.0\nseconds = 1.5\n\
         [[step]]\nname = \"back and turn\"\nto_mm = 4.0\nseconds = 1.0\nturned_deg = 12.0\n\
         [[step]]\nname = \"in again\"\npast = \"vessel\"\nby_mm = 1.0\nseconds = 1.5\n\
         [[step]]\nname = \"out\"\nto_mm = -2.0\nseconds = 1.5\nturned_deg = 0.0\n";
    std::fs::write(&turned, text_of).expect("written");
    let (_, redirected) = scored("redirected", &["--seconds", "6", "--procedure", text(&turned)]);
    assert_eq!(
        (&redirected[0]["passes"], &redirected[0]["redirections"]),
        (&Value::from(2), &Value::from(1))
    );
    assert!(redirected[0]["angle_largest_error_deg"].as_f64().expect("a number") > 11.0, "{redirected:?}");
    assert_eq!(redirected[0]["vessel"], Value::Bool(true));
}

/// The phantom's vessel gives way at 4.8 mm and its bottom skin at 8.0 mm under the skin; the
/// needle goes to 10 mm, waits there for half a second, and comes out.
#[test]
fn a_table_that_ruptures_is_scored_like_any_other() {
    let arguments = ["--profile", "phantom", "--procedure", "insertion-5mms-60deg", "--seconds", "6.5"];
    let (file, through) = scored("ruptures", &arguments);
    let one = &through[0];
    assert_eq!(
        (&one["punctures"], &one["vessel"], &one["through_far_wall"]),
        (&3.into(), &true.into(), &true.into())
    );
    // In: from 4.8 to 8.0 mm at 5 mm/s along 60°. Out: 10 mm in 3 s, smoothly, through the lumen
    // between 7 and 4 mm in half a second.
    let in_s = (8.0 - 4.8) / 60.0_f64.to_radians().sin() / 5.0;
    let in_lumen_s = one["in_lumen_s"].as_f64().expect("a number");
    assert!((in_s + 0.4..in_s + 0.8).contains(&in_lumen_s), "{in_lumen_s} s, {in_s} s of it on the way in");
    let out = folder("ruptures-debrief");
    run_well(&["debrief", text(&file), "--out", text(&out)]);
    let page = std::fs::read_to_string(out.join("debrief.html")).expect("written");
    assert!(
        page.contains("through the far wall") && !page.contains("not entered"),
        "the debrief says the same"
    );
    // The same again in the track that it has made: no layer gives way, each is met open.
    let again = folder("ruptures-again").join("again.toml");
    let steps = "format = 1\nname = \"again\"\nstart_mm = -1.0\n[hand]\nstiffness_n_per_mm = 10.0\ndamping_n_s_per_mm = 0.02\n\
         tremor_mm = 0.0\nseed = 1\n[[step]]\nname = \"wait\"\nseconds = 0.5\n[[step]]\nname = \"in\"\nto_mm = 11.0\nseconds = 2.0\n\
         [[step]]\nname = \"back\"\nto_mm = 1.0\nseconds = 1.0\n[[step]]\nname = \"in again\"\nto_mm = 11.0\nseconds = 2.0\n\
         [[step]]\nname = \"out\"\nto_mm = -1.0\nseconds = 1.0\n";
    std::fs::write(&again, steps).expect("written");
    let (_, twice) =
        scored("ruptures-twice", &["--profile", "phantom", "--procedure", text(&again), "--seconds", "6.5"]);
    let counts = ["punctures", "met_in_track", "pierced_again", "passes"].map(|key| twice[0][key].as_u64());
    assert_eq!(counts, [Some(3), Some(2), Some(0), Some(2)], "{twice:?}");
    let in_lumen_s = twice[0]["in_lumen_s"].as_f64().expect("a number");
    assert!(in_lumen_s < 1.8, "beyond the far wall is not in the lumen: {in_lumen_s} s");
}

#[test]
fn a_turned_needle_is_scored_by_the_patients_fixture() {
    let turned = |degrees: &str| {
        let file = folder(&format!("fixture-{degrees}")).join("turned.toml");
        let text_of = format!(
            "format = 1\nname = \"turned\"\nstart_mm = -2.0\n[hand]\nstiffness_n_per_mm = 5.0\ndamping_n_s_per_mm = 0.02\n\
             tremor_mm = 0.0\nseed = 1\n[[step]]\nname = \"wait\"\nseconds = 0.5\n[[step]]\nname = \"in\"\nto_mm = 15.0\nseconds = 2.0\n\
             [[step]]\nname = \"turn\"\nseconds = 1.0\nturned_deg = {degrees}\n[[step]]\nname = \"out\"\nto_mm = -2.0\nseconds = 2.0\nturned_deg = 0.0\n"
        );
        std::fs::write(&file, text_of).expect("written");
        let arguments = ["--seconds", "6", "--profile", "shoulder", "--procedure", text(&file)];
        let (_, insertions) = scored(&format!("fixture-score-{degrees}"), &arguments);
        (insertions[0]["barriers"].clone(), insertions[0]["largest_lateral_n"].as_f64().expect("a number"))
    };
    // 0.2 N for each degree, up to 10°.
    let (barriers, lateral_n) = turned("5.0");
    assert!(barriers == 0 && (lateral_n - 1.0).abs() < 0.03, "{barriers} {lateral_n}");
    let (barriers, lateral_n) = turned("12.0");
    assert!(barriers == 1 && (lateral_n - 2.0).abs() < 0.03, "{barriers} {lateral_n}");
    let (_, adult) = scored("fixture-none", &["--seconds", "6"]);
    assert_eq!((&adult[0]["barriers"], &adult[0]["largest_lateral_n"]), (&Value::from(0), &Value::Null));
}

/// Paper 002, IV: in at 37° the needle passes the bursa where it does not reach; drawn back and
/// turned to 45° it comes to it.
#[test]
fn the_first_injection_misses_the_bursa_and_then_reaches_it() {
    let injection = |procedure: &str| {
        let arguments = ["--profile", "shoulder", "--procedure", procedure, "--seconds", "26"];
        let (file, insertions) = scored(procedure, &arguments);
        let out = folder(&format!("{procedure}-debrief"));
        run_well(&["debrief", text(&file), "--out", text(&out)]);
        (insertions[0].clone(), std::fs::read_to_string(out.join("debrief.html")).expect("written"))
    };
    let (first, page) = injection("shoulder-redirected");
    let target = &first["target"];
    assert_eq!((&target["name"], &target["outcome"]), (&"bursa".into(), &"beyond".into()), "{first}");
    assert_eq!((&target["passed_beside"], &first["redirections"]), (&1.into(), &1.into()), "{first}");
    assert!(target["time_s"].as_f64().is_some_and(|time_s| (0.5..3.0).contains(&time_s)), "{first}");
    assert_eq!(
        (&first["hit"], &first["spared"]),
        (&serde_json::json!(["tendon", "cartilage"]), &serde_json::json!(["vein"]))
    );
    assert!(page.contains("The needle passed beside it once."));
    let flat = ["--profile", "shoulder", "--procedure", "insertion-5mms-25deg", "--seconds", "10"];
    let (_, flat) = scored("shoulder-flat", &flat);
    assert!(flat[0]["hit"].as_array().is_some_and(|hit| hit.contains(&"vein".into())), "{}", flat[0]);
    let (second, _) = injection("shoulder-straight");
    assert_eq!(
        (&second["target"]["passed_beside"], &second["target"]["outcome"]),
        (&0.into(), &"beyond".into())
    );
}

#[test]
fn patients_are_listed_with_their_layers() {
    let all = run_well(&["profiles"]);
    for words in [
        "adult",
        "thin-elderly",
        "high-body-mass",
        "firm-skin",
        "dorsal-hand",
        "child",
        "shoulder",
        "phantom",
        "shoulder-joint",
        "forearm",
        "knee",
        "hip",
        "vessel, 3.0 × 4.5 mm",
        "gives way at 1.00 N",
    ] {
        assert!(all.contains(words), "{words} is not in: {all}");
    }
    let one = run_well(&["profiles", "firm-skin"]);
    assert!(one.contains("1.50 N") && !one.contains("thin-elderly"));
    refused(&run(&["profiles", "giant"]), 2, &["giant", "adult"]);
}

#[test]
fn a_table_from_virtual_insertions_predicts_others() {
    let dir = folder("fit-device");
    let record = |speed: &str, angle: &str| {
        let file = dir.join(format!("{speed}-{angle}.mcap"));
        let procedure = format!("insertion-{speed}mms-{angle}deg");
        // Long enough for one way in at each speed.
        let seconds = if speed == "3" { "9" } else { "6" };
        let head = ["run", "--headless", "--fast", "--seconds", seconds, "--record", text(&file)];
        run_well(&[&head[..], &["--procedure", &procedure]].concat());
        file
    };
    let cells = [("3", "60"), ("5", "60"), ("5", "30"), ("5", "45")].map(|(v, a)| record(v, a));
    let unseen = record("5", "60.5");
    let out = dir.join("table.toml");
    let files: Vec<&str> = cells.iter().map(|c| text(c)).collect();
    let arguments = [&["fit-force"], &files[..], &["--holdout", text(&unseen), "--out", text(&out)]].concat();
    let said = run_well(&arguments);
    assert_eq!(
        (figure(&said, "cells"), figure(&said, "measured"), figure(&said, "judged")),
        (6.0, 4.0, 1.0),
        "{said}"
    );
    assert!(said.contains("no data at 3.0 mm/s and 30°") && said.contains("separable"), "{said}");
    let (size, unseen_n) = (figure(&said, "force_rms_n"), figure(&said, "unseen_rms_n"));
    assert!(size > 0.2 && unseen_n < 0.2 * size, "{said}");
    let written = std::fs::read_to_string(&out).expect("written");
    let table: toml::Table = written.parse().expect("TOML");
    let rows = table["force_table"]["force_n"].as_array().expect("rows");
    assert_eq!(rows.len(), 6);
    let page = std::fs::read_to_string(out.with_extension("html")).expect("written beside it");
    assert!(page.contains("<svg") && !page.contains("http") && page.contains("no data: separable"));

    refused(
        &run(&["fit-force", text(&unseen), "--holdout", text(&unseen), "--out", text(&out)]),
        2,
        &["5-60.5.mcap"],
    );
    refused(&run(&["fit-force", "/no/such.csv", "--out", text(&out)]), 2, &["/no/such.csv"]);
}

#[test]
fn the_papers_are_reproduced_each_on_its_own_law() {
    let dir = folder("papers");
    let page = |number: &str| {
        run_well(&["reproduce", "--paper", number, "--out", text(&dir)]);
        std::fs::read_to_string(dir.join(format!("paper-{number}.html"))).expect("written")
    };
    let jog = page("001");
    for words in ["the paper's number", ">ours<", "the paper gives none", "28.8 mN", "4000", "10 kHz", "<svg"]
    {
        assert!(jog.contains(words), "{words} is not on the page of 001");
    }
    assert!(jog.contains("0.99 N") || jog.contains("1.00 N"), "the skin's puncture");
    // Eq. 2 as printed lets go of a needle at rest; the cone does not.
    assert_eq!(jog.matches("0.00 N after").count(), 1, "eq. 2 as printed, and the cone holds");
    for current in ["0.60 A for 28.8 mN·m with 48.0 mN·m/A", "1.23 A for 28.8 mN·m with 23.4 mN·m/A"] {
        assert!(jog.contains(current) && !jog.contains("not simulated"), "{current}: what the plant needs");
    }
    let xr = page("000");
    for words in [
        "1, 3 and 5 mm/s",
        "0.015",
        "180°",
        "not measured",
        "extrapolated",
        "vessel gives way",
        "depth from the deformed surface",
        "correlation",
        "<svg",
    ] {
        assert!(xr.contains(words), "{words} is not on the page of 000");
    }
    let sparte = page("002");
    for words in [
        "0.8 N",
        "cartilage",
        "10 N",
        "Fig. 5",
        "opposite direction",
        "at 0.65 of the law's",
        "1.59 N and 0.00 N",
        "<svg",
    ] {
        assert!(sparte.contains(words), "{words} is not on the page of 002");
    }
    // The paper's force, and ours of both injections, within 0.1 N.
    for (layer, newtons) in
        [("skin", 0.8), ("fat", 1.5), ("muscle", 2.0), ("bursa", 2.5), ("tendon", 3.0), ("cartilage", 4.0)]
    {
        let row =
            sparte.split("<tr>").find(|row| row.contains(&format!("cutting force, {layer} "))).expect(layer);
        let numbers: Vec<f64> =
            row.split(" N").filter_map(|before| before.rsplit(['>', ' ']).next()?.parse().ok()).collect();
        assert_eq!(numbers.len(), 3, "{row}");
        assert!(numbers.iter().all(|n| (n - newtons).abs() < 0.1), "{layer}: {numbers:?}");
    }
    for page in [jog, xr, sparte] {
        assert!(!page.contains("http"), "nothing is fetched");
    }
    refused(&run(&["reproduce", "--paper", "7", "--out", text(&dir)]), 2, &["000, 001 or 002"]);
}

/// The scripted injection into the bursa, and three that a teacher would stop: injected first,
/// injected before the bursa, not aspirated.
#[test]
fn tasks_are_recorded_and_scored() {
    let good = include_str!("../../procedures/bursa.toml");
    let swapped = good
        .replace("task = \"aspirate\"", "task = \"x\"")
        .replace("task = \"inject\"", "task = \"aspirate\"")
        .replace("task = \"x\"", "task = \"inject\"");
    let shallow = good.replace("by_mm = 1.5", "by_mm = -3.0");
    let left_out = good.replace("task = \"aspirate\"\n", "");
    let twice = good.replace(
        "[[step]]\nname = \"aspirate\"",
        "[[step]]\nname = \"too soon\"\nseconds = 0.5\ntask = \"inject\"\n\n[[step]]\nname = \"aspirate\"",
    );
    let cases: [(&str, &str, &[&str], usize); 5] = [
        ("right", good, &[], 0),
        ("swapped", &swapped, &["injected_early"], 1),
        ("twice", &twice, &["injected_early"], 1),
        ("shallow", &shallow, &["not_reached", "aspirated_elsewhere", "injected_elsewhere"], 1),
        ("left-out", &left_out, &["not_aspirated"], 1),
    ];
    for (name, text_of, wanted, critical) in cases {
        let file = folder(&format!("tasks-{name}-file")).join("p.toml");
        std::fs::write(&file, text_of).expect("the folder can be written");
        let arguments = ["--seconds", "9.2", "--profile", "shoulder-joint", "--procedure", text(&file)];
        let (recorded, insertions) = scored(&format!("tasks-{name}"), &arguments);
        let [one] = &insertions[..] else { panic!("{name}: {} insertions", insertions.len()) };
        let verdict = &one["verdict"];
        let reasons = verdict["reasons"].as_array().expect("reasons");
        let keys: Vec<&str> = reasons.iter().map(|reason| reason["key"].as_str().expect("a key")).collect();
        assert_eq!(keys, wanted, "{name}: {verdict}");
        let said = run_well(&["score", text(&recorded)]);
        assert!((figure(&said, "critical_errors") - critical as f64).abs() < 1e-9, "{said}");
        let xapi = run_well(&["score", text(&recorded), "--xapi", "--actor", "trainee@example.org"]);
        let statements: Value = serde_json::from_str(&xapi).expect("JSON");
        let result = &statements[0]["result"];
        assert_eq!(&result["extensions"]["urn:needle-insertion:figure:verdict"], verdict, "{name}");
        assert_eq!(result["success"], Value::Bool(wanted.is_empty()), "{name}: {result}");
    }
}
