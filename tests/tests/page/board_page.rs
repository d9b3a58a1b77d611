//! The page of a real board in a real browser. Its serial port and its USB are mocked and lead
//! here: to the virtual device, and to a bootloader with the rules of AN3156.

use crate::board_session::{ACTS, uncommissioned};
use crate::update::{carry_out, dfuse, image};
use board_wasm::dfu::Next;
use emulator::bootloader::{Bootloader, FLASH, MEMORY};
use lab::commission::bench::Line;
use lab::commission::mechanism::VirtualLine;
use link::Command;
use link::codec::Decoder;
use link::frames::HostFrame;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tests::browser::{Chromium, Error, PATIENCE, Page, Places, check};

/// The most that the device's time goes on between two exchanges with the page: it is never ahead
/// of the page's clock, whose heartbeat it awaits.
const AT_ONCE: Duration = Duration::from_millis(40);
const MOCK: &str = include_str!("board_page.js");

/// The page with its port, and the device behind it.
struct PageWithDevice {
    page: Page,
    _browser: Chromium,
    scratch: PathBuf,
    line: VirtualLine,
    decoder: Decoder,
    commands: Vec<Command>,
    exchanged: Instant,
    /// Bytes that the page has sent and the device has not received.
    out: Vec<u8>,
}

impl PageWithDevice {
    fn open(name: &str) -> Result<Self, Error> {
        let places = Places::find()?;
        let site = places.target.join("site/board.html");
        if !site.exists() {
            return Err(format!("no page at {}: run `cargo xtask site`", site.display()));
        }
        let scratch = places.scratch(name)?;
        let browser = Chromium::start(&scratch)?;
        let mut page = Page::open(&browser, &format!("file://{}", site.display()), 1_440, 900, false)?;
        page.wait("the page", "'ready' in document.body.dataset")?;
        page.evaluate(&format!("window.mockMemory = {}; {MOCK}", json!(MEMORY)))?;
        Ok(Self {
            page,
            _browser: browser,
            scratch,
            line: uncommissioned(),
            decoder: Decoder::default(),
            commands: Vec::new(),
            exchanged: Instant::now(),
            out: Vec::new(),
        })
    }

    /// Carries bytes to and fro until an expression of the page is true.
    fn until(&mut self, what: &str, expression: &str) -> Result<(), Error> {
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            let mut heard = Vec::new();
            std::thread::sleep(Duration::from_millis(2));
            let since = std::mem::replace(&mut self.exchanged, Instant::now()).elapsed().min(AT_ONCE);
            for _ in 0..since.as_millis() {
                let out = &mut self.out;
                self.line.exchange(&std::mem::take(out), &mut heard).map_err(|error| error.to_string())?;
            }
            let both = format!("[mock.exchange({}), Boolean({expression})]", json!(heard));
            let answer = self.page.evaluate(&both)?;
            self.out = bytes(&answer[0]);
            for byte in &self.out {
                if let Some(Ok(frame)) = self.decoder.push::<HostFrame>(*byte) {
                    self.commands.push(frame.command);
                }
            }
            if answer[1] == json!(true) {
                return Ok(());
            }
        }
        let state = self.page.text("document.body.innerText")?.replace('\n', " | ");
        Err(format!("{what}: not within {} s; the page shows: {state}", PATIENCE.as_secs()))
    }

    fn connect(&mut self) -> Result<(), Error> {
        self.page.click("connect")?;
        self.until(
            "a live board",
            "document.body.hasAttribute('data-live') && document.body.dataset.port === 'open'",
        )
    }

    fn gives_torque(&self) -> bool {
        self.commands
            .iter()
            .any(|command| matches!(command, Command::Start | Command::Excite(_) | Command::Play { .. }))
    }

    /// Begins a step as a person does.
    fn begin(&mut self, step: usize) -> Result<(), Error> {
        let button = format!("document.querySelector('.step:nth-child({step})[data-stage=asked] .begin')");
        self.until(&format!("step {step}"), &format!("{button} !== null"))?;
        if self.gives_torque() {
            return Err(format!("torque was asked for before step {step} was begun"));
        }
        self.page.evaluate(&format!("{button}.click()"))?;
        self.line.act(ACTS[step - 1]);
        Ok(())
    }
}

fn bytes(value: &Value) -> Vec<u8> {
    value.as_array().into_iter().flatten().filter_map(Value::as_u64).map(|byte| byte as u8).collect()
}

fn passes(done: Result<(), Error>) {
    if let Err(error) = done {
        panic!("{error}");
    }
}

#[test]
fn a_board_is_shown_and_commissioned_in_the_page() {
    passes(commission());
}

