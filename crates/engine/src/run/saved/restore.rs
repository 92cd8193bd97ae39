//! Checkpoint and restore of the recorder: reading recorded samples back for participants that continue from a cut.
//!
//! Samples that the tape does not have are buffered as long as they may be needed, and are saved in checkpoints. So a run that
//! leaves samples out of its tape can be resumed like any other.

use std::collections::BTreeMap;

use lockstep::plan::{Cut, InFlightSample, Plan, Position};
use lockstep::transport::Header;
use tape::{Event, EventKind};

use super::checkpoint::Checkpoint;
use super::history::History;
use super::off_tape::{OffTapeState, SampleBuffer};
use crate::assessment::Assessment;
use crate::run::outcome::RunFailure;
use crate::run::recording::faults;
use crate::run::recording::guard::SampleGuard;
use crate::run::recording::newest::NewestSamples;
use crate::run::recording::recorder::Recorder;
use crate::run::recording::store::no_samples;
use crate::run::recording::streams::streams;

/// Reads a sample back, by the number of its stream and its index.
type SampleReader<'a> = dyn Fn(u32, u64) -> Result<Vec<u8>, RunFailure> + 'a;

/// A run to continue from.
pub(crate) struct OriginRun<'a> {
    pub(crate) history: &'a History,
    pub(crate) checkpoint: &'a Checkpoint,
}

impl OriginRun<'_> {
    /// Where all participants continue, each with the state that it has.
    pub(crate) fn positions(&self, plan: &Plan) -> Result<Vec<Position>, RunFailure> {
        positions(plan, &self.checkpoint.cut, &|stream, index| {
            self.read(plan, stream, index)
        })
    }

    fn read(&self, plan: &Plan, stream: u32, index: u64) -> Result<Vec<u8>, RunFailure> {
        if let Some(payload) = self.history.payload(stream, index)? {
            return Ok(payload);
        }
        let off_tape = self.checkpoint.off_tape.as_ref();
        let payload = off_tape.and_then(|off_tape| off_tape.payload(stream as usize, index));
        payload
            .map(<[u8]>::to_vec)
            .ok_or_else(|| missing_sample_failure(plan, stream, index))
    }
}

fn positions(plan: &Plan, cut: &Cut, read: &SampleReader<'_>) -> Result<Vec<Position>, RunFailure> {
    let numbers = 0..plan.participants.len();
    numbers.map(|number| plan.position(cut, number, read)).collect()
}

/// The failure that a sample is needed and found nowhere.
fn missing_sample_failure(plan: &Plan, stream: u32, index: u64) -> RunFailure {
    let name = streams(plan)[stream as usize].name();
    RunFailure::Other(format!(
        "the run cannot be resumed: it needs sample #{index} of `{name}`, which is neither on the tape nor in the checkpoint: [record] \
         leaves it out, and it was not needed then; keep `{name}`, or change no delay, hold or fault that reaches further back"
    ))
}

impl Recorder {
    /// From now on, buffers the samples that the tape does not have, as long as they may be needed.
    pub(crate) fn enable_sample_buffer(&mut self) {
        if !self.tape_mapping.is_whole() && self.store.has_samples() {
            let all = streams(&self.plan).into_iter().enumerate();
            let size = |(stream, spec): (usize, tape::StreamSpec)| {
                (!self.tape_mapping.kept(stream).is_whole()).then_some(spec.descriptor.size as usize)
            };
            self.sample_buffer = Some(SampleBuffer::new(all.map(size)));
        }
    }

    /// A stream that an assessment without `save` reads and of which the tape leaves samples out.
    pub(crate) fn stream_without_save(&self) -> Option<String> {
        let assessment = self.assessment.as_ref()?;
        let mut all = 0..self.owners.len();
        let stream = all.find(|stream| !self.tape_mapping.kept(*stream).is_whole() && assessment.reads(*stream))?;
        assessment.save().is_none().then(|| self.name(stream))
    }

