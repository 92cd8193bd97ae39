//! Requests of the orchestrator to a participant: hello, parameters, connection, state, move.

use std::borrow::Borrow;

use lockstep::control::{PROTOCOL, Reply, Request};
use lockstep::participant::Interface;
use lockstep::plan::{Assignment, Plan, Position};

use super::monitor::Monitor;
use super::participants::{ParticipantHandle, foreign_writer_reason, request_all};
use super::placement::Placement;
use crate::run::outcome::RunFailure;
use crate::run::saved::checkpoint::{cannot_save, save_failed};
use crate::scenario::{Entry, Scenario};
use crate::text::quoted;

const HELLO: Request = Request::Hello { protocol: PROTOCOL };

/// Sends the hello request.
pub(crate) fn send_hello(handle: &mut ParticipantHandle, monitor: &Monitor) -> Result<(), RunFailure> {
    let reply = handle.request(&HELLO, monitor)?;
    check_hello_reply(handle, reply)
}

fn check_hello_reply(handle: &ParticipantHandle, reply: Reply) -> Result<(), RunFailure> {
    match reply {
        Reply::Hello { protocol: PROTOCOL, .. } => Ok(()),
        Reply::Hello { protocol, program } => Err(handle.participant_failure(format!(
            "`{program}` speaks version {protocol} of the protocol; this orchestrator speaks {PROTOCOL}"
        ))),
        other => Err(handle.participant_failure(format!("sent an unexpected reply to Hello: {other:?}"))),
    }
}

/// Hello and parameters: the participant describes its ports, which must match those that are `known`, if any are.
pub(crate) fn handshake_one(
    scenario: &Scenario,
    entry: &Entry,
    known: Option<&Interface>,
    handle: &mut ParticipantHandle,
    monitor: &Monitor,
) -> Result<Interface, RunFailure> {
    send_hello(handle, monitor)?;
    let reply = handle.request(&configure_request(entry), monitor)?;
    interface_from_reply(scenario, entry, known, handle, reply)
}

/// [`handshake_one`] for all of `handles`: the participants build their models at the same time.
pub(crate) fn handshake_all(
    scenario: &Scenario,
    entries: &[impl Borrow<Entry>],
    known: &[Option<&Interface>],
    handles: &mut [ParticipantHandle],
    monitor: &Monitor,
) -> Result<Vec<Interface>, RunFailure> {
    request_all(
        handles,
        |_| HELLO,
        monitor,
        |_, handle, reply| check_hello_reply(handle, reply),
    )?;
    let mut interfaces = Vec::with_capacity(handles.len());
    let configure = |number: usize| configure_request(entries[number].borrow());
    request_all(handles, configure, monitor, |number, handle, reply| {
        let known = known.get(number).copied().flatten();
        interfaces.push(interface_from_reply(
            scenario,
            entries[number].borrow(),
            known,
            handle,
            reply,
        )?);
        Ok(())
    })?;
    Ok(interfaces)
}

fn configure_request(entry: &Entry) -> Request {
    let setup = &entry.setup;
    Request::Configure {
        name: setup.name.clone(),
        parameters: setup.parameters.to_string(),
        seed: setup.seed,
        period: setup.period,
        offset: setup.offset,
    }
}

/// The ports in the reply to the parameters.
fn interface_from_reply(
    scenario: &Scenario,
    entry: &Entry,
    known: Option<&Interface>,
    handle: &ParticipantHandle,
    reply: Reply,
) -> Result<Interface, RunFailure> {
    let interface = match reply {
        Reply::Described { interface } => interface,
        Reply::Refused { key, reason } => {
            let refusal = scenario.refusal(entry, &quoted(&key), &quoted(&reason));
            return Err(refusal.into());
        }
        other => return Err(handle.participant_failure(format!("answered its parameters with {other:?}"))),
    };
    interface
        .validate()
        .map_err(|error| handle.participant_failure(format!("describes invalid ports: {error}")))?;
    if let Some(difference) = known.and_then(|known| interface.difference(known)) {
        return Err(handle.participant_failure(format!("describes other ports than expected: {difference}")));
    }
    Ok(interface)
}

