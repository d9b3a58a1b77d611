//! Serves the page on this computer only.

use super::assets::{ASSETS, Asset, CLASS_PAGE, DEVICE_PAGE, GUIDE_PAGE};
use super::connection;
use super::debrief::{self, Debrief};
use super::watched::{self, Said, Watched, Watches};
use crate::bounded_listener::BoundedListener;
use axum::Router;
use axum::extract::{State, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use device_sim::session::Session;
use std::fmt;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::JoinHandle;
use tokio::sync::oneshot;

/// Longest message taken from a page, in bytes: an edited patient with all its layers has about 3,000.
const LONGEST_MESSAGE: usize = 32_768;
/// Connections at a time: eight pages with all their files. Whoever publishes does so to each.
const MOST_CONNECTIONS: usize = 64;

/// The reason why the page cannot be served.
#[derive(Debug)]
pub enum ServeError {
    /// Something else listens there.
    PortInUse {
        /// The port.
        port: u16,
    },
    /// Any other reason.
    Io {
        /// The port.
        port: u16,
        /// The system's error.
        error: io::Error,
    },
}

impl fmt::Display for ServeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PortInUse { port } => write!(
                f,
                "port {port} on 127.0.0.1 is in use; stop the program that uses it or choose another port with --port"
            ),
            Self::Io { port, error } => {
                write!(f, "cannot serve the page on 127.0.0.1:{port}: {error}; try another port with --port")
            }
        }
    }
}

impl std::error::Error for ServeError {}

/// The state that every request needs.
#[derive(Clone)]
pub(super) struct Shared {
    pub(super) session: Session,
    /// True if a person has taken the needle in any page.
    pub(super) person: Arc<AtomicBool>,
}

