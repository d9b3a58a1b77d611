//! The bytes that the page of a real board sends, and when: nothing that gives torque but after a
//! press in the guide of this very connection.

use board_wasm::session::Session;
use board_wasm::work::Task;
use device_sim::device::device_config::DeviceConfig;
use device_sim::named_files::Text;
use device_sim::page::guide::GuideAnswer;
use diagnosis::rig::Rig;
use lab::characterise::mechanism::Wiring;
use lab::characterise::{self, writer};
use lab::commission::bench::{Act, Line};
use lab::commission::mechanism::VirtualLine;
use link::Command;
use link::codec::Decoder;
use link::frames::HostFrame;
use serde_json::Value;
use std::path::Path;
use std::time::Duration;

/// One exchange of the virtual device.
const EXCHANGE: Duration = Duration::from_millis(1);
/// Steps of the guide of commissioning, with the one that asks for the needle.
const STEPS: usize = 6;
/// The act of a hand in each.
pub(crate) const ACTS: [Act; STEPS] =
    [Act::HandsOff, Act::Turn(5), Act::Pull(100.0), Act::Tilt(0.0), Act::Tilt(0.8), Act::HandsOff];
const TASK: Task = Task::Commission { turns: 5, pull_mm: 100.0, counts_per_turn: None };

/// A board that nobody has commissioned, with its motor's leads reversed.
pub(crate) fn uncommissioned() -> VirtualLine {
    let scale = characterise::scale(&characterise::configuration()).expect("the default scale");
    let wiring = Wiring { leads_reversed: true, ..Wiring::default() };
    VirtualLine::new(&writer::nominal_rig(&scale), "the nominal rig", wiring, scale.roller_radius_mm)
        .expect("the nominal rig is sound")
}

/// A page's connection to a virtual device, without a browser.
struct Cable {
    session: Session,
    line: VirtualLine,
    now: Duration,
    heard: Vec<u8>,
    decoder: Decoder,
    /// All commands since the connection began.
    commands: Vec<Command>,
}

impl Cable {
    fn new() -> Self {
        Self::to(uncommissioned())
    }

    fn to(line: VirtualLine) -> Self {
        Self {
            session: Session::default(),
            line,
            now: Duration::ZERO,
            heard: Vec::new(),
            decoder: Decoder::default(),
            commands: Vec::new(),
        }
    }

    fn run(&mut self, time: Duration) {
        self.run_until(time, |_| false);
    }

    fn run_until(&mut self, longest: Duration, is_so: impl Fn(&Self) -> bool) {
        let end = self.now + longest;
        while self.now < end && !is_so(self) {
            self.now += EXCHANGE;
            let out = self.session.exchange(self.now, &self.heard).to_vec();
            for byte in &out {
                if let Some(Ok(frame)) = self.decoder.push::<HostFrame>(*byte) {
                    self.commands.push(frame.command);
                }
            }
            self.heard.clear();
            self.line.exchange(&out, &mut self.heard).expect("the virtual device is there");
        }
    }

    fn messages(&self) -> Vec<Value> {
        let lines = self.session.tell(self.now);
        lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }

    fn message(&self, kind: &str) -> Value {
        self.messages().into_iter().find(|message| message["type"] == kind).unwrap_or_default()
    }

    /// The number of the step that is asked for.
    fn asked(&self) -> Option<usize> {
        let steps = self.message("guide")["steps"].as_array().cloned().unwrap_or_default();
        steps.iter().position(|step| step["stage"] == "asked").map(|place| place + 1)
    }

    fn begin(&mut self, step: usize) {
        self.run_until(Duration::from_secs(90), |cable| cable.asked() == Some(step));
        assert_eq!(self.asked(), Some(step), "{:?}", self.message("guide"));
        self.session.answer(GuideAnswer::Begin { step });
        self.line.act(ACTS[step - 1]);
    }

    /// Commands that may give torque, or change what a later one gives.
    fn strong(&self) -> Vec<&Command> {
        let is_mild = |command: &&Command| matches!(command, Command::Hello { .. } | Command::Stop);
        self.commands.iter().filter(|command| !is_mild(command)).collect()
    }

    /// True while an excitation plays.
    fn moves(&self) -> bool {
        self.message("board")["needle"]["state"] == "excitation"
    }

