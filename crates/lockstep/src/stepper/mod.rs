//! The execution of one participant's activations, without blocking and without I/O of its own.
//!
//! A [`Stepper`] is the whole protocol of a participant: which sample to read, what to check, when to step, what to record and publish.
//! It never blocks: when it cannot continue it returns what it waits for, and its caller decides how to wait. The single-process loop,
//! the threads and the processes over shared memory all drive this same code.

mod deferred;
mod error;
mod input;
mod interpolator;
mod lifecycle;
mod output;
mod position;
mod progress;
mod resume;
mod source;
mod step;
mod step_pause;
mod termination;

pub use error::{PositionError, StepError};
pub use position::prepare_to_resume;
pub use progress::{LinkEnds, Progress, Wait};
pub use termination::terminate;

use std::panic::{AssertUnwindSafe, catch_unwind};

use input::{Assembled, InputState, SeenState};
use output::OutputState;
use progress::{DeferredStep, Phase, Requests, step_before};

use crate::participant::{Failure, Inputs, Kind, Log, Outputs, Participant, Step};
use crate::plan::{Assignment, Position};
use crate::time::Ticks;
use crate::transport::{Header, Recording};

/// A participant with its links, driven by [`Stepper::poll`].
pub struct Stepper {
    participant: Box<dyn Participant>,
    assignment: Assignment,
    /// The links that feed the inputs.
    inputs: Vec<InputState>,
    /// The inputs that are assembled from fields.
    assembled: Vec<Assembled>,
    /// The inputs whose values, as the participant saw them, are recorded on the tape.
    seen: Vec<SeenState>,
    outputs: Vec<OutputState>,
    recording: Box<dyn Recording>,
    input_buffers: Inputs,
    output_buffers: Outputs,
    horizon: Ticks,
    /// The activation that has begun last: the end of one is the beginning of the next.
    step: Step,
    /// The next activation.
    next: u64,
    /// The sample that the output buffers hold.
    sample: u64,
    initialised: bool,
    requests: Requests,
    phase: Phase,
    deferred: DeferredStep,
}

impl Stepper {
    /// A paused stepper before its first activation, with a horizon that does not allow any activation yet.
    pub fn new(participant: Box<dyn Participant>, assignment: Assignment, ends: LinkEnds) -> Stepper {
        let nothing = Position {
            inputs: vec![Vec::new(); assignment.inputs.len()],
            values: vec![Vec::new(); assignment.interface.inputs.len()],
            ..Position::default()
        };
        Stepper::at(participant, assignment, ends, nothing)
    }

    fn at(participant: Box<dyn Participant>, assignment: Assignment, ends: LinkEnds, position: Position) -> Stepper {
        let interface = &assignment.interface;
        let receivers = ends.receivers.into_iter().zip(&assignment.inputs).zip(position.inputs);
        let (next, held, sample_time) = (position.next, position.held, assignment.sample_time);
        let first_stamp = (next > 0).then(|| sample_time.instant(next));
        let inputs = receivers.map(|((receiver, link), backlog)| {
            let descriptor = &interface.inputs[link.input as usize].descriptor;
            InputState::new(
                link,
                descriptor,
                sample_time,
                next,
                assignment.timebase,
                receiver,
                backlog,
            )
        });
        let inputs: Vec<InputState> = inputs.collect();
        let mut seen: Vec<SeenState> = (assignment.seen.iter())
            .map(|seen| {
                let descriptor = &interface.inputs[seen.input as usize].descriptor;
                SeenState::new(seen, descriptor, assignment.timebase)
            })
            .collect();
        let senders = ends.senders.into_iter().zip(&assignment.outputs);
        let senders = senders.zip(&interface.outputs);
        let outputs = senders.map(|((senders, output), port)| {
            let timebase = assignment.timebase;
            OutputState::new(output, &port.name, &port.descriptor, senders, timebase, first_stamp)
        });
        let mut outputs: Vec<_> = outputs.collect();
        let mut output_buffers = Outputs::of(interface, Log::new(&assignment.name, None));
        for (output, flags) in outputs.iter().zip(&mut output_buffers.seen_flags) {
            flags.ever = output.is_ever_seen();
        }
        for seen in &mut seen {
            let held = held.inputs.get(seen.port);
            let injector = seen.injector.as_mut().zip(held);
            injector
                .into_iter()
                .for_each(|(injector, held)| injector.set_stuck_values(held));
        }
        for (output, held) in outputs.iter_mut().zip(&held.outputs) {
            let injection = output.fault_injection.iter_mut();
            injection.for_each(|injection| injection.injector.set_stuck_values(held));
        }
        Stepper {
            participant,
            assembled: Assembled::all(&assignment, &inputs),
            inputs,
            seen,
            outputs,
            recording: ends.recording,
            input_buffers: Inputs::zeroed(interface),
            output_buffers,
            horizon: Ticks::MIN,
            step: step_before(next, sample_time, assignment.timebase),
            next,
            sample: 0,
            initialised: false,
            requests: Requests::default(),
            phase: Phase::Initialise,
            deferred: DeferredStep::default(),
            assignment,
        }
    }

