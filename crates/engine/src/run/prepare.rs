//! Preparation of a run, common to both executors: the run folder, the recorder, stops and pacing.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use lockstep::participant::{Interface, Participant};
use lockstep::plan::{Cut, Plan, Position};
use lockstep::time::Ticks;
use serde::Serialize;
use tape::folder::{Reservation, RunFolder, utc_text};
use tape::{Event, EventKind, StreamSpec, Writer};

use super::executor::Slot;
use super::inputs::Inputs;
use super::options::{Options, Origin};
use super::outcome::RunFailure;
use super::processes::monitor::Monitor;
use super::processes::port_discovery;
use super::recording::guard::SampleGuard;
use super::recording::observed::Observers;
use super::recording::recorder::Recorder;
use super::recording::store::Store;
use super::recording::streams::streams;
use super::recording::tape_mapping::TapeMapping;
use super::saved::checkpoint::Checkpoint;
use super::saved::continuation;
use super::saved::history::History;
use super::saved::restore::OriginRun;
use super::state::RunState;
use crate::assessment::Assessment;
use crate::live::Steering;
use crate::observer::{Event as Report, Interrupt, PauseDecision, Progress};
use crate::scenario::{Entry, OnFailure, Scenario, ScenarioError, State};

/// How often a pause checks for signals and failures.
const PAUSE_POLL_INTERVAL: Duration = Duration::from_millis(5);

/// What is known of a scenario before anything starts.
pub struct CheckedScenario {
    /// The ports of each participant that this program contains.
    pub interfaces: Vec<Option<Interface>>,
    /// The plan; unknown ports of external programs are assumed to match the ports that they are connected to.
    pub plan: Plan,
}

/// Makes the participants that this program contains, makes the plan, and checks the assessment: everything except starting
/// programs.
pub fn check(scenario: &Scenario) -> Result<CheckedScenario, ScenarioError> {
    check_participants(scenario, scenario.make()?).map(|(known, _)| known)
}

/// [`check`] for a run in this process, into which the libraries of the scenario are loaded.
pub fn check_here(scenario: &Scenario) -> Result<CheckedScenario, ScenarioError> {
    check_participants(scenario, scenario.make_here()?).map(|(known, _)| known)
}

/// The participants that this process contains, made for a scenario.
pub(super) type MadeParticipants = Vec<Option<Box<dyn Participant>>>;

/// [`check`] with the participants that were `made` for the scenario, which are returned.
pub(super) fn check_participants(
    scenario: &Scenario,
    made: MadeParticipants,
) -> Result<(CheckedScenario, MadeParticipants), ScenarioError> {
    let interfaces: Vec<Option<Interface>> = (made.iter())
        .map(|participant| participant.as_ref().map(|participant| participant.interface()))
        .collect();
    for substitution in &scenario.substitutions {
        let entry = &substitution.entry;
        let Some(factory) = scenario.builtins().factory_of(&entry.program) else {
            continue;
        };
        let substitute = factory(&entry.setup).map_err(|error| scenario.refusal(entry, &error.key, &error.reason))?;
        let known = interfaces[substitution.participant].as_ref();
        if let Some(difference) = known.and_then(|known| substitute.interface().difference(known)) {
            let program = &entry.program;
            let reason = format!("{program} has other ports than `{}`: {difference}", entry.setup.name);
            return Err(scenario.program_refusal(entry, &reason));
        }
    }
    let plan = scenario.assumed_plan(&interfaces)?;
    scenario.watches(&plan, |participant| interfaces[participant].is_some())?;
    scenario.check_drawings(&plan, |participant| interfaces[participant].is_some())?;
    scenario.kept(&plan, &streams(&plan), |participant| interfaces[participant].is_some())?;
    if interfaces.iter().all(Option::is_some) {
        assess(scenario, &streams(&plan))?;
    } else {
        let certain = |name: &str| {
            plan.participant(name)
                .is_some_and(|number| interfaces[number].is_some())
        };
        scenario.measures(&streams(&plan), certain)?;
    }
    Ok((CheckedScenario { interfaces, plan }, made))
}

impl CheckedScenario {
    /// The names of the participants that were not asked for their ports.
    pub fn unknown(&self) -> Vec<&str> {
        let all = self.plan.participants.iter().zip(&self.interfaces);
        all.filter_map(|(planned, interface)| interface.is_none().then_some(planned.name.as_str()))
            .collect()
    }
}

