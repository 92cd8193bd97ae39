//! The recorder: from participants' samples to the tape and the figures of merit.

use std::collections::VecDeque;
use std::sync::Arc;

use lockstep::participant::Payload;
use lockstep::plan::{Cut, Plan};
use lockstep::time::Ticks;
use lockstep::transport::{Header, TransportError};
use tape::{AppendError, Digest, Event, EventKind};

use super::faults;
use super::guard::SampleGuard;
use super::newest::NewestSamples;
use super::store::Store;
use super::streams::streams;
use super::tape_mapping::TapeMapping;
use crate::assessment::{Assessment, Figures};
use crate::run::outcome::Ending;
use crate::run::saved::history::{History, difference};
use crate::run::saved::off_tape::SampleBuffer;

/// The number of samples of stream number `stream` when the next activation of its owner is `next`.
pub(crate) fn samples(plan: &Plan, stream: usize, owner: usize, next: u64) -> u64 {
    let outputs = plan.participants.iter().map(|planned| planned.interface.outputs.len());
    if stream < outputs.sum() {
        plan.samples_before(owner, next)
    } else {
        // A disturbed input gives one sample per activation.
        next
    }
}

/// Everything that is derived from samples as they arrive.
pub struct Recorder {
    pub(crate) store: Store,
    /// Which samples are recorded.
    pub(crate) tape_mapping: TapeMapping,
    pub(crate) assessment: Option<Box<dyn Assessment>>,
    /// The streams that the assessment reads.
    assessed: Vec<bool>,
    pub(crate) plan: Arc<Plan>,
    /// The participant that owns each stream.
    pub(crate) owners: Vec<usize>,
    /// The events of faults that are still to be recorded.
    pub(crate) faults: VecDeque<(Ticks, Event)>,
    /// The newest stamp of any sample, ticks.
    pub newest: i64,
    pub(crate) error: Option<AppendError>,
    pub(crate) guards: Vec<SampleGuard>,
    /// The newest sample of each stream, if a program may ask for it.
    pub(crate) latest: Option<NewestSamples>,
    /// How many events that do not follow from the samples have been recorded.
    pub(crate) event_count: usize,
    /// The first sample that a guard rejected: its participant, and the reason.
    pub(crate) violation: Option<(usize, String)>,
    /// The participants whose guard violations were reported, until another program provides their outputs.
    offenders: Vec<usize>,
    /// The samples that were recorded before the run went back to a checkpoint, and are now recorded again.
    pub(crate) previous: Option<History>,
    /// The buffered samples of streams of which the tape leaves samples out, if the run may be resumed.
    pub(crate) sample_buffer: Option<SampleBuffer>,
    /// How many samples of each stream its producer has published at its present position: those that have come, or fewer since the
    /// run went back.
    pub(crate) published: Vec<u64>,
    /// How many samples of each stream have come.
    pub(crate) recorded: Vec<u64>,
    /// The number of samples of each stream that precede the first activation.
    initial_samples: Vec<u64>,
    /// The activation at which each participant started in the present domain.
    pub(crate) base_activations: Vec<u64>,
    /// The granted time (horizon), ticks: no activation at or past it may happen yet.
    pub(crate) granted: Ticks,
}

impl Recorder {
    /// Records into `store` the samples that `tape_mapping` selects from the streams of `plan`, and checks every sample with `guards`.
    pub(crate) fn new(
        plan: Arc<Plan>,
        store: Store,
        tape_mapping: TapeMapping,
        assessment: Option<Box<dyn Assessment>>,
        guards: Vec<SampleGuard>,
    ) -> Recorder {
        let outputs = plan.participants.iter().enumerate();
        let outputs = outputs.flat_map(|(number, planned)| planned.interface.outputs.iter().map(move |_| number));
        let owners: Vec<usize> = outputs.chain(plan.seen.iter().map(|seen| seen.participant)).collect();
        let published = vec![0; owners.len()];
        let initial_samples = owners.iter().enumerate();
        let initial_samples = initial_samples
            .map(|(stream, &owner)| samples(&plan, stream, owner, 0))
            .collect();
        let reads = |stream| assessment.as_ref().is_some_and(|assessment| assessment.reads(stream));
        Recorder {
            assessed: (0..owners.len()).map(reads).collect(),
            store,
            tape_mapping,
            assessment,
            guards,
            latest: None,
            event_count: 0,
            initial_samples,
            violation: None,
            offenders: Vec::new(),
            faults: faults::events(&plan),
            base_activations: vec![0; plan.participants.len()],
            granted: Ticks::MAX,
            plan,
            owners,
            newest: i64::MIN,
            error: None,
            previous: None,
            sample_buffer: None,
            recorded: published.clone(),
            published,
        }
    }

