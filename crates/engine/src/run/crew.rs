//! The participants of a run with everything the orchestrator holds of them.

use std::time::{Duration, Instant};

use lockstep::control::{Note, PROTOCOL, Reply, Request, Timing};
use lockstep::participant::Interface;
use lockstep::plan::{Plan, Position};
use lockstep::span::{Detail, Span};
use lockstep::time::Ticks;
use lockstep::transport::Broken;
use lockstep::transport::iceoryx::{Domain, Recorded, Sleeping};

use super::awake::{Awake, Patience};
use super::checkpoint::CANNOT_SAVE;
use super::child::Participant;
use super::explain;
use super::life::life;
use super::log::{flood, words};
use super::monitor::Monitor;
use super::options::Options;
use super::outcome::RunFailure;
use super::placement::Placement;
use super::ports::Ports;
use super::recording::Recorder;
use super::room;
use crate::scenario::{Entry, Scenario};
use crate::text::quoted;

/// How long a program may take to enter the run, and to answer a request, if nothing else is said.
const START_WITHIN: Duration = Duration::from_secs(20);

/// How long the program of `entry` may take to enter the run, and to answer a request.
pub(super) fn start_within(entry: &Entry, options: &Options) -> Duration {
    let own = entry
        .start_within
        .map(|time| Duration::try_from_secs_f64(time.seconds()));
    let own = own.map(|own| own.unwrap_or(Duration::MAX));
    options.start_within.or(own).unwrap_or(START_WITHIN)
}

/// The content of one batch of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Taken {
    /// Nothing.
    Nothing,
    /// Notes that were there before, which are no progress.
    Old,
    /// Samples, or a note about progress.
    News,
}

/// One participant.
pub(super) struct Member {
    pub(super) process: Participant,
    ports: Ports,
    /// How long it may take to enter the run, and to answer a request.
    within: Duration,
    /// Where its time went; known when it is done.
    pub(super) timing: Option<Timing>,
    /// Its own account of why it failed.
    pub(super) failed: Option<Note>,
    at_rest: Option<Ticks>,
    /// The next activation, once it has come to rest on the order to do so.
    pub(super) recalled: Option<u64>,
    /// What it did when, and how many spans are missing behind each batch; until they are taken.
    pub(super) spans: Vec<(u64, Vec<Span>)>,
}