    fn gives_torque(&self) -> bool {
        self.commands
            .iter()
            .any(|command| matches!(command, Command::Start | Command::Excite(_) | Command::Play { .. }))
    }
}

#[test]
fn a_page_by_itself_says_hello_and_stop_only() {
    let mut cable = Cable::new();
    cable.run(Duration::from_secs(3));
    let board = cable.message("board");
    assert_eq!(board["live"], true, "{board}");
    assert!(board["needle"]["state"].is_string() && board["board"]["firmware"].is_string(), "{board}");
    // The board starts anew, or another one is plugged in.
    cable.line = uncommissioned();
    cable.run(Duration::from_secs(3));
    assert_eq!(cable.message("board")["live"], true);
    assert!(cable.strong().is_empty(), "{:?}", cable.strong());
    assert!(cable.commands.iter().filter(|command| matches!(command, Command::Hello { .. })).count() >= 2);
}

#[test]
fn commissioning_sends_torque_only_after_the_press_of_its_step() {
    let mut cable = Cable::new();
    cable.run(Duration::from_millis(200));
    cable.session.begin(TASK).expect("its numbers are sound");
    cable.run(Duration::from_secs(2));
    assert!(cable.strong().is_empty(), "before the first press: {:?}", cable.strong());
    for step in 1..STEPS {
        cable.begin(step);
    }
    cable.run_until(Duration::from_secs(90), |cable| cable.asked() == Some(STEPS));
    cable.run(Duration::from_secs(2));
    assert!(!cable.gives_torque(), "before the last press");
    assert_eq!(cable.message("guide")["steps"][STEPS - 1]["moves"], true);
    // A second press on a step before, or on one that is not there, begins nothing.
    for step in [1, STEPS - 1, STEPS + 1] {
        cable.session.answer(GuideAnswer::Begin { step });
    }
    cable.run(Duration::from_secs(1));
    assert!(!cable.gives_torque());
    cable.begin(STEPS);
    cable.run_until(Duration::from_secs(30), |cable| !cable.message("guide")["end"].is_null());
    let end = &cable.message("guide")["end"];
    assert_eq!(end["well"], true, "{end}");
    assert!(end["lines"].to_string().contains("4000 counts a turn"), "{end}");
    assert!(end["lines"].to_string().contains("leads reversed"), "{end}");
    let file = cable.session.file().expect("it ended well").to_owned();
    let text = Text { origin: "device.toml".into(), text: file };
    assert!(DeviceConfig::parse(text).expect("it is read again").device.commissioned);
    cable.run(EXCHANGE * 5);
    assert!(matches!(cable.commands.last(), Some(Command::Stop)), "{:?}", cable.commands.last());
}

fn fixture(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name);
    std::fs::read_to_string(path).expect("a fixture")
}

/// Force on a hand in a line such as `all before=102.8 after=13.4 mN rms`.
fn felt(lines: &Value, when: &str) -> f64 {
    let all = lines.as_array().expect("lines").iter().filter_map(Value::as_str);
    let line = all.into_iter().find(|line| line.starts_with("all ")).expect("the sum of all phases");
    let number = line.split(' ').find_map(|word| word.strip_prefix(when)?.strip_prefix('='));
    number.expect("a number").parse().expect("a number")
}

#[test]
fn compensation_leaves_a_quarter_and_waits_for_each_press() {
    let hidden = Rig::parse(&fixture("hidden.toml"), "hidden.toml").expect("a rig");
    let mut cable = Cable::to(VirtualLine::commissioned(&hidden, "hidden.toml", 10.0).expect("a device"));
    cable.run(Duration::from_millis(200));
    let task = Task::Compensate { rig: fixture("hidden-found.toml"), share: 1.0 };
    cable.session.begin(task).expect("its numbers are sound");
    let mut pressed = 0;
    let end = loop {
        cable.run_until(Duration::from_secs(180), |cable| {
            cable.asked().is_some() || !cable.message("guide")["end"].is_null()
        });
        let guide = cable.message("guide");
        if !guide["end"].is_null() {
            break guide["end"].clone();
        }
        let step = cable.asked().expect("it asks, or it ends");
        let text = guide["steps"][step - 1]["text"].as_str().unwrap_or_default().to_owned();
        // Nothing moves while nobody presses.
        cable.commands.clear();
        cable.run(Duration::from_secs(1));
        assert!(!cable.gives_torque(), "before the press of: {text}");
        cable.session.answer(GuideAnswer::Begin { step });
        if text.contains("point the device down") {
            cable.line.act(Act::Tilt(0.5));
        }
        cable.run_until(Duration::from_secs(5), |cable| cable.asked() != Some(step));
        pressed += 1;
    };
    assert_eq!(end["well"], true, "{end}");
    assert!(pressed >= 3, "each step has its press: {pressed}");
    let (before, after) = (felt(&end["lines"], "before"), felt(&end["lines"], "after"));
    assert!(before > 80.0 && after <= before / 4.0, "{after} after {before} mN");
}