    /// The participant's part of the plan.
    pub fn assignment(&self) -> &Assignment {
        &self.assignment
    }

    /// The number of the next activation: all before it are complete.
    pub fn next_activation(&self) -> u64 {
        self.next
    }

    /// The instant of the next activation, ticks.
    pub fn next_instant(&self) -> Ticks {
        self.assignment.sample_time.instant(self.next)
    }

    /// The instant of the next activation, s.
    pub fn next_seconds(&self) -> f64 {
        self.assignment.timebase.seconds(self.next_instant())
    }

    /// Allows activations before `horizon`. The horizon only moves forward; an earlier one changes nothing.
    pub fn extend_horizon(&mut self, horizon: Ticks) {
        self.horizon = self.horizon.max(horizon);
    }

    /// The participant.
    pub fn participant(&self) -> &dyn Participant {
        &*self.participant
    }

    /// Pauses at any phase: an activation that has been stepped is recorded, one that has not is left for later. Returns `false`
    /// when the recorder must make room first. Samples that were not sent yet are on the tape; a stepper that resumes the run from here
    /// reads them from there.
    pub fn pause(&mut self) -> Result<bool, StepError> {
        loop {
            match self.phase {
                Phase::Initialise => self.initialise()?,
                Phase::Gather { .. } | Phase::Ready | Phase::Deferred => self.phase = Phase::Idle,
                Phase::Record { output } => {
                    if !self.record(output)? {
                        return Ok(false);
                    }
                }
                Phase::RecordInputs { seen } => {
                    if !self.record_inputs(seen)? {
                        return Ok(false);
                    }
                }
                Phase::Publish { .. } => {
                    self.next += u64::from(self.initialised);
                    self.initialised = true;
                    self.phase = Phase::Idle;
                }
                Phase::Idle => return Ok(true),
            }
        }
    }

    /// Prepares all links; to be called when all participants have connected, before the first activation.
    pub fn prepare(&mut self) -> Result<(), StepError> {
        self.inputs.iter_mut().try_for_each(InputState::prepare)?;
        self.outputs.iter_mut().try_for_each(OutputState::prepare)
    }

    /// Works until an activation is complete, or until something is missing. Another call continues where this one stopped.
    pub fn poll(&mut self) -> Result<Progress, StepError> {
        self.poll_boxed().map_err(|error| *error)
    }

    fn poll_boxed(&mut self) -> Result<Progress, Box<StepError>> {
        loop {
            match self.phase {
                Phase::Initialise => self.initialise()?,
                Phase::Idle => {
                    let at_end = self.next >= self.assignment.activations;
                    if at_end || self.next_instant() >= self.horizon {
                        return Ok(if at_end {
                            Progress::Finished
                        } else {
                            Progress::AtHorizon
                        });
                    }
                    for seen in &self.seen {
                        seen.remove_faults(self.input_buffers.payloads[seen.port].bytes_mut());
                    }
                    self.begin_activation();
                    self.phase = Phase::Gather { input: 0 };
                }
                Phase::Gather { input } => {
                    if let Some(wait) = self.gather(input)? {
                        return Ok(Progress::Waiting(wait));
                    }
                }
                Phase::Ready => {
                    if self.requests.pause_from.is_some_and(|from| self.next >= from) {
                        return Ok(Progress::BeforeStep);
                    }
                    self.do_step()?;
                }
                Phase::Deferred => {
                    if !self.finish_deferred_step()? {
                        return Ok(Progress::Deferred);
                    }
                }
                Phase::RecordInputs { seen } => {
                    if !self.record_inputs(seen)? {
                        return Ok(Progress::Waiting(Wait::Recording));
                    }
                }
                Phase::Record { output } => {
                    if !self.record(output)? {
                        return Ok(Progress::Waiting(Wait::Recording));
                    }
                }
                Phase::Publish { output } => {
                    if let Some(wait) = self.publish(output)? {
                        return Ok(Progress::Waiting(wait));
                    }
                    self.phase = Phase::Idle;
                    if std::mem::replace(&mut self.initialised, true) {
                        self.next += 1;
                        return Ok(Progress::Stepped);
                    }
                }
            }
        }
    }

    fn initialise(&mut self) -> Result<(), StepError> {
        let continuous = self.assignment.interface.kind == Kind::Continuous;
        let t = self.next_seconds();
        if continuous {
            self.update_seen_outputs();
        }
        self.requests.notify_termination = true;
        self.output_buffers.log.set_time(t);
        let result = catch_failure(|| self.participant.initialise(t, &mut self.output_buffers));
        self.note_panic(result)?;
        if continuous && self.assignment.activations > 0 {
            self.check_outputs()?;
            self.phase = Phase::Record { output: 0 };
        } else {
            self.initialised = true;
            self.phase = Phase::Idle;
        }
        Ok(())
    }

