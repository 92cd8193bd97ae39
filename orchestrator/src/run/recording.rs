//! From participants' samples to the tape and the figures of merit.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::plan::Plan;
use lockstep::time::Ticks;
use lockstep::transport::{Broken, Header, Recording};
use recorder::tape::{AppendError, Digest, Event, StreamSpec, Writer};

use super::faults;
use super::outcome::Ending;
use crate::assessment::{Assessment, Summary};

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
}

impl Recorder {
    /// Records onto `writer`, which was made for the streams of `plan`.
    pub fn new(plan: Plan, writer: Writer, assessment: Option<Box<dyn Assessment>>) -> Recorder {
        let outputs = plan.participants.iter().enumerate();
        let outputs = outputs.flat_map(|(number, own)| own.interface.outputs.iter().map(move |_| number));
        let owners = outputs.chain(plan.seen.iter().map(|seen| seen.participant)).collect();
        Recorder {
            writer,
            assessment,
            faults: faults::events(&plan),
            plan,
            owners,
            newest: i64::MIN,
            error: None,
        }
    }

    /// Takes one sample that `participant` says it has published. The sample comes from another process: a wrong stream,
    /// index, stamp or size is that participant's fault and comes back as words.
    pub fn sample(&mut self, participant: usize, stream: u32, header: Header, payload: &[u8]) -> Result<(), Broken> {
        let number = stream as usize;
        if self.owners.get(number) != Some(&participant) {
            return Err(Broken(format!(
                "it recorded a sample of stream {stream}, which is not its own"
            )));
        }
        let due = self.plan.participants[participant].sample_time.instant(header.index);
        if header.stamp != due {
            let (stamp, due) = (
                self.plan.timebase.seconds(header.stamp),
                self.plan.timebase.seconds(due),
            );
            return Err(Broken(format!(
                "it recorded sample #{} stamped {stamp} s; its stamp must be {due} s",
                header.index
            )));
        }
        let stamp = self.plan.timebase.seconds(header.stamp);
        match self.writer.append(number, header.index, stamp, payload) {
            Ok(()) => {}
            Err(error @ AppendError::Io { .. }) => {
                let text = error.to_string();
                self.error = Some(error);
                return Err(Broken(text));
            }
            Err(error) => return Err(Broken(format!("it recorded {error}"))),
        }
        if let Some(assessment) = &mut self.assessment {
            assessment.sample(number, stamp, payload);
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

    /// The failure of the tape itself, if there was one: not the fault of any participant.
    pub fn take_error(&mut self) -> Option<AppendError> {
        self.error.take()
    }

    /// Closes the tape.
    pub fn finish(self) -> Result<(Digest, Option<Summary>), AppendError> {
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

    fn try_flush(&mut self) -> Result<bool, Broken> {
        Ok(true)
    }
}