/// [`check`] with the ports that the programs of the other participants and of all substitutes describe: each program is started
/// for that and ended again. No port is assumed then.
///
/// # Errors
/// Everything for which a run of the scenario would be refused, and a program that does not answer.
pub fn check_with_programs(scenario: &Scenario, options: &Options) -> Result<CheckedScenario, RunFailure> {
    let known = check(scenario)?;
    let unknown = scenario.participants.iter().zip(&known.interfaces);
    let unknown: Vec<&Entry> = unknown
        .filter_map(|(entry, interface)| interface.is_none().then_some(entry))
        .collect();
    let mut described = port_discovery::ask(scenario, &unknown, options)?.into_iter();
    let interfaces: Vec<Interface> = (known.interfaces.into_iter())
        .filter_map(|interface| interface.or_else(|| described.next()))
        .collect();
    let check_substitutes = || {
        let monitor = Monitor::new(options.interrupt.clone());
        port_discovery::check_substitutes(scenario, &interfaces, options, &monitor)
    };
    if unknown.is_empty() {
        // Nothing was assumed, so this is the plan.
        check_substitutes()?;
        return Ok(CheckedScenario {
            interfaces: interfaces.into_iter().map(Some).collect(),
            plan: known.plan,
        });
    }
    let plan = scenario.plan(&interfaces)?;
    check_substitutes()?;
    assess(scenario, &streams(&plan))?;
    scenario.watches(&plan, |_| true)?;
    scenario.check_drawings(&plan, |_| true)?;
    scenario.kept(&plan, &streams(&plan), |_| true)?;
    Ok(CheckedScenario {
        interfaces: interfaces.into_iter().map(Some).collect(),
        plan,
    })
}

fn assess(scenario: &Scenario, streams: &[StreamSpec]) -> Result<Option<Box<dyn Assessment>>, ScenarioError> {
    scenario.assess(streams)
}

/// What produced a run: kept in its folder for later readers.
#[derive(Serialize)]
struct Provenance<'a> {
    scenario: &'a str,
    title: &'a str,
    started: String,
    command: Vec<String>,
    version: &'a str,
    iceoryx2: &'a str,
    host: Host,
    files: Vec<String>,
    /// For a branch: before this instant the run was made by another plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    changed_at: Option<String>,
}

#[derive(Serialize)]
struct Host {
    name: String,
    kernel: String,
    processor: String,
    cores: usize,
}

