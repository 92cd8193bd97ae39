//! One participant's session: it serves requests while the participant is at rest, and steps otherwise.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use super::HostError;
use super::ready::{Pause, Ready, connect};
use super::spans::Spans;
use crate::control::{PROTOCOL, ParticipantEvent, Reply, Request, Timing, Waiting};
use crate::panic::message;
use crate::participant::{Factory, Log, Participant, Setup, Termination, state};
use crate::plan::{Assignment, Position};
use crate::span::Detail;
use crate::stepper::{settle, terminate};
use crate::time::Ticks;
use crate::transport::iceoryx::{Address, Command, ControlServer, Domain, Sleeper, StatusWriter};

/// The state of a session that is independent of its address in shared memory.
pub(super) struct Seat {
    name: String,
    program: String,
    factory: Factory,
    stage: Stage,
    timing: Timing,
    /// The requested detail of spans, if any.
    spans: Option<Detail>,
    /// Whether another participant replaces this one.
    replaced: bool,
}

/// The participant's progress through the orchestrator's requests.
enum Stage {
    Unknown,
    /// Created, or moved here with its state (`worked`).
    Described {
        participant: Box<dyn Participant>,
        worked: bool,
    },
    Ready(Box<Ready>),
    Leaving,
}

impl Seat {
    pub(super) fn empty(name: &str, program: &str, factory: Factory, spans: Option<Detail>) -> Seat {
        Seat {
            name: name.to_owned(),
            program: program.to_owned(),
            factory,
            stage: Stage::Unknown,
            timing: Timing::default(),
            spans,
            replaced: false,
        }
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        if let Stage::Described {
            participant,
            worked: true,
        } = &mut self.stage
        {
            // It was moving to another address, and has not arrived.
            terminate(participant.as_mut(), Termination::Stopped, &Log::new(&self.name, None));
        }
    }
}

/// A seat at one address in shared memory.
pub(super) struct Session {
    domain: Domain,
    control: ControlServer,
    status: StatusWriter,
    sleeper: Sleeper,
    seat: Seat,
    /// The address to go to when the clock commands to terminate; `None` when it is not known.
    destination: Option<Address>,
}

impl Session {
    pub(super) fn open(address: Address, seat: Seat) -> Result<Session, HostError> {
        let domain = Domain::join(address, &seat.name)?;
        let status = StatusWriter::open(&domain, &seat.name)?;
        let sleeper = Sleeper::open(&domain, &seat.name)?;
        // The server comes last: the orchestrator sends requests as soon as it is present.
        let control = ControlServer::open(&domain, &seat.name)?;
        Ok(Session {
            domain,
            control,
            status,
            sleeper,
            seat,
            destination: None,
        })
    }

    /// Serves requests and steps until ordered to leave. Returns the address to go to, if there is one, and the seat that moves there.
    pub(super) fn run(mut self) -> Result<(Option<Address>, Seat), HostError> {
        let mut rested_at = None;
        let mut recalled = false;
        loop {
            match &mut self.seat.stage {
                Stage::Leaving => return Ok((None, self.seat)),
                Stage::Unknown | Stage::Described { .. } => {
                    if !self.serve()? {
                        self.sleeper.sleep(Duration::from_millis(1))?;
                    }
                }
                Stage::Ready(ready) => {
                    let horizon = ready.clock.horizon();
                    match ready.clock.command() {
                        Command::Terminate => return Ok(self.leave()),
                        Command::Pause if !recalled => {
                            let result = ready.recall(&mut self.status, &mut self.sleeper);
                            self.explain(result)?;
                            recalled = true;
                            continue;
                        }
                        Command::Pause | Command::Run => {}
                    }
                    if recalled || horizon == Ticks::MIN || rested_at == Some(horizon) {
                        let since = Instant::now();
                        ready.patience.sleep(&mut self.sleeper)?;
                        ready.timing.horizon_ns += since.elapsed().as_nanos() as u64;
                        self.serve()?;
                        continue;
                    }
                    let result = ready.advance(horizon, &mut self.status, &mut self.sleeper);
                    match self.explain(result)? {
                        Pause::AtHorizon(horizon) => rested_at = Some(horizon),
                        // Keeps serving requests (such as saving a last state) until the command or the request to terminate.
                        Pause::Finished => rested_at = Some(horizon),
                        Pause::Commanded => {}
                    }
                }
            }
        }
    }

    /// Takes the participant out of its links, for the address where it goes next.
    fn leave(self) -> (Option<Address>, Seat) {
        let mut seat = self.seat;
        if let Stage::Ready(mut ready) = std::mem::replace(&mut seat.stage, Stage::Leaving) {
            if self.destination.is_some() {
                seat.timing = ready.timing;
                seat.stage = Stage::Described {
                    participant: ready.stepper.into_participant(),
                    worked: true,
                };
            } else if seat.replaced {
                ready.stepper.terminate(Termination::Replaced);
            }
        }
        (self.destination, seat)
    }

