//! The evidence table: what the tool says of every hypothesis of every case, with the truth beside
//! it, so that a decision can be tried without running a case again.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::Path;
use std::sync::Mutex;

use crate::options::Options;

/// The file in a case's folder that the tool leaves its rows in.
pub(crate) const FILE: &str = "evidence.csv";

/// Cases that run at the same time take turns.
static TURN: Mutex<()> = Mutex::new(());

/// Adds the rows of a case to the table of `--evidence`; `group` is what may not judge itself, as
/// the machine, and `hidden` what was concealed. A case of which the tool says nothing adds none.
pub(crate) fn collect(
    options: &Options,
    [case, group]: [&str; 2],
    hidden: &[impl AsRef<str>],
    out: &Path,
) -> Result<(), String> {
    let Some(table) = &options.evidence else { return Ok(()) };
    let Ok(text) = std::fs::read_to_string(out.join(FILE)) else { return Ok(()) };
    let failed = |e: std::io::Error| format!("cannot write {}: {e}; check --evidence", table.display());
    let hidden: Vec<&str> = hidden.iter().map(AsRef::as_ref).collect();
    let _turn = TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let mut file = OpenOptions::new().append(true).create(true).open(table).map_err(failed)?;
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default();
    if file.metadata().map_err(failed)?.len() == 0 {
        writeln!(file, "case,group,hidden,right,{header}").map_err(failed)?;
    }
    for line in lines {
        let name = line.split(',').next().unwrap_or_default();
        let right = if hidden.is_empty() { name == "none" } else { hidden.contains(&name) };
        writeln!(file, "{case},{group},{},{},{line}", hidden.join("+"), u8::from(right)).map_err(failed)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::Scratch;

    #[test]
    fn rows_share_one_header_and_know_what_is_right() {
        let scratch = Scratch::new().unwrap();
        let dir = &scratch.0;
        std::fs::create_dir_all(dir).unwrap();
        std::fs::write(dir.join(FILE), "hypothesis,named,share\nnone,0,0\ncogging,1,0.4\n").unwrap();
        let table = dir.join("table.csv");
        let options = Options { evidence: Some(table.clone()), ..Options::default() };
        collect(&options, ["1", "cart"], &["cogging"], dir).unwrap();
        collect(&options, ["2", "ur1"], &[] as &[&str], dir).unwrap();
        let expected = "case,group,hidden,right,hypothesis,named,share\n\
                        1,cart,cogging,0,none,0,0\n1,cart,cogging,1,cogging,1,0.4\n\
                        2,ur1,,1,none,0,0\n2,ur1,,0,cogging,1,0.4\n";
        assert_eq!(std::fs::read_to_string(table).unwrap(), expected);
    }
}
