//! Serves the page: on this computer only, or to a network and with a token.

use super::assets::{ASSETS, Asset, CLASS_PAGE, DEVICE_PAGE, GUIDE_PAGE, IMPORT_PAGE};
use super::connection;
use super::debrief::{self, Debrief};
use super::demonstration::{self, Demonstration};
use super::gate::{self, Gate, Peer};
use super::read_only_page::{self, Said, Watched, Watches};
use super::shared::Shared;
use super::workbench::{self, Workbench};
use crate::bounded_listener::BoundedListener;
use axum::Router;
use axum::extract::{State, WebSocketUpgrade};
use axum::http::header;
use axum::middleware;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use device_sim::session::Session;
use std::fmt;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::sync::Arc;
use std::thread::JoinHandle;
use tokio::sync::oneshot;

/// Longest message taken from a page, in bytes: an edited patient with all its layers has about
/// 3,000.
const LONGEST_MESSAGE: usize = 32_768;
/// Connections at a time: eight pages with all their files. Whoever publishes does so to each.
const MOST_CONNECTIONS: usize = 64;

/// The reason why the page cannot be served.
#[derive(Debug)]
pub enum ServeError {
    /// Something else listens there.
    PortInUse {
        /// The address.
        address: SocketAddr,
    },
    /// This computer does not have the address.
    NoSuchAddress {
        /// The address.
        address: SocketAddr,
    },
    /// Any other reason.
    Io {
        /// The address.
        address: SocketAddr,
        /// The system's error.
        error: io::Error,
    },
}

impl fmt::Display for ServeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PortInUse { address } => write!(
                f,
                "port {} on {} is in use; stop the program that uses it or choose another port with {}",
                address.port(),
                address.ip(),
                option(address)
            ),
            Self::NoSuchAddress { address } => write!(
                f,
                "this computer has no address {}; give --listen one of its own, or 0.0.0.0 for all of them",
                address.ip()
            ),
            Self::Io { address, error } => {
                write!(
                    f,
                    "cannot serve the page on {address}: {error}; try another port with {}",
                    option(address)
                )
            }
        }
    }
}

/// The option that says where the page is served.
fn option(address: &SocketAddr) -> &'static str {
    if address.ip().is_loopback() { "--port" } else { "--listen ADDRESS:PORT" }
}

impl std::error::Error for ServeError {}

/// A page being served; dropped, it is not any more.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    /// The token that other computers have to know.
    token: Option<String>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Returns the page's address.
    pub fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            address.set_ip(Ipv4Addr::LOCALHOST.into());
        }
        format!("http://{address}/")
    }

    /// Returns the page's address for other computers, with its token; none where it is served to
    /// this one only.
    pub fn url_for_others(&self) -> Option<String> {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            address.set_ip(own_address().unwrap_or(address.ip()));
        }
        self.token.as_ref().map(|token| gate::address_with(&format!("http://{address}/"), token))
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

/// The address by which this computer is known in its network: the one that it would send from.
/// Nothing is sent.
fn own_address() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    // An address for documentation (RFC 5737), which nobody has.
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    Some(socket.local_addr().ok()?.ip())
}

fn local(port: u16) -> SocketAddr {
    (Ipv4Addr::LOCALHOST, port).into()
}

/// Serves the page of `session` at `port` of 127.0.0.1 (0: any free one) on a thread of its own.
pub fn serve(session: Session, port: u16) -> Result<Server, ServeError> {
    let shared = Shared { session, person: Arc::default() };
    start(local(port), &DEVICE_PAGE, Router::new().route("/live", get(live).with_state(shared)))
}

/// The same at any address, with a debrief of the last recording, which `write` makes of its file,
/// at `/debrief`, and the report of a demonstration of the diagnosis. Other computers need the
/// token of [`Server::url_for_others`].
pub fn serve_with_reports(
    session: Session,
    address: SocketAddr,
    write: Debrief,
    demonstrate: Demonstration,
) -> Result<Server, ServeError> {
    let router = debrief::router(session.clone(), write).merge(demonstration::router(demonstrate));
    let shared = Shared { session, person: Arc::default() };
    start(address, &DEVICE_PAGE, router.route("/live", get(live).with_state(shared)))
}

/// Serves a page of a class, which only looks at what `watches` give, as [`serve`] does.
pub fn serve_watched(watches: Watches, port: u16) -> Result<Server, ServeError> {
    let live = get(read_only_page::live).with_state(Watched { watches, said: None });
    start(local(port), &CLASS_PAGE, Router::new().route("/live", live))
}

/// Serves the page of a guide, which looks at what `watches` give and agrees by what `said` takes,
/// as [`serve`] does.
pub fn serve_guide(watches: Watches, said: Said, port: u16) -> Result<Server, ServeError> {
    let live = get(read_only_page::live).with_state(Watched { watches, said: Some(said) });
    start(local(port), &GUIDE_PAGE, Router::new().route("/live", live))
}

/// Serves the page to drop a log on, whose questions `answer` answers, as [`serve`] does.
pub fn serve_workbench(answer: Workbench, port: u16) -> Result<Server, ServeError> {
    start(local(port), &IMPORT_PAGE, workbench::router(answer))
}

