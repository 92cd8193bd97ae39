//! The participants of a run, each with the process, the services and the records that the orchestrator holds for it.

use std::borrow::Borrow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use lockstep::control::{ParticipantEvent, Reply, Request, WallTimeBreakdown};
use lockstep::plan::Plan;
use lockstep::span::{Detail, Span};
use lockstep::time::Ticks;
use lockstep::transport::TransportError;
use lockstep::transport::iceoryx::{Domain, PendingRequest, Recorded, WaitReason, WakeNotifier};

use super::child::ParticipantProcess;
use super::descriptions;
use super::monitor::Monitor;
use super::ports::Ports;
use super::process_state::process_state;
use super::resources;
use super::run_services::check_pages;
use crate::run::log::{full_log_reason, tail_message};
use crate::run::options::Options;
use crate::run::outcome::RunFailure;
use crate::run::recording::recorder::Recorder;
use crate::run::timeout::{ActiveTime, Timeout};
use crate::scenario::{Entry, Scenario};
use crate::text::quoted;

/// How long a program may take to enter the run, and to answer a request, unless the scenario or an option specifies it.
const START_WITHIN: Duration = Duration::from_secs(20);

/// How long the program of `entry` may take to enter the run, and to answer a request.
pub(crate) fn start_within(entry: &Entry, options: &Options) -> Duration {
    let scenario_value = entry
        .start_within
        .map(|time| Duration::try_from_secs_f64(time.seconds()));
    let scenario_value = scenario_value.map(|scenario_value| scenario_value.unwrap_or(Duration::MAX));
    options.start_within.or(scenario_value).unwrap_or(START_WITHIN)
}

/// The result of taking one batch of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BatchResult {
    /// Nothing.
    Empty,
    /// Participant events that repeat what is known already.
    NoProgress,
    /// Samples, or an event about progress.
    Progress,
}

/// One participant.
pub(crate) struct ParticipantHandle {
    pub(crate) process: ParticipantProcess,
    pub(crate) ports: Ports,
    /// How long the participant may take to enter the run, and to answer a request.
    reply_timeout: Duration,
    /// How its wall time was spent; known when it is done.
    pub(crate) timing: Option<WallTimeBreakdown>,
    /// The reason for its failure, as it reported it.
    pub(crate) failure_event: Option<ParticipantEvent>,
    reached_horizon: Option<Ticks>,
    /// The next activation, once the participant has paused on command of the clock.
    pub(crate) paused_before: Option<u64>,
    /// Its spans of wall time, with the number of missing spans after each batch; until they are taken.
    pub(crate) spans: Vec<(u64, Vec<Span>)>,
}

impl ParticipantHandle {
    pub(crate) fn new(process: ParticipantProcess, ports: Ports, reply_timeout: Duration) -> ParticipantHandle {
        ParticipantHandle {
            process,
            ports,
            reply_timeout,
            timing: None,
            failure_event: None,
            reached_horizon: None,
            paused_before: None,
            spans: Vec::new(),
        }
    }

    /// Whether the participant has done everything before `horizon`.
    pub(crate) fn has_reached(&self, horizon: Ticks) -> bool {
        self.timing.is_some() || self.reached_horizon == Some(horizon)
    }

    /// The reason for its failure, as it reported it, if it did.
    pub(crate) fn failure(&self) -> Option<String> {
        match &self.failure_event {
            Some(ParticipantEvent::Failed { activation, t, reason }) => {
                let (t, reason) = (quoted(t), quoted(reason));
                Some(format!("failed at t = {t} s (activation {activation}): {reason}"))
            }
            _ => None,
        }
    }

    /// How the process of participant number `number` failed, if it did: it ended before the participant was done, or its log is
    /// full.
    pub(crate) fn process_failure(&mut self, plan: &Plan, number: usize) -> Option<String> {
        match self.process.exit_status() {
            Some(status) if self.timing.is_some() && status.success() => None,
            Some(status) => Some(descriptions::exit_report(
                plan,
                number,
                &self.process,
                self.status(),
                status,
            )),
            None if self.process.log_is_full() => Some(full_log_reason()),
            None => None,
        }
    }