    /// Checks that the run can be saved and can go back.
    pub(crate) fn check_samples(&self) -> Result<(), RunFailure> {
        if !self.store.has_samples() {
            return Err(no_samples());
        }
        match self.stream_without_save() {
            None => Ok(()),
            Some(stream) => Err(RunFailure::Other(format!(
                "the run cannot be saved: its assessment has no `save`, and uses `{stream}`, of which [record] leaves samples out; keep it"
            ))),
        }
    }

    /// Calls `work` with a function that reads samples back: from the tape if it has them, else from the buffer.
    fn with_sample_reader<R>(
        &mut self,
        work: impl FnOnce(&Recorder, &SampleReader<'_>) -> Result<R, RunFailure>,
    ) -> Result<R, RunFailure> {
        let plan = self.plan.clone();
        let kept = self.store.take_samples(&plan, !self.tape_mapping.is_whole())?;
        let this = &*self;
        let done = work(this, &|stream, index| {
            if let Some(payload) = kept.payload(stream, index)? {
                return Ok(payload);
            }
            let payload = this
                .sample_buffer
                .as_ref()
                .and_then(|sample_buffer| sample_buffer.get(stream as usize, index));
            payload
                .map(<[u8]>::to_vec)
                .ok_or_else(|| missing_sample_failure(&plan, stream, index))
        });
        self.store.return_samples(kept);
        done
    }

    /// Where all participants continue at `cut`, each with the state that it has.
    pub fn positions(&mut self, cut: &Cut) -> Result<Vec<Position>, RunFailure> {
        self.with_sample_reader(|this, read| positions(&this.plan, cut, read))
    }

    /// For each stream the samples that are needed at `cut` and that the tape does not have.
    fn needed(&self, cut: &Cut, read: &SampleReader<'_>) -> Result<Vec<Vec<InFlightSample>>, RunFailure> {
        let needed = std::cell::RefCell::new(vec![BTreeMap::new(); self.owners.len()]);
        let read_and_note = |stream: u32, index: u64| {
            let payload = read(stream, index)?;
            if !self.tape_mapping.has(stream as usize, index) {
                needed.borrow_mut()[stream as usize].insert(index, payload.clone());
            }
            Ok(payload)
        };
        positions(&self.plan, cut, &read_and_note)?;
        // A program that drives the run may ask for the newest sample of any stream.
        for (stream, samples) in self.samples_before(cut).into_iter().enumerate() {
            if let Some(newest) = samples.checked_sub(1) {
                read_and_note(stream as u32, newest)?;
            }
        }
        let one = |samples: BTreeMap<u64, Vec<u8>>| {
            let all = samples.into_iter();
            all.map(|(index, payload)| InFlightSample { index, payload }).collect()
        };
        Ok(needed.into_inner().into_iter().map(one).collect())
    }

    /// The samples needed at `cut`, which all participants have reached or passed; drops all buffered samples that are no longer
    /// needed.
    fn drop_before(&mut self, cut: &Cut) -> Result<Vec<Vec<InFlightSample>>, RunFailure> {
        let samples = self.with_sample_reader(|this, read| this.needed(cut, read))?;
        let before = self.samples_before(cut);
        if let Some(sample_buffer) = &mut self.sample_buffer {
            sample_buffer.keep(&before, &samples);
        }
        Ok(samples)
    }

    /// Drops the samples that are no longer needed, if enough are buffered to make this worthwhile. Each participant has reached
    /// activation `next` or a later one.
    pub(crate) fn drop_unneeded(&mut self, next: impl Fn(&Recorder, usize) -> u64) -> Result<(), RunFailure> {
        if self.sample_buffer.as_ref().is_some_and(SampleBuffer::needs_cleanup) {
            let next = (0..self.plan.participants.len())
                .map(|number| next(self, number))
                .collect();
            self.drop_before(&Cut { next })?;
        }
        Ok(())
    }

    /// What a checkpoint at `cut` needs besides the states; `None` where the tape has every sample.
    pub(crate) fn off_tape_state(&mut self, cut: &Cut) -> Result<Option<OffTapeState>, RunFailure> {
        if self.sample_buffer.is_none() {
            return Ok(None);
        }
        Ok(Some(OffTapeState {
            samples: self.drop_before(cut)?,
            counts: self.tape_mapping.of_first(&self.samples_before(cut)),
            assessment: self.assessment.as_ref().and_then(|assessment| assessment.save()),
            guards: self.guards.iter().map(SampleGuard::saved).collect(),
        }))
    }

    /// Records what another run had recorded before its checkpoint.
    pub(crate) fn copy_origin(&mut self, origin: &OriginRun<'_>) -> Result<(), RunFailure> {
        let OriginRun { history, checkpoint } = origin;
        let (plan, samples) = (self.plan.clone(), self.samples_before(&checkpoint.cut));
        let off_tape = checkpoint.off_tape.as_ref();
        let counts = off_tape.map_or(&samples, |off_tape| &off_tape.counts);
        if counts.len() != samples.len() {
            let reason = "the run cannot be resumed: the checkpoint is one of other streams";
            return Err(RunFailure::Other(reason.into()));
        }
        let incomplete: Vec<bool> = counts.iter().zip(&samples).map(|(kept, all)| kept < all).collect();
        let mut kept_counts = vec![0; samples.len()];
        history.for_each_sample(&plan, counts, |participant, stream, header, payload| {
            let (stream, stamp_s) = (stream as usize, plan.timebase.seconds(header.stamp));
            if self.tape_mapping.has(stream, header.index) {
                self.check_next(stream, kept_counts[stream], header.index)?;
                kept_counts[stream] += 1;
            }
            self.tape_mapping
                .put(&mut self.store, stream, header.index, stamp_s, payload)?;
            self.reevaluate(participant, stream, header, payload, &incomplete)
        })?;
        for (stream, count) in kept_counts.into_iter().enumerate() {
            self.check_next(stream, count, samples[stream])?;
        }
        if self.sample_buffer.is_some() {
            let needed = self.needed(&checkpoint.cut, &|stream, index| origin.read(&plan, stream, index))?;
            self.set_buffer(&needed);
        }
        (self.recorded, self.published) = (samples.clone(), samples);
        self.restore_evaluators(off_tape, &incomplete)?;
        // Faults are reported again with the samples that reach their times. What takes place at the instant of the checkpoint
        // takes place again.
        let time = checkpoint.time;
        let is_copied = |event: &&Event| match event.kind {
            EventKind::Fault => false,
            EventKind::Substitution => event.time < time,
            _ => event.time <= time,
        };
        for event in history.events()?.iter().filter(is_copied) {
            self.event(event)?;
        }
        Ok(())
    }

    /// Checks that `put` is the number of samples that the tape gets of the first `index` samples of a stream.
    fn check_next(&self, stream: usize, put: u64, index: u64) -> Result<(), RunFailure> {
        if put == self.tape_mapping.kept(stream).of_first(index) {
            return Ok(());
        }
        Err(RunFailure::Other(format!(
            "the run cannot be resumed: [record] keeps more of `{}` now than the run before did, and its tape does not have that; keep no \
             more than it did",
            self.name(stream)
        )))
    }

    /// Prepares for going back: samples that are on the tape will come again, and must be the same.
    pub fn expect_repetition(&mut self) -> Result<(), RunFailure> {
        self.previous = self.store.tape(&self.plan, !self.tape_mapping.is_whole())?;
        Ok(())
    }

    /// Sets the buffer to `needed`: the samples after these come next.
    pub(crate) fn set_buffer(&mut self, needed: &[Vec<InFlightSample>]) {
        if let Some(sample_buffer) = &mut self.sample_buffer {
            sample_buffer.reset(needed);
        }
    }

    /// Goes back to `checkpoint` for a different continuation: all samples after it are discarded, and so are all events that do
    /// not follow from the samples, except the first `event_count` of them. `assessment` and `guards` are new.
    pub(crate) fn cut_back(
        &mut self,
        checkpoint: &Checkpoint,
        event_count: usize,
        assessment: Option<Box<dyn Assessment>>,
        guards: Vec<SampleGuard>,
    ) -> Result<(), RunFailure> {
        let plan = self.plan.clone();
        let mut events = self.store.events(&plan)?;
        events.truncate(event_count);
        let samples = self.samples_before(&checkpoint.cut);
        self.store.cut_back(&self.tape_mapping.on_tape(&samples))?;
        (self.assessment, self.guards, self.violation, self.previous) = (assessment, guards, None, None);
        (self.faults, self.newest, self.event_count) = (faults::events(&plan), i64::MIN, 0);
        self.latest.iter_mut().for_each(NewestSamples::clear);
        let counts = self.tape_mapping.of_first(&samples);
        let incomplete: Vec<bool> = counts.iter().zip(&samples).map(|(kept, all)| kept < all).collect();
        if let Some(off_tape) = &checkpoint.off_tape {
            self.set_buffer(&off_tape.samples);
        }
        // The figures, guards and faults are restored from the samples that were kept and from their saved state.
        let kept = self.store.take_samples(&plan, !self.tape_mapping.is_whole())?;
        let evaluated = kept.for_each_sample(&plan, &counts, |participant, stream, header, payload| {
            self.reevaluate(participant, stream as usize, header, payload, &incomplete)
        });
        self.store.return_samples(kept);
        evaluated?;
        self.continue_at(&checkpoint.cut);
        self.recorded.clone_from(&self.published);
        self.restore_evaluators(checkpoint.off_tape.as_ref(), &incomplete)?;
        self.violation = None;
        events.iter().try_for_each(|event| self.event(event))?;
        Ok(())
    }

    /// Evaluates a sample of the tape as when it was recorded, unless its stream is `incomplete`.
    fn reevaluate(
        &mut self,
        participant: usize,
        stream: usize,
        header: Header,
        payload: &[u8],
        incomplete: &[bool],
    ) -> Result<(), RunFailure> {
        if incomplete[stream] {
            return Ok(());
        }
        let stamp_s = self.plan.timebase.seconds(header.stamp);
        let evaluated = self.evaluate(participant, stream, header, stamp_s, payload);
        evaluated.map_err(|broken| match self.error.take() {
            Some(error) => error.into(),
            None => RunFailure::Other(format!("the tape to resume from: {broken}")),
        })
    }

    /// Restores what evaluates streams with missing samples to the state after all of their samples.
    fn restore_evaluators(&mut self, off_tape: Option<&OffTapeState>, incomplete: &[bool]) -> Result<(), RunFailure> {
        let Some(off_tape) = off_tape.filter(|_| incomplete.contains(&true)) else {
            return Ok(());
        };
        let cannot = |what: &str| RunFailure::Other(format!("the run cannot be resumed: {what}"));
        let incomplete_streams = (0..incomplete.len()).filter(|stream| incomplete[*stream]);
        if let Some(assessment) = &mut self.assessment
            && incomplete_streams.clone().any(|stream| assessment.reads(stream))
        {
            let saved = off_tape.assessment.as_deref().unwrap_or_default();
            let restored = assessment.restore(saved, incomplete);
            restored.map_err(|reason| cannot(&reason))?;
        }
        for guard in self.guards.iter_mut().filter(|guard| incomplete[guard.stream]) {
            if !guard.restore(&off_tape.guards) {
                let what = format!(
                    "{} is new or was changed, and uses a stream of which [record] leaves samples out",
                    guard.label()
                );
                return Err(cannot(&what));
            }
        }
        let mut newest = Vec::new();
        for stream in incomplete_streams.filter(|stream| self.published[*stream] > 0) {
            let (planned, index) = (&self.plan.participants[self.owners[stream]], self.published[stream] - 1);
            let stamp = planned.sample_time.instant(index);
            newest.push((stream, Header { index, stamp }));
        }
        if self.latest.is_some() {
            let payloads = self.with_sample_reader(|_, read| {
                let all = newest.iter().map(|(stream, header)| read(*stream as u32, header.index));
                all.collect::<Result<Vec<_>, _>>()
            })?;
            for ((stream, header), payload) in newest.iter().zip(payloads) {
                self.latest
                    .iter_mut()
                    .for_each(|latest| latest.put(*stream, *header, &payload));
            }
        }
        for (_, header) in newest {
            self.advance(header.stamp)
                .map_err(|broken| cannot(&broken.to_string()))?;
        }
        Ok(())
    }
}