impl Member {
    pub(super) fn new(process: Participant, ports: Ports, within: Duration) -> Member {
        Member {
            process,
            ports,
            within,
            timing: None,
            failed: None,
            at_rest: None,
            recalled: None,
            spans: Vec::new(),
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
                let (t, reason) = (quoted(t), quoted(reason));
                Some(format!("failed at t = {t} s (activation {activation}): {reason}"))
            }
            _ => None,
        }
    }

    /// How its process failed, if it did: it ended before it was done, or its log is full. It is participant number `number`.
    pub(super) fn process_failure(&mut self, plan: &Plan, number: usize) -> Option<String> {
        match self.process.ended() {
            Some(status) if self.timing.is_some() && status.success() => None,
            Some(status) => Some(explain::death(plan, number, &self.process, self.status(), status)),
            None if self.process.floods() => Some(flood()),
            None => None,
        }
    }

    /// Another participant that has opened a publisher of this one's record, with the number of the process. `all` has the names and
    /// processes of the participants.
    pub(super) fn foreign_writer<'a>(&self, all: impl Iterator<Item = (&'a str, u32)>) -> Option<(&'a str, u32)> {
        let writers = self.ports.record.writers();
        // A participant may be a script that starts the program.
        let lines: Vec<(u32, Vec<u32>)> = writers.into_iter().map(|pid| (pid, ancestry(pid))).collect();
        all.filter(|(_, pid)| *pid != self.process.pid())
            .find_map(|(name, pid)| {
                let line = lines.iter().find(|(_, line)| line.contains(&pid));
                line.map(|(writer, _)| (name, *writer))
            })
    }

    /// What it does.
    pub(super) fn status(&self) -> lockstep::transport::iceoryx::Status {
        self.ports.status.get()
    }

    /// Wakes it.
    pub(super) fn ring(&self) {
        self.ports.bell.ring();
    }

    /// Takes a batch of its record. Notes about its progress are compared with the plan and with the samples on the tape.
    pub(super) fn take(&mut self, number: usize, recorder: &mut Recorder) -> Result<Taken, Broken> {
        let mut news = false;
        let Member {
            ports,
            timing,
            failed,
            at_rest,
            recalled,
            spans,
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
                } => {
                    recorder.sample(number, stream, header, payload)?;
                    news = true;
                }
                Recorded::Note(Note::Finished(spent)) => {
                    recorder.finished(number)?;
                    news |= timing.replace(spent).is_none();
                }
                Recorded::Note(Note::AtRest { horizon, next }) => {
                    recorder.rests(number, horizon, next)?;
                    news |= *at_rest < Some(horizon);
                    *at_rest = (*at_rest).max(Some(horizon));
                }
                Recorded::Note(Note::Recalled { next }) => {
                    recorder.recalled(number, next)?;
                    news |= recalled.replace(next).is_none();
                }
                Recorded::Note(Note::Spans { lost, spans: some }) => spans.push((lost, some)),
                Recorded::Note(note @ Note::Failed { .. }) => *failed = Some(note),
            }
            Ok(())
        });
        // A participant that sleeps for room in the recording is woken by anything.
        if matches!(took, Ok(true)) && status.asleep() == Some(Sleeping::FOR_ANYTHING) {
            bell.ring();
        }
        Ok(match took? {
            false => Taken::Nothing,
            true if news => Taken::News,
            true => Taken::Old,
        })
    }

    /// Sends a request and waits for the reply.
    pub(super) fn ask(&mut self, request: &Request, monitor: &Monitor) -> Result<Reply, RunFailure> {
        let Member { ports, process, .. } = self;
        ports.bell.ring();
        let control = &ports.control;
        let mut patience = Patience::new(self.within);
        let reply = control.ask(request, || {
            let failed = process.ended().is_some() || process.floods() || monitor.failure().is_some();
            failed || patience.is_over()
        });
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
            Ok(None) => Err(silent(&mut self.process, self.within, monitor, "answer", when)),
            Err(broken) => Err(self.odd(format!("gave no answer that can be used {when}: {broken}"))),
        }
    }

    /// A failure of this participant; `reason` may contain text of the participant.
    pub(super) fn odd(&self, reason: impl AsRef<str>) -> RunFailure {
        RunFailure::Participant {
            participant: self.process.name.clone(),
            reason: quoted(reason.as_ref()),
        }
    }
}

/// The numbers of a process, its parent, and so on.
fn ancestry(mut pid: u32) -> Vec<u32> {
    let mut line = Vec::new();
    while pid > 1 && !line.contains(&pid) && line.len() < 16 {
        line.push(pid);
        let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
        let parent = status.lines().find_map(|line| line.strip_prefix("PPid:"));
        pid = parent.and_then(|parent| parent.trim().parse().ok()).unwrap_or(0);
    }
    line
}

/// The reason of a failure by a participant that opened the record of `victim`, which failed with `broken`.
pub(super) fn foreign_writer_reason(victim: &str, process: u32, broken: &str) -> String {
    format!("process {process} opened the record of `{victim}`, which is not its own: `{victim}` {broken}")
}

/// Why a participant did not do `what`: it ended or is late, or the monitor reports another failure.
fn silent(process: &mut Participant, within: Duration, monitor: &Monitor, what: &str, when: &str) -> RunFailure {
    let elsewhere = monitor.failure();
    let reason = match (process.ended(), elsewhere) {
        (_, Some(RunFailure::Interrupted)) => return RunFailure::Interrupted,
        (Some(status), _) => format!(
            "{} {when}{}{}",
            Participant::ending(status),
            room::of_bus_error(status),
            words(process.log())
        ),
        (None, _) if process.floods() => format!("{} {when}", flood()),
        (None, Some(failure)) => return failure,
        (None, None) => {
            let pid = process.pid();
            format!(
                "did not {what} within {} s {when} (pid {pid}, {}); a program that needs longer is given it by `start-within` in the \
                 scenario or --start-within{}",
                within.as_secs_f64(),
                life(pid).words(),
                words(process.log())
            )
        }
    };
    RunFailure::Participant {
        participant: process.name.clone(),
        reason,
    }
}

