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

/// The number of samples of stream number `stream` when the next activation of its owner is `next`.
fn samples(plan: &Plan, stream: usize, owner: usize, next: u64) -> u64 {
    let outputs = plan.participants.iter().map(|own| own.interface.outputs.len());
    if stream < outputs.sum() {
        plan.samples_before(owner, next)
    } else {
        // One sample of a disturbed input per activation.
        next
    }
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
    /// How many samples each stream has where its producer stands: those on the tape, or fewer since the run went back.
    reached: Vec<u64>,
    /// The number of samples of each stream that precede the first activation.
    early: Vec<u64>,
    /// The activation at which each participant started in the present place.
    base: Vec<u64>,
    /// The granted time (horizon), ticks: no activation at or past it may happen yet.
    granted: Ticks,
}

impl Recorder {
    /// Records onto `writer`, which was made for the streams of `plan`, and looks at every sample with `watches`.
    pub fn new(plan: Plan, writer: Writer, assessment: Option<Box<dyn Assessment>>, watches: Vec<Watch>) -> Recorder {
        let outputs = plan.participants.iter().enumerate();
        let outputs = outputs.flat_map(|(number, own)| own.interface.outputs.iter().map(move |_| number));
        let owners: Vec<usize> = outputs.chain(plan.seen.iter().map(|seen| seen.participant)).collect();
        let reached = vec![0; owners.len()];
        let early = owners.iter().enumerate();
        let early = early.map(|(stream, &owner)| samples(&plan, stream, owner, 0)).collect();
        Recorder {
            writer,
            assessment,
            watches,
            early,
            lie: None,
            faults: faults::events(&plan),
            base: vec![0; plan.participants.len()],
            granted: Ticks::MAX,
            plan,
            owners,
            newest: i64::MIN,
            error: None,
            again: None,
            reached,
        }
    }

    /// Grants time up to `horizon`: samples of activations at or past it are refused.
    pub fn grant(&mut self, horizon: Ticks) {
        self.granted = horizon;
    }

    /// All participants go on at `cut`: the samples behind it come next.
    pub fn stand_at(&mut self, cut: &Cut) {
        self.base.clone_from(&cut.next);
        for (stream, reached) in self.reached.iter_mut().enumerate() {
            let owner = self.owners[stream];
            *reached = samples(&self.plan, stream, owner, cut.next[owner]);
        }
    }

    /// The next activation of each participant at rest at `now`. A substitute of a failed participant may be further on.
    pub fn cut_at(&self, now: Ticks) -> Cut {
        let mut cut = self.plan.cut_at(now);
        for (next, base) in cut.next.iter_mut().zip(&self.base) {
            *next = (*next).max(*base);
        }
        cut
    }