    /// Grants time up to `horizon`: samples of activations at or past it are refused.
    pub fn grant(&mut self, horizon: Ticks) {
        self.granted = horizon;
    }

    /// All participants continue at `cut`: the samples after it come next.
    pub fn continue_at(&mut self, cut: &Cut) {
        self.base_activations.clone_from(&cut.next);
        self.published = self.samples_before(cut);
    }

    /// How many samples each stream has at `cut`.
    pub(crate) fn samples_before(&self, cut: &Cut) -> Vec<u64> {
        let owned = self.owners.iter().enumerate();
        let counts = owned.map(|(stream, &owner)| samples(&self.plan, stream, owner, cut.next[owner]));
        counts.collect()
    }

    /// The next activation of each participant, paused at `now`. A substitute of a failed participant may be further ahead.
    pub fn cut_at(&self, now: Ticks) -> Cut {
        let mut cut = self.plan.cut_at(now);
        for (next, base) in cut.next.iter_mut().zip(&self.base_activations) {
            *next = (*next).max(*base);
        }
        cut
    }

    /// The activation at which participant number `participant` started in the present domain.
    pub fn base_activation(&self, participant: usize) -> u64 {
        self.base_activations[participant]
    }

    /// From now on the newest sample of each stream can be asked for.
    pub fn keep_newest(&mut self) {
        self.latest
            .get_or_insert_with(|| NewestSamples::new(&streams(&self.plan)));
    }

    /// The newest sample of stream number `stream`, if there is one and [`Recorder::keep_newest`] was called before it came.
    pub(crate) fn newest_of(&self, stream: usize) -> Option<(Header, &Payload)> {
        self.latest.as_ref()?.get(stream)
    }

    /// How many events that do not follow from the samples have been recorded.
    pub(crate) fn event_count(&self) -> usize {
        self.event_count
    }

    /// The streams of the outputs of participant number `participant`.
    fn outputs(&self, participant: usize) -> std::ops::Range<usize> {
        let planned = &self.plan.participants[participant];
        let first = planned.first_stream as usize;
        first..first + planned.interface.outputs.len()
    }

    /// How many whole activations of participant number `participant` have been recorded up to its present position; `None` if it
    /// has no outputs, because its samples then do not show that.
    pub fn activations(&self, participant: usize) -> Option<u64> {
        let counts = self.published[self.outputs(participant)].iter();
        counts
            .min()
            .map(|samples| self.plan.activations_of(participant, *samples))
    }

    /// `participant.port` of stream number `stream`.
    pub(crate) fn name(&self, stream: usize) -> String {
        streams(&self.plan)[stream].name()
    }

    /// Whether the tape has samples of participant number `participant` that are still to come again, since the run went back.
    pub fn is_ahead_of(&self, participant: usize) -> bool {
        let mut outputs = self.outputs(participant);
        outputs.any(|stream| self.published[stream] < self.recorded[stream])
    }

    /// Compares a sample that comes again with the one on the tape, if it is there.
    fn compare_with_previous(
        &self,
        previous: &History,
        number: usize,
        header: Header,
        payload: &[u8],
    ) -> Result<(), TransportError> {
        let before = previous
            .payload(number as u32, header.index)
            .map_err(|error| TransportError(error.to_string()))?;
        let Some(before) = before.filter(|before| before != payload) else {
            return Ok(());
        };
        let spec = &streams(&self.plan)[number];
        Err(TransportError(format!(
            "is not deterministic, so it cannot be restarted: sample #{} of `{}` came again with {}",
            header.index,
            spec.name(),
            difference(&spec.descriptor, &before, payload)
        )))
    }

