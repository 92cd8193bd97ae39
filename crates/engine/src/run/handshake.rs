//! Requests of the orchestrator to a participant: hello, parameters, connection, state, move.

use std::borrow::Borrow;

use lockstep::control::{PROTOCOL, Reply, Request};
use lockstep::participant::Interface;
use lockstep::plan::{Assignment, Plan, Position};

use super::checkpoint::CANNOT_SAVE;
use super::crew::{Member, ask_all, foreign_writer_reason};
use super::monitor::Monitor;
use super::outcome::RunFailure;
use super::placement::Placement;
use crate::scenario::{Entry, Scenario};
use crate::text::quoted;

const HELLO: Request = Request::Hello { protocol: PROTOCOL };

/// Sends the hello request.
pub(super) fn greet(member: &mut Member, monitor: &Monitor) -> Result<(), RunFailure> {
    let reply = member.ask(&HELLO, monitor)?;
    greeted(member, reply)
}

fn greeted(member: &Member, reply: Reply) -> Result<(), RunFailure> {
    match reply {
        Reply::Hello { protocol: PROTOCOL, .. } => Ok(()),
        Reply::Hello { protocol, program } => Err(member.odd(format!(
            "`{program}` speaks version {protocol} of the protocol; this orchestrator speaks {PROTOCOL}"
        ))),
        other => Err(member.odd(format!("answered the greeting with {other:?}"))),
    }
}

/// Hello and parameters: the participant describes its ports, which must match those that are `known`, if any are.
pub(super) fn introduce(
    scenario: &Scenario,
    entry: &Entry,
    known: Option<&Interface>,
    member: &mut Member,
    monitor: &Monitor,
) -> Result<Interface, RunFailure> {
    greet(member, monitor)?;
    let reply = member.ask(&configuration(entry), monitor)?;
    described(scenario, entry, known, member, reply)
}

/// [`introduce`] for all of `crew`: the participants build their models at the same time.
pub(super) fn introduce_all(
    scenario: &Scenario,
    entries: &[impl Borrow<Entry>],
    known: &[Option<&Interface>],
    crew: &mut [Member],
    monitor: &Monitor,
) -> Result<Vec<Interface>, RunFailure> {
    ask_all(crew, |_| HELLO, monitor, |_, member, reply| greeted(member, reply))?;
    let mut interfaces = Vec::with_capacity(crew.len());
    let configure = |number: usize| configuration(entries[number].borrow());
    ask_all(crew, configure, monitor, |number, member, reply| {
        let known = known.get(number).copied().flatten();
        interfaces.push(described(scenario, entries[number].borrow(), known, member, reply)?);
        Ok(())
    })?;
    Ok(interfaces)
}

fn configuration(entry: &Entry) -> Request {
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
fn described(
    scenario: &Scenario,
    entry: &Entry,
    known: Option<&Interface>,
    member: &Member,
    reply: Reply,
) -> Result<Interface, RunFailure> {
    let interface = match reply {
        Reply::Described { interface } => interface,
        Reply::Refused { key, reason } => {
            let refusal = scenario.refusal(entry, &quoted(&key), &quoted(&reason));
            return Err(refusal.into());
        }
        other => return Err(member.odd(format!("answered its parameters with {other:?}"))),
    };
    interface
        .validate()
        .map_err(|error| member.odd(format!("describes ports that cannot be: {error}")))?;
    if let Some(text) = control_text(&interface) {
        return Err(member.odd(format!(
            "describes ports that cannot be: a name, unit or frame has a control character in it: {text}"
        )));
    }
    if let Some(difference) = known.and_then(|known| interface.difference(known)) {
        return Err(member.odd(format!("describes other ports than expected: {difference}")));
    }
    Ok(interface)
}

/// The first name, unit or frame with a control character. They appear in messages, file names and pages.
fn control_text(interface: &Interface) -> Option<&str> {
    let inputs = interface.inputs.iter().map(|port| &port.descriptor);
    let mut all = inputs.chain(interface.outputs.iter().map(|port| &port.descriptor));
    all.find_map(|descriptor| {
        let fields = descriptor.fields.iter();
        let mut texts =
            std::iter::once(&descriptor.name).chain(fields.flat_map(|field| [&field.name, &field.unit, &field.frame]));
        texts.find(|text| quoted(text) != **text).map(String::as_str)
    })
}

/// What participants receive in the connection request besides their parts of the plan.
pub(super) struct Connecting<'a> {
    pub(super) placement: &'a Placement,
    /// The size of the ring of each record, bytes.
    pub(super) rings: &'a [u32],
    pub(super) monitor: &'a Monitor,
}

