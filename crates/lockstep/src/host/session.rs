//! One participant's session: it serves requests while the participant is paused, and steps otherwise.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use super::HostError;
use super::connected::{AdvanceOutcome, ConnectedParticipant, connect};
use super::spans::Spans;
use crate::control::{PROTOCOL, ParticipantEvent, Reply, Request, WaitStrategy, WallTimeBreakdown};
use crate::panic::message;
use crate::participant::{Factory, Log, Participant, Setup, Termination, state};
use crate::plan::{Assignment, Position};
use crate::span::Detail;
use crate::stepper::{prepare_to_resume, terminate};
use crate::time::Ticks;
use crate::transport::iceoryx::{Address, Command, ControlServer, Domain, Sleeper, StatusWriter};

/// The state of a session that is independent of its address in shared memory.
pub(super) struct SessionState {
    name: String,
    program: String,
    factory: Factory,
    stage: Stage,
    timing: WallTimeBreakdown,
    /// The requested detail of spans, if any.
    spans: Option<Detail>,
    /// Whether another participant replaces this one.
    replaced: bool,
}

/// The participant's progress through the orchestrator's requests.
enum Stage {
    Unconfigured,
    /// Created, or moved here with its state (`initialised`).
    Configured {
        participant: Box<dyn Participant>,
        initialised: bool,
    },
    Connected(Box<ConnectedParticipant>),
    Terminating,
}

impl SessionState {
    pub(super) fn new(name: &str, program: &str, factory: Factory, spans: Option<Detail>) -> SessionState {
        SessionState {
            name: name.to_owned(),
            program: program.to_owned(),
            factory,
            stage: Stage::Unconfigured,
            timing: WallTimeBreakdown::default(),
            spans,
            replaced: false,
        }
    }
}

impl Drop for SessionState {
    fn drop(&mut self) {
        if let Stage::Configured {
            participant,
            initialised: true,
        } = &mut self.stage
        {
            // The participant was moving to another address, and the move failed.
            terminate(participant.as_mut(), Termination::Stopped, &Log::new(&self.name, None));
        }
    }
}

/// A participant's session at one address in shared memory.
pub(super) struct Session {
    domain: Domain,
    control: ControlServer,
    status: StatusWriter,
    sleeper: Sleeper,
    state: SessionState,
    /// The address to go to when the clock commands to terminate; `None` when it is not known.
    destination: Option<Address>,
}

impl Session {
    pub(super) fn open(address: Address, state: SessionState) -> Result<Session, HostError> {
        let domain = Domain::join(address, &state.name)?;
        let status = StatusWriter::open(&domain, &state.name)?;
        let sleeper = Sleeper::open(&domain, &state.name)?;
        // The server comes last: the orchestrator sends requests as soon as it is present.
        let control = ControlServer::open(&domain, &state.name)?;
        Ok(Session {
            domain,
            control,
            status,
            sleeper,
            state,
            destination: None,
        })
    }

    /// Serves requests and steps until ordered to leave. Returns the address to go to, if there is one, and the state that moves there.
    pub(super) fn run(mut self) -> Result<(Option<Address>, SessionState), HostError> {
        let mut paused_at = None;
        let mut paused = false;
        loop {
            match &mut self.state.stage {
                Stage::Terminating => return Ok((None, self.state)),
                Stage::Unconfigured | Stage::Configured { .. } => {
                    if !self.serve()? {
                        self.sleeper.sleep(Duration::from_millis(1))?;
                    }
                }
                Stage::Connected(connected) => {
                    let horizon = connected.clock.horizon();
                    match connected.clock.command() {
                        Command::Terminate => return Ok(self.detach()),
                        Command::Pause if !paused => {
                            let result = connected.pause(&mut self.status, &mut self.sleeper);
                            self.report_failure(result)?;
                            paused = true;
                            continue;
                        }
                        Command::Pause | Command::Run => {}
                    }
                    if paused || horizon == Ticks::MIN || paused_at == Some(horizon) {
                        let since = Instant::now();
                        connected.backoff.sleep(&mut self.sleeper)?;
                        connected.timing.horizon_ns += since.elapsed().as_nanos() as u64;
                        self.serve()?;
                        continue;
                    }
                    let result = connected.advance(horizon, &mut self.status, &mut self.sleeper);
                    match self.report_failure(result)? {
                        AdvanceOutcome::AtHorizon(horizon) => paused_at = Some(horizon),
                        // Keeps serving requests (such as saving a last state) until the command or the request to terminate.
                        AdvanceOutcome::Finished => paused_at = Some(horizon),
                        AdvanceOutcome::Commanded => {}
                    }
                }
            }
        }
    }