fn commission() -> Result<(), Error> {
    let mut bench = PageWithDevice::open("page-board")?;
    bench.page.photograph(&bench.scratch.join("closed.png"))?;
    let shown = bench.page.evaluate("document.getElementById('stop').offsetHeight > 0")?;
    check("Stop is always there", shown == json!(true), shown)?;
    bench.connect()?;
    bench.until("the figures", "document.getElementById('late').textContent !== '–' && document.getElementById('depth').textContent !== '–'")?;
    bench.page.photograph(&bench.scratch.join("view.png"))?;
    let firmware = bench.page.text("document.getElementById('firmware').textContent")?;
    check("the firmware", firmware.starts_with("0."), firmware)?;
    let only_greets =
        bench.commands.iter().all(|command| matches!(command, Command::Hello { .. } | Command::Stop));
    check("it only greets", only_greets, &bench.commands)?;
    let clears = bench.page.evaluate("!document.getElementById('clear').hidden")?;
    check("there is no fault to clear", clears == json!(false), clears)?;
    bench.commands.clear();
    bench.page.click("stop")?;
    for _ in 0..10 {
        bench.until("an exchange", "true")?;
    }
    check("a stop is sent at once", bench.commands.contains(&Command::Stop), &bench.commands)?;
    bench.page.click("commission")?;
    for step in 1..=ACTS.len() {
        bench.begin(step)?;
    }
    bench.until("the end", "document.getElementById('end').hasAttribute('data-well')")?;
    bench.page.resize(390, 844, true)?;
    bench.page.photograph(&bench.scratch.join("done-phone.png"))?;
    let lines = bench.page.text("document.getElementById('end').innerText")?;
    check("what was found", lines.contains("4000 counts a turn") && lines.contains("leads reversed"), lines)?;
    check(
        "a file to keep",
        bench.page.evaluate("!document.getElementById('download').hidden")? == json!(true),
        (),
    )?;
    let complaints = bench.page.complaints()?;
    check("no complaint", complaints.is_empty(), complaints)
}

#[test]
fn a_cable_that_is_pulled_forgets_the_guide() {
    passes(pull());
}

fn pull() -> Result<(), Error> {
    let mut bench = PageWithDevice::open("page-board-pulled")?;
    bench.connect()?;
    bench.page.click("commission")?;
    for step in 1..=ACTS.len() {
        bench.begin(step)?;
    }
    bench.until("the pulses", "mock.state.out.length === 0 && document.querySelector('.step:nth-child(6)[data-stage=running]') !== null")?;
    let begin = Instant::now();
    while !bench.gives_torque() && begin.elapsed() < PATIENCE {
        bench.until("an exchange", "true")?;
    }
    check("the pulses have begun", bench.gives_torque(), &bench.commands)?;
    bench.page.evaluate("mock.pull()")?;
    bench.page.wait("the end of the connection", "document.body.dataset.port === 'closed'")?;
    let said = bench.page.text("document.getElementById('banner').textContent")?;
    check("it says so", said.contains("gone"), said)?;
    bench.line = uncommissioned();
    bench.commands.clear();
    bench.out.clear();
    bench.decoder = Decoder::default();
    bench.connect()?;
    for _ in 0..100 {
        bench.until("an exchange", "true")?;
    }
    let only_greets =
        bench.commands.iter().all(|command| matches!(command, Command::Hello { .. } | Command::Stop));
    check("it only greets", only_greets && !bench.commands.is_empty(), &bench.commands)?;
    let guides = bench.page.number("document.querySelectorAll('.step').length")?;
    let shown = bench.page.evaluate("document.getElementById('choose').offsetHeight > 0")?;
    check("no guide is left", guides == 0.0 && shown == json!(true), (guides, shown))
}

#[test]
fn a_board_is_updated_in_the_page() {
    passes(update());
}

fn update() -> Result<(), Error> {
    let mut bench = PageWithDevice::open("page-board-update")?;
    let mut bootloader = Bootloader::default();
    let file = dfuse(FLASH, &image());
    bench.page.evaluate(&format!("mock.choose({})", json!(file)))?;
    bench.page.wait("the button", "!document.getElementById('update').disabled")?;
    bench.page.evaluate("document.getElementById('update').click()")?;
    let mut answer = json!(null);
    loop {
        let asked = bench.page.evaluate(&format!("mock.transfer({answer})"))?;
        let number = |key: &str| asked[key].as_u64().unwrap_or_default();
        let (request, value) = (number("request") as u8, number("value") as u16);
        let next = match asked["do"].as_str() {
            Some("out") => Next::Out { request, value, data: bytes(&asked["data"]) },
            Some(_) => Next::In { request, value, length: number("length") as u16 },
            None if bench.page.evaluate("document.getElementById('banner').hidden")? == json!(true) => {
                // The page waits by itself, for as long as the bootloader said: 0.5 s for an
                // erasure.
                answer = json!(null);
                continue;
            }
            None => break,
        };
        // It has waited, or it would not ask.
        bootloader.wait(500);
        answer = match carry_out(&mut bootloader, &next).unwrap_or(Ok(Vec::new())) {
            Ok(data) => json!({ "data": data }),
            Err(failed) => json!({ "failed": failed }),
        };
    }
    bench.page.photograph(&bench.scratch.join("updated.png"))?;
    let said = bench.page.text("document.getElementById('banner').textContent")?;
    check("it says so", said.starts_with("Updated"), said)?;
    check("the flash", bootloader.flash.starts_with(&image()), ())?;
    check("it is started", bootloader.started == Some(FLASH), bootloader.started)
}