    /// The activation at which participant number `participant` started in the present place.
    pub fn base(&self, participant: usize) -> u64 {
        self.base[participant]
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

    /// The streams of the outputs of participant number `participant`.
    fn outputs(&self, participant: usize) -> std::ops::Range<usize> {
        let own = &self.plan.participants[participant];
        let first = own.first_stream as usize;
        first..first + own.interface.outputs.len()
    }

    /// How many whole activations of participant number `participant` have been recorded where it stands; `None` when that cannot be
    /// told from its samples, because it has no outputs.
    pub fn activations(&self, participant: usize) -> Option<u64> {
        let counts = self.reached[self.outputs(participant)].iter();
        counts
            .min()
            .map(|samples| self.plan.activations_of(participant, *samples))
    }

    /// Checks a Finished note of participant number `participant` against its recorded samples.
    ///
    /// # Errors
    /// The contradiction, in words that follow the participant's name.
    pub fn finished(&self, participant: usize) -> Result<(), Broken> {
        let own = &self.plan.participants[participant];
        let says = "reports that it has finished";
        let last = own.activations.checked_sub(1).map(|last| own.sample_time.instant(last));
        if last.is_some_and(|last| last >= self.granted) {
            return Err(Broken(format!(
                "{says}; it may go no further than t = {} s",
                self.plan.timebase.seconds(self.granted)
            )));
        }
        self.stands_at(participant, own.activations, says)
    }

    /// Checks an AtRest note (granted time and next activation) against the plan and the recorded samples.
    ///
    /// # Errors
    /// As [`Recorder::finished`].
    pub fn rests(&self, participant: usize, horizon: Ticks, next: u64) -> Result<(), Broken> {
        let t = self.plan.timebase.seconds(horizon);
        let says = format!("reports that it rests at t = {t} s");
        if horizon > self.granted {
            return Err(Broken(format!(
                "{says}; it may go no further than t = {} s",
                self.plan.timebase.seconds(self.granted)
            )));
        }
        let own = &self.plan.participants[participant];
        let before = own.sample_time.count_before(horizon.min(self.plan.end));
        let right = before.max(self.base[participant]);
        if next != right {
            return Err(Broken(format!(
                "{says} before its activation {next}; by the plan it rests there before activation {right}"
            )));
        }
        self.stands_at(participant, next, &says)
    }

    /// Checks a Recalled note (next activation) against the recorded samples.
    ///
    /// # Errors
    /// As [`Recorder::finished`].
    pub fn recalled(&self, participant: usize, next: u64) -> Result<(), Broken> {
        let (least, most) = (self.base[participant], self.plan.participants[participant].activations);
        let says = format!("reports that it rests before its activation {next}");
        if !(least..=most).contains(&next) {
            return Err(Broken(format!(
                "{says}, of those from {least} to {most} that it may have reached"
            )));
        }
        self.stands_at(participant, next, &says)
    }

    /// Checks that the participant has recorded exactly the samples of the activations before `next`.
    fn stands_at(&self, participant: usize, next: u64, says: &str) -> Result<(), Broken> {
        let owned = self.owners.iter().enumerate();
        for (stream, _) in owned.filter(|(_, owner)| **owner == participant) {
            let (due, right) = (self.reached[stream], samples(&self.plan, stream, participant, next));
            if due != right {
                let name = self.name(stream);
                return Err(Broken(format!(
                    "{says}, and has recorded {due} samples of `{name}` where the plan has {right}"
                )));
            }
        }
        Ok(())
    }

    /// `participant.port` of stream number `stream`.
    fn name(&self, stream: usize) -> String {
        streams(&self.plan)[stream].name()
    }

    /// Whether the tape has samples of participant number `participant` that are still to come again, since the run went back.
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
        self.is_due(participant, number, header.index)?;
        if let Some(again) = &self.again
            && header.index < again.count(number)
        {
            Self::same_again(again, stream, header, payload)?;
            self.reached[number] += 1;
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
        self.reached[number] += 1;
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

    /// Checks that sample `index` of stream number `stream` is the next one, and that its activation lies before the granted time.
    fn is_due(&self, participant: usize, stream: usize, index: u64) -> Result<(), Broken> {
        let (own, due) = (&self.plan.participants[participant], self.reached[stream]);
        let activation = index.checked_sub(self.early[stream]);
        let granted = activation.is_none_or(|k| k < own.activations && own.sample_time.instant(k) < self.granted);
        if index == due && granted {
            return Ok(());
        }
        let name = self.name(stream);
        Err(Broken(if index != due {
            format!("recorded stream `{name}`: sample {index} came where sample {due} was due")
        } else if let Some(k) = activation.filter(|&k| k < own.activations) {
            format!(
                "recorded sample #{index} of `{name}`, which its activation at t = {} s gives; it may go no further than t = {} s",
                self.plan.timebase.seconds(own.sample_time.instant(k)),
                self.plan.timebase.seconds(self.granted)
            )
        } else {
            format!("recorded sample #{index} of `{name}`, of which the plan has {due}")
        }))
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

    /// How many samples of stream number `stream` have come.
    pub fn count(&self, stream: usize) -> u64 {
        self.writer.count(stream).unwrap_or(0)
    }

    /// Closes the tape. What is on it can be read even if that fails.
    pub fn finish(self) -> (Result<Digest, AppendError>, Option<Figures>) {
        let digest = self.writer.finish();
        (digest, self.assessment.map(|mut assessment| assessment.finish()))
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