/// What participants receive in the connection request besides their parts of the plan.
pub(crate) struct Connector<'a> {
    pub(crate) placement: &'a Placement,
    /// The size of the ring of each record, bytes.
    pub(crate) rings: &'a [u32],
    pub(crate) monitor: &'a Monitor,
}

impl Connector<'_> {
    /// The request that gives participant number `number` its part of the plan, its cores, and its position; `None` at the start of
    /// a run.
    fn request(&self, number: usize, assignment: Assignment, position: Option<Position>) -> Request {
        Request::Connect {
            assignment,
            cores: self.placement.cores[number].iter().map(|&core| core as u32).collect(),
            waiting: self.placement.waiting[number],
            record: self.rings[number],
            position: position.map(Box::new),
        }
    }

    /// Connects participant number `number`.
    pub(crate) fn connect_one(
        &self,
        number: usize,
        handle: &mut ParticipantHandle,
        assignment: Assignment,
        position: Option<Position>,
    ) -> Result<(), RunFailure> {
        let reply = handle.request(&self.request(number, assignment, position), self.monitor)?;
        self.check_connect_reply(handle, reply)
    }

    /// Connects all of `handles` at the same time.
    pub(crate) fn connect_all(
        &self,
        handles: &mut [ParticipantHandle],
        plan: &Plan,
        positions: Option<&[Position]>,
    ) -> Result<(), RunFailure> {
        let mut assignments = plan.assignments();
        let request = |number: usize| {
            let assignment = assignments.next().expect("the plan has every participant");
            self.request(number, assignment, positions.map(|all| all[number].clone()))
        };
        request_all(handles, request, self.monitor, |_, handle, reply| {
            self.check_connect_reply(handle, reply)
        })
    }

    fn check_connect_reply(&self, handle: &mut ParticipantHandle, reply: Reply) -> Result<(), RunFailure> {
        let failure = match reply {
            // Everything it records from now on reaches the recorder, even if the participant exits at once.
            Reply::Done => match handle.ports.record.take_memory() {
                Ok(true) => return super::run_services::check_pages(),
                Ok(false) => "has connected without sending the memory of its record".to_owned(),
                Err(broken) => format!("its record cannot be received: {broken}"),
            },
            Reply::Refused { reason, .. } => format!("cannot connect: {reason}"),
            other => format!("answered its part of the plan with {other:?}"),
        };
        match handle.foreign_writer(self.monitor.participants()) {
            Some((author, process)) => Err(RunFailure::Participant {
                participant: author.to_owned(),
                reason: quoted(&foreign_writer_reason(&handle.process.name, process, &failure)),
            }),
            None => Err(handle.participant_failure(failure)),
        }
    }
}

/// Asks a paused participant to go to `address` when the clock commands to terminate.
pub(crate) fn request_move(handle: &mut ParticipantHandle, address: &str, monitor: &Monitor) -> Result<(), RunFailure> {
    let address = address.to_owned();
    match handle.request(&Request::Move { address }, monitor)? {
        Reply::Done => Ok(()),
        Reply::Refused { reason, .. } => {
            Err(handle.participant_failure(format!("cannot take part in a substitution or a restart: {reason}")))
        }
        other => Err(handle.participant_failure(format!("answered the request to move with {other:?}"))),
    }
}

/// Notifies a paused participant that it is being replaced, if its process still exists. Its reply does not matter.
pub(crate) fn notify_replaced(handle: &mut ParticipantHandle, monitor: &Monitor) {
    if handle.process.exit_status().is_none() {
        let address = String::new();
        let _ = handle.request(&Request::Move { address }, monitor);
    }
}

/// The state of a paused participant.
pub(crate) fn save(handle: &mut ParticipantHandle, monitor: &Monitor) -> Result<Vec<u8>, RunFailure> {
    match handle.request(&Request::Save, monitor)? {
        Reply::State(Some(state)) => Ok(state),
        Reply::State(None) => Err(handle.participant_failure(cannot_save())),
        Reply::Refused { reason, .. } => Err(handle.participant_failure(save_failed(&reason))),
        other => Err(handle.participant_failure(format!("answered the request for its state with {other:?}"))),
    }
}
