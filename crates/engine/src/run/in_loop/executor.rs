//! The executor that runs all participants in one loop of this process.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lockstep::executor::{InLoop, LocalParticipant, LoopEvent, RunError, StopReason, connect_locally};
use lockstep::participant::{Log, Participant, PendingStep, Termination, state};
use lockstep::plan::{Cut, Plan, Position};
use lockstep::stepper::{Stepper, prepare_to_resume, terminate};
use lockstep::time::Ticks;
use tape::folder::RunFolder;

use super::direct::Direct;
use super::logs::SharedLogs;
use crate::observer::Event as Report;
use crate::run::executor::{Executor, ExecutorReport, Slot, Turn};
use crate::run::failed::FailedParticipant;
use crate::run::log::full_log_reason;
use crate::run::options::Options;
use crate::run::outcome::{Ending, RunFailure};
use crate::run::prepare::MadeParticipants;
use crate::run::recording::recorder::Recorder;
use crate::run::saved::checkpoint::{cannot_save, save_failed};
use crate::run::state::RunState;
use crate::scenario::{Entry, ORCHESTRATOR, Program, Scenario};

/// Activations between two looks at the clock and the signals.
const ACTIVATIONS_PER_CHECK: i64 = 512;
/// The pause between polls while no participant may proceed.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// With a live page, recorded samples are flushed at least this often.
const FLUSH_INTERVAL: Duration = Duration::from_millis(50);

/// All participants of a run in one loop.
pub(crate) struct LoopExecutor {
    /// Always present, except while the loop is being rebuilt for a restored checkpoint.
    in_loop: Option<InLoop>,
    reached: Ticks,
    /// Where the present stretch ends, while it waits for a step to be done together with those of other runs.
    parked: Option<Ticks>,
    last_flush: Instant,
    /// The participant that is paused before each step.
    pause_before: Option<usize>,
    logs: SharedLogs,
}

/// The participants in the slots of a run when it begins.
pub(crate) fn create_participants(
    scenario: &Scenario,
    options: &Options,
    entries: &[Entry],
    made: MadeParticipants,
) -> Result<Vec<Box<dyn Participant>>, RunFailure> {
    // A program that cannot run in this process is refused now, not at its substitution.
    let cannot_run_here =
        |entry: &&Entry| entry.program.is_external() && scenario.builtins().factory_within(&entry.program).is_none();
    if let Some(entry) = entries.iter().find(cannot_run_here) {
        return Err(external_program_refusal(scenario, entry));
    }
    for substitution in &scenario.substitutions {
        if !matches!(substitution.entry.program, Program::Builtin(_)) {
            make(scenario, &substitution.entry)?;
        }
    }
    if options.origin.is_none()
        && let Some(participants) = made.into_iter().collect()
    {
        return Ok(participants);
    }
    entries.iter().map(|entry| make(scenario, entry)).collect()
}

/// The loop over `participants`, where the run begins; their logs are in `folder`, or in memory.
pub(crate) fn set_up(
    plan: &Plan,
    entries: &[Entry],
    from: Ticks,
    positions: Option<Vec<Position>>,
    recorder: &Arc<Mutex<Recorder>>,
    mut participants: Vec<Box<dyn Participant>>,
    folder: Option<&RunFolder>,
) -> Result<LoopExecutor, RunFailure> {
    let logs = SharedLogs::new(folder);
    let mut in_loop = match positions {
        None => InLoop::new(plan, parts(plan, participants, recorder)),
        Some(mut positions) => {
            for (number, (participant, position)) in participants.iter_mut().zip(&mut positions).enumerate() {
                let state = position.state.take();
                let t = instant(plan, number, position.next);
                prepare_to_resume(
                    participant.as_mut(),
                    t,
                    true,
                    state.as_deref(),
                    &log(plan, number, &logs),
                )
                .map_err(|error| participant_failure(&entries[number], error))?;
            }
            let parts = parts(plan, participants, recorder);
            InLoop::resume(plan, parts, positions).map_err(|error| RunFailure::Other(error.to_string()))?
        }
    };
    in_loop.log_to(&logs.sink());
    Ok(LoopExecutor {
        in_loop: Some(in_loop),
        reached: from,
        parked: None,
        last_flush: Instant::now(),
        pause_before: None,
        logs,
    })
}

