//! A run: its start, its main loop from stop to stop, and its outcome.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lockstep::time::Ticks;
use tape::folder::{Reservation, RunFolder};
use tape::{Event, EventKind};

use super::executor::{Executor, Turn};
use super::in_loop;
use super::inputs;
use super::options::Options;
use super::outcome::{Ending, Outcome, RunFailure};
use super::pace::clock_controller::ClockController;
use super::pace::spans::SpanAnalysis;
use super::prepare::{self, PreparedRun};
use super::processes::monitor::Monitor;
use super::processes::resources;
use super::processes::start_up;
use super::recording::store::{Record, no_samples};
use super::state::RunState;
use super::stops::actions::{self, perform_actions};
use super::stops::instants;
use super::stops::schedule::Schedule;
use crate::assessment::Figures;
use crate::observer::Event as Report;
use crate::scenario::Scenario;
use crate::scope;

/// A run under way, which is paused until a call lets it continue.
///
/// It belongs to the thread that starts it. When it is dropped, its processes end, and nothing of it stays in shared memory; its
/// folder can be read up to the last complete sample, but has no seal. [`Run::end`] ends it properly.
///
/// It never writes to standard streams or handles signals.
pub struct Run {
    // Dropped first: the recorder must outlive the participants that record.
    pub(super) executor: Box<dyn Executor>,
    pub(super) run_state: RunState,
    /// All participants have done exactly the activations before this instant.
    pub(super) now: Ticks,
    /// A participant is paused before its step at this instant.
    pub(super) before_step: bool,
    /// Outputs were set in place of a participant's step.
    pub(super) outputs_set: bool,
    pub(super) over: Option<RunEnd>,
    /// Inputs were set that the participants have not received yet.
    pub(super) inputs_pending: bool,
    /// The number of this run in this process.
    pub(super) number: u64,
    /// The checkpoints that the run can go back to, oldest first.
    pub(super) valid_checkpoints: Vec<u64>,
    pub(super) checkpoint_count: u64,
    pub(super) wall: Duration,
    /// The claim to the run's folder, if it has one: no other run takes the folder before this one has ended.
    claim: Option<Reservation>,
}

/// The state in which [`Run::run_loop`] has left a run.
pub(super) enum LoopExit {
    /// At its bound.
    Paused,
    Over(Ending),
    /// Where a participant is paused before its step.
    BeforeStep(Ticks),
    /// At a step that is to be done together with those of other runs: the next call continues after it.
    Parked,
}

/// How a run has ended.
pub(super) struct RunEnd {
    pub(super) ending: Ending,
    pub(super) ended_at: Instant,
}

impl Run {
    /// Starts a run of `scenario`: all participants have been started and have published what exists before the first activation,
    /// and the run is paused.
    ///
    /// # Errors
    /// The reason why the run cannot start; then it has left nothing, unless there was something to record.
    pub fn start(scenario: &Scenario, options: &Options) -> Result<Run, RunFailure> {
        let mut run = Run::begin(Arc::new(scenario.clone()), options.clone(), true)?;
        run.run_state.recorder().keep_newest();
        let from = run.now;
        run.run_until(Some(from));
        match run.over.take() {
            None => Ok(run),
            Some(RunEnd { ending, .. }) => match ending {
                Ending::Failed { participant, reason } => Err(RunFailure::Participant { participant, reason }),
                Ending::Complete | Ending::Stopped { .. } => Err(RunFailure::Interrupted),
            },
        }
    }

