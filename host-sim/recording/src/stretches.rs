//! The parts of a recording without a gap: what scores, reports and exports are made of.

use super::messages::{Hello, Message, Probe, Samples, Setup};
use super::read::Recording;
use control_core::controller::Sample;
use device_sim::session::TaskDone;
use link::frames::Event;

/// Samples that follow one another without a gap, all in the same scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// The scale.
    pub hello: Hello,
    /// Tick of the first sample.
    pub first_tick: u64,
    /// 10 kHz.
    pub samples: Vec<Sample>,
    /// The events during these samples.
    pub events: Vec<Event>,
    /// The places of the ultrasound probe while the page showed its image.
    pub probes: Vec<Probe>,
    /// The tasks that were done, from the end of the stretch before.
    pub tasks: Vec<TaskDone>,
    /// The setup before them, if a new one was made; `None` for the recording's own.
    pub setup: Option<Setup>,
}

/// The stretches of a recording, in order.
pub fn stretches(recording: &Recording) -> Vec<Stretch> {
    let (mut all, mut hello): (Vec<Stretch>, Option<Hello>) = (Vec::new(), None);
    // An event is reported before the block of samples in which it happened.
    let mut told = Vec::new();
    let mut tasks = Vec::new();
    let mut setup: Option<&Setup> = None;
    for message in &recording.messages {
        match message {
            Message::Hello(new) => {
                hello = Some(new.clone());
                // Events that a device reported for samples that never came are dropped with those
                // samples.
                told.clear();
                tasks.clear();
            }
            Message::Event(event) => told.push(*event),
            Message::Setup(new) => setup = Some(new),
            Message::Probe(probe) => all.last_mut().into_iter().for_each(|last| last.probes.push(*probe)),
            Message::Task(task) => tasks.push(task.clone()),
            Message::Samples(block) => {
                let Some(hello) = &hello else { continue };
                extend(&mut all, (hello, setup), block, &mut told);
                take_tasks(&mut all, &mut tasks);
            }
            _ => {}
        }
    }
    all
}

fn extend(
    all: &mut Vec<Stretch>,
    (hello, setup): (&Hello, Option<&Setup>),
    block: &Samples,
    told: &mut Vec<Event>,
) {
    let follows = all.last().is_some_and(|last| {
        last.end_tick() == block.first_tick && same_scale(&last.hello, hello) && last.setup.as_ref() == setup
    });
    if !follows {
        all.push(Stretch {
            hello: hello.clone(),
            first_tick: block.first_tick,
            samples: Vec::new(),
            events: Vec::new(),
            setup: setup.cloned(),
            probes: Vec::new(),
            tasks: Vec::new(),
        });
    }
    if let Some(last) = all.last_mut() {
        last.samples.extend(block.rows().map(|row| row.1));
        let end = last.end_tick();
        let first = last.first_tick;
        last.events.extend(told.iter().filter(|e| (first..end).contains(&e.tick)));
        told.retain(|event| event.tick >= end);
    }
}

/// Gives the last stretch the tasks that were done until its end.
fn take_tasks(all: &mut [Stretch], tasks: &mut Vec<TaskDone>) {
    let Some(last) = all.last_mut() else { return };
    let end = last.end_tick();
    last.tasks.extend(tasks.extract_if(.., |task| task.tick < end));
}

impl Stretch {
    /// Tick after the last sample.
    pub fn end_tick(&self) -> u64 {
        self.first_tick + self.samples.len() as u64
    }
}

fn same_scale(a: &Hello, b: &Hello) -> bool {
    (a.mm_per_count, a.roller_radius_mm, a.full_scale_torque_mnm, a.dac_bits)
        == (b.mm_per_count, b.roller_radius_mm, b.full_scale_torque_mnm, b.dac_bits)
}
