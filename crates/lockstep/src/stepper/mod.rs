//! The execution of one participant's activations, without blocking and without I/O of its own.
//!
//! A [`Stepper`] is the whole protocol of a participant: which sample to read, what to check, when to step, what to record and publish.
//! It never blocks: when it cannot continue it returns what it waits for, and its caller decides how to wait. The single-process loop,
//! the threads and the processes over shared memory all drive this same code.

mod between;
mod error;
mod held;
mod input;
mod life;
mod output;
mod parked;
mod position;
mod progress;
mod rest;
mod source;
mod step;
mod termination;

pub use error::{PositionError, StepError};
pub use position::settle;
pub use progress::{Ends, Progress, Wait};
pub use termination::terminate;

use std::panic::{AssertUnwindSafe, catch_unwind};

use input::{Assembled, InputState, SeenState};
use output::{ConsumerState, Disturbed, OutputState};
use progress::{Orders, Parked, Phase};

use crate::fault::Injector;
use crate::participant::{Failure, Inputs, Kind, Log, Outputs, Participant, ValueCheck};
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
    /// The period, s.
    period_s: f64,
    /// An activation and its instant, s: the end of one is the beginning of the next.
    known_s: (u64, f64),
    /// The next activation.
    next: u64,
    /// The sample that the output buffers hold.
    sample: u64,
    initialised: bool,
    orders: Orders,
    phase: Phase,
    parked: Parked,
}

impl Stepper {
    /// A stepper at rest before its first activation, with a horizon that does not allow any activation yet.
    pub fn new(participant: Box<dyn Participant>, assignment: Assignment, ends: Ends) -> Stepper {
        let nothing = Position {
            inputs: vec![Vec::new(); assignment.inputs.len()],
            values: vec![Vec::new(); assignment.interface.inputs.len()],
            ..Position::default()
        };
        Stepper::at(participant, assignment, ends, nothing)
    }