fn start(wanted: SocketAddr, page: &'static Asset, router: Router) -> Result<Server, ServeError> {
    let failed = |error: io::Error| match error.kind() {
        io::ErrorKind::AddrInUse => ServeError::PortInUse { address: wanted },
        io::ErrorKind::AddrNotAvailable => ServeError::NoSuchAddress { address: wanted },
        _ => ServeError::Io { address: wanted, error },
    };
    let (gate, token) = match wanted.ip().is_loopback() {
        true => (Gate::default(), None),
        false => Gate::with_token().map(|(gate, token)| (gate, Some(token))).map_err(|e| failed(e.into()))?,
    };
    let listener = TcpListener::bind(wanted).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let (stop, stopped) = oneshot::channel();
    let run = move || {
        runtime.block_on(async {
            tokio::select! {
                () = listen(listener, page, router, gate) => {}
                _ = stopped => {}
            }
        });
        // Ends connections too; nothing in them blocks.
        runtime.shutdown_background();
    };
    let thread = std::thread::Builder::new().name("page".into()).spawn(run).map_err(failed)?;
    Ok(Server { address, token, stop: Some(stop), thread: Some(thread) })
}

async fn listen(listener: TcpListener, page: &'static Asset, mut router: Router, gate: Gate) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    for asset in std::iter::once(page).chain(ASSETS) {
        router = router.route(asset.path, get(move || async move { file(asset) }));
    }
    let guarded = router.layer(middleware::from_fn_with_state(gate, gate::pass));
    let service = guarded.into_make_service_with_connect_info::<Peer>();
    // Ends only with its future.
    let _ = axum::serve(BoundedListener::new(listener, MOST_CONNECTIONS), service).await;
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

async fn live(State(shared): State<Shared>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(LONGEST_MESSAGE)
        .max_frame_size(LONGEST_MESSAGE)
        .on_upgrade(move |socket| connection::run(socket, shared))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::time::{Duration, Instant};

    #[test]
    fn a_port_in_use_is_one_clear_line() {
        let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = taken.local_addr().unwrap().port();
        let (session, _publisher) = device_sim::session::open(super::super::test_scene());
        let error = serve(session, port).unwrap_err();
        assert!(matches!(error, ServeError::PortInUse { address } if address.port() == port));
        assert_eq!(error.to_string().lines().count(), 1);
        assert!(error.to_string().contains(&port.to_string()));
    }

    /// The status and the head of the answer to a request to this computer's address `to`.
    fn answer(to: SocketAddr, path: &str, cookie: &str) -> String {
        let mut stream = TcpStream::connect(to).unwrap();
        let request = format!("GET {path} HTTP/1.1\r\nHost: {to}\r\n{cookie}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut head = vec![0; 400];
        let count = stream.read(&mut head).unwrap();
        String::from_utf8_lossy(&head[..count]).into_owned()
    }

    #[test]
    fn another_computer_needs_the_token_and_this_one_does_not() {
        // Without a network there is nobody to keep out.
        let Some(own) = own_address().filter(|address| !address.is_loopback()) else { return };
        let (session, _publisher) = device_sim::session::open(super::super::test_scene());
        let write: Debrief = Arc::new(|_, _| Ok(String::new()));
        let all = (Ipv4Addr::UNSPECIFIED, 0).into();
        let server = serve_with_reports(session, all, write, || Ok(String::new())).unwrap();
        let from_outside = SocketAddr::from((own, server.port()));
        for path in [
            "/",
            "/main.js",
            "/live",
            "/debrief",
            demonstration::PATH,
            "/?token=",
            "/?token=0123456789abcdef0123456789abcdef",
        ] {
            assert!(answer(from_outside, path, "").starts_with("HTTP/1.1 403"), "{path}");
        }
        let url = server.url_for_others().unwrap();
        let path = url.strip_prefix(&format!("http://{from_outside}")).unwrap();
        let head = answer(from_outside, path, "");
        assert!(head.starts_with("HTTP/1.1 303"), "{head}");
        let cookie = head.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
        assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
        let cookie = format!("Cookie: {}\r\n", cookie.split(';').next().unwrap());
        assert!(answer(from_outside, "/", &cookie).starts_with("HTTP/1.1 200"));
        assert!(
            answer(from_outside, "/debrief", &cookie).starts_with("HTTP/1.1 404"),
            "nothing was recorded"
        );
        let strange = format!("{cookie}Origin: http://example.org\r\n");
        assert!(answer(from_outside, "/live", &strange).starts_with("HTTP/1.1 403"));
        assert!(answer(local(server.port()), "/", "").starts_with("HTTP/1.1 200"), "{}", server.url());
    }

    #[test]
    fn an_address_of_another_computer_is_one_clear_line() {
        let (session, _publisher) = device_sim::session::open(super::super::test_scene());
        let write: Debrief = Arc::new(|_, _| Ok(String::new()));
        let error = serve_with_reports(session, "192.0.2.7:0".parse().unwrap(), write, || Ok(String::new()))
            .unwrap_err();
        assert!(matches!(error, ServeError::NoSuchAddress { .. }), "{error}");
        assert!(error.to_string().contains("192.0.2.7") && error.to_string().contains("--listen"), "{error}");
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