    /// Everything before the first step. `driven` says whether a program drives the run and may query the samples of any stream.
    pub(crate) fn begin(scenario: Arc<Scenario>, options: Options, driven: bool) -> Result<Run, RunFailure> {
        options.check_record()?;
        // Everything that can be refused is refused before anything is started or written.
        let made = if options.in_process {
            scenario.make_here()?
        } else {
            scenario.make()?
        };
        let (known, made) = prepare::check_participants(&scenario, made)?;
        instants::check(scenario.duration, known.plan.end, &known.plan.timebase, &options)?;
        let entries = prepare::initial_entries(&scenario, &options)?;
        let participants = if options.in_process {
            Some(in_loop::executor::create_participants(
                &scenario, &options, &entries, made,
            )?)
        } else {
            drop(made);
            reject_nested_run(&scenario)?;
            scope::leftovers().iter().for_each(scope::Leftover::remove);
            fmu::remove_leftovers();
            resources::check(&known.plan, scenario.may_relocate())?;
            None
        };
        let mut claim = match options.record {
            Record::Folder => Some(prepare::create_folder(&scenario, &options)?),
            Record::Memory | Record::Digest | Record::Nothing => None,
        };
        let folder = claim.as_ref().map(|claim| claim.folder().clone());
        let made: Result<(PreparedRun, PreparedExecutor), RunFailure> = match (participants, &folder) {
            (Some(participants), folder) => {
                let recorder = prepare::create_recorder(&scenario, known.plan, &options, folder.as_ref(), driven);
                recorder.and_then(|mut recorder| {
                    let plan = recorder.plan.clone();
                    let start = prepare::start_point(&plan, &options, &mut recorder)?;
                    let recovered = Vec::new();
                    let prepared = PreparedRun {
                        entries,
                        plan,
                        recorder,
                        start,
                        recovered,
                    };
                    Ok((prepared, PreparedExecutor::InProcess(participants)))
                })
            }
            (None, Some(folder)) => {
                let monitor = Monitor::new(options.interrupt.clone());
                start_up::set_up(&scenario, &options, &known, entries, folder, &monitor, driven)
                    .map(|(prepared, processes)| (prepared, PreparedExecutor::Processes(Box::new(processes))))
            }
            (None, None) => Err(no_samples()),
        };
        let mut run = made.and_then(|(prepared, executor)| Run::of(scenario, options, prepared, executor, folder));
        // A run that was refused leaves nothing in its folder. One that failed before it began leaves what there is to read, unless
        // there is a previous run to restore.
        let keep_folder = match &run {
            Ok(_) => true,
            Err(failure) => failure.exit_code() != 2 && !claim.as_ref().is_some_and(Reservation::replaces),
        };
        if keep_folder {
            claim.iter_mut().for_each(Reservation::commit);
        }
        if let Ok(run) = &mut run {
            run.claim = claim;
        }
        run
    }

    fn of(
        scenario: Arc<Scenario>,
        options: Options,
        prepared: PreparedRun,
        executor: PreparedExecutor,
        folder: Option<RunFolder>,
    ) -> Result<Run, RunFailure> {
        static RUNS: AtomicU64 = AtomicU64::new(0);
        let PreparedRun {
            entries,
            plan,
            recorder,
            start,
            recovered,
        } = prepared;
        let (from, substituted) = (start.from, start.substituted);
        let schedule = Schedule::new(&scenario, &plan, &options, from, substituted)?;
        let span_analysis = SpanAnalysis::new(&plan, &options, &scenario.title)?;
        let recorder = Arc::new(Mutex::new(recorder));
        let executor: Box<dyn Executor> = match executor {
            PreparedExecutor::InProcess(participants) => {
                let loop_executor = in_loop::executor::set_up(
                    &plan,
                    &entries,
                    from,
                    start.positions,
                    &recorder,
                    participants,
                    folder.as_ref(),
                )?;
                Box::new(loop_executor)
            }
            PreparedExecutor::Processes(processes) => processes,
        };
        options.begin(&plan, folder.as_ref());
        let run_state = RunState {
            clock: ClockController::new(&plan, &options, schedule, from),
            entries,
            substituted,
            inputs: start.inputs,
            last_checkpoint: start.checkpoint,
            recovered,
            folder,
            recorder,
            span_analysis,
            scenario,
            options,
            plan,
        };
        Ok(Run {
            executor,
            run_state,
            now: from,
            before_step: false,
            outputs_set: false,
            over: None,
            inputs_pending: false,
            number: RUNS.fetch_add(1, Ordering::Relaxed),
            valid_checkpoints: Vec::new(),
            checkpoint_count: 0,
            wall: Duration::ZERO,
            claim: None,
        })
    }

    /// Runs until all participants are paused at `bound`, or to the end of the run.
    pub(super) fn run_until(&mut self, bound: Option<Ticks>) {
        self.executor.clear_step_pause();
        self.advance(bound);
    }