    /// Another participant that has opened a publisher of this one's record, with its process number. `all` has the names and
    /// processes of the participants.
    pub(crate) fn foreign_writer<'a>(&self, all: impl Iterator<Item = (&'a str, u32)>) -> Option<(&'a str, u32)> {
        let writers = self.ports.record.writers();
        // A participant may be a script that starts the program.
        let lines: Vec<(u32, Vec<u32>)> = writers.into_iter().map(|pid| (pid, ancestry(pid))).collect();
        all.filter(|(_, pid)| *pid != self.process.pid())
            .find_map(|(name, pid)| {
                let line = lines.iter().find(|(_, line)| line.contains(&pid));
                line.map(|(writer, _)| (name, *writer))
            })
    }

    /// What the participant does.
    pub(crate) fn status(&self) -> lockstep::transport::iceoryx::Status {
        self.ports.status.get()
    }

    /// Wakes the participant.
    pub(crate) fn wake(&self) {
        self.ports.notifier.notify();
    }

    /// Takes a batch of the participant's record. Participant events are checked against the plan and the samples on the tape.
    pub(crate) fn take(&mut self, number: usize, recorder: &mut Recorder) -> Result<BatchResult, TransportError> {
        let mut progressed = false;
        let ParticipantHandle {
            ports,
            timing,
            failure_event,
            reached_horizon,
            paused_before,
            spans,
            ..
        } = self;
        let Ports {
            record,
            status,
            notifier,
            ..
        } = ports;
        let took = record.receive(|entry| {
            match entry {
                Recorded::Sample {
                    stream,
                    header,
                    payload,
                } => {
                    recorder.sample(number, stream, header, payload)?;
                    progressed = true;
                }
                Recorded::Event(ParticipantEvent::Finished(spent)) => {
                    recorder.check_finished(number)?;
                    progressed |= timing.replace(spent).is_none();
                }
                Recorded::Event(ParticipantEvent::AtHorizon { horizon, next }) => {
                    recorder.check_at_horizon(number, horizon, next)?;
                    progressed |= *reached_horizon < Some(horizon);
                    *reached_horizon = (*reached_horizon).max(Some(horizon));
                }
                Recorded::Event(ParticipantEvent::Paused { next }) => {
                    recorder.check_paused(number, next)?;
                    progressed |= paused_before.replace(next).is_none();
                }
                Recorded::Event(ParticipantEvent::Spans { lost, spans: some }) => spans.push((lost, some)),
                Recorded::Event(event @ ParticipantEvent::Failed { .. }) => *failure_event = Some(event),
            }
            Ok(())
        });
        // A participant that sleeps until there is room for its record is woken now: a batch has been taken.
        if matches!(took, Ok(true)) && status.wait_reason() == Some(WaitReason::FOR_ANYTHING) {
            notifier.notify();
        }
        Ok(match took? {
            false => BatchResult::Empty,
            true if progressed => BatchResult::Progress,
            true => BatchResult::NoProgress,
        })
    }

    /// Sends a request and waits for the reply.
    pub(crate) fn request(&mut self, request: &Request, monitor: &Monitor) -> Result<Reply, RunFailure> {
        let mut reply = None;
        request_all(
            std::slice::from_mut(self),
            |_| request,
            monitor,
            |_, _, one| {
                reply = Some(one);
                Ok(())
            },
        )?;
        Ok(reply.expect("the only one has answered"))
    }

    /// A failure of this participant; `reason` may contain text from the participant.
    pub(crate) fn participant_failure(&self, reason: impl AsRef<str>) -> RunFailure {
        RunFailure::Participant {
            participant: self.process.name.clone(),
            reason: quoted(reason.as_ref()),
        }
    }
}

/// A request under way, with what is monitored until the reply comes.
struct MonitoredRequest<'a> {
    request: PendingRequest<'a>,
    notifier: &'a WakeNotifier,
    process: &'a mut ParticipantProcess,
    reply_timeout: Duration,
    timeout: Timeout,
    when: &'static str,
    reply: Option<Reply>,
}