#[test]
fn a_restart_or_a_new_connection_forgets_the_guide() {
    for is_new_connection in [false, true] {
        let mut cable = Cable::new();
        cable.session.begin(TASK).expect("sound");
        for step in 1..=STEPS {
            cable.begin(step);
        }
        cable.run_until(Duration::from_secs(5), Cable::gives_torque);
        assert!(cable.gives_torque(), "the pulses have begun");
        cable.line = uncommissioned();
        cable.heard.clear();
        if is_new_connection {
            (cable.session, cable.decoder) = (Session::default(), Decoder::default());
        }
        cable.commands.clear();
        cable.run(Duration::from_secs(8));
        assert!(!cable.gives_torque(), "{:?}", cable.commands);
        let guide = cable.message("guide");
        if is_new_connection {
            assert!(guide.is_null(), "{guide}");
        } else {
            assert_eq!(guide["end"]["well"], false, "{guide}");
        }
    }
}

#[test]
fn a_guide_that_is_left_sends_a_stop() {
    let mut cable = Cable::new();
    cable.session.begin(TASK).expect("sound");
    for step in 1..=STEPS {
        cable.begin(step);
    }
    cable.run_until(Duration::from_secs(5), Cable::gives_torque);
    cable.commands.clear();
    cable.session.answer(GuideAnswer::Leave);
    cable.run(Duration::from_millis(100));
    assert!(cable.commands.contains(&Command::Stop) && !cable.gives_torque(), "{:?}", cable.commands);
}

/// The page's own message, as it is in `board.js`.
fn weighing(correct: bool) -> Task {
    let message = serde_json::json!({ "do": "weigh", "grams": 100, "correct": correct });
    serde_json::from_value(message).expect("a task")
}

/// A commissioned device whose motor gives `gain` times what it is asked for.
fn weighed(gain: f64, wiring: Wiring) -> Cable {
    let scale = characterise::scale(&characterise::configuration()).expect("the default scale");
    let mut rig = writer::nominal_rig(&scale);
    rig.actuator.gain *= gain;
    // The 30 g and 0.06 N of its record: what commissioning finds with the wrong torque.
    (rig.model.inertia, rig.model.coulomb) = (3e-6 * gain, Some(6e-4 * gain));
    let line = VirtualLine::commissioned(&rig, "the nominal rig", 10.0).expect("a device");
    Cable::to(line.wired(wiring))
}

#[test]
fn weighing_waits_for_each_press_and_corrects_a_newton() {
    let mut cable = weighed(0.5, Wiring::default());
    cable.run(Duration::from_millis(200));
    cable.session.begin(weighing(true)).expect("its numbers are sound");
    let acts = [Act::Tilt(std::f64::consts::FRAC_PI_2), Act::Hang(100.0), Act::HandsOff];
    for (step, act) in (1..).zip(acts) {
        cable.run_until(Duration::from_secs(90), |cable| cable.asked() == Some(step));
        let guide = cable.message("guide");
        assert_eq!(guide["steps"][step - 1]["moves"], true, "{guide}");
        cable.commands.clear();
        cable.run(Duration::from_secs(1));
        assert!(!cable.gives_torque(), "before the press of step {step}");
        cable.session.answer(GuideAnswer::Begin { step });
        cable.line.act(act);
        // The pad takes the weight as soon as nothing moves it any more.
        cable.run_until(Duration::from_secs(10), |cable| cable.moves());
        cable.run_until(Duration::from_secs(30), |cable| !cable.moves());
        cable.line.act(Act::Hang(0.0));
    }
    cable.run_until(Duration::from_secs(30), |cable| !cable.message("guide")["end"].is_null());
    let end = &cable.message("guide")["end"];
    assert_eq!(end["well"], true, "{end}");
    let text = Text { origin: "device.toml".into(), text: cable.session.file().expect("a file").to_owned() };
    let found = DeviceConfig::parse(text).expect("it is read again").device;
    let full_scale = found.full_scale_torque.0.to_num::<f64>();
    let within = f64::from(found.torque_uncertainty) * 1e-3;
    assert!((full_scale / 14.4 - 1.0).abs() <= within && within < 0.1, "{full_scale} mN·m, {within}");
}

