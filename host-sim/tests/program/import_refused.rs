//! Files and options that `import` refuses, each with the sentence and the option that it says
//! then.

use crate::common::{folder, host_sim, text};
use crate::import::{angle, foreign};
use std::path::{Path, PathBuf};

/// A file, the options of `import`, and a part of the sentence that it is refused with.
type Refused = (PathBuf, &'static [&'static str], &'static str);

fn written(out: &Path, name: &str, content: &[u8]) -> PathBuf {
    let path = out.join(name);
    std::fs::write(&path, content).expect("written");
    path
}

/// A table of 2 s at 200 rows a second with this header.
fn table(header: &str) -> String {
    let rows: String =
        (0..400).map(|i| format!("{},{},{}\n", i as f64 * 0.005, angle(i as f64 * 0.005), i % 7)).collect();
    format!("{header}\n{rows}")
}

/// Refused with status 2 and one sentence, and nothing is half written.
fn assert_refused(out: &Path, cases: Vec<Refused>) {
    for (path, options, sentence) in cases {
        let result = out.join("result");
        let mut arguments = vec!["import", text(&path), "--out", text(&result)];
        arguments.extend(options);
        let output = host_sim(&arguments).output().expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{}: {said}", path.display());
        assert!(said.contains(sentence), "{} should say \"{sentence}\": {said}", path.display());
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        assert!(!result.exists(), "nothing is half written");
    }
}

#[test]
fn a_column_that_only_a_person_knows_is_asked_with_its_option() {
    let out = &folder("import-refused");
    let cases: Vec<Refused> = vec![
        (
            written(out, "a.csv", table("t,theta,u").as_bytes()),
            &[],
            "the position column theta does not say its unit; say it with --column position=theta:UNIT, in rad, deg",
        ),
        (
            written(out, "b.csv", table("t,theta_deg,foo").as_bytes()),
            &[],
            "no column is known to be the command; say which with --column command=NAME[:UNIT]; its columns are t, theta_deg, foo; or give --undriven",
        ),
        (
            written(out, "c.csv", table("t,pos_m,pos_mm").as_bytes()),
            &["--undriven"],
            "pos_m and pos_mm could both be the position; say which with --column position=pos_m",
        ),
        (
            written(out, "d.csv", table("x,theta_deg,u").as_bytes()),
            &["--column", "position=theta_deg"],
            "or give --rate HZ",
        ),
        (
            written(out, "e.csv", table("t,theta_deg,u").as_bytes()),
            &["--column", "position=thetta:deg"],
            "has no column \"thetta\"; its columns are t, theta_deg, u",
        ),
        (
            written(out, "f.csv", table("t,theta_deg,u").as_bytes()),
            &["--column", "position=theta_deg:s"],
            "a position is not measured in s",
        ),
        (
            foreign("coarse.csv"),
            &[],
            "has steps of 20, which could be ms or µs; say which with --column time=t:ms",
        ),
        (
            written(out, "same.csv", table("t,value,u").as_bytes()),
            &["--column", "position=value:rad", "--column", "command=value:Nm"],
            "--column gives value two roles, position and command",
        ),
        (
            written(out, "spaces.csv", table("t,the angle,the torque").as_bytes()),
            &["--column", "command=the torque"],
            "say it with --column 'position=the angle:UNIT'",
        ),
        (
            foreign("bare.txt"),
            &["--column", "command=column3"],
            "its columns are column1 (0, 0.005, 0.01, …), column2 (0, ",
        ),
    ];
    assert_refused(out, cases);
}

#[cfg(feature = "hdf5")]
const UNREAD_HDF5: &str = "is not a usable HDF5 file";
#[cfg(not(feature = "hdf5"))]
const UNREAD_HDF5: &str = "save('FILE.mat', '-v7')";

#[test]
fn columns_of_one_name_are_distinguished_by_numbers() {
    let out = &folder("import-repeated");
    let path = written(out, "repeated.csv", table("log.t,value,value").as_bytes());
    let sentence = "has several columns \"value\"; say which by its number, as in --column position=2; its columns are log.t, value (column 2), value (column 3)";
    assert_refused(out, vec![(path.clone(), &["--undriven", "--column", "position=value:rad"], sentence)]);
    let alike = written(out, "alike.csv", table("log.t,theta,theta").as_bytes());
    let asked = "could both be the position; say which with --column position=2";
    assert_refused(out, vec![(alike, &["--undriven"], asked)]);
    let result = out.join("result");
    let numbered =
        ["import", text(&path), "--column", "position=2:rad", "--undriven", "--out", text(&result)];
    assert!(host_sim(&numbered).status().expect("it runs").success());
}

#[test]
fn a_file_that_holds_no_usable_table_is_refused() {
    let out = &folder("import-unusable");
    let cases: Vec<Refused> = vec![
        (
            written(out, "g.mat", b"MATLAB 5.0 MAT-file, Platform: GLNXA64"),
            &[],
            "is not a usable MATLAB file",
        ),
        (written(out, "v73.mat", b"MATLAB 7.3 MAT-file"), &[], UNREAD_HDF5),
        (written(out, "v4.mat", b"\0\0\0\0\x01\0\0\0"), &[], "is a MATLAB 4 file; save it again"),
        (foreign("sheet.xlsx"), &[], "is an Excel workbook; save its sheet as CSV"),
        (
            written(out, "both.csv", table("t,theta,foo").as_bytes()),
            &[],
            "--undriven where nothing drives the axis; and the position column theta",
        ),
        (written(out, "h.csv", b"nothing here\nbut words\n"), &[], "no row of numbers was found"),
        (written(out, "i.npz", b"PK\x03\x04 q.npy and no more"), &[], "is not a usable NumPy file"),
    ];
    assert_refused(out, cases);
}
