//! The participants of a run with everything the orchestrator holds of them.

use std::time::{Duration, Instant};

use lockstep::control::{Note, PROTOCOL, Reply, Request, Timing};
use lockstep::participant::Interface;
use lockstep::plan::{Placement, Plan, place};
use lockstep::time::Ticks;
use lockstep::transport::Broken;
use lockstep::transport::iceoryx::{
    Bell, ControlClient, Domain, RecordReceiver, Recorded, StatusReader, StatusService, WakeService,
};
use recorder::folder::RunFolder;

use super::Options;
use super::child::Participant;
use super::explain;
use super::outcome::RunFailure;
use super::recording::Recorder;
use super::signals::Interrupt;
use crate::scenario::{Entry, Scenario};

/// How long a program may take to enter the run, and to answer a request.
const PATIENCE: Duration = Duration::from_secs(20);

/// One participant.
pub(super) struct Member {
    pub(super) process: Participant,
    pub(super) status: StatusReader,
    pub(super) bell: Bell,
    record: RecordReceiver,
    control: ControlClient,
    /// Where its time went; known when it is done.
    pub(super) timing: Option<Timing>,
    /// Its own account of why it failed.
    pub(super) failed: Option<Note>,
    at_rest: Option<Ticks>,
    _services: (StatusService, WakeService),
}

impl Member {
    /// Whether it has done everything before `horizon`.
    pub(super) fn rests_at(&self, horizon: Ticks) -> bool {
        self.timing.is_some() || self.at_rest == Some(horizon)
    }

    /// Takes the next parcel of its samples and notes; whether there was one.
    pub(super) fn take(&mut self, number: usize, recorder: &mut Recorder) -> Result<bool, Broken> {
        let Member {
            record,
            timing,
            failed,
            at_rest,
            ..
        } = self;
        record.receive(|entry| {
            match entry {
                Recorded::Sample {
                    stream,
                    header,
                    payload,
                } => recorder.sample(number, stream, header, payload)?,
                Recorded::Note(Note::Finished(spent)) => *timing = Some(spent),
                Recorded::Note(Note::AtRest { horizon, .. }) => *at_rest = Some(horizon),
                Recorded::Note(note @ Note::Failed { .. }) => *failed = Some(note),
                Recorded::Note(Note::Recalled { .. }) => {}
            }
            Ok(())
        })
    }

    /// Sends a request and waits for the reply.
    fn ask(&mut self, request: &Request, interrupt: &Interrupt) -> Result<Reply, RunFailure> {
        let Member { control, process, .. } = self;
        let reply = control.ask(request, PATIENCE, || process.ended().is_some() || interrupt.asked());
        match reply {
            Ok(Some(reply)) => Ok(reply),
            Ok(None) if interrupt.asked() => Err(RunFailure::Interrupted),
            Ok(None) => Err(silent(&mut self.process, "answer")),
            Err(broken) => Err(RunFailure::Participant {
                participant: self.process.name.clone(),
                reason: broken.0,
            }),
        }
    }
}

fn silent(process: &mut Participant, what: &str) -> RunFailure {
    let reason = match process.ended() {
        Some(status) => format!(
            "{} before the run began{}",
            Participant::ending(status),
            explain::words(process)
        ),
        None => format!("did not {what} within {} s (pid {})", PATIENCE.as_secs(), process.pid()),
    };
    RunFailure::Participant {
        participant: process.name.clone(),
        reason,
    }
}

/// Starts every participant and waits until all have entered the run.
pub(super) fn launch(
    scenario: &Scenario,
    domain: &Domain,
    folder: &RunFolder,
    interrupt: &Interrupt,
) -> Result<Vec<Member>, RunFailure> {
    let count = scenario.participants.len();
    let mut crew = Vec::with_capacity(count);
    for entry in &scenario.participants {
        let name = &entry.setup.name;
        // Every service is there before anybody who opens it.
        let services = (
            StatusService::create(domain, name, count + 1)?,
            WakeService::create(domain, name, count + 1)?,
        );
        let control = ControlClient::create(domain, name)?;
        let record = RecordReceiver::create(domain, name)?;
        let log = folder.stderr(name);
        let process = Participant::start(entry, &domain.address().to_string(), &log).map_err(|error| {
            RunFailure::Participant {
                participant: name.clone(),
                reason: format!("cannot be started: {error}"),
            }
        })?;
        crew.push(Member {
            process,
            status: StatusReader::open(domain, name)?,
            bell: services.1.bell(domain)?,
            record,
            control,
            timing: None,
            failed: None,
            at_rest: None,
            _services: services,
        });
    }
    let started = Instant::now();
    for member in &mut crew {
        while !member.control.present() {
            if interrupt.asked() {
                return Err(RunFailure::Interrupted);
            }
            if member.process.ended().is_some() || started.elapsed() > PATIENCE {
                return Err(silent(&mut member.process, "enter the run"));
            }
            std::thread::sleep(Duration::from_micros(300));
        }
    }
    Ok(crew)
}