    fn at(participant: Box<dyn Participant>, assignment: Assignment, ends: Ends, position: Position) -> Stepper {
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
        let outputs = senders.map(|((senders, output), port)| OutputState {
            stream: output.stream,
            observed: output.observed,
            recorded: true,
            seen: true,
            name: port.name.clone(),
            values: ValueCheck::new(&port.descriptor, false),
            descriptor: port.descriptor.clone(),
            consumers: senders
                .into_iter()
                .zip(&output.consumers)
                .map(|(s, c)| ConsumerState::new(c, s, first_stamp))
                .collect(),
            disturbed: Injector::new(&output.faults, assignment.timebase)
                .map(|injector| Disturbed::new(injector, port.descriptor.size as usize)),
            served: 0,
        });
        let mut outputs: Vec<_> = outputs.collect();
        let mut output_buffers = Outputs::of(interface, Log::new(&assignment.name, None));
        for (output, look) in outputs.iter().zip(&mut output_buffers.looks) {
            look.ever = output.is_ever_seen();
        }
        for seen in &mut seen {
            let held = held.inputs.get(seen.port);
            let injector = seen.injector.as_mut().zip(held);
            injector
                .into_iter()
                .for_each(|(injector, held)| injector.remember(held));
        }
        for (output, held) in outputs.iter_mut().zip(&held.outputs) {
            let disturbed = output.disturbed.iter_mut();
            disturbed.for_each(|disturbed| disturbed.injector.remember(held));
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
            period_s: assignment.timebase.seconds(sample_time.period),
            known_s: (next, assignment.timebase.seconds(sample_time.instant(next))),
            next,
            sample: 0,
            initialised: false,
            orders: Orders::default(),
            phase: Phase::Initialise,
            parked: Parked::default(),
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

    /// Comes to rest at any phase: an activation that has been stepped is recorded, one that has not is left for later. Returns `false`
    /// when the recorder must make room first. Samples that were not sent yet are on the tape; a stepper that resumes the run from here
    /// reads them from there.
    pub fn come_to_rest(&mut self) -> Result<bool, StepError> {
        loop {
            match self.phase {
                Phase::Initialise => self.initialise()?,
                Phase::Gather { .. } | Phase::Ready | Phase::Parked => self.phase = Phase::Idle,
                Phase::Record { output } => {
                    if !self.record(output)? {
                        return Ok(false);
                    }
                }
                Phase::Look { seen } => {
                    if !self.look(seen)? {
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
        self.work().map_err(|error| *error)
    }

    fn work(&mut self) -> Result<Progress, Box<StepError>> {
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
                        seen.undo(self.input_buffers.payloads[seen.port].bytes_mut());
                    }
                    self.phase = Phase::Gather { input: 0 };
                }
                Phase::Gather { input } => {
                    if let Some(wait) = self.gather(input)? {
                        return Ok(Progress::Waiting(wait));
                    }
                }
                Phase::Ready => {
                    if self.orders.hold.is_some_and(|from| self.next >= from) {
                        return Ok(Progress::Held);
                    }
                    self.do_step()?;
                }
                Phase::Parked => {
                    if !self.take_over()? {
                        return Ok(Progress::Parked);
                    }
                }
                Phase::Look { seen } => {
                    if !self.look(seen)? {
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
            self.look_at_outputs();
        }
        self.orders.begun = true;
        self.output_buffers.log.set_time(t);
        let begun = guarded(|| self.participant.initialise(t, &mut self.output_buffers));
        self.whole(begun)?;
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
        self.disturb_inputs();
        self.phase = Phase::Ready;
        Ok(None)
    }

    /// Applies signal faults to the inputs, once all samples have been received and checked.
    fn disturb_inputs(&mut self) {
        let t = self.next_instant();
        for seen in &mut self.seen {
            let payload = self.input_buffers.payloads[seen.port].bytes_mut();
            seen.disturb(self.next, t, payload);
        }
    }

    /// Appends the values that the inputs of `seen` had at this activation, from number `first` on, to the tape, after the outputs.
    fn look(&mut self, first: usize) -> Result<bool, StepError> {
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
            if !appended.map_err(to_the_recorder)? {
                self.phase = Phase::Look { seen: number };
                return Ok(false);
            }
        }
        self.prepare_to_publish();
        Ok(true)
    }

    /// Determines whether the next samples are seen, and shows that to the participant.
    fn look_at_outputs(&mut self) {
        for (output, look) in self.outputs.iter_mut().zip(&mut self.output_buffers.looks) {
            output.look_at(self.sample);
            look.now = output.seen;
        }
    }

    fn check_outputs(&self) -> Result<(), StepError> {
        let seen = self.outputs.iter().zip(&self.output_buffers.payloads);
        for (output, payload) in seen.filter(|(output, _)| output.seen) {
            if !output.values.passes(payload.bytes()) {
                return Err(StepError::Invalid {
                    port: output.name.clone(),
                    what: output.values.words(&output.descriptor, payload.bytes(), "an output"),
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
            if !appended.map_err(to_the_recorder)? {
                self.phase = Phase::Record { output: number };
                return Ok(false);
            }
        }
        if self.initialised && !self.seen.is_empty() {
            return self.look(0);
        }
        self.prepare_to_publish();
        Ok(true)
    }

    /// Commits the activation to the tape. Samples that no consumer reads are not sent.
    fn prepare_to_publish(&mut self) {
        self.recording.commit();
        let header = self.header();
        for (output, payload) in self.outputs.iter_mut().zip(&self.output_buffers.payloads) {
            output.disturb(header, payload.bytes());
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
fn guarded(work: impl FnOnce() -> Result<(), Failure>) -> Result<(), StepError> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result.map_err(StepError::Failed),
        Err(panic) => Err(StepError::Panicked(crate::panic::message(&*panic))),
    }
}

fn to_the_recorder(source: crate::transport::Broken) -> StepError {
    StepError::Broken {
        way: "to the recorder".into(),
        source,
    }
}
