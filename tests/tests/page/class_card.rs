//! The card of a trainee on the page of a class: goal and reasons are read whole, in three
//! languages, on a desktop, a tablet and a phone.

use crate::needle::Size;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use tests::browser::{Chromium, Error, Page, Places, check};

const SIZES: [Size; 6] = [
    (1440, 900, false),
    (1280, 720, false),
    (1024, 768, true),
    (768, 1024, true),
    (390, 844, true),
    (844, 390, true),
];
/// Keeps the page's socket, so that a message can be put into it as from the instructor's program.
const KEEP_SOCKET: &str =
    "WebSocket = class extends WebSocket { constructor(...all) { super(...all); window.socket = this; } };";
/// A trainee who did much wrong.
const MEMBER: &str = "socket.onmessage({ data: JSON.stringify({ type: 'class', name: 'ward-3', address: '10.0.0.1:7447', members: [{
    name: 'bed-1', trainee: 'Anna', connected: true, gone: false, silent_s: 0, stuck: null, recording: false, events: [], scene: null, pose: null,
    score: { insertions: 3, passed: 1, last: { time_s: 12.5, peak_force_n: 1.25, verdict: { goal: 'Put a catheter into the vein', reasons: [
        { words: 'the skin was pierced at 45°, not at 10–30°' }, { words: 'it went through the far wall' },
        { words: 'the needle left the vein before the catheter was in' }, { words: 'the tourniquet was left on' }] } } } }] }) })";

#[test]
fn reasons_are_read_whole_in_three_languages() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-class")?;
    let browser = Chromium::start(&scratch)?;
    let address = serve()?;
    let url = format!("http://{address}/class.html");
    let mut page = Page::open(&browser, &url, SIZES[0].0, SIZES[0].1, SIZES[0].2)?;
    page.before_load(KEEP_SOCKET)?;
    for (language, first, last) in [
        ("en", "the skin was pierced at 45°, not at 10–30°", "the tourniquet was left on"),
        ("de", "die Haut wurde unter 45° durchstochen", "Stauschlauch"),
        ("fr", "peau", "garrot"),
    ] {
        page.languages(language)?;
        page.evaluate("window.__old = true, location.reload()")?;
        page.wait("the page anew", "!window.__old && Boolean(window.socket?.onmessage)")?;
        page.evaluate(MEMBER)?;
        page.wait("a card", "document.querySelectorAll('.card').length === 1")?;
        let text = page.text("document.querySelector('[data-figure=reasons]').textContent")?;
        check(
            &format!("{language}: the reasons are in the language"),
            text.contains(first) && text.contains(last) && text.matches(';').count() == 3,
            &text,
        )?;
        for size in SIZES {
            page.resize(size.0, size.1, size.2)?;
            is_whole(&mut page, language, size)?;
            page.photograph(&scratch.join(format!("{language}-{}x{}.png", size.0, size.1)))?;
        }
    }
    Ok(())
}

/// Serves the files of the page, for the program of an instructor is another build. Returns the
/// address.
fn serve() -> Result<std::net::SocketAddr, Error> {
    let listener = TcpListener::bind("127.0.0.1:0").map_err(|cause| cause.to_string())?;
    let address = listener.local_addr().map_err(|cause| cause.to_string())?;
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            std::thread::spawn(move || answer(stream));
        }
    });
    Ok(address)
}

fn answer(mut stream: TcpStream) -> std::io::Result<()> {
    let mut request = String::new();
    let mut reader = BufReader::new(stream.try_clone()?);
    reader.read_line(&mut request)?;
    let mut header = String::new();
    while reader.read_line(&mut header)? > 2 {
        header.clear();
    }
    let path = request.split(' ').nth(1).unwrap_or_default().trim_start_matches('/');
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/page/js").join(path);
    let kind = match file.extension().and_then(|end| end.to_str()) {
        Some("html") => "text/html",
        Some("js") => "text/javascript",
        Some("css") => "text/css",
        Some("svg") => "image/svg+xml",
        _ => "text/plain",
    };
    let (state, body) = std::fs::read(&file).map_or(("404 Not Found", Vec::new()), |body| ("200 OK", body));
    let length = body.len();
    write!(
        stream,
        "HTTP/1.1 {state}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    )?;
    stream.write_all(&body)
}

/// Nothing of goal and reasons is cut off, and nothing is wider than the page.
fn is_whole(page: &mut Page, language: &str, size: Size) -> Result<(), Error> {
    let cut = page.text(
        "[...document.querySelectorAll('[data-figure], .card h2, #class-name')] \
         .filter(e => e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1) \
         .map(e => e.dataset.figure ?? e.tagName).concat(document.documentElement.scrollWidth > innerWidth ? ['page'] : []).join(' ')",
    )?;
    check(&format!("{language}: all is read whole"), cut.is_empty(), (size, cut))
}