impl Host {
    fn here() -> Host {
        let system = rustix::system::uname();
        let text = |part: &std::ffi::CStr| part.to_string_lossy().into_owned();
        let cpu_info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = cpu_info.lines().find_map(|line| {
            line.strip_prefix("model name")?
                .split_once(':')
                .map(|(_, m)| m.trim().to_owned())
        });
        Host {
            name: text(system.nodename()),
            kernel: format!("{} {}", text(system.sysname()), text(system.release())),
            processor: model.unwrap_or_else(|| text(system.machine())),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }
}

/// Makes the run folder, with the resolved scenario and the provenance of the run.
pub(super) fn create_folder(scenario: &Scenario, options: &Options) -> Result<Reservation, RunFailure> {
    let claim = match &options.out {
        Some(out) => Reservation::reserve(out, options.force)?,
        None => RunFolder::create_default(std::path::Path::new("runs"), &scenario.name)?,
    };
    let folder = claim.folder();
    let written = scenario.written();
    folder.write(&folder.plan(), &written.to_text())?;
    let provenance = Provenance {
        scenario: &scenario.name,
        title: &scenario.title,
        started: utc_text(SystemTime::now()),
        command: std::env::args_os()
            .map(|word| word.to_string_lossy().into_owned())
            .collect(),
        version: scenario.builtins().version(),
        iceoryx2: lockstep::transport::iceoryx::VERSION,
        host: Host::here(),
        files: scenario.files().iter().map(|file| file.display().to_string()).collect(),
        changed_at: options
            .origin
            .as_ref()
            .and_then(|origin| changed_at(written.to_table(), origin)),
    };
    folder.write_json(&folder.run(), &provenance)?;
    Ok(claim)
}

/// The instant from which a run that continues `origin` follows its own plan `own`; `None` means from its beginning. A different
/// run length does not affect what was before.
fn changed_at(plan: toml::Table, origin: &Origin) -> Option<String> {
    let parent = RunFolder::open(&origin.run);
    let without_duration = |mut table: toml::Table| {
        table.remove("duration");
        table
    };
    let before = String::from_utf8(tape::read_regular(&parent.plan()).ok()?).ok()?;
    let before = before.parse::<toml::Table>().ok()?;
    if without_duration(before) != without_duration(plan) {
        return Some(origin.checkpoint.time.to_string());
    }
    parent.changed_at()
}

/// Opens the store of the samples: the tape in `folder`, or what the options ask for without a folder. The recorder's plan records
/// which samples are observed: by the recorder and, if `driven`, by a program that drives the run.
pub(super) fn create_recorder(
    scenario: &Scenario,
    mut plan: Plan,
    options: &Options,
    folder: Option<&RunFolder>,
    driven: bool,
) -> Result<Recorder, RunFailure> {
    let streams = streams(&plan);
    let (assessment, guards) = create_evaluators(scenario, &plan, &streams)?;
    let kept = scenario.kept(&plan, &streams, |_| true)?;
    let saves = options.checkpoint_every.is_some() || !options.checkpoint_at.is_empty();
    // Taking up a run needs samples of all outputs.
    let resumable = driven || saves || (scenario.may_relocate() && !options.in_process);
    let observers = Observers {
        kept: (folder.is_some() || options.record.needs_samples()).then_some(&kept),
        assessment: assessment.as_deref(),
        guards: &guards,
        all: resumable,
    };
    plan.observed = observers.observed(scenario, &plan, &streams);
    let (tape_mapping, kept) = TapeMapping::new(&kept, &streams);
    let store = match folder {
        Some(folder) => Store::Disk(Writer::create(&folder.tape(), kept)?.with_thread()),
        None => Store::without_folder(options.record, kept)?,
    };
    let mut recorder = Recorder::new(Arc::new(plan), store, tape_mapping, assessment, guards);
    if resumable {
        recorder.enable_sample_buffer();
    }
    match recorder.stream_without_save().filter(|_| saves) {
        Some(stream) => {
            let what = format!("a checkpoint of an assessment without `save`, which uses `{stream}`,");
            Err(scenario.needs_samples(&what).into())
        }
        None => Ok(recorder),
    }
}

/// The assessment of a run, if it has one, and its guards.
type Evaluators = (Option<Box<dyn Assessment>>, Vec<SampleGuard>);

/// The assessment and the guards of a run at its beginning.
pub(super) fn create_evaluators(
    scenario: &Scenario,
    plan: &Plan,
    streams: &[StreamSpec],
) -> Result<Evaluators, ScenarioError> {
    scenario.check_drawings(plan, |_| true)?;
    Ok((assess(scenario, streams)?, scenario.watches(plan, |_| true)?))
}

/// For each stream of which the tape does not have every sample: what it has, in words.
pub(super) fn partial_streams(scenario: &Scenario, plan: &Plan) -> Vec<String> {
    if scenario.records_all() {
        return Vec::new();
    }
    let streams = streams(plan);
    let kept = scenario.kept(plan, &streams, |_| true).unwrap_or_default();
    let all = kept.iter().zip(&streams);
    all.filter_map(|(kept, spec)| kept.describe(spec)).collect()
}

/// The name of the source of each link into each participant.
pub(super) fn link_sources(plan: &Plan) -> BTreeMap<String, Vec<String>> {
    let source = |link: usize| plan.output_name(plan.links[link].from);
    let all = plan.participants.iter().enumerate();
    all.map(|(number, planned)| (planned.name.clone(), plan.links_into(number).map(source).collect()))
        .collect()
}

/// A run before its first step, without its executor.
pub(super) struct PreparedRun {
    /// What runs in each slot.
    pub(super) entries: Vec<Entry>,
    pub(super) plan: Arc<Plan>,
    pub(super) recorder: Recorder,
    pub(super) start: StartPoint,
    /// How failures of participants were handled so far.
    pub(super) recovered: Vec<String>,
}

/// Where a run begins.
pub(super) struct StartPoint {
    /// No activation before this instant happens in this run, ticks.
    pub(super) from: Ticks,
    /// Where each participant continues; `None` at the beginning of a run.
    pub(super) positions: Option<Vec<Position>>,
    /// How many of the scenario's substitutions have taken place.
    pub(super) substituted: usize,
    /// The values of unconnected inputs.
    pub(super) inputs: Inputs,
    /// The checkpoint that the run continues from; restarts use it too, until the first checkpoint of this run.
    pub(super) checkpoint: Option<Checkpoint>,
}

/// What runs in each slot when the run begins.
///
/// # Errors
/// When the scenario is no continuation of the checkpoint that the run starts from.
pub(super) fn initial_entries(scenario: &Scenario, options: &Options) -> Result<Vec<Entry>, RunFailure> {
    let mut entries = scenario.participants.clone();
    if let Some(origin) = &options.origin {
        continuation::check(scenario, &origin.checkpoint)?;
        entries = entries_at(scenario, &origin.checkpoint);
    }
    Ok(entries)
}

/// What ran in each slot when `checkpoint` was made.
pub(super) fn entries_at(scenario: &Scenario, checkpoint: &Checkpoint) -> Vec<Entry> {
    let mut entries = scenario.participants.clone();
    let done = usize::try_from(checkpoint.substitutions).unwrap_or(usize::MAX);
    for substitution in scenario.substitutions.iter().take(done) {
        entries[substitution.participant] = substitution.entry.clone();
    }
    for (slot, replaced) in entries.iter_mut().zip(&checkpoint.replaced) {
        if let (true, OnFailure::Substitute(program)) = (replaced, slot.on_failure.clone()) {
            *slot = slot.replaced_by(&program);
        }
    }
    entries
}

/// What runs in each slot when the run goes back to `checkpoint`; the participants for which `anew` returns true get new processes.
pub(super) fn slots_at(run_state: &RunState, checkpoint: &Checkpoint, anew: impl Fn(usize) -> bool) -> Vec<Slot> {
    let entries = entries_at(&run_state.scenario, checkpoint);
    let slots = checkpoint.states.iter().cloned().zip(entries).enumerate();
    let slots = slots.map(|(number, (state, entry))| {
        if anew(number) || !entry.runs_as(&run_state.entries[number]) {
            Slot::New(Box::new(entry), Some(state))
        } else {
            Slot::Same(Some(state))
        }
    });
    slots.collect()
}

/// The start of the run; everything before it is copied to the tape. [`entries`] has checked that the scenario continues from
/// there.
pub(super) fn start_point(plan: &Plan, options: &Options, recorder: &mut Recorder) -> Result<StartPoint, RunFailure> {
    let Some(Origin { run, checkpoint }) = &options.origin else {
        return Ok(StartPoint {
            from: 0,
            positions: None,
            substituted: 0,
            inputs: Inputs::default(),
            checkpoint: None,
        });
    };
    let from = plan.timebase.ceil(checkpoint.time);
    let from = from.map_err(|error| RunFailure::Other(error.to_string()))?;
    let history = &History::open(&RunFolder::open(run).tape(), plan, checkpoint.off_tape.is_some())?;
    let origin_run = OriginRun { history, checkpoint };
    recorder.copy_origin(&origin_run)?;
    recorder.event(&Event {
        time: checkpoint.time,
        kind: EventKind::Resume,
        participant: None,
        text: format!("taken up from the checkpoint at t = {}", checkpoint.time),
    })?;
    let mut events = history.events()?;
    events.retain(|event| event.time <= checkpoint.time);
    let inputs = Inputs::of_events(plan, &events)?;
    let mut positions = origin_run.positions(plan)?;
    inputs.put_into(&mut positions);
    for (position, state) in positions.iter_mut().zip(&checkpoint.states) {
        position.state = Some(state.clone());
    }
    Ok(StartPoint {
        from,
        positions: Some(positions),
        substituted: usize::try_from(checkpoint.substitutions).unwrap_or(usize::MAX),
        inputs,
        checkpoint: Some(Checkpoint {
            off_tape: recorder.off_tape_state(&checkpoint.cut)?,
            ..checkpoint.clone()
        }),
    })
}

/// The tape's event for a substitution at `now`.
pub(super) fn substitution_event(
    plan: &Plan,
    now: Ticks,
    cut: &Cut,
    slot: usize,
    entry: &Entry,
    state: State,
) -> Event {
    let how = match state {
        State::Cold => "from its initial state",
        State::Keep => "with the state of the one before",
    };
    Event {
        time: plan.timebase.time(now).unwrap_or_default(),
        kind: EventKind::Substitution,
        participant: Some(entry.setup.name.clone()),
        text: format!("{} takes over at activation {} {how}", entry.program, cut.next[slot]),
    }
}

/// Waits during a pause until the observer answers, the live page lets the run continue, or an end is requested; returns whether the run
/// continues. `processes` says in words which process is which participant.
///
/// # Errors
/// The failure that `look` returns; it is called every few milliseconds.
pub(super) fn wait_while_paused(
    plan: &Plan,
    at: Ticks,
    processes: &str,
    progress: &Progress,
    interrupt: &Interrupt,
    steering: Option<&Steering>,
    mut check_failure: impl FnMut() -> Option<RunFailure>,
) -> Result<bool, RunFailure> {
    let t_s = plan.timebase.seconds(at);
    progress.report(Report::Paused { t_s, processes });
    loop {
        match (progress.pause_decision(), steering) {
            (Some(PauseDecision::Continue), _) => {
                steering.into_iter().for_each(Steering::resume);
                return Ok(true);
            }
            (Some(PauseDecision::End), _) => {
                steering.into_iter().for_each(Steering::resume);
                return Ok(false);
            }
            (Some(PauseDecision::Unavailable), None) => return Ok(false),
            (_, Some(steering)) if steering.allows_past(at) => return Ok(true),
            _ if interrupt.is_requested() => return Ok(false),
            _ => std::thread::sleep(PAUSE_POLL_INTERVAL),
        }
        if let Some(failure) = check_failure() {
            return Err(failure);
        }
    }
}
