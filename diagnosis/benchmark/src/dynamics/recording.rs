//! A recording as the judge reads it. What the tool has accepted is taken to be well-formed.

use std::path::Path;

/// One recording; all columns of the same length, zeros where a column is missing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Recording {
    pub(crate) time: Vec<f64>,
    pub(crate) command: Vec<f64>,
    pub(crate) counts: Vec<f64>,
    pub(crate) tilt: Vec<f64>,
    pub(crate) force: Vec<f64>,
}

impl Recording {
    /// Reads a CSV file of the contract.
    ///
    /// # Errors
    /// What is missing, with the file's name.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let text =
            std::fs::read_to_string(path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
        Self::parse(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines();
        let head: Vec<&str> = lines.next().unwrap_or("").split(',').map(str::trim).collect();
        let place = |name: &str| head.iter().position(|h| *h == name);
        let needed = |name: &str| place(name).ok_or(format!("there is no column {name}"));
        let columns = [
            Some(needed("time_s")?),
            Some(needed("command")?),
            Some(needed("position_counts")?),
            place("tilt_rad"),
            place("force"),
        ];
        let mut values: [Vec<f64>; 5] = Default::default();
        for (index, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let fields: Vec<&str> = line.split(',').collect();
            for (column, values) in columns.iter().zip(&mut values) {
                let value = match column {
                    Some(i) => fields.get(*i).and_then(|f| f.trim().parse::<f64>().ok()),
                    None => Some(0.0),
                };
                values.push(value.ok_or(format!("line {} holds something that is no number", index + 2))?);
            }
        }
        let [time, command, counts, tilt, force] = values;
        if time.len() < 100 {
            return Err(format!("{} rows are too few to judge by", time.len()));
        }
        Ok(Self { time, command, counts, tilt, force })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_name() {
        let mut text = String::from("command,time_s,extra,position_counts,force\n");
        (0..100).for_each(|i| text += &format!("{},{},9,{},2\n", 3 * i, i, 7 * i));
        let r = Recording::parse(&text).unwrap();
        assert_eq!(
            (r.time[5], r.command[5], r.counts[5], r.tilt[5], r.force[5]),
            (5.0, 15.0, 35.0, 0.0, 2.0)
        );
        assert!(Recording::parse("time_s,command\n").unwrap_err().contains("position_counts"));
    }
}