impl MonitoredRequest<'_> {
    /// Polls for the reply; `other_failed` says that the monitor reports a failure.
    ///
    /// # Errors
    /// When no usable reply will come.
    fn poll(&mut self, monitor: &Monitor, other_failed: bool) -> Result<(), RunFailure> {
        if self.reply.is_none() {
            self.reply = self
                .exchange()
                .map_err(|broken| unusable_reply(self.process, self.when, &broken))?;
        }
        if self.reply.is_some() {
            return Ok(());
        }
        let process = &mut *self.process;
        let failed = other_failed || process.exit_status().is_some() || process.log_is_full();
        match failed || self.timeout.is_over() {
            true => Err(no_reply_failure(
                process,
                self.reply_timeout,
                monitor,
                &Expectation::reply(self.when),
            )),
            false => Ok(()),
        }
    }

    /// Sends the request until it has reached the participant, and returns the reply once it has arrived.
    fn exchange(&mut self) -> Result<Option<Reply>, TransportError> {
        // In this order: a participant that is woken before the request is there goes back to sleep.
        if self.request.send()? {
            self.notifier.notify();
        }
        self.request.reply()
    }
}

/// Sends each of `handles` the request that `request` returns, and passes the replies to `take` in order. The participants prepare
/// their replies at the same time.
///
/// # Errors
/// The first failure: a participant that does not answer, or an error of `take` for an earlier reply.
pub(crate) fn request_all<R: Borrow<Request>>(
    handles: &mut [ParticipantHandle],
    mut request: impl FnMut(usize) -> R,
    monitor: &Monitor,
    mut take: impl FnMut(usize, &mut ParticipantHandle, Reply) -> Result<(), RunFailure>,
) -> Result<(), RunFailure> {
    let mut all = Vec::with_capacity(handles.len());
    for (number, handle) in handles.iter_mut().enumerate() {
        let request = request(number);
        let ParticipantHandle {
            ports,
            process,
            reply_timeout,
            ..
        } = handle;
        let when = when(request.borrow());
        let begun = ports.control.begin_request(request.borrow());
        all.push(MonitoredRequest {
            request: begun.map_err(|broken| unusable_reply(process, when, &broken))?,
            notifier: &ports.notifier,
            process,
            reply_timeout: *reply_timeout,
            timeout: Timeout::new(*reply_timeout),
            when,
            reply: None,
        });
    }
    let mut outcome;
    loop {
        // Only once per round: the monitor queries the system for every process.
        let other_failed = monitor.failure().is_some();
        // Each participant's own state first: one that has died on its own request is reported as that, whichever participant
        // before it is still waited for.
        let mut poll = |other_failed| {
            (all.iter_mut())
                .map(|one| one.poll(monitor, other_failed))
                .fold(Ok(()), Result::and)
        };
        outcome = poll(false);
        if other_failed && outcome.is_ok() {
            outcome = poll(true);
        }
        let mut answered = all.iter().map_while(|one| one.reply.as_ref());
        let refused = answered.any(|reply| matches!(reply, Reply::Refused { .. }));
        if outcome.is_err() || refused || all.iter().all(|one| one.reply.is_some()) {
            break;
        }
        std::thread::sleep(PendingRequest::POLL_INTERVAL);
    }
    let replies: Vec<Reply> = all.into_iter().map_while(|one| one.reply).collect();
    for (number, (handle, reply)) in handles.iter_mut().zip(replies).enumerate() {
        take(number, handle, reply)?;
    }
    outcome
}

/// When a request was made, in words.
fn when(request: &Request) -> &'static str {
    match request {
        Request::Hello { .. } => "when it was greeted",
        Request::Configure { .. } => "when it was given its parameters",
        Request::Connect { .. } => "when it was given its part of the plan",
        Request::Save => "when it was asked for its state",
        Request::Move { .. } => "when it was asked to move",
        Request::Terminate => "on the request to terminate",
    }
}

/// The failure of a participant whose reply cannot be used.
fn unusable_reply(process: &ParticipantProcess, when: &str, broken: &TransportError) -> RunFailure {
    RunFailure::Participant {
        participant: process.name.clone(),
        reason: quoted(&format!("sent an invalid reply {when}: {broken}")),
    }
}

/// The process numbers of a process, its parent, and so on.
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

/// The reason of a failure caused by another participant that opened the record of `victim`, which failed with `broken`.
pub(crate) fn foreign_writer_reason(victim: &str, process: u32, broken: &str) -> String {
    format!("process {process} opened the record of `{victim}`, which is not its own: `{victim}` {broken}")
}

