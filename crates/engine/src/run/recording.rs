//! From participants' samples to the tape and the figures of merit.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::plan::{Cut, Plan};
use lockstep::time::{Rational, Ticks};
use lockstep::transport::{Broken, Header, Recording};
use tape::{AppendError, Digest, Event, EventKind, StreamSpec, Writer};

use super::faults;
use super::guard::Watch;
use super::outcome::{Ending, RunFailure};
use super::played::{Played, difference};
use crate::assessment::{Assessment, Figures};

/// The streams of a run, in the order of their numbers.
pub fn streams(plan: &Plan) -> Vec<StreamSpec> {
    let mut streams = Vec::new();
    for participant in &plan.participants {
        for output in &participant.interface.outputs {
            let (name, descriptor) = (participant.name.clone(), output.descriptor.clone());
            streams.push(StreamSpec::new(
                name,
                output.name.clone(),
                descriptor,
                participant.offset,
                participant.period,
            ));
        }
    }
    for seen in &plan.seen {
        let participant = &plan.participants[seen.participant];
        let input = &participant.interface.inputs[seen.input];
        streams.push(StreamSpec::seen(
            participant.name.clone(),
            &input.name,
            input.descriptor.clone(),
            participant.offset,
            participant.period,
        ));
    }
    streams
}

/// Everything that is made of samples while they come.
pub struct Recorder {
    writer: Writer,
    assessment: Option<Box<dyn Assessment>>,
    plan: Plan,
    /// The participant that owns each stream.
    owners: Vec<usize>,
    /// What is still to be told of faults.
    faults: VecDeque<(Ticks, Event)>,
    /// The newest stamp of anybody, ticks.
    pub newest: i64,
    error: Option<AppendError>,
    watches: Vec<Watch>,
    /// The first sample that a guard did not let pass: whose, and what was wrong with it.
    lie: Option<(usize, String)>,
    /// What was recorded before everybody went back to a checkpoint, and is now recorded again.
    again: Option<Played>,
    /// How many samples each stream has where its producer stands: those on the tape, or fewer since everybody went back.
    reached: Vec<u64>,
}

impl Recorder {
    /// Records onto `writer`, which was made for the streams of `plan`, and looks at every sample with `watches`.
    pub fn new(plan: Plan, writer: Writer, assessment: Option<Box<dyn Assessment>>, watches: Vec<Watch>) -> Recorder {
        let outputs = plan.participants.iter().enumerate();
        let outputs = outputs.flat_map(|(number, own)| own.interface.outputs.iter().map(move |_| number));
        let owners: Vec<usize> = outputs.chain(plan.seen.iter().map(|seen| seen.participant)).collect();
        let reached = vec![0; owners.len()];
        Recorder {
            writer,
            assessment,
            watches,
            lie: None,
            faults: faults::events(&plan),
            plan,
            owners,
            newest: i64::MIN,
            error: None,
            again: None,
            reached,
        }
    }

    /// Records what another run had recorded before `cut`.
    pub fn copy(&mut self, played: &Played, cut: &Cut, time: Rational) -> Result<(), RunFailure> {
        let plan = self.plan.clone();
        played.each_before(&plan, cut, |participant, stream, header, payload| {
            let taken = self.sample(participant, stream, header, payload);
            taken.map_err(|broken| match self.error.take() {
                Some(error) => error.into(),
                None => RunFailure::Other(format!("the tape to go on from: {broken}")),
            })
        })?;
        // Faults are told again when the samples come that they are told with, and what takes place at the instant of the
        // checkpoint takes place again.
        let told = |event: &&Event| match event.kind {
            EventKind::Fault => false,
            EventKind::Substitution => event.time < time,
            _ => event.time <= time,
        };
        for event in played.events()?.iter().filter(told) {
            self.event(event)?;
        }
        Ok(())
    }

    /// The tape so far.
    pub fn played(&mut self) -> Result<Played, RunFailure> {
        self.writer.flush()?;
        Played::open(self.writer.dir(), &self.plan)
    }

    /// Everybody goes back: samples that are on the tape will come again, and must be what they were.
    pub fn expect_again(&mut self) -> Result<(), RunFailure> {
        self.again = Some(self.played()?);
        Ok(())
    }

    /// Everybody stands at `cut` from now on, whatever is on the tape.
    pub fn stand_at(&mut self, cut: &Cut) {
        for (stream, participant) in self.owners.iter().enumerate() {
            self.reached[stream] = self.plan.samples_before(*participant, cut.next[*participant]);
        }
    }

    /// The streams of the outputs of participant number `participant`.
    fn outputs(&self, participant: usize) -> std::ops::Range<usize> {
        let own = &self.plan.participants[participant];
        let first = own.first_stream as usize;
        first..first + own.interface.outputs.len()
    }

    /// How many activations of participant number `participant` have been recorded where it stands; `None` when that cannot be told
    /// from its samples, because it has no outputs or left an activation incomplete.
    pub fn activations(&self, participant: usize) -> Option<u64> {
        let mut counts = self.reached[self.outputs(participant)].iter();
        let samples = *counts.next()?;
        counts
            .all(|other| *other == samples)
            .then(|| self.plan.activations_of(participant, samples))
    }

    /// Whether the tape has samples of participant number `participant` that are still to come again, since everybody went back.
    pub fn is_ahead_of(&self, participant: usize) -> bool {
        let mut outputs = self.outputs(participant);
        outputs.any(|stream| {
            self.writer
                .count(stream)
                .is_some_and(|count| self.reached[stream] < count)
        })
    }

