//! The participants of a run with everything the orchestrator holds of them.

use std::time::{Duration, Instant};

use lockstep::control::{Note, PROTOCOL, Reply, Request, Timing};
use lockstep::participant::Interface;
use lockstep::plan::{Placement, Plan, Position, place};
use lockstep::time::Ticks;
use lockstep::transport::Broken;
use lockstep::transport::iceoryx::{
    Bell, ControlClient, Domain, DomainError, RecordReceiver, Recorded, Sleeping, StatusReader, StatusService,
    WakeService,
};

use super::Options;
use super::child::Participant;
use super::explain;
use super::outcome::RunFailure;
use super::recording::Recorder;
use crate::observer::Interrupt;
use crate::scenario::{Entry, Scenario};

/// How long a program may take to enter the run, and to answer a request.
pub(super) const PATIENCE: Duration = Duration::from_secs(20);

/// The orchestrator's ends of what belongs to one participant in one place in shared memory. They are there before anybody
/// who opens them.
pub(super) struct Ports {
    status: StatusReader,
    bell: Bell,
    record: RecordReceiver,
    control: ControlClient,
    _services: (StatusService, WakeService),
}

impl Ports {
    /// Makes the services of the participant `name`, one of `count`.
    pub(super) fn create(domain: &Domain, name: &str, count: usize) -> Result<Ports, DomainError> {
        let services = (
            StatusService::create(domain, name, count + 1)?,
            WakeService::create(domain, name, count + 1)?,
        );
        Ok(Ports {
            control: ControlClient::create(domain, name)?,
            record: RecordReceiver::create(domain, name)?,
            status: StatusReader::open(domain, name)?,
            bell: services.1.bell(domain)?,
            _services: services,
        })
    }
}

/// One participant.
pub(super) struct Member {
    pub(super) process: Participant,
    ports: Ports,
    /// Where its time went; known when it is done.
    pub(super) timing: Option<Timing>,
    /// Its own account of why it failed.
    pub(super) failed: Option<Note>,
    at_rest: Option<Ticks>,
    /// The next activation, once it has come to rest on the order to do so.
    pub(super) recalled: Option<u64>,
}

impl Member {
    pub(super) fn new(process: Participant, ports: Ports) -> Member {
        Member {
            process,
            ports,
            timing: None,
            failed: None,
            at_rest: None,
            recalled: None,
        }
    }

    /// Whether it has done everything before `horizon`.
    pub(super) fn rests_at(&self, horizon: Ticks) -> bool {
        self.timing.is_some() || self.at_rest == Some(horizon)
    }

    /// Why it failed, in its own account, if it did.
    pub(super) fn failure(&self) -> Option<String> {
        match &self.failed {
            Some(Note::Failed { activation, t, reason }) => {
                Some(format!("failed at t = {t} s (activation {activation}): {reason}"))
            }
            _ => None,
        }
    }

    /// What it does.
    pub(super) fn status(&self) -> lockstep::transport::iceoryx::Status {
        self.ports.status.get()
    }

    /// Wakes it.
    pub(super) fn ring(&self) {
        self.ports.bell.ring();
    }

    /// Takes what it has recorded, a batch at most; whether there was anything.
    pub(super) fn take(&mut self, number: usize, recorder: &mut Recorder) -> Result<bool, Broken> {
        let Member {
            ports,
            timing,
            failed,
            at_rest,
            recalled,
            ..
        } = self;
        let Ports {
            record, status, bell, ..
        } = ports;
        let took = record.receive(|entry| {
            match entry {
                Recorded::Sample {
                    stream,
                    header,
                    payload,
                } => recorder.sample(number, stream, header, payload)?,
                Recorded::Note(Note::Finished(spent)) => *timing = Some(spent),
                Recorded::Note(Note::AtRest { horizon, .. }) => *at_rest = Some(horizon),
                Recorded::Note(Note::Recalled { next }) => *recalled = Some(next),
                Recorded::Note(note @ Note::Failed { .. }) => *failed = Some(note),
            }
            Ok(())
        });
        // Whoever sleeps for room in the recording sleeps for anything.
        if matches!(took, Ok(true)) && status.asleep() == Some(Sleeping::FOR_ANYTHING) {
            bell.ring();
        }
        took
    }

