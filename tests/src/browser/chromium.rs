//! Chromium as a process of our own: a fresh profile, no screen, nothing in the background, ended
//! with its test.

use super::devtools::DevTools;
use super::{Error, PATIENCE};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// The paths on Debian and Ubuntu.
const PROGRAMS: &[&str] = &["/usr/bin/chromium", "/usr/bin/chromium-browser"];
/// Time to close by itself before it is ended.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);
const ARGUMENTS: &[&str] = &[
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--disable-breakpad",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
    "about:blank",
];

/// WebGL without a graphics processor.
const WEBGL: &[&str] = &["--disable-gpu", "--enable-unsafe-swiftshader"];
/// WebGPU and WebGL without one. The canvas of WebGPU can be read but does not come to the screen.
const WEBGPU: &[&str] = &[
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
    "--disable-vulkan-surface",
    "--ignore-gpu-blocklist",
];

/// A running browser; dropped, it is ended and its profile deleted.
pub struct Chromium {
    process: Child,
    profile: PathBuf,
    address: String,
}

impl Chromium {
    /// Starts it with a fresh profile below `scratch`, without WebGPU.
    pub fn start(scratch: &Path) -> Result<Self, Error> {
        Self::start_with(scratch, WEBGL)
    }

    /// The same with WebGPU computed by the processor.
    pub fn start_with_webgpu(scratch: &Path) -> Result<Self, Error> {
        Self::start_with(scratch, WEBGPU)
    }

    fn start_with(scratch: &Path, graphics: &[&str]) -> Result<Self, Error> {
        let program = PROGRAMS.iter().find(|path| Path::new(path).exists()).ok_or_else(|| {
            format!("no browser at {}: run `cargo xtask test`, which installs Chromium", PROGRAMS[0])
        })?;
        let profile = scratch.join(format!("chromium-{}", std::process::id()));
        fs::create_dir_all(&profile).map_err(|e| format!("cannot create {}: {e}", profile.display()))?;
        let mut process = Command::new(program)
            .args(graphics)
            .args(ARGUMENTS)
            .arg(format!("--user-data-dir={}", profile.display()))
            // It keeps some of its state outside the profile otherwise.
            .env("HOME", &profile)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| format!("cannot start {program}: {e}"))?;
        let address = announced(&mut process);
        let mut browser = Self { process, profile, address: String::new() };
        browser.address = address?;
        Ok(browser)
    }

    /// The process that was started; the others are its children and theirs.
    pub(super) fn id(&self) -> u32 {
        self.process.id()
    }

    /// A new connection to it.
    pub fn devtools(&self) -> Result<DevTools, Error> {
        DevTools::connect(&self.address)
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        if let Ok(mut devtools) = DevTools::connect(&self.address) {
            let _ = devtools.call("Browser.close", serde_json::json!({}));
        }
        let begin = Instant::now();
        while begin.elapsed() < CLOSE_TIMEOUT && matches!(self.process.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = fs::remove_dir_all(&self.profile);
    }
}

/// The address of the DevTools protocol, which Chromium prints when it is ready.
fn announced(process: &mut Child) -> Result<String, Error> {
    let stderr = process.stderr.take().ok_or("no standard error")?;
    let (sender, receiver) = mpsc::channel();
    // Reads on after the address: a full pipe would stop the browser.
    std::thread::spawn(move || {
        let mut last = String::new();
        for line in BufReader::new(stderr).lines().map_while(Result::ok) {
            if let Some(address) = line.strip_prefix("DevTools listening on ") {
                let _ = sender.send(Ok(address.trim().to_owned()));
            } else {
                last = line;
            }
        }
        let _ = sender.send(Err(format!("the browser ended before it was ready; it said last: {last}")));
    });
    receiver
        .recv_timeout(PATIENCE)
        .unwrap_or_else(|_| Err(format!("the browser was not ready within {} s", PATIENCE.as_secs())))
}