    /// Gets the samples of the links from number `first` on.
    fn gather(&mut self, first: usize) -> Result<Option<Wait>, Box<StepError>> {
        let t = self.next_instant();
        for (number, input) in self.inputs.iter_mut().enumerate().skip(first) {
            let payload = self.input_buffers.payloads[input.port].bytes_mut();
            if let Some(index) = input.fetch(t, payload)? {
                self.phase = Phase::Gather { input: number };
                return Ok(Some(Wait::Sample { input: number, index }));
            }
        }
        for input in &self.assembled {
            input.assemble(&self.inputs, &mut self.input_buffers)?;
        }
        self.inject_input_faults();
        self.phase = Phase::Ready;
        Ok(None)
    }

    /// Applies signal faults to the inputs, once all samples have been received and checked.
    fn inject_input_faults(&mut self) {
        let t = self.next_instant();
        for seen in &mut self.seen {
            let payload = self.input_buffers.payloads[seen.port].bytes_mut();
            seen.inject_faults(self.next, t, payload);
        }
    }

    /// Appends the values that the inputs of `seen` had at this activation, from number `first` on, to the tape, after the outputs.
    fn record_inputs(&mut self, first: usize) -> Result<bool, StepError> {
        let header = Header {
            index: self.next,
            stamp: self.next_instant(),
        };
        for (number, seen) in self.seen.iter().enumerate().skip(first) {
            let payload = match seen.observed.contains(header.index) {
                true => self.input_buffers.payloads[seen.port].bytes(),
                false => &[],
            };
            let appended = self.recording.try_append(seen.stream, header, payload);
            if !appended.map_err(recording_error)? {
                self.phase = Phase::RecordInputs { seen: number };
                return Ok(false);
            }
        }
        self.prepare_to_publish();
        Ok(true)
    }

    /// Determines whether the next samples are seen, and shows that to the participant.
    fn update_seen_outputs(&mut self) {
        for (output, flags) in self.outputs.iter_mut().zip(&mut self.output_buffers.seen_flags) {
            output.update_seen(self.sample);
            flags.now = output.seen;
        }
    }

    fn check_outputs(&self) -> Result<(), StepError> {
        let seen = self.outputs.iter().zip(&self.output_buffers.payloads);
        for (output, payload) in seen.filter(|(output, _)| output.seen) {
            if !output.values.passes(payload.bytes()) {
                return Err(StepError::Invalid {
                    port: output.name.clone(),
                    what: output
                        .values
                        .describe_invalid(&output.descriptor, payload.bytes(), "an output"),
                });
            }
        }
        Ok(())
    }

    fn header(&self) -> Header {
        Header {
            index: self.sample,
            stamp: self.assignment.sample_time.instant(self.sample),
        }
    }

    /// Appends the outputs from number `first` on to the tape.
    fn record(&mut self, first: usize) -> Result<bool, StepError> {
        let header = self.header();
        for (number, output) in self.outputs.iter_mut().enumerate().skip(first) {
            let payload = output.record(&self.output_buffers.payloads[number]);
            let appended = self.recording.try_append(output.stream, header, payload);
            if !appended.map_err(recording_error)? {
                self.phase = Phase::Record { output: number };
                return Ok(false);
            }
        }
        if self.initialised && !self.seen.is_empty() {
            return self.record_inputs(0);
        }
        self.prepare_to_publish();
        Ok(true)
    }

    /// Commits the activation to the tape. Samples that no consumer reads are not sent.
    fn prepare_to_publish(&mut self) {
        self.recording.commit();
        let header = self.header();
        for (output, payload) in self.outputs.iter_mut().zip(&self.output_buffers.payloads) {
            output.inject_faults(header, payload.bytes());
        }
        self.phase = Phase::Publish { output: 0 };
    }

    /// Sends the outputs from number `first` on to their consumers; a sample that no consumer reads is not sent.
    fn publish(&mut self, first: usize) -> Result<Option<Wait>, Box<StepError>> {
        let header = self.header();
        for (number, output) in self.outputs.iter_mut().enumerate().skip(first) {
            if let Some(consumer) = output.publish(header, self.output_buffers.payloads[number].bytes())? {
                self.phase = Phase::Publish { output: number };
                return Ok(Some(Wait::Room {
                    output: number,
                    consumer,
                }));
            }
        }
        Ok(None)
    }
}

/// Calls the participant's code and reports a panic as a failure. What a panic left half done is not used again.
fn catch_failure(work: impl FnOnce() -> Result<(), Failure>) -> Result<(), StepError> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result.map_err(StepError::Failed),
        Err(panic) => Err(StepError::Panicked(crate::panic::message(&*panic))),
    }
}

fn recording_error(source: crate::transport::TransportError) -> StepError {
    StepError::Broken {
        way: "to the recorder".into(),
        source,
    }
}
