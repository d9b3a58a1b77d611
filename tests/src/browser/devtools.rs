//! The DevTools protocol as far as a test needs it: a call and its answer, and the events that
//! arrive in between.

use super::{Error, PATIENCE};
use serde_json::{Value, json};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// Wait for one message, so that a timeout is noticed.
const READ_TIMEOUT: Duration = Duration::from_millis(50);

/// A connection to the browser, or to one tab once attached to it.
pub struct DevTools {
    socket: WebSocket<TcpStream>,
    last_id: u64,
    session: Option<String>,
    events: Vec<Value>,
}

/// Time for events that are on their way.
const DRAIN_TIME: std::time::Duration = std::time::Duration::from_millis(300);

impl DevTools {
    /// Connects to the address that the browser announced.
    pub fn connect(address: &str) -> Result<Self, Error> {
        let host = address.strip_prefix("ws://").and_then(|rest| rest.split('/').next()).unwrap_or_default();
        let stream = TcpStream::connect(host).map_err(|e| format!("no DevTools at {host}: {e}"))?;
        let ready = stream.set_nodelay(true).and_then(|()| stream.set_read_timeout(Some(PATIENCE)));
        ready.map_err(|e| e.to_string())?;
        let (socket, _) = tungstenite::client(address, stream).map_err(|e| format!("DevTools: {e}"))?;
        socket.get_ref().set_read_timeout(Some(READ_TIMEOUT)).map_err(|e| e.to_string())?;
        Ok(Self { socket, last_id: 0, session: None, events: Vec::new() })
    }

    /// From here on calls go to a new tab.
    pub fn open_tab(&mut self) -> Result<(), Error> {
        let text = |value: &Value, key: &str| value[key].as_str().map(str::to_owned).ok_or("no id of a tab");
        let tab = self.call("Target.createTarget", json!({ "url": "about:blank" }))?;
        let attach = json!({ "targetId": text(&tab, "targetId")?, "flatten": true });
        let attached = self.call("Target.attachToTarget", attach)?;
        self.session = Some(text(&attached, "sessionId")?);
        Ok(())
    }

    /// Calls a method and waits for its result.
    pub fn call(&mut self, method: &str, parameters: Value) -> Result<Value, Error> {
        self.last_id += 1;
        let mut message = json!({ "id": self.last_id, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        let sent = self.socket.send(Message::text(message.to_string()));
        sent.map_err(|e| format!("{method}: {e}"))?;
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            let Some(mut message) = self.receive()? else { continue };
            if message["id"] == json!(self.last_id) {
                return match message.get("error") {
                    Some(error) => Err(format!("{method}: {error}")),
                    None => Ok(message["result"].take()),
                };
            }
            self.events.push(message);
        }
        Err(format!("{method}: no answer within {} s", PATIENCE.as_secs()))
    }

    /// Events that have arrived since the last time, oldest first.
    pub fn events(&mut self) -> Result<Vec<Value>, Error> {
        // A page that streams never falls silent: what has not come by now is not waited for.
        let begin = Instant::now();
        while begin.elapsed() < DRAIN_TIME
            && let Some(message) = self.receive()?
        {
            self.events.push(message);
        }
        Ok(std::mem::take(&mut self.events))
    }

    /// The next message, if one arrives soon.
    fn receive(&mut self) -> Result<Option<Value>, Error> {
        match self.socket.read() {
            Ok(Message::Text(text)) => {
                serde_json::from_str(&text).map(Some).map_err(|e| format!("DevTools: {e}"))
            }
            Ok(_) => Ok(None),
            Err(tungstenite::Error::Io(e))
                if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
            {
                Ok(None)
            }
            Err(e) => Err(format!("DevTools: {e}")),
        }
    }
}