impl Connecting<'_> {
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
    pub(super) fn one(
        &self,
        number: usize,
        member: &mut Member,
        assignment: Assignment,
        position: Option<Position>,
    ) -> Result<(), RunFailure> {
        let reply = member.ask(&self.request(number, assignment, position), self.monitor)?;
        self.connected(member, reply)
    }

    /// Connects all of `crew` at the same time.
    pub(super) fn all(
        &self,
        crew: &mut [Member],
        plan: &Plan,
        positions: Option<&[Position]>,
    ) -> Result<(), RunFailure> {
        let mut assignments = plan.assignments();
        let request = |number: usize| {
            let assignment = assignments.next().expect("the plan has every participant");
            self.request(number, assignment, positions.map(|all| all[number].clone()))
        };
        ask_all(crew, request, self.monitor, |_, member, reply| {
            self.connected(member, reply)
        })
    }

    fn connected(&self, member: &mut Member, reply: Reply) -> Result<(), RunFailure> {
        let failure = match reply {
            // Everything it records from now on reaches the recorder, even if the participant exits at once.
            Reply::Done => match member.ports.record.take_memory() {
                Ok(true) => return super::place::all_there(),
                Ok(false) => "has connected without sending the memory of its record".to_owned(),
                Err(broken) => format!("its record cannot be received: {broken}"),
            },
            Reply::Refused { reason, .. } => format!("cannot connect: {reason}"),
            other => format!("answered its part of the plan with {other:?}"),
        };
        match member.foreign_writer(self.monitor.all()) {
            Some((author, process)) => Err(RunFailure::Participant {
                participant: author.to_owned(),
                reason: quoted(&foreign_writer_reason(&member.process.name, process, &failure)),
            }),
            None => Err(member.odd(failure)),
        }
    }
}

/// Asks a participant at rest to go to `address` when the clock gives the order to leave.
pub(super) fn send_to(member: &mut Member, address: &str, monitor: &Monitor) -> Result<(), RunFailure> {
    let address = address.to_owned();
    match member.ask(&Request::Move { address }, monitor)? {
        Reply::Done => Ok(()),
        Reply::Refused { reason, .. } => {
            Err(member.odd(format!("cannot take part in a substitution or a restart: {reason}")))
        }
        other => Err(member.odd(format!("answered the request to move with {other:?}"))),
    }
}

/// Tells a participant at rest that it is being replaced, if its process still exists. Its reply does not matter.
pub(super) fn tell_replaced(member: &mut Member, monitor: &Monitor) {
    if member.process.ended().is_none() {
        let address = String::new();
        let _ = member.ask(&Request::Move { address }, monitor);
    }
}

/// The state of a participant at rest.
pub(super) fn save(member: &mut Member, monitor: &Monitor) -> Result<Vec<u8>, RunFailure> {
    match member.ask(&Request::Save, monitor)? {
        Reply::State(Some(state)) => Ok(state),
        Reply::State(None) => Err(member.odd(CANNOT_SAVE)),
        Reply::Refused { reason, .. } => Err(member.odd(format!("cannot save its state: {reason}"))),
        other => Err(member.odd(format!("answered the request for its state with {other:?}"))),
    }
}
