//! Chromium as a process of our own: a fresh profile, no screen, nothing in the background. The
//! tests that run at one time in one program share it, each with windows, storage and cache of its
//! own; it ends with the last of them.

use super::Error;
use super::devtools::DevTools;
use serde_json::json;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError, Weak, mpsc};
use std::time::{Duration, Instant};

/// The paths on Debian and Ubuntu.
const PROGRAMS: &[&str] = &["/usr/bin/chromium", "/usr/bin/chromium-browser"];
/// A first start with a fresh profile on a busy machine.
const START_TIMEOUT: Duration = Duration::from_secs(60);
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

/// The process that tests share while one of them needs it.
static SHARED: Mutex<Weak<Process>> = Mutex::new(Weak::new());

/// A running browser as a test has it: a profile of its own in a process that others may use, too.
pub struct Chromium {
    /// Its profile lasts as long as this connection.
    _keeps_profile: DevTools,
    profile: String,
    process: Arc<Process>,
}

impl Chromium {
    /// Returns a fresh profile, without WebGPU, in the process that other tests use, or in one with
    /// its files below `scratch` where none runs.
    ///
    /// # Errors
    ///
    /// If there is no browser, or it does not start.
    pub fn start(scratch: &Path) -> Result<Self, Error> {
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        let process = match shared.upgrade() {
            Some(process) => process,
            None => Arc::new(Process::start(scratch, WEBGL)?),
        };
        *shared = Arc::downgrade(&process);
        Self::of(process)
    }

    /// The same in a process that no other test uses: its processor time is that of this test.
    ///
    /// # Errors
    ///
    /// As for [`Chromium::start`].
    pub fn start_alone(scratch: &Path) -> Result<Self, Error> {
        Self::of(Arc::new(Process::start(scratch, WEBGL)?))
    }

    /// The same with WebGPU computed by the processor.
    ///
    /// # Errors
    ///
    /// As for [`Chromium::start`].
    pub fn start_with_webgpu(scratch: &Path) -> Result<Self, Error> {
        Self::of(Arc::new(Process::start(scratch, WEBGPU)?))
    }

    fn of(process: Arc<Process>) -> Result<Self, Error> {
        let mut devtools = DevTools::connect(&process.address)?;
        let made = devtools.call("Target.createBrowserContext", json!({ "disposeOnDetach": true }))?;
        let profile = made["browserContextId"].as_str().ok_or("no id of a profile")?.to_owned();
        Ok(Self { _keeps_profile: devtools, profile, process })
    }

    /// The process that was started; the others are its children and theirs.
    pub(super) fn id(&self) -> u32 {
        self.process.child.id()
    }

    /// A new connection, to a new tab.
    pub(super) fn tab(&self) -> Result<DevTools, Error> {
        let mut devtools = DevTools::connect(&self.process.address)?;
        devtools.open_tab(&self.profile)?;
        Ok(devtools)
    }
}

/// A browser's process; dropped, it is ended and its files deleted.
struct Process {
    child: Child,
    files: PathBuf,
    address: String,
}

impl Process {
    fn start(scratch: &Path, graphics: &[&str]) -> Result<Self, Error> {
        let program = PROGRAMS.iter().find(|path| Path::new(path).exists()).ok_or_else(|| {
            format!("no browser at {}: run `cargo xtask test`, which installs Chromium", PROGRAMS[0])
        })?;
        let files = scratch.join(format!("chromium-{}", std::process::id()));
        fs::create_dir_all(&files).map_err(|e| format!("cannot create {}: {e}", files.display()))?;
        let mut child = Command::new(program)
            .args(graphics)
            .args(ARGUMENTS)
            .arg(format!("--user-data-dir={}", files.display()))
            // It keeps some of its state outside the profile otherwise.
            .env("HOME", &files)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| format!("cannot start {program}: {e}"))?;
        let address = announced(&mut child);
        let mut process = Self { child, files, address: String::new() };
        process.address = address?;
        Ok(process)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if let Ok(mut devtools) = DevTools::connect(&self.address) {
            let _ = devtools.call("Browser.close", json!({}));
        }
        let begin = Instant::now();
        while begin.elapsed() < CLOSE_TIMEOUT && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = fs::remove_dir_all(&self.files);
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
        .recv_timeout(START_TIMEOUT)
        .unwrap_or_else(|_| Err(format!("the browser was not ready within {} s", START_TIMEOUT.as_secs())))
}
