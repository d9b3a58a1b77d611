//! Recordings: CSV with a header line, read and checked; nothing is dropped in silence.

use crate::data::error::InputError;
use std::borrow::Cow;
use std::path::Path;

/// One recording. All columns have the same length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// Its name in reports: the file's name.
    pub file: String,
    /// s, strictly increasing.
    pub time_s: Vec<f64>,
    /// In the rig's command unit, held until the next row.
    pub command: Vec<f64>,
    /// Counts; the zero is arbitrary.
    pub position_counts: Vec<f64>,
    /// Inclination below the horizontal, rad.
    pub tilt_rad: Option<Vec<f64>>,
    /// The reference of a position loop, counts.
    pub reference_counts: Option<Vec<f64>>,
    /// An independently measured external load on the coordinate, N·m or N.
    pub force: Option<Vec<f64>>,
}

const COLUMNS: [&str; 6] = ["time_s", "command", "position_counts", "tilt_rad", "reference_counts", "force"];

/// Larger than anything a sensor says, small enough that squares of squares stay finite.
const LARGEST: f64 = 1e15;

/// Says what a header is that does not have fields between commas; none if it has.
fn foreign(header: &str) -> Option<String> {
    let by = "let host-sim import read the file, or write it with";
    if header.starts_with(['#', '%']) {
        return Some(format!("a comment line where the header belongs; {by}out it"));
    }
    let between = |mark: char, what: &str| {
        (header.contains(mark) && !header.contains(','))
            .then(|| format!("fields are separated by {what}; {by} commas and decimal points"))
    };
    between(';', "semicolons").or_else(|| between('\t', "tabs"))
}

/// The rows of a recording as they are read.
struct Rows {
    /// The place of each known column in a row.
    place: [Option<usize>; 6],
    /// The known column in each field of a row.
    wanted: Vec<Option<usize>>,
    columns: [Vec<f64>; 6],
    /// The first empty line: an error if a row comes after it.
    blank: Option<usize>,
}

impl Rows {
    /// No rows yet, under a header line.
    fn new(header: &str) -> Result<Self, String> {
        foreign(header).map_or(Ok(()), Err)?;
        let names: Vec<&str> = header.split(',').map(|name| name.trim().trim_matches('"')).collect();
        let mut place = [None; 6];
        for (index, name) in names.iter().enumerate() {
            if let Some(known) = COLUMNS.iter().position(|column| column == name)
                && place[known].replace(index).is_some()
            {
                return Err(format!("there are two columns {name}; keep one of them"));
            }
        }
        if let Some(needed) = (0..3).find(|needed| place[*needed].is_none()) {
            let name = COLUMNS[needed];
            return Err(format!("the column {name} is missing; name it in the header line"));
        }
        let wanted = (0..names.len()).map(|index| place.iter().position(|p| *p == Some(index))).collect();
        Ok(Self { place, wanted, columns: Default::default(), blank: None })
    }

    /// Makes room for so many rows.
    fn reserve(&mut self, rows: usize) {
        for (column, place) in self.columns.iter_mut().zip(self.place) {
            if place.is_some() {
                column.reserve(rows);
            }
        }
    }

    /// Reads one more row; the line that is wrong, and why, where it cannot be used.
    fn push(&mut self, line: usize, row: &str) -> Result<(), (usize, String)> {
        if row.trim().is_empty() {
            self.blank = self.blank.or(Some(line));
            return Ok(());
        }
        if row.starts_with(['#', '%']) {
            return Err((line, "a comment line; take it out, or let host-sim import read the file".into()));
        }
        if let Some(blank) = self.blank {
            return Err((blank, "an empty line between rows; remove it or restore the row".into()));
        }
        let mut count = 0;
        for field in row.split(',') {
            if let Some(Some(known)) = self.wanted.get(count) {
                let field = field.trim();
                let value = field.parse::<f64>().ok().filter(|x| x.is_finite() && x.abs() < LARGEST);
                let Some(value) = value else {
                    let name = COLUMNS[*known];
                    let field: String = field.chars().take(24).collect();
                    let what =
                        format!("{name} is \"{field}\", not a usable number; correct or cut the recording");
                    return Err((line, what));
                };
                self.columns[*known].push(value);
            }
            count += 1;
        }
        if count != self.wanted.len() {
            let what = format!(
                "{count} fields where the header names {}; restore the row or cut the recording before it",
                self.wanted.len()
            );
            return Err((line, what));
        }
        if let [.., before, now] = self.columns[0][..]
            && now <= before
        {
            let what = format!(
                "the time {now} s does not come after {before} s; times must increase from row to row"
            );
            return Err((line, what));
        }
        Ok(())
    }
}

/// Rest at an end that is idle, and how much of it is kept, s.
const IDLE_S: f64 = 1.0;
const MARGIN_S: f64 = 0.3;