/// Hello and parameters: every participant tells its ports.
pub(super) fn interfaces(
    scenario: &Scenario,
    known: &[Option<Interface>],
    crew: &mut [Member],
    interrupt: &Interrupt,
) -> Result<Vec<Interface>, RunFailure> {
    let mut interfaces = Vec::with_capacity(crew.len());
    for ((member, entry), known) in crew.iter_mut().zip(&scenario.participants).zip(known) {
        let interface = introduce(scenario, member, entry, interrupt)?;
        let name = &entry.setup.name;
        let odd = |reason| RunFailure::Participant {
            participant: name.clone(),
            reason,
        };
        interface
            .validate()
            .map_err(|error| odd(format!("describes ports that cannot be: {error}")))?;
        if let Some(difference) = known.as_ref().and_then(|known| interface.difference(known)) {
            return Err(odd(format!("describes other ports than expected: {difference}")));
        }
        interfaces.push(interface);
    }
    Ok(interfaces)
}

fn introduce(
    scenario: &Scenario,
    member: &mut Member,
    entry: &Entry,
    interrupt: &Interrupt,
) -> Result<Interface, RunFailure> {
    let name = entry.setup.name.clone();
    let odd = |reason| RunFailure::Participant {
        participant: name.clone(),
        reason,
    };
    match member.ask(&Request::Hello { protocol: PROTOCOL }, interrupt)? {
        Reply::Hello { protocol: PROTOCOL, .. } => {}
        Reply::Hello { protocol, program } => {
            return Err(odd(format!(
                "`{program}` speaks version {protocol} of the protocol; this orchestrator speaks {PROTOCOL}"
            )));
        }
        other => return Err(odd(format!("answered the greeting with {other:?}"))),
    }
    let setup = &entry.setup;
    let request = Request::Configure {
        name: setup.name.clone(),
        parameters: setup.parameters.to_string(),
        seed: setup.seed,
        period: setup.period,
        offset: setup.offset,
    };
    match member.ask(&request, interrupt)? {
        Reply::Described { interface } => Ok(interface),
        Reply::Refused { key, reason } => Err(scenario.refusal(&setup.name, &key, &reason).into()),
        other => Err(odd(format!("answered its parameters with {other:?}"))),
    }
}

/// Gives every participant its part of the plan and its core. Returns the choice of cores in words.
pub(super) fn connect(
    plan: &Plan,
    crew: &mut [Member],
    options: &Options,
    interrupt: &Interrupt,
) -> Result<String, RunFailure> {
    let placement = placement(plan, options);
    for (number, member) in crew.iter_mut().enumerate() {
        let request = Request::Connect {
            assignment: plan.assignment(number),
            cores: placement.cores[number].iter().map(|&core| core as u32).collect(),
            waiting: options.wait.strategy(placement.sharing[number]),
            position: None,
        };
        match member.ask(&request, interrupt)? {
            Reply::Done => {}
            Reply::Refused { reason, .. } => {
                let participant = member.process.name.clone();
                return Err(RunFailure::Participant {
                    participant,
                    reason: format!("cannot connect: {reason}"),
                });
            }
            other => {
                let participant = member.process.name.clone();
                return Err(RunFailure::Participant {
                    participant,
                    reason: format!("answered its part of the plan with {other:?}"),
                });
            }
        }
    }
    Ok(placement.reason)
}

/// The cores this process may use, and who goes where.
pub(crate) fn placement(plan: &Plan, options: &Options) -> Placement {
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