impl From<RunError> for Ending {
    fn from(error: RunError) -> Ending {
        let (participant, reason) = match error {
            RunError::Participant {
                participant,
                t,
                activation,
                source,
            } => (
                participant,
                format!("failed at t = {t} s (activation {activation}): {source}"),
            ),
            deadlock @ RunError::Deadlock { .. } => (ORCHESTRATOR.into(), deadlock.to_string()),
        };
        Ending::Failed { participant, reason }
    }
}

/// A mistake of the user, like everything that is refused before the run.
fn external_program_refusal(scenario: &Scenario, entry: &Entry) -> RunFailure {
    let name = &entry.setup.name;
    let reason = format!(
        "participant `{name}` is a program of its own, {}, which cannot run in this process: leave out --in-process, or make it a plug-in",
        entry.program
    );
    scenario.program_refusal(entry, &reason).into()
}

/// A participant that can run in this process.
fn make(scenario: &Scenario, entry: &Entry) -> Result<Box<dyn Participant>, RunFailure> {
    scenario
        .participant(entry)?
        .ok_or_else(|| external_program_refusal(scenario, entry))
}

fn parts(
    plan: &Plan,
    participants: Vec<Box<dyn Participant>>,
    recorder: &Arc<Mutex<Recorder>>,
) -> Vec<LocalParticipant> {
    connect_locally(plan, participants, |participant| {
        Box::new(Direct {
            recorder: recorder.clone(),
            participant,
        })
    })
}

/// The time of activation `next` of participant number `number`, s.
fn instant(plan: &Plan, number: usize, next: u64) -> f64 {
    plan.timebase
        .seconds(plan.participants[number].sample_time.instant(next))
}

/// The log of participant number `number`.
fn log(plan: &Plan, number: usize, logs: &SharedLogs) -> Log {
    Log::new(&plan.participants[number].name, Some(logs.sink()))
}

fn participant_failure(entry: &Entry, error: impl ToString) -> RunFailure {
    RunFailure::Participant {
        participant: entry.setup.name.clone(),
        reason: error.to_string(),
    }
}

/// The participant in a slot when the run is resumed; `now` is the present participant, which is about to do activation `next`.
fn fill_slot(
    run_state: &RunState,
    number: usize,
    next: u64,
    slot: Slot,
    now: Option<Box<dyn Participant>>,
    logs: &SharedLogs,
) -> Result<Option<Box<dyn Participant>>, RunFailure> {
    let t = instant(&run_state.plan, number, next);
    let log = log(&run_state.plan, number, logs);
    match (slot, now) {
        (Slot::Same(state), Some(mut participant)) => {
            prepare_to_resume(participant.as_mut(), t, false, state.as_deref(), &log)
                .map_err(|error| participant_failure(&run_state.entries[number], error))?;
            Ok(Some(participant))
        }
        (Slot::Same(_), None) => Ok(None),
        (Slot::New(entry, state), now) => {
            if let Some(mut now) = now {
                terminate(now.as_mut(), Termination::Replaced, &log);
            }
            let mut replacement = make(&run_state.scenario, &entry)?;
            if let Some(difference) = replacement
                .interface()
                .difference(&run_state.plan.participants[number].interface)
            {
                let reason = format!("describes other ports than expected: {difference}");
                return Err(participant_failure(&entry, reason));
            }
            prepare_to_resume(replacement.as_mut(), t, true, state.as_deref(), &log)
                .map_err(|error| participant_failure(&entry, error))?;
            Ok(Some(replacement))
        }
    }
}

fn interrupted_ending(t_s: f64) -> Ending {
    let reason = format!("interrupted at t = {t_s} s");
    Ending::Stopped { reason }
}

impl LoopExecutor {
    /// The end of the next stretch: as far as the clock controller grants, and short enough to look at the clock and the signals in time.
    fn next_horizon(&self, run_state: &mut RunState) -> Ticks {
        let reached = self.reached;
        let shortest = run_state
            .plan
            .participants
            .iter()
            .map(|planned| planned.sample_time.period)
            .min();
        let stretch = shortest.unwrap_or(1).saturating_mul(ACTIVATIONS_PER_CHECK);
        let horizon = run_state.clock.horizon(reached).min(reached.saturating_add(stretch));
        if horizon == reached && horizon > 0 && run_state.clock.stop() != Some(reached) {
            std::thread::sleep(POLL_INTERVAL);
        }
        horizon
    }