    /// Records one sample that `participant` reports as published. The sample comes from another process: a wrong stream, index,
    /// stamp or size is that participant's fault, and is returned as an error in words.
    pub fn sample(
        &mut self,
        participant: usize,
        stream: u32,
        header: Header,
        payload: &[u8],
    ) -> Result<(), TransportError> {
        let number = stream as usize;
        if self.owners.get(number) != Some(&participant) {
            return Err(TransportError(format!(
                "recorded a sample of stream {stream}, which is not its own"
            )));
        }
        let due = self.plan.participants[participant].sample_time.instant(header.index);
        if header.stamp != due {
            let (stamp, due) = (
                self.plan.timebase.seconds(header.stamp),
                self.plan.timebase.seconds(due),
            );
            return Err(TransportError(format!(
                "recorded sample #{} stamped {stamp} s; its stamp must be {due} s",
                header.index
            )));
        }
        self.check_due(participant, number, header.index)?;
        self.take(participant, number, header, payload)
    }

    /// Records the next sample of a stream of `participant`; its header is known to be right.
    pub fn take(
        &mut self,
        participant: usize,
        number: usize,
        header: Header,
        payload: &[u8],
    ) -> Result<(), TransportError> {
        if payload.is_empty() {
            return self.count_unobserved(number, header);
        }
        if let Some(sample_buffer) = &mut self.sample_buffer {
            sample_buffer.put(number, header.index, payload);
        }
        if let Some(previous) = &self.previous
            && header.index < self.recorded[number]
        {
            self.compare_with_previous(previous, number, header, payload)?;
            self.published[number] += 1;
            return Ok(());
        }
        let stamp = self.plan.timebase.seconds(header.stamp);
        match self
            .tape_mapping
            .put(&mut self.store, number, header.index, stamp, payload)
        {
            Ok(()) => {}
            Err(error @ (AppendError::Io { .. } | AppendError::DiskFull { .. })) => {
                let text = error.to_string();
                self.error = Some(error);
                return Err(TransportError(text));
            }
            Err(error) => return Err(TransportError(format!("recorded {error}"))),
        }
        self.count_sample(number);
        self.evaluate(participant, number, header, stamp, payload)
    }

    /// Counts a sample that is not observed; its participant has sent only the header.
    fn count_unobserved(&mut self, number: usize, header: Header) -> Result<(), TransportError> {
        if self.plan.observed(number).contains(header.index) {
            return Err(TransportError(format!(
                "recorded sample #{} of `{}` without a payload, which only a sample that is not observed may be",
                header.index,
                self.name(number)
            )));
        }
        self.count_sample(number);
        self.advance(header.stamp)
    }

    fn count_sample(&mut self, number: usize) {
        self.published[number] += 1;
        self.recorded[number] = self.recorded[number].max(self.published[number]);
    }

    /// Evaluates a sample for everything except the recording.
    pub(crate) fn evaluate(
        &mut self,
        participant: usize,
        number: usize,
        header: Header,
        stamp_s: f64,
        payload: &[u8],
    ) -> Result<(), TransportError> {
        if let Some(assessment) = self.assessment.as_mut().filter(|_| self.assessed[number]) {
            assessment.sample(number, stamp_s, payload);
        }
        if let Some(latest) = &mut self.latest {
            latest.put(number, header, payload);
        }
        for guard in self.guards.iter_mut().filter(|guard| guard.stream == number) {
            if let Some(what) = guard.check(header.index, header.stamp, payload, self.plan.timebase)
                && self.violation.is_none()
            {
                let planned = &self.plan.participants[participant];
                let output = &planned.interface.outputs[number - planned.first_stream as usize].name;
                self.violation = Some((participant, format!("gave out `{}.{output}` {what}", planned.name)));
            }
        }
        self.advance(header.stamp)
    }

    /// Registers that samples with the stamp `stamp` have come.
    pub(crate) fn advance(&mut self, stamp: Ticks) -> Result<(), TransportError> {
        if stamp > self.newest {
            self.newest = stamp;
            self.record_due_faults()?;
        }
        Ok(())
    }

