//! Foxglove's live WebSocket: `/pose` and `/event` as JSON with a schema, `/tf` for its 3D panel.

use super::feed::Snapshot;
use foxglove::messages::{FrameTransform, Quaternion, Vector3};
use foxglove::{Channel, ChannelBuilder, Context, FoxgloveError, RawChannel, Schema};
use std::net::SocketAddr;
use std::sync::Arc;
use tokio::sync::watch;

/// Messages that wait for a slow client; the oldest give way.
const BACKLOG: usize = 64;

/// The channels.
struct Channels {
    pose: Arc<RawChannel>,
    event: Arc<RawChannel>,
    transform: Channel<FrameTransform>,
}

impl Channels {
    fn open(context: &Arc<Context>) -> Result<Self, FoxgloveError> {
        let json = |topic: &str, name: &str, schema: &'static str| {
            ChannelBuilder::new(topic)
                .context(context)
                .message_encoding("json")
                .schema(Schema::new(name, "jsonschema", schema.as_bytes()))
                .build_raw()
        };
        Ok(Self {
            pose: json("/pose", "NeedlePose", include_str!("schemas/pose.json"))?,
            event: json("/event", "NeedleEvent", include_str!("schemas/event.json"))?,
            transform: ChannelBuilder::new("/tf").context(context).build(),
        })
    }

    /// Sends the events after the first `told`, and the pose.
    fn send(&self, snapshot: &Snapshot, told: u64) {
        for text in snapshot.events.since(told).filter_map(|event| serde_json::to_vec(event).ok()) {
            self.event.log(&text);
        }
        let Some(pose) = &snapshot.pose else { return };
        if let Ok(text) = serde_json::to_vec(pose) {
            self.pose.log(&text);
        }
        let metres = pose.tip_mm.map(|mm| mm / 1000.0);
        let (sine, cosine) = (pose.tilt_rad / 2.0).sin_cos();
        self.transform.log(&FrameTransform {
            timestamp: None,
            parent_frame_id: "skin".into(),
            child_frame_id: "needle".into(),
            translation: Some(Vector3 { x: metres[0], y: metres[1], z: metres[2] }),
            // About the axis across: the needle's x axis points in the direction of insertion.
            rotation: Some(Quaternion { x: 0.0, y: sine, z: 0.0, w: cosine }),
        });
    }
}

/// Serves at `address`.
pub(super) async fn serve(
    address: SocketAddr,
    mut newest: watch::Receiver<Snapshot>,
) -> Result<SocketAddr, FoxgloveError> {
    let context = Context::new();
    let channels = Channels::open(&context)?;
    let server = context
        .websocket_server()
        .name("needle")
        .bind(address.ip().to_string(), address.port())
        .message_backlog_size(BACKLOG)
        .tokio_runtime(&tokio::runtime::Handle::current())
        .start()
        .await?;
    let bound = SocketAddr::new(address.ip(), server.port());
    tokio::spawn(async move {
        // Both live as long as the stream.
        let (_server, _context) = (server, context);
        let mut told = 0;
        while newest.changed().await.is_ok() {
            let snapshot = newest.borrow_and_update().clone();
            channels.send(&snapshot, told);
            told = snapshot.events.total();
        }
    });
    Ok(bound)
}