    /// Detaches the participant from its links, for a move to the next address or for good.
    fn detach(self) -> (Option<Address>, SessionState) {
        let mut state = self.state;
        if let Stage::Connected(mut connected) = std::mem::replace(&mut state.stage, Stage::Terminating) {
            if self.destination.is_some() {
                state.timing = connected.timing;
                state.stage = Stage::Configured {
                    participant: connected.stepper.into_participant(),
                    initialised: true,
                };
            } else if state.replaced {
                connected.stepper.terminate(Termination::Replaced);
            } else {
                // The run is over, and this process with it. Its exit closes everything at once, and the orchestrator removes the
                // files of the run. To close each end here takes longer, and the orchestrator waits for it.
                connected.leave_open();
                std::mem::forget((self.control, self.sleeper, self.status, self.domain));
            }
        }
        (self.destination, state)
    }

    /// Answers one request; returns whether there was one.
    fn serve(&mut self) -> Result<bool, HostError> {
        let Session {
            domain,
            control,
            state,
            destination,
            ..
        } = self;
        let served = control.serve(|request| match request {
            Request::Hello { .. } => Reply::Hello {
                protocol: PROTOCOL,
                program: state.program.clone(),
            },
            Request::Configure {
                name,
                parameters,
                seed,
                period,
                offset,
            } => match configure(&state.factory, name, &parameters, seed, period, offset) {
                Ok(participant) => {
                    let interface = participant.interface();
                    let initialised = false;
                    state.stage = Stage::Configured {
                        participant,
                        initialised,
                    };
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
            } => state.connect(
                domain,
                assignment,
                &cores,
                waiting,
                record,
                position.map(|boxed| *boxed),
            ),
            Request::Save => match &state.stage {
                Stage::Connected(connected) => save_reply(connected.stepper.participant()),
                _ => refusal("it has no state yet: connect first"),
            },
            Request::Move { address } if address.is_empty() && matches!(state.stage, Stage::Connected(_)) => {
                state.replaced = true;
                Reply::Done
            }
            Request::Move { address } => match (&state.stage, address.parse()) {
                (Stage::Connected(_), Ok(address)) => {
                    *destination = Some(address);
                    Reply::Done
                }
                (_, Err(error)) => refusal(&error.to_string()),
                _ => refusal("it is nowhere yet: connect first"),
            },
            Request::Terminate => {
                state.stage = Stage::Terminating;
                Reply::Done
            }
        })?;
        Ok(served)
    }

    /// If `result` is a failure, ensures that what was complete reaches the tape and that the orchestrator receives the participant's own
    /// reason.
    fn report_failure<T>(&mut self, result: Result<T, HostError>) -> Result<T, HostError> {
        if let (Err(error), Stage::Connected(connected)) = (&result, &mut self.state.stage) {
            let stepper = &connected.stepper;
            let (t, activation) = (stepper.next_seconds(), stepper.next_activation());
            let reason = match error {
                HostError::Step { source, .. } => source.to_string(),
                other => other.to_string(),
            };
            connected.send_all_spans(&mut self.sleeper)?;
            let event = ParticipantEvent::Failed {
                activation,
                t: t.to_string(),
                reason,
            };
            connected.send_event(&event, &mut self.sleeper)?;
        }
        result
    }
}

impl SessionState {
    fn connect(
        &mut self,
        domain: &Domain,
        assignment: Assignment,
        cores: &[u32],
        waiting: WaitStrategy,
        record: u32,
        mut position: Option<Position>,
    ) -> Reply {
        let Stage::Configured {
            participant,
            initialised,
        } = &mut self.stage
        else {
            return refusal("it is not time to connect: configure first");
        };
        match &mut position {
            None if *initialised => {
                return refusal("it has already been initialised, so a position to continue from is required");
            }
            None => {}
            Some(position) => {
                let instant = assignment.sample_time.instant(position.next);
                let t = assignment.timebase.seconds(instant);
                let state = position.state.take();
                let log = Log::new(&self.name, None);
                if let Err(error) = prepare_to_resume(participant.as_mut(), t, !*initialised, state.as_deref(), &log) {
                    return refusal(&error.to_string());
                }
                // The participant is initialised now.
                *initialised = true;
            }
        }
        let Stage::Configured { participant, .. } = std::mem::replace(&mut self.stage, Stage::Unconfigured) else {
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
            Ok(mut connected) => {
                if self.timing.inputs_ns.len() == inputs {
                    connected.timing = std::mem::take(&mut self.timing);
                }
                connected.spans = self.spans.map(Spans::new);
                self.stage = Stage::Connected(Box::new(connected));
                Reply::Done
            }
            Err(error) => refusal(&error.to_string()),
        }
    }
}

fn save_reply(participant: &dyn Participant) -> Reply {
    match catch_unwind(AssertUnwindSafe(|| state::of(participant))) {
        Ok(Ok(state)) => Reply::State(state),
        Ok(Err(reason)) => refusal(&reason),
        Err(panic) => refusal(&format!("it panicked: {}", message(&*panic))),
    }
}

fn refusal(reason: &str) -> Reply {
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
