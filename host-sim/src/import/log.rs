//! MCAP logs of any program: messages in JSON, a table for every topic. Chunks may be compressed with zstd or lz4.

use super::json;
use super::table::{Column, Log, Table};
use super::units;
use crate::failure::Failure;
use mcap::read::{LinearReader, Options};
use mcap::records::Record;
use std::collections::BTreeMap;
use std::io::Read;

/// What a chunk may become: a file of recordings is not larger in memory.
const LARGEST_CHUNK: u64 = 1 << 31;

#[derive(Default)]
struct Topic {
    name: String,
    encoding: String,
    times: Vec<f64>,
    columns: BTreeMap<String, Vec<f64>>,
    broken: usize,
}

pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Log, Failure> {
    let unusable = |cause: &dyn std::fmt::Display| {
        Failure::input(format_args!("{file}: is no usable MCAP recording ({cause}); record it again"))
    };
    let mut topics: BTreeMap<u16, Topic> = BTreeMap::new();
    let mut notes = Vec::new();
    // Seconds since 1970 in a float would cost digits.
    let mut origin = None;
    let records =
        LinearReader::new_with_options(bytes, Options::IgnoreEndMagic.into()).map_err(|e| unusable(&e))?;
    for record in records {
        match record {
            Ok(Record::Chunk { header, data }) => {
                let plain = decompress(&header.compression, &data, header.uncompressed_size)
                    .map_err(|why| unusable(&why))?;
                for record in LinearReader::sans_magic(&plain) {
                    take(record.map_err(|cause| unusable(&cause))?, &mut topics, &mut origin);
                }
            }
            Ok(record) => take(record, &mut topics, &mut origin),
            Err(cause) => {
                notes.push(format!("ends early ({cause}); what is there was read"));
                break;
            }
        }
    }
    if topics.values().any(|t| t.name == "/setup") && topics.values().any(|t| t.name == "/samples") {
        return Err(Failure::input(format_args!(
            "{file}: is a recording of this program; `host-sim export {file} --out DIR` gives its files"
        )));
    }
    let mut tables = Vec::new();
    let mut foreign = Vec::new();
    for topic in topics.into_values() {
        if topic.encoding != "json" {
            foreign.push(format!(
                "{} ({})",
                topic.name,
                if topic.encoding.is_empty() { "no encoding" } else { &topic.encoding }
            ));
            continue;
        }
        if topic.broken > 0 {
            notes.push(format!("{} messages of {} are no JSON and were left out", topic.broken, topic.name));
        }
        tables.push(table(topic));
    }
    if tables.is_empty() {
        return Err(Failure::input(format_args!(
            "{file}: has no messages in JSON ({}); write the topics as JSON, or export them as CSV (Foxglove and PlotJuggler do)",
            if foreign.is_empty() { "nor any others".to_owned() } else { foreign.join(", ") }
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
        notes.push(format!("topics that are not in JSON left out: {}", foreign.join(", ")));
    }
    Ok(Log { file: file.to_owned(), tables, notes })
}

fn table(topic: Topic) -> Table {
    let mut time = Column::new("log_time", topic.times);
    time.unit = units::parse("s");
    let rows = time.values.len();
    let mut columns = vec![time];
    for (name, mut values) in topic.columns {
        values.resize(rows, f64::NAN);
        columns.push(Column::new(format!("{}.{name}", topic.name.trim_start_matches('/')), values));
    }
    Table { name: topic.name, columns }
}

fn take(record: Record, topics: &mut BTreeMap<u16, Topic>, origin: &mut Option<u64>) {
    match record {
        Record::Channel(channel) => {
            let topic = topics.entry(channel.id).or_default();
            (topic.name, topic.encoding) = (channel.topic, channel.message_encoding.to_lowercase());
        }
        Record::Message { header, data } => {
            let Some(topic) = topics.get_mut(&header.channel_id) else { return };
            if topic.encoding != "json" {
                return;
            }
            let Ok(value) = serde_json::from_slice(&data) else {
                topic.broken += 1;
                return;
            };
            let row = topic.times.len();
            let since = i128::from(header.log_time) - i128::from(*origin.get_or_insert(header.log_time));
            topic.times.push(since as f64 * 1e-9);
            json::flatten("", &value, 0, &mut |name, value| {
                let name = if name.is_empty() { "value".to_owned() } else { name };
                let column = topic.columns.entry(name).or_default();
                column.resize(row, f64::NAN);
                column.push(value);
            });
        }
        _ => {}
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