    /// Sends a request and waits for the reply.
    pub(super) fn ask(&mut self, request: &Request, interrupt: &Interrupt) -> Result<Reply, RunFailure> {
        let Member { ports, process, .. } = self;
        ports.bell.ring();
        let control = &ports.control;
        let reply = control.ask(request, PATIENCE, || process.ended().is_some() || interrupt.asked());
        let when = match request {
            Request::Hello { .. } => "when it was greeted",
            Request::Configure { .. } => "when it was given its parameters",
            Request::Connect { .. } => "when it was given its part of the plan",
            Request::Save => "when it was asked for its state",
            Request::Move { .. } => "when it was asked to move",
            Request::Terminate => "when it was told to leave",
        };
        match reply {
            Ok(Some(reply)) => Ok(reply),
            Ok(None) if interrupt.asked() => Err(RunFailure::Interrupted),
            Ok(None) => Err(silent(&mut self.process, "answer", when)),
            Err(broken) => Err(self.odd(format!("gave no answer that can be used {when}: {broken}"))),
        }
    }

    /// Something that this participant should not have done.
    pub(super) fn odd(&self, reason: impl Into<String>) -> RunFailure {
        RunFailure::Participant {
            participant: self.process.name.clone(),
            reason: reason.into(),
        }
    }
}

/// Who did not do `what`, and is dead or too late.
fn silent(process: &mut Participant, what: &str, when: &str) -> RunFailure {
    let reason = match process.ended() {
        Some(status) => format!("{} {when}{}", Participant::ending(status), explain::words(process)),
        None => format!(
            "did not {what} within {} s {when} (pid {})",
            PATIENCE.as_secs(),
            process.pid()
        ),
    };
    RunFailure::Participant {
        participant: process.name.clone(),
        reason,
    }
}

/// Starts the program of `entry`; what it writes goes to `log`.
pub(super) fn start(entry: &Entry, domain: &Domain, log: &std::path::Path) -> Result<Participant, RunFailure> {
    Participant::start(entry, &domain.address().to_string(), log).map_err(|error| RunFailure::Participant {
        participant: entry.setup.name.clone(),
        reason: format!("cannot be started: {error}"),
    })
}

/// Waits until it has entered the run, which everybody was asked to do at `asked`.
pub(super) fn arrive(member: &mut Member, asked: Instant, interrupt: &Interrupt) -> Result<(), RunFailure> {
    while !member.ports.control.present() {
        if interrupt.asked() {
            return Err(RunFailure::Interrupted);
        }
        if member.process.ended().is_some() || asked.elapsed() > PATIENCE {
            return Err(silent(
                &mut member.process,
                "enter the run",
                "before it had entered the run",
            ));
        }
        std::thread::sleep(Duration::from_micros(300));
    }
    Ok(())
}

/// Hello.
pub(super) fn greet(member: &mut Member, interrupt: &Interrupt) -> Result<(), RunFailure> {
    match member.ask(&Request::Hello { protocol: PROTOCOL }, interrupt)? {
        Reply::Hello { protocol: PROTOCOL, .. } => Ok(()),
        Reply::Hello { protocol, program } => Err(member.odd(format!(
            "`{program}` speaks version {protocol} of the protocol; this orchestrator speaks {PROTOCOL}"
        ))),
        other => Err(member.odd(format!("answered the greeting with {other:?}"))),
    }
}