impl Recording {
    /// Reads and checks a recording.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let shown = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|cause| {
            InputError::new(format!("{shown}: the recording cannot be read ({cause}); check its path"))
        })?;
        let text = String::from_utf8(bytes).map_err(|cause| {
            let valid = cause.utf8_error().valid_up_to();
            let line = cause.as_bytes()[..valid].iter().filter(|byte| **byte == b'\n').count() + 1;
            InputError::new(format!("{shown}, line {line}: not text; a recording is a CSV file in UTF-8"))
        })?;
        let name = path.file_name().map_or(shown.clone(), |name| name.to_string_lossy().into_owned());
        let mut recording = Self::parse(&text, &shown)?;
        recording.file = name;
        Ok(recording)
    }

    /// Checks the text of a recording; `file` is what errors call it.
    pub fn parse(text: &str, file: &str) -> Result<Self, InputError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let error_at =
            |(line, what): (usize, String)| InputError::new(format!("{file}, line {line}: {what}"));
        let mut lines = text.lines();
        let header = lines.next().unwrap_or("");
        let mut rows = Rows::new(header).map_err(|what| error_at((1, what)))?;
        rows.reserve(text.len() / header.len().max(12));
        for (index, row) in lines.enumerate() {
            rows.push(index + 2, row).map_err(error_at)?;
        }
        let place = rows.place;
        let [time_s, command, position_counts, tilt, reference, force] = rows.columns;
        if time_s.len() < 2 {
            return Err(InputError::new(format!(
                "{file}: fewer than two rows; record some seconds of motion"
            )));
        }
        let optional = |column: Vec<f64>, known: usize| place[known].map(|_| column);
        Ok(Self {
            file: file.to_owned(),
            time_s,
            command,
            position_counts,
            tilt_rad: optional(tilt, 3),
            reference_counts: optional(reference, 4),
            force: optional(force, 5),
        })
    }

    /// The recording without long rests at its ends, which carry no information, and the time that
    /// was taken from its start, s.
    pub(crate) fn without_idle_ends(&self) -> (Cow<'_, Self>, f64) {
        let n = self.len();
        let counts = &self.position_counts;
        let still = |from: f64| move |x: &&f64| (**x - from).abs() <= 1.0;
        let lead = counts.iter().take_while(still(counts[0])).count();
        let trail = counts.iter().rev().take_while(still(counts[n - 1])).count();
        let t = &self.time_s;
        if lead == n {
            return (Cow::Borrowed(self), 0.0);
        }
        let first = match t[lead] - t[0] {
            idle if idle > IDLE_S => t.partition_point(|x| *x < t[lead] - MARGIN_S),
            _ => 0,
        };
        let end = match t[n - 1] - t[n - 1 - trail] {
            idle if idle > IDLE_S => t.partition_point(|x| *x < t[n - 1 - trail] + MARGIN_S).min(n),
            _ => n,
        };
        if first == 0 && end == n {
            return (Cow::Borrowed(self), 0.0);
        }
        let part = self.mapped(|column| column[first..end].to_vec());
        (Cow::Owned(part), t[first] - t[0])
    }

    /// The recording with each of its columns changed in the same way.
    fn mapped(&self, change: impl Fn(&Vec<f64>) -> Vec<f64>) -> Self {
        Self {
            file: self.file.clone(),
            time_s: change(&self.time_s),
            command: change(&self.command),
            position_counts: change(&self.position_counts),
            tilt_rad: self.tilt_rad.as_ref().map(&change),
            reference_counts: self.reference_counts.as_ref().map(&change),
            force: self.force.as_ref().map(&change),
        }
    }

    /// The recording at some of its rows, in order, each with the mean command until the next.
    pub(crate) fn at_rows(&self, rows: &[usize]) -> Self {
        let mut out = self.mapped(|column| rows.iter().map(|row| column[*row]).collect());
        let t = &self.time_s;
        for (place, from) in rows.iter().enumerate() {
            let to = rows.get(place + 1).copied().unwrap_or(self.len() - 1);
            let acted: f64 = (*from..to).map(|row| self.command[row] * (t[row + 1] - t[row])).sum();
            if to > *from {
                out.command[place] = acted / (t[to] - t[*from]);
            }
        }
        out
    }

    /// At most so many rows of the recording, from its middle.
    pub(crate) fn middle(&self, most: usize) -> Cow<'_, Self> {
        let first = self.len().saturating_sub(most) / 2;
        match self.len() > most {
            true => Cow::Owned(self.mapped(|column| column[first..first + most].to_vec())),
            false => Cow::Borrowed(self),
        }
    }

    /// The recording with the commands that were logged so many rows later, which the last rows
    /// lack.
    pub(crate) fn with_earlier_command(&self, rows: usize) -> Self {
        let n = self.len().saturating_sub(rows);
        let command = self.command[self.len() - n..].to_vec();
        Self { command, ..self.mapped(|column| column[..n].to_vec()) }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// True if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// From the first row to the last, s.
    pub(crate) fn duration_s(&self) -> f64 {
        self.time_s[self.len() - 1] - self.time_s[0]
    }

    /// Mean rate of the rows, Hz.
    pub fn rate_hz(&self) -> f64 {
        (self.len() - 1) as f64 / self.duration_s()
    }
}

/// Says what rows at a rate, Hz, can show: a swing takes some five rows, and the command is held
/// from row to row.
pub fn shown_at(rate_hz: f64) -> String {
    format!(
        "{rate_hz:.0} rows a second: shows what happens below about {:.0} Hz; delays and lags much shorter than {:.2} ms do not show",
        rate_hz / 5.0,
        1e3 / rate_hz
    )
}
