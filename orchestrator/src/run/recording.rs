//! From participants' samples to the tape and the figures of merit.

use std::sync::{Arc, Mutex, PoisonError};

use lockstep::plan::Plan;
use lockstep::transport::{Broken, Header, Recording};
use recorder::tape::{AppendError, Digest, Event, StreamSpec, Writer};

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
    streams
}

/// Everything that is made of samples while they come.
pub struct Recorder {
    writer: Writer,
    assessment: Option<Box<dyn Assessment>>,
    plan: Plan,
    /// The participant that owns each stream.
    owners: Vec<usize>,
    /// The newest stamp of anybody, ticks.
    pub newest: i64,
    error: Option<AppendError>,
}

impl Recorder {
    /// Records onto `writer`, which was made for the streams of `plan`.
    pub fn new(plan: Plan, writer: Writer, assessment: Option<Box<dyn Assessment>>) -> Recorder {
        let owners = plan.participants.iter().enumerate();
        let owners = owners
            .flat_map(|(number, own)| own.interface.outputs.iter().map(move |_| number))
            .collect();
        Recorder {
            writer,
            assessment,
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
        self.newest = self.newest.max(header.stamp);
        Ok(())
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
