//! Reads a recording, whole or cut short: everything up to the cut is there, and that it was cut is
//! said.

use super::mcap_repair::intact;
use super::messages::{Message, Setup};
use device_sim::error::Error;
use device_sim::named_files::Text;
use device_sim::profile::Profile;
use mcap::read::{MessageStream, Options};
use std::borrow::Cow;
use std::path::Path;

/// A recording in memory.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The file's name in errors.
    pub file: String,
    /// The setup at the beginning.
    pub setup: Setup,
    /// Everything else, later set-ups too, in the order in which it was written.
    pub messages: Vec<Message>,
    /// The reason why it ends early, if it does.
    pub cut: Option<String>,
    /// Time of tick 0 in nanoseconds since 1970, by the clock of the computer that recorded; 0 if
    /// that had none.
    pub begun_ns: u64,
}

/// Adds the extension that a person left out, if that is the file that exists.
fn with_extension(path: &Path) -> Cow<'_, Path> {
    if path.extension().is_none() && !path.exists() {
        let whole = path.with_extension("mcap");
        if whole.exists() {
            return Cow::Owned(whole);
        }
    }
    Cow::Borrowed(path)
}

impl Recording {
    /// Reads a recording. A file that was cut is read up to the cut. `monday` is `monday.mcap`
    /// unless there is a file of that name.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let path = with_extension(path);
        let shown = path.display().to_string();
        let bytes = std::fs::read(&path).map_err(|cause| {
            Error::input(format_args!("{shown}: the recording cannot be read ({cause}); check its path"))
        })?;
        Self::parse(shown, &bytes)
    }

    /// Reads the bytes of a recording; `file` is what errors call it.
    pub fn parse(file: String, bytes: &[u8]) -> Result<Self, Error> {
        if !bytes.starts_with(mcap::MAGIC) {
            return Err(Error::input(format_args!(
                "{file}: not an MCAP recording; give one that `run --record` made"
            )));
        }
        let stream = MessageStream::new_with_options(intact(bytes), Options::IgnoreEndMagic.into())
            .map_err(|cause| Error::input(format_args!("{file}: not a usable MCAP recording ({cause})")))?;
        let (mut setup, mut messages, mut cut, mut begun_ns) = (None, Vec::new(), None, 0);
        for message in stream {
            let message = match message {
                Ok(message) => message,
                Err(cause) => {
                    cut = Some(cause.to_string());
                    break;
                }
            };
            let topic = message.channel.topic.as_str();
            match parse(topic, &message.data) {
                Ok(Some(Message::Setup(first))) if setup.is_none() => {
                    (setup, begun_ns) = (Some(first), message.log_time);
                }
                Ok(Some(other)) => messages.push(other),
                // Somebody else's channel.
                Ok(None) => {}
                Err(cause) => {
                    return Err(Error::input(format_args!(
                        "{file}: a message on {topic} cannot be understood ({cause}); was it recorded by host-sim?"
                    )));
                }
            }
        }
        // The totals of the link are the last thing that a run writes.
        if cut.is_none() && !matches!(messages.last(), Some(Message::Link(_))) {
            cut = Some("its end was never written".to_owned());
        }
        let setup = setup.ok_or_else(|| {
            Error::input(format_args!("{file}: has no /setup message; was it recorded by host-sim?"))
        })?;
        Ok(Self { file, setup, messages, cut, begun_ns })
    }

    /// The profile that it was recorded with at the beginning.
    pub fn profile(&self) -> Result<Profile, Error> {
        self.profile_of(&self.setup)
    }

    /// The profile of one of its set-ups.
    pub fn profile_of(&self, setup: &Setup) -> Result<Profile, Error> {
        let origin = format!("{}, {}", self.file, setup.profile_origin);
        Profile::parse(Text { origin, text: setup.profile_toml.clone() })
    }
}

/// Ticks beyond this cannot be a device's: it would be 28,000 years old.
const LATEST_TICK: u64 = 1 << 53;

fn parse(topic: &str, json: &[u8]) -> Result<Option<Message>, String> {
    let understood = match topic {
        "/setup" => serde_json::from_slice(json).map(Message::Setup),
        "/hello" => serde_json::from_slice(json).map(Message::Hello),
        "/samples" => serde_json::from_slice(json).map(Message::Samples),
        "/pose" => serde_json::from_slice(json).map(Message::Pose),
        "/event" => serde_json::from_slice(json).map(Message::Event),
        "/link" => serde_json::from_slice(json).map(Message::Link),
        "/task" => serde_json::from_slice(json).map(Message::Task),
        "/probe" => serde_json::from_slice(json).map(Message::Probe),
        _ => return Ok(None),
    };
    let message = understood.map_err(|cause| cause.to_string())?;
    match &message {
        Message::Hello(hello) if !hello.is_plausible() => Err("its scale cannot be a device's".into()),
        other if other.tick().is_some_and(|tick| tick > LATEST_TICK) => {
            Err("its tick cannot be a device's".into())
        }
        _ => Ok(Some(message)),
    }
}