    /// Runs the participants up to `horizon`, or up to the step of the participant that is to be paused.
    fn run_up_to(&mut self, run_state: &mut RunState, horizon: Ticks) -> Result<StopReason, RunError> {
        let Some(in_loop) = &mut self.in_loop else {
            return Ok(StopReason::Horizon);
        };
        let RunState {
            span_analysis, clock, ..
        } = run_state;
        let needs_spans = span_analysis.needs_spans();
        let observe = |event| match event {
            _ if !needs_spans => {}
            LoopEvent::Started => span_analysis.step_begins(),
            LoopEvent::Stepped {
                participant,
                activation,
            } => span_analysis.step_ends(participant, activation, clock),
        };
        match self.pause_before {
            Some(number) => in_loop.run_to_step(number, horizon, observe),
            None if needs_spans => in_loop.run_to(horizon, observe),
            None => in_loop.run_to(horizon, |_| {}),
        }
    }
}

impl Executor for LoopExecutor {
    fn turn(&mut self, run_state: &mut RunState) -> Result<Turn, Ending> {
        let horizon = self.parked.unwrap_or_else(|| self.next_horizon(run_state));
        let reach = self.run_up_to(run_state, horizon);
        self.logs.report_to(&run_state.options.progress);
        let reach = reach?;
        self.parked = (reach == StopReason::Deferred).then_some(horizon);
        if reach == StopReason::Deferred {
            return Ok(Turn::Parked);
        }
        let (plan, reached) = (run_state.plan.clone(), self.reached);
        let steppers = self.in_loop.as_ref().map(InLoop::steppers).unwrap_or_default();
        let dropped = run_state
            .recorder()
            .drop_unneeded(|_, number| steppers[number].next_activation());
        dropped.map_err(|failure| run_state.ending_of(failure))?;
        let violation = run_state.recorder().take_violation();
        if let Some((number, reason)) = violation {
            let participant = run_state.name(number).to_owned();
            return Err(Ending::Failed { participant, reason });
        }
        if let Some(participant) = self.logs.full() {
            let reason = full_log_reason();
            return Err(Ending::Failed { participant, reason });
        }
        if reach == StopReason::BeforeStep
            && let Some(stepper) = self.before_step()
        {
            let at = stepper.next_instant();
            let t_s = plan.timebase.seconds(at);
            run_state.options.progress.report(Report::Time { t_s });
            return Ok(match run_state.options.interrupt.is_requested() {
                true => Turn::Over(interrupted_ending(t_s)),
                false => Turn::BeforeStep(at),
            });
        }
        run_state.report_progress(horizon, horizon == reached);
        self.reached = horizon;
        let t_s = plan.timebase.seconds(horizon);
        run_state.options.progress.report(Report::Time { t_s });
        if run_state.options.interrupt.is_requested() {
            return Ok(Turn::Over(interrupted_ending(t_s)));
        }
        if let Some(reason) = run_state.span_analysis.stop_reason() {
            let reason = reason.to_owned();
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if horizon >= plan.end {
            return Ok(Turn::Over(Ending::Complete));
        }
        if run_state.options.steering.is_some() && self.last_flush.elapsed() > FLUSH_INTERVAL {
            self.last_flush = Instant::now();
            let flushed = run_state.recorder().flush();
            flushed.map_err(|error| Ending::orchestrator_failed(error.to_string()))?;
        }
        match run_state.clock.stop() {
            Some(stop) if stop == horizon => Ok(Turn::Paused(stop)),
            _ => Ok(Turn::Continue),
        }
    }

    fn park(&mut self) {
        self.in_loop.iter_mut().for_each(InLoop::defer_steps);
    }

    fn pending(&mut self) -> Option<PendingStep<'_>> {
        self.in_loop.as_mut()?.pending()
    }

    fn has_reached(&self, now: Ticks) -> bool {
        self.reached == now
    }

    fn save(&mut self, run_state: &RunState, number: usize) -> Result<Vec<u8>, RunFailure> {
        let steppers = self.in_loop.as_ref().map(InLoop::steppers).unwrap_or_default();
        let state = steppers
            .get(number)
            .map_or(Ok(None), |stepper| state::of(stepper.participant()));
        let entry = &run_state.entries[number];
        let state = state.map_err(|reason| participant_failure(entry, save_failed(&reason)))?;
        state.ok_or_else(|| participant_failure(entry, cannot_save()))
    }

