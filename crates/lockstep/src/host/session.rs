//! One participant's session: requests while it is at rest, steps while it may step.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::time::Instant;

use super::HostError;
use super::waiting::Patience;
use crate::control::{Note, PROTOCOL, Reply, Request, Timing, Waiting};
use crate::participant::{Factory, Participant, Setup};
use crate::plan::Assignment;
use crate::stepper::{Ends, Progress, Stepper, Wait};
use crate::time::Ticks;
use crate::transport::iceoryx::{
    Activity, Address, ClockReader, ControlServer, Domain, DomainError, LinkService, RecordSender, SharedRecord,
    Sleeper, Status, StatusWriter, Waker,
};
use crate::transport::{Broken, Receiver, Sender};

/// How far a participant has come with its requests.
enum Stage {
    Unknown,
    Described(Box<dyn Participant>),
    Ready(Box<Ready>),
    Leaving,
}

/// A participant with all of its links.
struct Ready {
    stepper: Stepper,
    clock: ClockReader,
    record: SharedRecord,
    /// Whoever may be waiting for a sample of an output, or for room on the link into an input; once each.
    neighbours: Vec<Waker>,
    patience: Patience,
    timing: Timing,
    /// Keeps the services of the links open.
    _links: Vec<LinkService>,
}

/// Why a stretch of steps ended.
enum Pause {
    AtHorizon(Ticks),
    Finished,
    Stopped,
}

pub(super) struct Session {
    domain: Domain,
    name: String,
    program: String,
    factory: Factory,
    control: ControlServer,
    status: StatusWriter,
    sleeper: Sleeper,
    stage: Stage,
}

impl Session {
    pub(super) fn open(address: Address, name: &str, program: &str, factory: Factory) -> Result<Session, HostError> {
        let domain = Domain::enter(address, name)?;
        let status = StatusWriter::open(&domain, name)?;
        let sleeper = Sleeper::open(&domain, name)?;
        // The server last: once it is there the orchestrator asks.
        let control = ControlServer::open(&domain, name)?;
        let (name, program) = (name.to_owned(), program.to_owned());
        Ok(Session {
            domain,
            name,
            program,
            factory,
            control,
            status,
            sleeper,
            stage: Stage::Unknown,
        })
    }

    /// Serves requests and steps until told to leave.
    pub(super) fn run(mut self) -> Result<(), HostError> {
        let mut rested_at = None;
        loop {
            match &mut self.stage {
                Stage::Leaving => return Ok(()),
                Stage::Unknown | Stage::Described(_) => {
                    if !self.serve()? {
                        self.sleeper.sleep(std::time::Duration::from_millis(1))?;
                    }
                }
                Stage::Ready(ready) => {
                    let horizon = ready.clock.horizon();
                    if ready.clock.stopped() {
                        return Ok(());
                    }
                    if horizon == Ticks::MIN || rested_at == Some(horizon) {
                        let since = Instant::now();
                        ready.patience.doze(&mut self.sleeper)?;
                        ready.timing.horizon_ns += since.elapsed().as_nanos() as u64;
                        self.serve()?;
                        continue;
                    }
                    match self.advance(horizon)? {
                        Pause::AtHorizon(horizon) => rested_at = Some(horizon),
                        // Stay for requests (a last state to save) until the stop flag or the request to leave.
                        Pause::Finished => rested_at = Some(horizon),
                        Pause::Stopped => return Ok(()),
                    }
                }
            }
        }
    }

    /// Answers one request; whether there was one.
    fn serve(&mut self) -> Result<bool, HostError> {
        let Session {
            domain,
            name,
            program,
            factory,
            control,
            stage,
            ..
        } = self;
        let served = control.serve(|request| match request {
            Request::Hello { .. } => Reply::Hello {
                protocol: PROTOCOL,
                program: program.clone(),
            },
            Request::Configure {
                name,
                parameters,
                seed,
                period,
                offset,
            } => match configure(*factory, name, &parameters, seed, period, offset) {
                Ok(participant) => {
                    let interface = participant.interface();
                    *stage = Stage::Described(participant);
                    Reply::Described { interface }
                }
                Err((key, reason)) => Reply::Refused { key, reason },
            },
            Request::Connect {
                assignment,
                cores,
                waiting,
            } => match std::mem::replace(stage, Stage::Unknown) {
                Stage::Described(participant) => {
                    match connect(domain, name, participant, assignment, &cores, waiting) {
                        Ok(ready) => {
                            *stage = Stage::Ready(Box::new(ready));
                            Reply::Done
                        }
                        Err(error) => Reply::Refused {
                            key: String::new(),
                            reason: error.to_string(),
                        },
                    }
                }
                other => {
                    *stage = other;
                    refused("it is not time to connect: configure first")
                }
            },
            Request::Save => match stage {
                Stage::Ready(ready) => Reply::State(ready.stepper.participant().save()),
                _ => refused("it has no state yet: connect first"),
            },
            Request::Restore { .. } => refused("states are restored only before a run"),
            Request::Terminate => {
                *stage = Stage::Leaving;
                Reply::Done
            }
        })?;
        Ok(served)
    }

