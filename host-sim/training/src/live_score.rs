//! A trainee's insertions while they happen, judged by the same code as a recording: the samples of
//! an insertion are kept until the needle has left the skin, and then scored as `host-sim score`
//! scores them.

use crate::score::{Insertion, Judge, Span};
use crate::verdict::{self, Verdict};
use control_core::TICK_HZ;
use control_core::controller::Sample;
use device_sim::procedure::purpose::Purpose;
use device_sim::profile::Profile;
use device_sim::session::Batch;
use link::frames::EventKind;
use recording::messages::Hello;
use recording::stretches::Stretch;

/// Samples kept while the needle is outside: an event may be reported a moment before or after its
/// samples. 0.5 s.
const OUTSIDE: usize = TICK_HZ as usize / 2;
/// An insertion that takes longer than five minutes is left to the recording.
const LONGEST: usize = 300 * TICK_HZ as usize;
/// Tasks kept of an insertion and of the time before it; a page may report any number.
const MOST_TASKS: usize = 1_000;

/// The insertion in progress.
#[derive(Debug, Default)]
pub struct LiveScore {
    judge: Option<Judge>,
    stretch: Option<Stretch>,
    /// Tick of the first sample ever: begins are counted from it, as in a recording.
    zero_tick: Option<u64>,
}

impl LiveScore {
    /// Insertions from now on are into `profile`, for this purpose; one in progress is dropped.
    pub fn patient(&mut self, profile: &Profile, purpose: Option<Purpose>) {
        self.judge = Some(Judge::new(profile, purpose, 0));
        if let Some(stretch) = &mut self.stretch {
            stretch.tasks.clear();
            let end = stretch.end_tick();
            begin_at(stretch, end);
        }
    }

    /// Takes what has arrived and shows each insertion that has ended with it to `see`, with its
    /// figures.
    pub(crate) fn take_each(&mut self, batch: &Batch, see: impl FnMut(&Judge, Span<'_>, Insertion)) {
        if let Some(hello) = &batch.hello {
            let hello = Hello::from(hello);
            let (samples, events) = (Vec::new(), Vec::new());
            let (probes, tasks) = (Vec::new(), Vec::new());
            self.stretch =
                Some(Stretch { hello, first_tick: 0, samples, events, probes, tasks, setup: None });
        }
        let Some(stretch) = &mut self.stretch else { return };
        for (tick, sample) in &batch.samples {
            let zero_tick = *self.zero_tick.get_or_insert(*tick);
            self.judge.iter_mut().for_each(|judge| judge.count_from(zero_tick));
            append(stretch, *tick, *sample);
        }
        let first = stretch.first_tick;
        stretch.events.extend(batch.events.iter().map(|h| h.event).filter(|event| event.tick >= first));
        stretch.tasks.extend(batch.tasks.iter().cloned());
        let excess = stretch.tasks.len().saturating_sub(MOST_TASKS);
        stretch.tasks.drain(..excess);
        self.ended(see);
    }

    /// Shows the insertions whose samples are all here; they are forgotten.
    fn ended(&mut self, mut see: impl FnMut(&Judge, Span<'_>, Insertion)) {
        let (Some(stretch), Some(judge)) = (&mut self.stretch, &self.judge) else { return };
        let end = stretch.end_tick();
        let mut left = None;
        for (span, has_ended) in judge.spans(stretch) {
            if has_ended && span.end < end {
                see(judge, span, judge.insertion(span));
                left = Some(span.end);
            }
        }
        let Some(left) = left else {
            if !stretch.events.iter().any(|event| matches!(event.kind, EventKind::Contact { layer: 0 })) {
                let first = end.saturating_sub(OUTSIDE as u64).max(stretch.first_tick);
                begin_at(stretch, first);
            }
            return;
        };
        begin_at(stretch, left + 1);
        // Tasks that were done before this insertion ended do not count for the next one.
        stretch.tasks.retain(|task| task.tick > left);
    }

    /// Returns the goal with nothing done, before a device has said anything.
    pub(crate) fn to_come(&self) -> Option<Verdict> {
        self.judge.as_ref().map(|judge| verdict::open(judge.aim()))
    }

    /// True if an insertion has begun and not ended.
    pub(crate) fn is_going_on(&self) -> bool {
        let (Some(stretch), Some(judge)) = (&self.stretch, &self.judge) else { return false };
        judge.spans(stretch).pop().is_some_and(|(_, has_ended)| !has_ended)
    }

    /// Returns the verdict so far on the attempt that is going on, or is to come.
    pub(crate) fn so_far(&self) -> Option<Verdict> {
        let (stretch, judge) = (self.stretch.as_ref()?, self.judge.as_ref()?);
        let now = stretch.end_tick();
        let begun = judge.spans(stretch).pop().map(|(span, _)| span);
        Some(judge.verdict(begun.unwrap_or(Span { stretch, begin: now, end: now })))
    }
}

/// Adds a sample. After a gap the insertion begins anew: one with a hole in it has no score, as in
/// a recording.
fn append(stretch: &mut Stretch, tick: u64, sample: Sample) {
    if stretch.end_tick() != tick || stretch.samples.len() >= LONGEST {
        stretch.samples.clear();
        stretch.events.retain(|event| event.tick >= tick);
        stretch.first_tick = tick;
    }
    stretch.samples.push(sample);
}

/// Forgets what was before `tick`, which is in the stretch or at its end.
fn begin_at(stretch: &mut Stretch, tick: u64) {
    let gone = (tick - stretch.first_tick) as usize;
    stretch.samples.drain(..gone.min(stretch.samples.len()));
    stretch.first_tick = tick;
    stretch.events.retain(|event| event.tick >= tick);
}