    fn continue_at(
        &mut self,
        run_state: &mut RunState,
        cut: &Cut,
        slots: Vec<Slot>,
        rewind: bool,
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        let replacements: Vec<Option<Entry>> = (slots.iter())
            .map(|slot| match slot {
                Slot::New(entry, _) => Some((**entry).clone()),
                Slot::Same(_) => None,
            })
            .collect();
        if rewind {
            let Some(in_loop) = self.in_loop.take() else {
                return Err(RunFailure::Other("the run is over".into()));
            };
            let slotted = in_loop.into_participants().into_iter().zip(slots).enumerate();
            let participants = slotted.filter_map(|(number, (now, one))| {
                fill_slot(run_state, number, cut.next[number], one, Some(now), &self.logs).transpose()
            });
            let participants = participants.collect::<Result<Vec<_>, _>>()?;
            let positions = run_state.positions(cut)?;
            let parts = parts(&run_state.plan, participants, &run_state.recorder);
            let in_loop = InLoop::resume(&run_state.plan, parts, positions);
            let mut in_loop = in_loop.map_err(|error| RunFailure::Other(error.to_string()))?;
            in_loop.log_to(&self.logs.sink());
            self.in_loop = Some(in_loop);
        } else if let Some(in_loop) = &mut self.in_loop {
            // The other participants are not affected when a slot gets another program.
            for (number, one) in slots.into_iter().enumerate() {
                if let Slot::New(..) = one {
                    in_loop.notify_replaced(number);
                }
                if let Some(replacement) = fill_slot(run_state, number, cut.next[number], one, None, &self.logs)? {
                    in_loop.replace(number, replacement);
                }
            }
        }
        run_state.recorder().continue_at(cut);
        for (entry, replacement) in run_state.entries.iter_mut().zip(replacements) {
            if let Some(replacement) = replacement {
                *entry = replacement;
            }
        }
        Ok(Vec::new())
    }

    fn apply_inputs(&mut self, run_state: &mut RunState, _: &Cut) -> Result<Vec<FailedParticipant>, RunFailure> {
        if let Some(in_loop) = &mut self.in_loop {
            for (participant, input, payload) in run_state.inputs.iter() {
                in_loop.set_input(participant, input, payload);
            }
        }
        Ok(Vec::new())
    }

    fn set_reached(&mut self, to: Ticks) {
        self.reached = to;
    }

    fn isolates_failures(&self) -> bool {
        false
    }

    fn handle_failure(&mut self, _: &mut RunState, ending: Ending) -> Result<(), Ending> {
        Err(ending)
    }

    fn register_failures(&mut self, _: Vec<FailedParticipant>) {}

    fn processes(&self) -> String {
        format!("process {}", std::process::id())
    }

    fn failure(&mut self, _: &RunState) -> Option<RunFailure> {
        None
    }

    fn restart_timeout(&mut self) {}

    fn pause_before_step(&mut self, number: usize) -> Option<Ticks> {
        self.pause_before = Some(number);
        let stepper = self.in_loop.as_ref()?.steppers().get(number)?;
        let next = stepper.next_activation() + u64::from(stepper.is_before_step());
        Some(stepper.assignment().sample_time.instant(next))
    }

    fn clear_step_pause(&mut self) {
        self.pause_before = None;
    }

    fn before_step(&self) -> Option<&Stepper> {
        let stepper = self.in_loop.as_ref()?.steppers().get(self.pause_before?)?;
        stepper.is_before_step().then_some(stepper)
    }

    fn set_output(&mut self, output: usize, payload: &[u8]) {
        if let (Some(in_loop), Some(number)) = (&mut self.in_loop, self.pause_before) {
            in_loop.set_output(number, output, payload);
        }
    }

    fn newest_log(&self, participant: &str) -> Option<String> {
        Some(self.logs.newest(participant))
    }

    fn shut_down(&mut self, run_state: &mut RunState) {
        self.in_loop = None;
        self.logs.report_to(&run_state.options.progress);
    }

    fn report(&self) -> ExecutorReport {
        ExecutorReport {
            placement: "all participants in one loop of one process".into(),
            logs: self.logs.in_memory(),
            ..ExecutorReport::default()
        }
    }
}