/// A page being served; dropped, it is not any more.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Returns the page's address.
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// The port, which the system chose where 0 was asked for.
    pub fn port(&self) -> u16 {
        self.address.port()
    }

    /// Serves until the program ends.
    pub fn wait(mut self) {
        if let Some(thread) = self.thread.take() {
            // A server that panicked serves no more, and its panic has been printed.
            let _ = thread.join();
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Serves the page of `session` at `port` of 127.0.0.1 (0: any free one) on a thread of its own.
pub fn serve(session: Session, port: u16) -> Result<Server, ServeError> {
    let shared = Shared { session, person: Arc::default() };
    start(port, &DEVICE_PAGE, Router::new().route("/live", get(live).with_state(shared)))
}

/// The same with a debrief of the last recording, which `write` makes of its file, at `/debrief`.
pub fn serve_with_debrief(session: Session, port: u16, write: Debrief) -> Result<Server, ServeError> {
    let router = debrief::router(session.clone(), write);
    let shared = Shared { session, person: Arc::default() };
    start(port, &DEVICE_PAGE, router.route("/live", get(live).with_state(shared)))
}

/// Serves a page of a class, which only looks at what `watches` give, as [`serve`] does.
pub fn serve_watched(watches: Watches, port: u16) -> Result<Server, ServeError> {
    let live = get(watched::live).with_state(Watched { watches, said: None });
    start(port, &CLASS_PAGE, Router::new().route("/live", live))
}

/// Serves the page of a guide, which looks at what `watches` give and agrees by what `said` takes, as [`serve`] does.
pub fn serve_guide(watches: Watches, said: Said, port: u16) -> Result<Server, ServeError> {
    let live = get(watched::live).with_state(Watched { watches, said: Some(said) });
    start(port, &GUIDE_PAGE, Router::new().route("/live", live))
}

fn start(port: u16, page: &'static Asset, router: Router) -> Result<Server, ServeError> {
    let failed = |error: io::Error| match error.kind() {
        io::ErrorKind::AddrInUse => ServeError::PortInUse { port },
        _ => ServeError::Io { port, error },
    };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let (stop, stopped) = oneshot::channel();
    let run = move || {
        runtime.block_on(async {
            tokio::select! {
                () = listen(listener, page, router) => {}
                _ = stopped => {}
            }
        });
        // Ends connections too; nothing in them blocks.
        runtime.shutdown_background();
    };
    let thread = std::thread::Builder::new().name("page".into()).spawn(run).map_err(failed)?;
    Ok(Server { address, stop: Some(stop), thread: Some(thread) })
}

async fn listen(listener: TcpListener, page: &'static Asset, mut router: Router) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    for asset in std::iter::once(page).chain(ASSETS) {
        router = router.route(asset.path, get(move || async move { file(asset) }));
    }
    // Ends only with its future.
    let _ = axum::serve(BoundedListener::new(listener, MOST_CONNECTIONS), router).await;
}

fn file(asset: &'static Asset) -> Response {
    let headers = [
        (header::CONTENT_TYPE, asset.content_type),
        // A newer program at the same address must not meet the older one's page.
        (header::CACHE_CONTROL, "no-cache"),
        // Tissue and ultrasound are WebAssembly.
        (header::CONTENT_SECURITY_POLICY, "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    (headers, asset.body).into_response()
}

async fn live(State(shared): State<Shared>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    if !is_own_page(&headers) {
        return (StatusCode::FORBIDDEN, "only the page of this program may move the needle").into_response();
    }
    upgrade
        .max_message_size(LONGEST_MESSAGE)
        .max_frame_size(LONGEST_MESSAGE)
        .on_upgrade(move |socket| connection::run(socket, shared))
}

/// Any site that a person visits may open a WebSocket to 127.0.0.1 and would drive the motor: the browser tells where the
/// script came from, and that has to be here.
pub(super) fn is_own_page(headers: &HeaderMap) -> bool {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let Some(host) = text(header::HOST) else { return false };
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    let local = matches!(name, "127.0.0.1" | "localhost" | "[::1]");
    // Programs that are no browser send no origin.
    local && text(header::ORIGIN).is_none_or(|origin| origin.strip_prefix("http://") == Some(host))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::time::{Duration, Instant};

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().unwrap());
        }
        headers
    }

    #[test]
    fn only_the_own_page_may_connect() {
        assert!(is_own_page(&headers("127.0.0.1:8710", Some("http://127.0.0.1:8710"))));
        assert!(is_own_page(&headers("localhost:9000", Some("http://localhost:9000"))));
        assert!(is_own_page(&headers("127.0.0.1:8710", None)));
        assert!(!is_own_page(&headers("127.0.0.1:8710", Some("http://example.org"))));
        assert!(!is_own_page(&headers("127.0.0.1:8710", Some("null"))));
        assert!(!is_own_page(&headers("example.org:8710", Some("http://example.org:8710"))));
    }

    #[test]
    fn a_port_in_use_is_one_clear_line() {
        let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = taken.local_addr().unwrap().port();
        let (session, _publisher) = device_sim::session::open(super::super::test_scene());
        let error = serve(session, port).unwrap_err();
        assert!(matches!(error, ServeError::PortInUse { port: p } if p == port));
        assert_eq!(error.to_string().lines().count(), 1);
        assert!(error.to_string().contains(&port.to_string()));
    }

    /// A WebSocket by hand: the upgrade, then nothing is read any more.
    fn connect_and_stop_reading(port: u16) -> TcpStream {
        let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, port)).unwrap();
        let request = format!(
            "GET /live HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).unwrap();
        assert_eq!(&answer, b"HTTP/1.1 101");
        stream
    }

    /// A short text as a masked frame, the mask being zero.
    fn text_frame(text: &str) -> Vec<u8> {
        let length = u8::try_from(text.len()).unwrap();
        assert!(length < 126);
        [&[0x81, 0x80 | length, 0, 0, 0, 0], text.as_bytes()].concat()
    }

    #[test]
    fn a_page_that_reads_nothing_costs_nothing_and_can_still_stop() {
        let (session, publisher) = device_sim::session::open(super::super::test_scene());
        let server = serve(session, 0).unwrap();
        let mut page = connect_and_stop_reading(server.port());
        // Each round fills what waits for it; together they are many times what sockets hold.
        let block = [control_core::controller::Sample::default(); 32];
        for round in 0..200 {
            let begin = Instant::now();
            for number in 0..20_000 / 32 {
                let tick = round * 20_000 + number * 32;
                publisher.samples(tick, &block);
                publisher.event(link::frames::Event { tick, kind: link::frames::EventKind::Started });
            }
            assert!(begin.elapsed() < Duration::from_secs(2), "the device waits for the page");
            std::thread::sleep(Duration::from_millis(8));
        }
        page.write_all(&text_frame(r#"{"do":"stop"}"#)).unwrap();
        let asked = (0..500).find_map(|_| {
            std::thread::sleep(Duration::from_millis(10));
            publisher.next_control()
        });
        assert_eq!(asked, Some(device_sim::session::Control::Stop));
    }

    #[test]
    fn nonsense_from_a_page_ends_its_connection_and_nothing_else() {
        let (session, publisher) = device_sim::session::open(super::super::test_scene());
        let server = serve(session, 0).unwrap();
        let mut page = connect_and_stop_reading(server.port());
        page.write_all(&text_frame(r#"{"do":"drag","depth_mm":1e9}"#)).unwrap();
        page.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        let mut rest = Vec::new();
        page.read_to_end(&mut rest).unwrap();
        assert!(String::from_utf8_lossy(&rest).contains("not within -200 to 500 mm"));
        assert_eq!(publisher.next_control(), None);
        let mut other = connect_and_stop_reading(server.port());
        other.write_all(&text_frame(r#"{"do":"start"}"#)).unwrap();
        let asked = (0..500).find_map(|_| {
            std::thread::sleep(Duration::from_millis(10));
            publisher.next_control()
        });
        assert_eq!(asked, Some(device_sim::session::Control::Start));
    }
}