    /// Checks that sample `index` of stream number `stream` is the next one, and that its activation lies before the granted time.
    fn check_due(&self, participant: usize, stream: usize, index: u64) -> Result<(), TransportError> {
        let (planned, due) = (&self.plan.participants[participant], self.published[stream]);
        let activation = index.checked_sub(self.initial_samples[stream]);
        let granted =
            activation.is_none_or(|k| k < planned.activations && planned.sample_time.instant(k) < self.granted);
        if index == due && granted {
            return Ok(());
        }
        let name = self.name(stream);
        Err(TransportError(if index != due {
            format!("recorded stream `{name}`: sample {index} came where sample {due} was due")
        } else if let Some(k) = activation.filter(|&k| k < planned.activations) {
            format!(
                "recorded sample #{index} of `{name}`, which its activation at t = {} s gives; it is granted no time after t = {} s",
                self.plan.timebase.seconds(planned.sample_time.instant(k)),
                self.plan.timebase.seconds(self.granted)
            )
        } else {
            format!("recorded sample #{index} of `{name}`, of which the plan has {due}")
        }))
    }

    /// Records the faults that begin or end by now.
    fn record_due_faults(&mut self) -> Result<(), TransportError> {
        while self.faults.front().is_some_and(|(when, _)| *when <= self.newest) {
            let Some((_, event)) = self.faults.pop_front() else {
                break;
            };
            if let Err(error) = self.store.event(&event) {
                let text = error.to_string();
                self.error = Some(error);
                return Err(TransportError(text));
            }
        }
        Ok(())
    }

    /// The ending, extended by the faults that were active when a participant failed: they may be the reason.
    pub fn with_active_faults(&self, ending: Ending) -> Ending {
        match ending {
            Ending::Failed { participant, reason } => Ending::Failed {
                participant,
                reason: reason + &faults::active(&self.plan, self.newest),
            },
            other => other,
        }
    }

    /// Records an event.
    pub fn event(&mut self, event: &Event) -> Result<(), AppendError> {
        self.event_count += usize::from(event.kind != EventKind::Fault);
        self.store.event(event)
    }

    /// Flushes buffered data to the disk.
    pub fn flush(&mut self) -> Result<(), AppendError> {
        self.store.flush()
    }

    /// The participant whose sample a guard rejected, and the reason; returned once. The sample is on the tape, and others may have
    /// seen it.
    pub fn take_violation(&mut self) -> Option<(usize, String)> {
        let violation = self.violation.take();
        self.offenders.extend(violation.iter().map(|(offender, _)| *offender));
        violation
    }

    /// Whether a guard rejected a sample of participant number `participant`.
    pub fn is_offender(&self, participant: usize) -> bool {
        self.offenders.contains(&participant)
    }

    /// Another program provides the outputs of participant number `participant` from now on.
    pub fn producer_replaced(&mut self, participant: usize) {
        let is_owned = self.owners.iter().map(|owner| *owner == participant);
        let is_owned: Vec<bool> = is_owned.collect();
        let guards = self.guards.iter_mut();
        guards
            .filter(|guard| is_owned[guard.stream])
            .for_each(SampleGuard::reset);
        // Violations by the predecessor while it was shut down need no further report.
        self.violation = self.violation.take().filter(|(offender, _)| *offender != participant);
        self.offenders.retain(|offender| *offender != participant);
    }

    /// The failure of the tape itself, if there was one: no participant is at fault.
    pub fn take_error(&mut self) -> Option<AppendError> {
        self.error.take()
    }

    /// How many samples of stream number `stream` have come.
    pub fn count(&self, stream: usize) -> u64 {
        self.recorded[stream]
    }

    /// The figures of the samples so far.
    pub fn figures(&mut self) -> Option<Figures> {
        self.assessment.as_mut().map(|assessment| assessment.finish(Vec::new()))
    }

    /// Closes the tape. Even if that fails, the samples on it can be read.
    pub fn finish(self) -> (Result<Option<Digest>, AppendError>, Option<Figures>) {
        let digest = self.store.finish();
        (
            digest,
            self.assessment.map(|mut assessment| assessment.finish(Vec::new())),
        )
    }
}
