//! MCAP logs of any program: messages in JSON and, with the feature `ros`, ROS 2 messages; a table
//! for every topic. Chunks may be compressed with zstd or lz4.

use super::json;
use super::table::{Column, ColumnTable, Log};
use super::units;
use device_sim::error::Error;
use mcap::read::{LinearReader, Options};
use mcap::records::Record;
use std::collections::BTreeMap;
use std::io::Read;

/// The largest size of a decompressed chunk: a file of recordings is not larger in memory.
const LARGEST_CHUNK: u64 = 1 << 31;

#[derive(Default)]
struct Topic {
    name: String,
    encoding: String,
    #[cfg(feature = "ros")]
    decoder: Option<super::ros::Decoder>,
    times: Vec<f64>,
    columns: BTreeMap<String, Vec<f64>>,
    broken: usize,
}

pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Log, Error> {
    let unusable = |cause: &dyn std::fmt::Display| {
        Error::input(format_args!("{file}: is not a usable MCAP recording ({cause}); record it again"))
    };
    let mut found = Found::default();
    let mut notes = Vec::new();
    let records =
        LinearReader::new_with_options(bytes, Options::IgnoreEndMagic.into()).map_err(|e| unusable(&e))?;
    for record in records {
        match record {
            Ok(Record::Chunk { header, data }) => {
                let plain = decompress(&header.compression, &data, header.uncompressed_size)
                    .map_err(|why| unusable(&why))?;
                for record in LinearReader::sans_magic(&plain) {
                    found.take(record.map_err(|cause| unusable(&cause))?);
                }
            }
            Ok(record) => found.take(record),
            Err(cause) => {
                notes.push(format!("ends early ({cause}); what is there was read"));
                break;
            }
        }
    }
    tables_of(file, found.topics, notes)
}

/// Returns the tables of the topics that are read, and notes on the others; an error if no topic is
/// read.
fn tables_of(file: &str, topics: BTreeMap<u16, Topic>, mut notes: Vec<String>) -> Result<Log, Error> {
    if topics.values().any(|t| t.name == "/setup") && topics.values().any(|t| t.name == "/samples") {
        return Err(Error::input(format_args!(
            "{file}: is a recording of this program; `host-sim export {file} --out DIR` gives its files"
        )));
    }
    let mut tables = Vec::new();
    let mut foreign = Vec::new();
    for topic in topics.into_values() {
        if !topic.is_read() {
            foreign.push(format!(
                "{} ({})",
                topic.name,
                if topic.encoding.is_empty() { "no encoding" } else { &topic.encoding }
            ));
            continue;
        }
        if topic.broken > 0 {
            notes.push(format!(
                "{} messages of {} cannot be read and were left out",
                topic.broken, topic.name
            ));
        }
        tables.push(table(topic));
    }
    if tables.is_empty() {
        return Err(Error::input(format_args!(
            "{file}: has no messages that are read ({}); {}",
            if foreign.is_empty() { "it has none at all".to_owned() } else { foreign.join(", ") },
            if cfg!(not(feature = "ros")) && foreign.iter().any(|topic| topic.ends_with("(cdr)")) {
                "they are ROS 2 messages, which a build with `--features ros` reads (cargo run --release --features ros -- import …)"
            } else {
                "write the topics as JSON, or export them as CSV (Foxglove and PlotJuggler do)"
            }
        )));
    }
    notes.insert(
        0,
        format!(
            "read as MCAP: topics {}",
            tables.iter().map(|t| t.name.as_str()).collect::<Vec<_>>().join(", ")
        ),
    );
    if !foreign.is_empty() {
        notes.push(format!("topics that are not read left out: {}", foreign.join(", ")));
    }
    Ok(Log { file: file.to_owned(), tables, notes })
}

fn table(topic: Topic) -> ColumnTable {
    let mut time = Column::new("log_time", topic.times);
    time.unit = units::parse("s");
    let rows = time.values.len();
    let mut columns = vec![time];
    for (name, mut values) in topic.columns {
        values.resize(rows, f64::NAN);
        columns.push(Column::new(format!("{}.{name}", topic.name.trim_start_matches('/')), values));
    }
    ColumnTable { name: topic.name, columns }
}

/// The findings in a file.
#[derive(Default)]
struct Found {
    topics: BTreeMap<u16, Topic>,
    /// Time of the first message, ns: seconds since 1970 in a float would cost digits.
    origin: Option<u64>,
    #[cfg(feature = "ros")]
    schemas: BTreeMap<u16, (mcap::records::SchemaHeader, Vec<u8>)>,
}

impl Found {
    fn take(&mut self, record: Record) {
        match record {
            #[cfg(feature = "ros")]
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header, data.into_owned()));
            }
            Record::Channel(channel) => {
                let topic = self.topics.entry(channel.id).or_default();
                (topic.name, topic.encoding) = (channel.topic, channel.message_encoding.to_lowercase());
                #[cfg(feature = "ros")]
                if topic.encoding == "cdr"
                    && let Some((schema, text)) = self.schemas.get(&channel.schema_id)
                    && schema.encoding == "ros2msg"
                {
                    topic.decoder = super::ros::Decoder::new(&schema.name, text);
                }
            }
            Record::Message { header, data } => {
                let Some(topic) = self.topics.get_mut(&header.channel_id) else { return };
                let origin = *self.origin.get_or_insert(header.log_time);
                if topic.is_read() {
                    topic.add((i128::from(header.log_time) - i128::from(origin)) as f64 * 1e-9, &data);
                }
            }
            _ => {}
        }
    }
}

impl Topic {
    /// True if its messages are of an encoding that is read.
    fn is_read(&self) -> bool {
        #[cfg(feature = "ros")]
        if self.decoder.is_some() {
            return true;
        }
        self.encoding == "json"
    }

    fn decode(&self, data: &[u8]) -> Option<serde_json::Value> {
        #[cfg(feature = "ros")]
        if let Some(decoder) = &self.decoder {
            return decoder.decode(data);
        }
        serde_json::from_slice(data).ok()
    }

    fn add(&mut self, time: f64, data: &[u8]) {
        let Some(value) = self.decode(data) else {
            self.broken += 1;
            return;
        };
        let row = self.times.len();
        self.times.push(time);
        json::flatten("", &value, 0, &mut |name, value| {
            let name = if name.is_empty() { "value".to_owned() } else { name };
            let column = self.columns.entry(name).or_default();
            column.resize(row, f64::NAN);
            column.push(value);
        });
    }
}

fn decompress(compression: &str, data: &[u8], size: u64) -> Result<Vec<u8>, String> {
    if size > LARGEST_CHUNK {
        return Err(format!("a chunk of {size} bytes"));
    }
    let mut out = Vec::new();
    let read = |reader: &mut dyn Read, out: &mut Vec<u8>| {
        reader.take(size).read_to_end(out).map_err(|cause| format!("a chunk cannot be unpacked: {cause}"))
    };
    match compression {
        "" => out.extend_from_slice(data),
        "lz4" => {
            read(&mut lz4_flex::frame::FrameDecoder::new(data), &mut out)?;
        }
        "zstd" => {
            let mut reader =
                ruzstd::decoding::StreamingDecoder::new(data).map_err(|cause| cause.to_string())?;
            read(&mut reader, &mut out)?;
        }
        other => return Err(format!("compressed with {other}, which is not known")),
    }
    Ok(out)
}