/// Motor leads that were swapped after commissioning: the needle runs away, and the fault stays
/// until a person clears it.
#[test]
fn a_fault_is_cleared_by_a_press_and_by_nothing_else() {
    let mut cable = weighed(1.0, Wiring { leads_reversed: true, ..Wiring::default() });
    cable.run(Duration::from_millis(200));
    cable.session.begin(weighing(false)).expect("its numbers are sound");
    cable.run_until(Duration::from_secs(5), |cable| cable.asked() == Some(1));
    cable.session.answer(GuideAnswer::Begin { step: 1 });
    cable.line.act(Act::Tilt(std::f64::consts::FRAC_PI_2));
    cable.run_until(Duration::from_secs(30), |cable| !cable.message("guide")["end"].is_null());
    assert_eq!(cable.message("guide")["end"]["well"], false);
    cable.session.answer(GuideAnswer::Leave);
    cable.commands.clear();
    cable.run(Duration::from_secs(3));
    assert!(cable.strong().is_empty(), "{:?}", cable.strong());
    assert!(cable.message("board")["fault"].is_string(), "{}", cable.message("board"));
    cable.session.clear();
    cable.run(Duration::from_millis(100));
    assert_eq!(cable.strong(), [&Command::Clear], "and no torque");
    let stop = cable.commands.iter().position(|command| *command == Command::Stop);
    let clear = cable.commands.iter().position(|command| *command == Command::Clear);
    assert!(stop.is_some() && stop < clear, "it is taken after a stop only: {:?}", cable.commands);
    assert!(cable.message("board")["fault"].is_null(), "{}", cable.message("board"));
}

#[test]
fn a_stop_is_always_there_and_ends_an_open_guide() {
    let mut cable = Cable::new();
    cable.session.stop();
    cable.run(EXCHANGE * 2);
    assert!(cable.commands.contains(&Command::Stop), "without a guide: {:?}", cable.commands);
    cable.session.begin(TASK).expect("sound");
    for step in 1..=STEPS {
        cable.begin(step);
    }
    cable.run_until(Duration::from_secs(5), Cable::gives_torque);
    cable.run(Duration::from_millis(50));
    cable.commands.clear();
    cable.session.stop();
    cable.run(EXCHANGE);
    assert!(cable.commands.contains(&Command::Stop), "with the next bytes: {:?}", cable.commands);
    cable.run(Duration::from_secs(3));
    assert!(!cable.gives_torque(), "{:?}", cable.commands);
    assert_eq!(cable.message("guide")["end"]["well"], false, "{}", cable.message("guide"));
    assert_eq!(cable.message("board")["needle"]["state"], "idle", "{}", cable.message("board"));
}

#[test]
fn numbers_that_make_no_sense_are_refused() {
    for wrong in [
        Task::Commission { turns: 0, pull_mm: 100.0, counts_per_turn: None },
        Task::Commission { turns: 5, pull_mm: f64::NAN, counts_per_turn: None },
        Task::Commission { turns: 5, pull_mm: 100.0, counts_per_turn: Some(3) },
        Task::Weigh { grams: 0.0, correct: true },
        Task::Compensate { rig: "nonsense".into(), share: 1.0 },
    ] {
        let why = Session::default().begin(wrong.clone()).expect_err("it is refused").to_string();
        assert!(!why.is_empty() && !why.contains('\n'), "{wrong:?}: {why}");
    }
}