/// Hello and parameters: the participant tells its ports, which must be those that are `known`, if any are.
pub(super) fn introduce(
    scenario: &Scenario,
    entry: &Entry,
    known: Option<&Interface>,
    member: &mut Member,
    interrupt: &Interrupt,
) -> Result<Interface, RunFailure> {
    greet(member, interrupt)?;
    let setup = &entry.setup;
    let request = Request::Configure {
        name: setup.name.clone(),
        parameters: setup.parameters.to_string(),
        seed: setup.seed,
        period: setup.period,
        offset: setup.offset,
    };
    let interface = match member.ask(&request, interrupt)? {
        Reply::Described { interface } => interface,
        Reply::Refused { key, reason } => return Err(scenario.refusal(&setup.name, &key, &reason).into()),
        other => return Err(member.odd(format!("answered its parameters with {other:?}"))),
    };
    interface
        .validate()
        .map_err(|error| member.odd(format!("describes ports that cannot be: {error}")))?;
    if let Some(difference) = known.and_then(|known| interface.difference(known)) {
        return Err(member.odd(format!("describes other ports than expected: {difference}")));
    }
    Ok(interface)
}

/// Gives participant number `number` its part of the plan, its cores, and where to take up the work; nothing for the start of
/// a run.
pub(super) fn connect(
    plan: &Plan,
    number: usize,
    member: &mut Member,
    position: Option<Position>,
    placement: &Placement,
    options: &Options,
    interrupt: &Interrupt,
) -> Result<(), RunFailure> {
    let request = Request::Connect {
        assignment: plan.assignment(number),
        cores: placement.cores[number].iter().map(|&core| core as u32).collect(),
        waiting: options.wait.strategy(placement.sharing[number]),
        position: position.map(Box::new),
    };
    match member.ask(&request, interrupt)? {
        Reply::Done => {}
        Reply::Refused { reason, .. } => return Err(member.odd(format!("cannot connect: {reason}"))),
        other => return Err(member.odd(format!("answered its part of the plan with {other:?}"))),
    }
    // Whatever it records from now on is there for the recorder, even if it leaves at once.
    match member.ports.record.take_memory() {
        Ok(true) => Ok(()),
        Ok(false) => Err(member.odd("has connected without sending the memory of its record")),
        Err(broken) => Err(member.odd(format!("its record cannot be received: {broken}"))),
    }
}

/// Asks a participant at rest to go to `address` when the clock says leave.
pub(super) fn send_to(member: &mut Member, address: &str, interrupt: &Interrupt) -> Result<(), RunFailure> {
    let address = address.to_owned();
    match member.ask(&Request::Move { address }, interrupt)? {
        Reply::Done => Ok(()),
        Reply::Refused { reason, .. } => {
            Err(member.odd(format!("cannot take part in a substitution or a restart: {reason}")))
        }
        other => Err(member.odd(format!("answered the request to move with {other:?}"))),
    }
}

/// The state of a participant at rest.
pub(super) fn save(member: &mut Member, interrupt: &Interrupt) -> Result<Vec<u8>, RunFailure> {
    match member.ask(&Request::Save, interrupt)? {
        Reply::State(Some(state)) => Ok(state),
        Reply::State(None) => Err(member.odd(
            "cannot save its state, which a checkpoint or a substitution with state needs: implement `save` and `restore`, \
             or run without",
        )),
        Reply::Refused { reason, .. } => Err(member.odd(format!("cannot save its state: {reason}"))),
        other => Err(member.odd(format!("answered the request for its state with {other:?}"))),
    }
}

/// The cores this process may use, and who goes where.
pub fn placement(plan: &Plan, options: &Options) -> Placement {
    let allowed = rustix::thread::sched_getaffinity(None).ok();
    let cores: Vec<usize> = allowed
        .map(|set| {
            (0..rustix::thread::CpuSet::MAX_CPU)
                .filter(|&core| set.is_set(core))
                .collect()
        })
        .unwrap_or_default();
    let mut placement = place(plan, &cores);
    if options.no_placement {
        placement.cores.iter_mut().for_each(|core| *core = None);
        placement.reason = "left to the operating system".into();
    }
    placement
}