/// What is expected of a participant, as parts of a message.
struct Expectation {
    /// What the participant is to do.
    what: &'static str,
    /// From when on the time counts.
    since: &'static str,
    /// When the participant ended instead.
    instead: &'static str,
}

impl Expectation {
    const ENTRY: Expectation = Expectation {
        what: "enter the run",
        since: "of its start",
        instead: "before it had entered the run",
    };

    /// The reply to the request that was made `when`.
    fn reply(when: &'static str) -> Expectation {
        Expectation {
            what: "answer",
            since: when,
            instead: when,
        }
    }
}

/// The failure that a participant did not do what is expected of it: it ended or is late, or the monitor reports another failure.
fn no_reply_failure(
    process: &mut ParticipantProcess,
    reply_timeout: Duration,
    monitor: &Monitor,
    awaited: &Expectation,
) -> RunFailure {
    let Expectation { what, since, instead } = awaited;
    let other_failed = monitor.failure();
    let reason = match (process.exit_status(), other_failed) {
        (_, Some(RunFailure::Interrupted)) => return RunFailure::Interrupted,
        (Some(status), _) => format!(
            "{} {instead}{}{}",
            ParticipantProcess::describe_exit(status),
            resources::bus_error_hint(status),
            tail_message(process.log())
        ),
        (None, _) if process.log_is_full() => format!("{} {instead}", full_log_reason()),
        (None, Some(failure)) => return failure,
        (None, None) => {
            let pid = process.pid();
            format!(
                "did not {what} within {} s {since} (pid {pid}, {}); a program that needs longer is given it by `start-within` in the \
                 scenario or --start-within{}",
                reply_timeout.as_secs_f64(),
                process_state(pid).description(),
                tail_message(process.log())
            )
        }
    };
    RunFailure::Participant {
        participant: process.name.clone(),
        reason,
    }
}

/// Starts the program of `entry`; its output goes to `log`.
///
/// # Errors
/// A file that is no program that can run here is a mistake in the scenario; any other error is a failure of the participant.
pub(crate) fn start(
    scenario: &Scenario,
    entry: &Entry,
    domain: &Domain,
    log: &Path,
    detail: Option<Detail>,
) -> Result<ParticipantProcess, RunFailure> {
    use std::io::ErrorKind::{NotADirectory, NotFound, PermissionDenied};
    ParticipantProcess::start(entry, &domain.address().to_string(), log, detail).map_err(|error| {
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

/// Starts the programs of `entries` in `domain`; `log` returns the file for the output of one. Each starts as soon as its own services
/// exist, while those of the next are created.
///
/// # Errors
/// Services that cannot be created, and those of [`start`]. Then all processes have ended.
pub(crate) fn start_all(
    scenario: &Scenario,
    entries: &[impl Borrow<Entry>],
    domain: &Domain,
    options: &Options,
    detail: Option<Detail>,
    mut log: impl FnMut(&str) -> PathBuf,
) -> Result<Vec<ParticipantHandle>, RunFailure> {
    let mut handles = Vec::with_capacity(entries.len());
    for entry in entries.iter().map(Borrow::borrow) {
        let name = &entry.setup.name;
        let ports = Ports::create(domain, name, entries.len())?;
        check_pages()?;
        let process = start(scenario, entry, domain, &log(name), detail)?;
        handles.push(ParticipantHandle::new(process, ports, start_within(entry, options)));
    }
    Ok(handles)
}

/// Waits until the participant has entered the run; `waited` counts from the start of all programs.
pub(crate) fn await_entry(
    handle: &mut ParticipantHandle,
    waited: &mut ActiveTime,
    monitor: &Monitor,
) -> Result<(), RunFailure> {
    while !handle.ports.control.has_server() {
        let process = &mut handle.process;
        let late = waited.at(Instant::now()) > handle.reply_timeout;
        if process.exit_status().is_some() || monitor.failure().is_some() || late {
            return Err(no_reply_failure(
                process,
                handle.reply_timeout,
                monitor,
                &Expectation::ENTRY,
            ));
        }
        std::thread::sleep(Duration::from_micros(300));
    }
    Ok(())
}