    /// As [`Run::run_until`], but the run also stops before the step of the participant that is to be paused.
    pub(super) fn advance(&mut self, bound: Option<Ticks>) {
        if self.over.is_some() {
            return;
        }
        let started = Instant::now();
        let bound = bound.filter(|bound| *bound < self.run_state.plan.end);
        self.begin_advance(bound);
        let exit = self.run_loop(bound);
        self.end_advance(bound, exit);
        self.wall += started.elapsed();
    }

    /// Preparation for [`Run::run_loop`].
    pub(super) fn begin_advance(&mut self, bound: Option<Ticks>) {
        self.run_state.clock.set_bound(bound);
        self.run_state.clock.resume();
        self.executor.restart_timeout();
    }

    /// Follow-up of [`Run::run_loop`], unless the run is parked.
    pub(super) fn end_advance(&mut self, bound: Option<Ticks>, exit: LoopExit) {
        self.now = bound.unwrap_or(self.run_state.plan.end);
        self.before_step = false;
        if let LoopExit::BeforeStep(at) = exit {
            (self.now, self.before_step) = (at, true);
        }
        if let LoopExit::Over(ending) = exit {
            let newest = self.run_state.newest().clamp(0, self.run_state.plan.end);
            if ending != Ending::Complete {
                self.now = newest;
            }
            let ended_at = Instant::now();
            self.over = Some(RunEnd { ending, ended_at });
        }
    }

    /// The main loop of every run: turns, stops, and recovery from failures.
    pub(super) fn run_loop(&mut self, bound: Option<Ticks>) -> LoopExit {
        let Run {
            executor, run_state, ..
        } = self;
        let executor = executor.as_mut();
        let mut applied = !std::mem::take(&mut self.inputs_pending);
        loop {
            let turn = if applied {
                executor.turn(run_state)
            } else {
                applied = true;
                apply_inputs(executor, run_state, self.now).map(|()| Turn::Continue)
            };
            let done = turn.and_then(|turn| match turn {
                Turn::Continue => Ok(None),
                Turn::Over(ending) => Ok(Some(LoopExit::Over(ending))),
                Turn::BeforeStep(at) => Ok(Some(LoopExit::BeforeStep(at))),
                Turn::Parked => Ok(Some(LoopExit::Parked)),
                Turn::Paused(now) => {
                    let ending = perform_actions(executor, run_state, now)?;
                    let rests = bound == Some(now) && run_state.clock.is_idle_at(now) && executor.has_reached(now);
                    Ok(ending.map(LoopExit::Over).or(rests.then_some(LoopExit::Paused)))
                }
            });
            match done {
                Ok(None) => {}
                Ok(Some(done)) => return done,
                Err(failed) => {
                    if let Err(ending) = executor.handle_failure(run_state, failed) {
                        return LoopExit::Over(ending);
                    }
                }
            }
        }
    }

    /// Ends the run, here if it is not over yet: the tape is sealed, and the figures are those of the samples so far.
    ///
    /// # Errors
    /// When the summary cannot be written.
    pub fn end(mut self) -> Result<Outcome, RunFailure> {
        if self.over.is_none() {
            let ending = Ending::Stopped {
                reason: format!("ended at t = {} s", self.now_s()),
            };
            let ended_at = Instant::now();
            self.over = Some(RunEnd { ending, ended_at });
        }
        let outcome = self.conclude();
        if let Some(folder) = &outcome.folder {
            let folder = RunFolder::open(folder);
            folder.write_json(&folder.summary(), &outcome.summary())?;
        }
        Ok(outcome)
    }

    /// Sets inputs again as the `events` of another run's tape say, each at its time, as far as this run has the inputs.
    pub(crate) fn replay_inputs(&mut self, events: &[Event]) -> Result<(), RunFailure> {
        for event in events.iter().filter(|event| event.kind == EventKind::Input) {
            let participant = event.participant.as_ref();
            let has_participant = participant.is_some_and(|name| self.run_state.plan.participant(name).is_some());
            if !has_participant || self.over.is_some() || event.time >= self.run_state.scenario.duration {
                continue;
            }
            let (input, payload) = inputs::read(&self.run_state.plan, event).map_err(RunFailure::Other)?;
            let ticks = self.run_state.plan.timebase.ceil(event.time);
            self.run_until(Some(ticks.map_err(|error| RunFailure::Other(error.to_string()))?));
            if self.over.is_none() {
                self.run_state.recorder().event(event)?;
                self.run_state.inputs.insert(input, payload);
                self.inputs_pending = true;
            }
        }
        Ok(())
    }