/// Starts the program of `entry`; what it writes goes to `log`.
///
/// # Errors
/// A file that is no program that could run here is a mistake in the scenario, whatever else goes wrong is not.
pub(super) fn start(
    scenario: &Scenario,
    entry: &Entry,
    domain: &Domain,
    log: &std::path::Path,
    detail: Option<Detail>,
) -> Result<Participant, RunFailure> {
    use std::io::ErrorKind::{NotADirectory, NotFound, PermissionDenied};
    Participant::start(entry, &domain.address().to_string(), log, detail).map_err(|error| {
        if matches!(error.kind(), NotFound | NotADirectory | PermissionDenied) {
            let reason = format!("{} cannot be started: {error}", entry.program);
            return scenario.program_refusal(entry, &reason).into();
        }
        RunFailure::Participant {
            participant: entry.setup.name.clone(),
            reason: format!("cannot be started: {error}"),
        }
    })
}

/// Waits until it has entered the run; `waited` counts since all were started.
pub(super) fn arrive(member: &mut Member, waited: &mut Awake, monitor: &Monitor) -> Result<(), RunFailure> {
    while !member.ports.control.present() {
        let process = &mut member.process;
        let late = waited.at(Instant::now()) > member.within;
        if process.ended().is_some() || monitor.failure().is_some() || late {
            return Err(silent(process, member.within, monitor, "enter the run", "of its start"));
        }
        std::thread::sleep(Duration::from_micros(300));
    }
    Ok(())
}

/// Hello.
pub(super) fn greet(member: &mut Member, monitor: &Monitor) -> Result<(), RunFailure> {
    match member.ask(&Request::Hello { protocol: PROTOCOL }, monitor)? {
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
    monitor: &Monitor,
) -> Result<Interface, RunFailure> {
    greet(member, monitor)?;
    let setup = &entry.setup;
    let request = Request::Configure {
        name: setup.name.clone(),
        parameters: setup.parameters.to_string(),
        seed: setup.seed,
        period: setup.period,
        offset: setup.offset,
    };
    let interface = match member.ask(&request, monitor)? {
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

/// A name, unit or frame with a control character. They appear in messages, file names and pages.
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

/// Gives participant number `number` its part of the plan, its cores, and where to take up the work; nothing for the start of
/// a run. `ring` is the size of its record's ring, bytes.
#[allow(
    clippy::too_many_arguments,
    reason = "what a participant is connected with comes from all parts of a run"
)]
pub(super) fn connect(
    plan: &Plan,
    number: usize,
    member: &mut Member,
    position: Option<Position>,
    placement: &Placement,
    ring: u32,
    monitor: &Monitor,
) -> Result<(), RunFailure> {
    let request = Request::Connect {
        assignment: plan.assignment(number),
        cores: placement.cores[number].iter().map(|&core| core as u32).collect(),
        waiting: placement.waiting[number],
        record: ring,
        position: position.map(Box::new),
    };
    let reply = member.ask(&request, monitor)?;
    let failure = match reply {
        // Whatever it records from now on is there for the recorder, even if it leaves at once.
        Reply::Done => match member.ports.record.take_memory() {
            Ok(true) => return super::place::all_there(),
            Ok(false) => "has connected without sending the memory of its record".to_owned(),
            Err(broken) => format!("its record cannot be received: {broken}"),
        },
        Reply::Refused { reason, .. } => format!("cannot connect: {reason}"),
        other => format!("answered its part of the plan with {other:?}"),
    };
    match member.foreign_writer(monitor.all()) {
        Some((author, process)) => Err(RunFailure::Participant {
            participant: author.to_owned(),
            reason: quoted(&foreign_writer_reason(&member.process.name, process, &failure)),
        }),
        None => Err(member.odd(failure)),
    }
}

/// Asks a participant at rest to go to `address` when the clock says leave.
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

/// The state of a participant at rest.
pub(super) fn save(member: &mut Member, monitor: &Monitor) -> Result<Vec<u8>, RunFailure> {
    match member.ask(&Request::Save, monitor)? {
        Reply::State(Some(state)) => Ok(state),
        Reply::State(None) => Err(member.odd(CANNOT_SAVE)),
        Reply::Refused { reason, .. } => Err(member.odd(format!("cannot save its state: {reason}"))),
        other => Err(member.odd(format!("answered the request for its state with {other:?}"))),
    }
}