    /// Answers one request; returns whether there was one.
    fn serve(&mut self) -> Result<bool, HostError> {
        let Session {
            domain,
            control,
            seat,
            destination,
            ..
        } = self;
        let served = control.serve(|request| match request {
            Request::Hello { .. } => Reply::Hello {
                protocol: PROTOCOL,
                program: seat.program.clone(),
            },
            Request::Configure {
                name,
                parameters,
                seed,
                period,
                offset,
            } => match configure(&seat.factory, name, &parameters, seed, period, offset) {
                Ok(participant) => {
                    let interface = participant.interface();
                    let worked = false;
                    seat.stage = Stage::Described { participant, worked };
                    Reply::Described { interface }
                }
                Err((key, reason)) => Reply::Refused { key, reason },
            },
            Request::Connect {
                assignment,
                cores,
                waiting,
                record,
                position,
            } => seat.connect(
                domain,
                assignment,
                &cores,
                waiting,
                record,
                position.map(|boxed| *boxed),
            ),
            Request::Save => match &seat.stage {
                Stage::Ready(ready) => saved(ready.stepper.participant()),
                _ => refused("it has no state yet: connect first"),
            },
            Request::Move { address } if address.is_empty() && matches!(seat.stage, Stage::Ready(_)) => {
                seat.replaced = true;
                Reply::Done
            }
            Request::Move { address } => match (&seat.stage, address.parse()) {
                (Stage::Ready(_), Ok(address)) => {
                    *destination = Some(address);
                    Reply::Done
                }
                (_, Err(error)) => refused(&error.to_string()),
                _ => refused("it is nowhere yet: connect first"),
            },
            Request::Terminate => {
                seat.stage = Stage::Leaving;
                Reply::Done
            }
        })?;
        Ok(served)
    }

    /// If `result` is a failure, ensures that what was complete reaches the tape and that the orchestrator receives the participant's own
    /// reason.
    fn explain<T>(&mut self, result: Result<T, HostError>) -> Result<T, HostError> {
        if let (Err(error), Stage::Ready(ready)) = (&result, &mut self.seat.stage) {
            let stepper = &ready.stepper;
            let (t, activation) = (stepper.next_seconds(), stepper.next_activation());
            let reason = match error {
                HostError::Step { source, .. } => source.to_string(),
                other => other.to_string(),
            };
            ready.hand_over_spans(&mut self.sleeper)?;
            let event = ParticipantEvent::Failed {
                activation,
                t: t.to_string(),
                reason,
            };
            ready.hand_over(&event, &mut self.sleeper)?;
        }
        result
    }
}

impl Seat {
    fn connect(
        &mut self,
        domain: &Domain,
        assignment: Assignment,
        cores: &[u32],
        waiting: Waiting,
        record: u32,
        mut position: Option<Position>,
    ) -> Reply {
        let Stage::Described { participant, worked } = &mut self.stage else {
            return refused("it is not time to connect: configure first");
        };
        match &mut position {
            None if *worked => {
                return refused("it has already been initialised, so a position to continue from is required");
            }
            None => {}
            Some(position) => {
                let instant = assignment.sample_time.instant(position.next);
                let t = assignment.timebase.seconds(instant);
                let state = position.state.take();
                let log = Log::new(&self.name, None);
                if let Err(error) = settle(participant.as_mut(), t, !*worked, state.as_deref(), &log) {
                    return refused(&error.to_string());
                }
                // The participant has begun.
                *worked = true;
            }
        }
        let Stage::Described { participant, .. } = std::mem::replace(&mut self.stage, Stage::Unknown) else {
            unreachable!("looked at above");
        };
        let inputs = assignment.inputs.len();
        match connect(
            domain,
            &self.name,
            participant,
            assignment,
            cores,
            waiting,
            record,
            position,
        ) {
            Ok(mut ready) => {
                if self.timing.inputs_ns.len() == inputs {
                    ready.timing = std::mem::take(&mut self.timing);
                }
                ready.spans = self.spans.map(Spans::new);
                self.stage = Stage::Ready(Box::new(ready));
                Reply::Done
            }
            Err(error) => refused(&error.to_string()),
        }
    }
}

fn saved(participant: &dyn Participant) -> Reply {
    match catch_unwind(AssertUnwindSafe(|| state::of(participant))) {
        Ok(Ok(state)) => Reply::State(state),
        Ok(Err(reason)) => refused(&reason),
        Err(panic) => refused(&format!("it panicked: {}", message(&*panic))),
    }
}

fn refused(reason: &str) -> Reply {
    Reply::Refused {
        key: String::new(),
        reason: reason.to_owned(),
    }
}

fn configure(
    factory: &Factory,
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
    catch_unwind(AssertUnwindSafe(|| factory(&setup)))
        .map_err(|panic| (String::new(), format!("it panicked: {}", message(&*panic))))?
        .map_err(|error| (error.key, error.reason))
}
