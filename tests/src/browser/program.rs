//! The program under test: found next to the test, started, asked where its page is, and ended.

use super::{Error, PATIENCE};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// The locations of programs and pages, relative to the test itself:
/// `target/release/deps/browser-…`.
pub struct Places {
    /// The target folder.
    pub target: PathBuf,
    /// `host-sim` of the same build.
    pub program: PathBuf,
}

impl Places {
    /// Looks for them; the error says what to run where the program is not there.
    pub fn find() -> Result<Self, Error> {
        let own = std::env::current_exe().map_err(|e| e.to_string())?;
        let profile = own.ancestors().nth(2).ok_or("the test is not in a target folder")?;
        let program = profile.join(format!("host-sim{}", std::env::consts::EXE_SUFFIX));
        if !program.exists() {
            let at = program.display();
            return Err(format!("no program at {at}: run `cargo xtask test`, which builds it first"));
        }
        let target = profile.parent().unwrap_or(profile).to_owned();
        Ok(Self { target, program })
    }

    /// An empty folder of one's own for pictures and recordings.
    pub fn scratch(&self, name: &str) -> Result<PathBuf, Error> {
        let scratch = self.target.join(name);
        if scratch.exists() {
            std::fs::remove_dir_all(&scratch)
                .map_err(|e| format!("cannot remove {}: {e}", scratch.display()))?;
        }
        std::fs::create_dir_all(&scratch).map_err(|e| format!("cannot create {}: {e}", scratch.display()))?;
        Ok(scratch)
    }
}

/// A running program; dropped, it is ended.
pub struct Program {
    process: Child,
    /// The address of its page.
    pub url: String,
}

impl Program {
    /// A virtual device with its page at `port` (0: any free one), recorded where that is wanted.
    /// The scripted hand does a venepuncture, 6 s a round.
    pub fn start(path: &Path, port: u16, record: Option<&Path>) -> Result<Self, Error> {
        let port = port.to_string();
        let record =
            record.map(|file| file.to_str().ok_or("the target folder has a plain name")).transpose()?;
        let mut arguments = vec!["run", "--port", &port, "--procedure", "venepuncture"];
        arguments.extend(record.into_iter().flat_map(|file| ["--record", file]));
        Self::start_with(path, &arguments)
    }

    /// Starts it and reads the address that it prints.
    pub fn start_with(path: &Path, arguments: &[&str]) -> Result<Self, Error> {
        Self::start_in(path, Path::new("."), arguments)
    }

    /// The same in another folder.
    pub fn start_in(path: &Path, folder: &Path, arguments: &[&str]) -> Result<Self, Error> {
        let mut command = Command::new(path);
        command.args(arguments).current_dir(folder);
        let spawned = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
        let mut process = spawned.map_err(|e| format!("cannot start {}: {e}", path.display()))?;
        let stdout = BufReader::new(process.stdout.take().ok_or("no standard output")?);
        let mut program = Self { process, url: String::new() };
        let (sender, receiver) = mpsc::channel();
        // Reads on after the address: the program may say more, and must not meet a closed pipe.
        std::thread::spawn(move || {
            for line in stdout.lines().map_while(Result::ok) {
                let address = line.find("http://").and_then(|at| line[at..].split_whitespace().next());
                let _ = address.map(|address| sender.send(address.to_owned()));
            }
        });
        program.url = receiver.recv_timeout(PATIENCE).map_err(|_| "the program printed no address")?;
        Ok(program)
    }

    /// The port of its page.
    pub fn port(&self) -> Result<u16, Error> {
        let port = self.url.trim_end_matches('/').rsplit(':').next().and_then(|port| port.parse().ok());
        port.ok_or_else(|| format!("no port in {}", self.url))
    }

    /// Waits until it has ended by itself, without a failure.
    pub fn ended(&mut self) -> Result<(), Error> {
        let begin = Instant::now();
        loop {
            match self.process.try_wait() {
                Ok(Some(status)) if status.success() => return Ok(()),
                Ok(Some(status)) => return Err(format!("the program failed ({status})")),
                Ok(None) if begin.elapsed() > PATIENCE => {
                    return Err(format!("the program goes on after {} s", PATIENCE.as_secs()));
                }
                Ok(None) => std::thread::sleep(Duration::from_millis(20)),
                Err(error) => return Err(format!("the program was lost: {error}")),
            }
        }
    }

    /// Ends it as a crash would.
    pub fn end(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.end();
    }
}