    /// Steps until `horizon`, the end, or the stop flag.
    fn advance(&mut self, horizon: Ticks) -> Result<Pause, HostError> {
        let Stage::Ready(ready) = &mut self.stage else {
            return Ok(Pause::Stopped);
        };
        let result = ready.advance(horizon, &mut self.status, &mut self.sleeper);
        if let Err(error) = &result {
            // What was complete reaches the tape, and the orchestrator learns the reason in the participant's own words.
            let stepper = &ready.stepper;
            let (t, activation) = (stepper.next_seconds(), stepper.next_activation());
            let reason = match error {
                HostError::Step { source, .. } => source.to_string(),
                other => other.to_string(),
            };
            let note = Note::Failed {
                activation,
                t: t.to_string(),
                reason,
            };
            ready.hand_over(&note, &mut self.sleeper)?;
        }
        result
    }
}

fn refused(reason: &str) -> Reply {
    Reply::Refused {
        key: String::new(),
        reason: reason.to_owned(),
    }
}

fn configure(
    factory: Factory,
    name: String,
    parameters: &str,
    seed: u64,
    period: f64,
    offset: f64,
) -> Result<Box<dyn Participant>, (String, String)> {
    let parameters = parameters
        .parse::<toml::Table>()
        .map_err(|error| (String::new(), error.to_string()))?;
    let setup = Setup {
        name,
        parameters,
        seed,
        period,
        offset,
    };
    catch_unwind(|| factory(&setup))
        .map_err(|panic| (String::new(), format!("it panicked: {}", message(&*panic))))?
        .map_err(|error| (error.key, error.reason))
}

fn connect(
    domain: &Domain,
    name: &str,
    participant: Box<dyn Participant>,
    assignment: Assignment,
    cores: &[u32],
    waiting: Waiting,
) -> Result<Ready, DomainError> {
    if !cores.is_empty() {
        let mut set = rustix::thread::CpuSet::new();
        cores.iter().for_each(|&core| set.set(core as usize));
        // A hint: without it the run is slower, not different.
        let _ = rustix::thread::sched_setaffinity(None, &set);
    }
    let mut links = Vec::new();
    let mut ends = Ends {
        receivers: Vec::new(),
        senders: Vec::new(),
        recording: Box::new(crate::transport::NoRecording),
    };
    let mut neighbours = Vec::<(String, Waker)>::new();
    let mut meet = |port: &str| -> Result<(), DomainError> {
        let neighbour = port.split('.').next().unwrap_or(port);
        if neighbour != name && !neighbours.iter().any(|(known, _)| known == neighbour) {
            neighbours.push((neighbour.to_owned(), Waker::open(domain, neighbour)?));
        }
        Ok(())
    };
    for (link, port) in assignment.inputs.iter().zip(&assignment.interface.inputs) {
        let mut receiver = None;
        if let Some(link) = link {
            let service = LinkService::open(domain, link.link, port.descriptor.size as usize, link.capacity as usize)?;
            receiver = Some(Box::new(service.receiver(domain)?) as Box<dyn Receiver>);
            meet(&link.from)?;
            links.push(service);
        }
        ends.receivers.push(receiver);
    }
    for (output, port) in assignment.outputs.iter().zip(&assignment.interface.outputs) {
        let mut senders = Vec::new();
        for to in &output.consumers {
            let service = LinkService::open(domain, to.link, port.descriptor.size as usize, to.capacity as usize)?;
            senders.push(Box::new(service.sender(domain)?) as Box<dyn Sender>);
            links.push(service);
            meet(&to.to)?;
        }
        ends.senders.push(senders);
    }
    let sizes = assignment
        .interface
        .outputs
        .iter()
        .map(|port| port.descriptor.size as usize);
    let payload_max = sizes.max().unwrap_or(0);
    let record = SharedRecord(Rc::new(RefCell::new(RecordSender::open(domain, name, payload_max)?)));
    ends.recording = Box::new(record.clone());
    let timing = Timing {
        inputs_ns: vec![0; assignment.inputs.len()],
        ..Timing::default()
    };
    Ok(Ready {
        stepper: Stepper::new(participant, assignment, ends),
        clock: ClockReader::open(domain)?,
        record,
        neighbours: neighbours.into_iter().map(|(_, waker)| waker).collect(),
        patience: Patience::new(waiting),
        timing,
        _links: links,
    })
}