    /// Runs to the end.
    pub(crate) fn finish(mut self) -> Outcome {
        self.run_until(None);
        self.conclude()
    }

    /// Ends the run, here if it is not over yet.
    pub(super) fn conclude(mut self) -> Outcome {
        let run_state = &mut self.run_state;
        run_state.options.progress.report(Report::Over);
        let origin = run_state.options.origin.as_ref();
        let resumed_s = origin.map(|origin| origin.checkpoint.time.seconds());
        self.executor.shut_down(run_state);
        let report = self.executor.report();
        drop(self.executor);
        let ended_at = self.over.as_ref().map_or_else(Instant::now, |over| over.ended_at);
        let ending = self.over.map_or(Ending::Complete, |over| over.ending);
        let RunState {
            plan,
            recorder,
            folder,
            recovered,
            span_analysis,
            scenario,
            ..
        } = self.run_state;
        let partial = prepare::partial_streams(&scenario, &plan);
        let (pace, traced) = span_analysis.finish();
        let recorder = Arc::into_inner(recorder).expect("the participants are gone");
        let mut recorder = recorder.into_inner().unwrap_or_else(PoisonError::into_inner);
        // No participant is at fault when the tape cannot be written.
        let ending = match recorder.take_error() {
            Some(error) => Ending::orchestrator_failed(error.to_string()),
            None => ending,
        };
        if let Ending::Failed { participant, reason } = &ending {
            // A full disk has no room for the event either; the reason is reported all the same.
            let _ = recorder.event(&Event {
                time: plan.timebase.time(recorder.newest.max(0)).unwrap_or_default(),
                kind: EventKind::Failure,
                participant: Some(participant.clone()),
                text: reason.clone(),
            });
        }
        // A run without outputs has no samples, and is complete at its end all the same.
        let simulated_until = if ending == Ending::Complete {
            plan.end
        } else {
            recorder.newest.clamp(0, plan.end)
        };
        let simulated_s = plan.timebase.seconds(simulated_until);
        let ending = recorder.with_active_faults(ending);
        let (sealed, figures) = recorder.finish();
        let (ending, digest) = Outcome::sealed(ending, sealed);
        let figures = match ending {
            Ending::Complete => figures,
            _ => figures.map(Figures::of_unfinished),
        };
        Outcome {
            folder: folder.map(|folder| folder.root().to_owned()),
            ending,
            simulated_s,
            resumed_s,
            wall_s: self.wall.as_secs_f64(),
            ended_at,
            digest,
            recovered,
            figures,
            sources: prepare::link_sources(&plan),
            pace,
            traced,
            partial,
            timing: report.timing,
            placement: report.placement,
            logs: report.logs,
        }
    }
}

/// Refuses a program that is started as a participant of its own run: it would start that run again, without end.
fn reject_nested_run(scenario: &Scenario) -> Result<(), RunFailure> {
    let starts_itself = scenario.programs().any(|program| !program.is_external());
    match std::env::var(lockstep::host::PARTICIPANT) {
        Ok(name) if starts_itself => Err(RunFailure::Other(format!(
            "this process was started as the participant `{name}` of a run: let the program's `main` begin with `Program::main`, which \
             becomes the participant, or run in this process"
        ))),
        _ => Ok(()),
    }
}

/// The executor of a run, as far as it has been made.
enum PreparedExecutor {
    InProcess(Vec<Box<dyn lockstep::participant::Participant>>),
    Processes(Box<super::processes::executor::Processes>),
}

/// Gives unconnected inputs the values that were set.
fn apply_inputs(executor: &mut dyn Executor, run_state: &mut RunState, now: Ticks) -> Result<(), Ending> {
    let cut = run_state.recorder().cut_at(now);
    let applied = executor
        .apply_inputs(run_state, &cut)
        .and_then(|mut failed_participants| {
            if failed_participants.is_empty() {
                failed_participants.extend(actions::save_for_restarts(
                    executor,
                    run_state,
                    run_state.time(now),
                    cut,
                )?);
            }
            Ok(failed_participants)
        });
    let failed_participants = applied.map_err(|failure| run_state.ending_of(failure))?;
    actions::report_failures(executor, run_state, failed_participants)
}