    fn same_again(again: &Played, stream: u32, header: Header, payload: &[u8]) -> Result<(), Broken> {
        let before = again
            .payload(stream, header.index)
            .map_err(|error| Broken(error.to_string()))?;
        if before == payload {
            return Ok(());
        }
        let spec = again.spec(stream);
        Err(Broken(format!(
            "is not deterministic, so it cannot be restarted: sample #{} of `{}` came again with {}",
            header.index,
            spec.name(),
            difference(&spec.descriptor, &before, payload)
        )))
    }

    /// Takes one sample that `participant` says it has published. The sample comes from another process: a wrong stream,
    /// index, stamp or size is that participant's fault and comes back as words.
    pub fn sample(&mut self, participant: usize, stream: u32, header: Header, payload: &[u8]) -> Result<(), Broken> {
        let number = stream as usize;
        if self.owners.get(number) != Some(&participant) {
            return Err(Broken(format!(
                "recorded a sample of stream {stream}, which is not its own"
            )));
        }
        let due = self.plan.participants[participant].sample_time.instant(header.index);
        if header.stamp != due {
            let (stamp, due) = (
                self.plan.timebase.seconds(header.stamp),
                self.plan.timebase.seconds(due),
            );
            return Err(Broken(format!(
                "recorded sample #{} stamped {stamp} s; its stamp must be {due} s",
                header.index
            )));
        }
        if let Some(again) = &self.again
            && header.index < again.count(number)
        {
            Self::same_again(again, stream, header, payload)?;
            self.reached[number] = self.reached[number].max(header.index + 1);
            return Ok(());
        }
        let stamp = self.plan.timebase.seconds(header.stamp);
        match self.writer.append(number, header.index, stamp, payload) {
            Ok(()) => {}
            Err(error @ (AppendError::Io { .. } | AppendError::DiskFull { .. })) => {
                let text = error.to_string();
                self.error = Some(error);
                return Err(Broken(text));
            }
            Err(error) => return Err(Broken(format!("recorded {error}"))),
        }
        self.reached[number] = header.index + 1;
        if let Some(assessment) = &mut self.assessment {
            assessment.sample(number, stamp, payload);
        }
        for watch in self.watches.iter_mut().filter(|watch| watch.stream == number) {
            if let Some(what) = watch.look(header.index, header.stamp, payload, self.plan.timebase)
                && self.lie.is_none()
            {
                let own = &self.plan.participants[participant];
                let output = &own.interface.outputs[number - own.first_stream as usize].name;
                self.lie = Some((participant, format!("gave out `{}.{output}` {what}", own.name)));
            }
        }
        if header.stamp > self.newest {
            self.newest = header.stamp;
            self.tell_of_faults()?;
        }
        Ok(())
    }

    /// Notes the faults that begin or end by now.
    fn tell_of_faults(&mut self) -> Result<(), Broken> {
        while self.faults.front().is_some_and(|(when, _)| *when <= self.newest) {
            let Some((_, event)) = self.faults.pop_front() else {
                break;
            };
            if let Err(error) = self.writer.event(&event) {
                let text = error.to_string();
                self.error = Some(error);
                return Err(Broken(text));
            }
        }
        Ok(())
    }

    /// The ending with the faults that were active when somebody failed: they may be the reason.
    pub fn with_active_faults(&self, ending: Ending) -> Ending {
        match ending {
            Ending::Failed { participant, reason } => Ending::Failed {
                participant,
                reason: reason + &faults::active(&self.plan, self.newest),
            },
            other => other,
        }
    }

    /// Notes an event.
    pub fn event(&mut self, event: &Event) -> Result<(), AppendError> {
        self.writer.event(event)
    }

    /// Puts what is buffered onto the disk.
    pub fn flush(&mut self) -> Result<(), AppendError> {
        self.writer.flush()
    }

    /// Whose sample a guard did not let pass, and why; told once. The sample is on the tape, and others may have seen it.
    pub fn take_lie(&mut self) -> Option<(usize, String)> {
        self.lie.take()
    }

    /// Another program gives the outputs of participant number `participant` from now on.
    pub fn renew(&mut self, participant: usize) {
        let own = self.owners.iter().map(|owner| *owner == participant);
        let own: Vec<bool> = own.collect();
        let watches = self.watches.iter_mut();
        watches.filter(|watch| own[watch.stream]).for_each(Watch::renew);
        // What the one before it gave while it was brought to its end is known well enough.
        self.lie = self.lie.take().filter(|(liar, _)| *liar != participant);
    }

    /// The failure of the tape itself, if there was one: not the fault of any participant.
    pub fn take_error(&mut self) -> Option<AppendError> {
        self.error.take()
    }

    /// Closes the tape.
    pub fn finish(self) -> Result<(Digest, Option<Figures>), AppendError> {
        let digest = self.writer.finish()?;
        Ok((digest, self.assessment.map(|mut assessment| assessment.finish())))
    }
}

/// One participant's way to the recorder in the same process.
pub struct Direct {
    /// The recorder that all share.
    pub recorder: Arc<Mutex<Recorder>>,
    /// The participant's number.
    pub participant: usize,
}

impl Recording for Direct {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        let mut recorder = self.recorder.lock().unwrap_or_else(PoisonError::into_inner);
        recorder
            .sample(self.participant, stream, header, payload)
            .map(|()| true)
    }
}