impl Ready {
    fn advance(
        &mut self,
        horizon: Ticks,
        status: &mut StatusWriter,
        sleeper: &mut Sleeper,
    ) -> Result<Pause, HostError> {
        let started = Instant::now();
        let count = self.stepper.assignment().activations;
        self.stepper.extend_horizon(horizon);
        let mut waiting: Option<(Wait, Instant)> = None;
        status.set(Status {
            next: self.stepper.next_activation(),
            activity: Activity::Computing,
        });
        loop {
            let (activation, t) = (self.stepper.next_activation(), self.stepper.next_seconds());
            let progress = match catch_unwind(AssertUnwindSafe(|| self.stepper.poll())) {
                Ok(progress) => progress.map_err(|source| HostError::Step { activation, t, source })?,
                Err(panic) => {
                    return Err(HostError::Panic {
                        activation,
                        t,
                        message: message(&*panic),
                    });
                }
            };
            if let Progress::Waiting(wait) = progress {
                if waiting.is_none_or(|(known, _)| known != wait) {
                    if let Some((known, since)) = waiting.replace((wait, Instant::now())) {
                        self.account(known, since);
                    }
                    // Whoever is waited for may itself sleep until it hears of what this participant has taken or given.
                    // Once is enough: who falls asleep later looks again first.
                    self.neighbours.iter().for_each(Waker::wake);
                }
                if self.patience.is_long() {
                    status.set(Status {
                        next: activation,
                        activity: activity(wait),
                    });
                    if self.clock.stopped() {
                        return Ok(Pause::Stopped);
                    }
                }
                self.patience.pause(status, sleeper)?;
                continue;
            }
            if let Some((wait, since)) = waiting.take() {
                self.account(wait, since);
                self.patience.rest(status);
            }
            match progress {
                Progress::Stepped => {
                    self.neighbours.iter().for_each(Waker::wake);
                    status.set(Status {
                        next: activation + 1,
                        activity: Activity::Computing,
                    });
                    if activation % 256 == 255 && self.clock.stopped() {
                        return Ok(Pause::Stopped);
                    }
                }
                Progress::AtHorizon => {
                    self.timing.total_ns += started.elapsed().as_nanos() as u64;
                    self.neighbours.iter().for_each(Waker::wake);
                    status.set(Status {
                        next: activation,
                        activity: Activity::Rest,
                    });
                    self.hand_over(
                        &Note::AtRest {
                            horizon,
                            next: activation,
                        },
                        sleeper,
                    )?;
                    return Ok(Pause::AtHorizon(horizon));
                }
                Progress::Finished => {
                    self.timing.total_ns += started.elapsed().as_nanos() as u64;
                    self.timing.sleeps = self.patience.sleeps;
                    self.neighbours.iter().for_each(Waker::wake);
                    status.set(Status {
                        next: count,
                        activity: Activity::Finished,
                    });
                    self.hand_over(&Note::Finished(self.timing.clone()), sleeper)?;
                    return Ok(Pause::Finished);
                }
                Progress::Waiting(_) => {}
            }
        }
    }

    fn account(&mut self, wait: Wait, since: Instant) {
        let nanos = since.elapsed().as_nanos() as u64;
        match wait {
            Wait::Sample { input, .. } => self.timing.inputs_ns[input] += nanos,
            Wait::Room { .. } => self.timing.room_ns += nanos,
            Wait::Recording => self.timing.recorder_ns += nanos,
        }
    }

    /// Sends a note to the recorder, behind all samples.
    fn hand_over(&mut self, note: &Note, sleeper: &mut Sleeper) -> Result<(), Broken> {
        use crate::transport::Recording;
        let mut noted = false;
        loop {
            noted = noted || self.record.0.borrow_mut().note(note)?;
            if noted && self.record.try_flush()? {
                break;
            }
            if self.clock.stopped() {
                break;
            }
            sleeper.sleep(std::time::Duration::from_millis(1))?;
        }
        Ok(())
    }
}

fn activity(wait: Wait) -> Activity {
    match wait {
        Wait::Sample { input, index } => Activity::Input {
            input: input as u32,
            index,
        },
        Wait::Room { output, consumer } => Activity::Room {
            output: output as u32,
            consumer: consumer as u32,
        },
        Wait::Recording => Activity::Recorder,
    }
}

fn message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a message".to_owned())
}
