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
use super::logs::Said;
use crate::observer::Event as Report;
use crate::run::executor::{Account, Executor, Slot, Turn};
use crate::run::failed::FailedParticipant;
use crate::run::log::flood;
use crate::run::options::Options;
use crate::run::outcome::{Ending, RunFailure};
use crate::run::prepare::Made;
use crate::run::recording::recorder::Recorder;
use crate::run::saved::checkpoint::{cannot_save, save_failed};
use crate::run::state::RunState;
use crate::scenario::{Entry, ORCHESTRATOR, Program, Scenario};

/// Activations between two looks at the clock and the signals.
const GLANCE: i64 = 512;
/// The pause between polls while no participant may proceed.
const NAP: Duration = Duration::from_millis(1);
/// With a live page, recorded samples are flushed at least this often.
const FLUSH: Duration = Duration::from_millis(50);

/// All participants of a run in one loop.
pub(crate) struct Loop {
    /// Always present, except while the loop is being rebuilt to go back.
    looped: Option<InLoop>,
    reached: Ticks,
    /// Where the present stretch ends, while it waits for a step to be done together with those of other runs.
    parked: Option<Ticks>,
    flushed: Instant,
    /// The participant that is held before each step.
    hold: Option<usize>,
    said: Said,
}

/// The participants in the slots of a run when it begins.
pub(crate) fn in_slots(
    scenario: &Scenario,
    options: &Options,
    entries: &[Entry],
    made: Made,
) -> Result<Vec<Box<dyn Participant>>, RunFailure> {
    // A program that cannot run in this process is refused now, not at its substitution.
    let elsewhere =
        |entry: &&Entry| entry.program.is_external() && scenario.builtins().factory_within(&entry.program).is_none();
    if let Some(entry) = entries.iter().find(elsewhere) {
        return Err(outside(scenario, entry));
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
) -> Result<Loop, RunFailure> {
    let said = Said::new(folder);
    let mut looped = match positions {
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
                    &log(plan, number, &said),
                )
                .map_err(|error| odd(&entries[number], error))?;
            }
            let parts = parts(plan, participants, recorder);
            InLoop::resume(plan, parts, positions).map_err(|error| RunFailure::Other(error.to_string()))?
        }
    };
    looped.log_to(&said.sink());
    Ok(Loop {
        looped: Some(looped),
        reached: from,
        parked: None,
        flushed: Instant::now(),
        hold: None,
        said,
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
fn outside(scenario: &Scenario, entry: &Entry) -> RunFailure {
    let name = &entry.setup.name;
    let reason = format!(
        "participant `{name}` is a program of its own, {}, which cannot run in this process: leave out --in-process, or make it a plug-in",
        entry.program
    );
    scenario.program_refusal(entry, &reason).into()
}

/// A participant that can run in this process.
fn make(scenario: &Scenario, entry: &Entry) -> Result<Box<dyn Participant>, RunFailure> {
    scenario.participant(entry)?.ok_or_else(|| outside(scenario, entry))
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
fn log(plan: &Plan, number: usize, said: &Said) -> Log {
    Log::new(&plan.participants[number].name, Some(said.sink()))
}

fn odd(entry: &Entry, error: impl ToString) -> RunFailure {
    RunFailure::Participant {
        participant: entry.setup.name.clone(),
        reason: error.to_string(),
    }
}

/// The participant in a slot when the run is resumed; `now` is the present participant, which is about to do activation `next`.
fn slot(
    run_state: &RunState,
    number: usize,
    next: u64,
    slot: Slot,
    now: Option<Box<dyn Participant>>,
    said: &Said,
) -> Result<Option<Box<dyn Participant>>, RunFailure> {
    let t = instant(&run_state.plan, number, next);
    let log = log(&run_state.plan, number, said);
    match (slot, now) {
        (Slot::Same(state), Some(mut participant)) => {
            prepare_to_resume(participant.as_mut(), t, false, state.as_deref(), &log)
                .map_err(|error| odd(&run_state.entries[number], error))?;
            Ok(Some(participant))
        }
        (Slot::Same(_), None) => Ok(None),
        (Slot::New(entry, state), now) => {
            if let Some(mut now) = now {
                terminate(now.as_mut(), Termination::Replaced, &log);
            }
            let mut newcomer = make(&run_state.scenario, &entry)?;
            if let Some(difference) = newcomer
                .interface()
                .difference(&run_state.plan.participants[number].interface)
            {
                let reason = format!("describes other ports than expected: {difference}");
                return Err(odd(&entry, reason));
            }
            prepare_to_resume(newcomer.as_mut(), t, true, state.as_deref(), &log)
                .map_err(|error| odd(&entry, error))?;
            Ok(Some(newcomer))
        }
    }
}

fn interrupted(t_s: f64) -> Ending {
    let reason = format!("interrupted at t = {t_s} s");
    Ending::Stopped { reason }
}

impl Loop {
    /// The end of the next stretch: as far as the clock controller grants, and short enough to look at the clock and the signals in time.
    fn next_horizon(&self, run_state: &mut RunState) -> Ticks {
        let reached = self.reached;
        let shortest = run_state
            .plan
            .participants
            .iter()
            .map(|own| own.sample_time.period)
            .min();
        let stretch = shortest.unwrap_or(1).saturating_mul(GLANCE);
        let horizon = run_state.clock.horizon(reached).min(reached.saturating_add(stretch));
        if horizon == reached && horizon > 0 && run_state.clock.stop() != Some(reached) {
            std::thread::sleep(NAP);
        }
        horizon
    }

    /// Runs the participants up to `horizon`, or up to the step of the participant that is to be held.
    fn stretch(&mut self, run_state: &mut RunState, horizon: Ticks) -> Result<StopReason, RunError> {
        let Some(looped) = &mut self.looped else {
            return Ok(StopReason::Horizon);
        };
        let RunState { times, clock, .. } = run_state;
        let wants = times.wants();
        let watch = |event| match event {
            _ if !wants => {}
            LoopEvent::Started => times.begins(),
            LoopEvent::Stepped {
                participant,
                activation,
            } => times.stepped(participant, activation, clock),
        };
        match self.hold {
            Some(number) => looped.run_before(number, horizon, watch),
            None if wants => looped.run_to(horizon, watch),
            None => looped.run_to(horizon, |_| {}),
        }
    }
}

impl Executor for Loop {
    fn turn(&mut self, run_state: &mut RunState) -> Result<Turn, Ending> {
        let horizon = self.parked.unwrap_or_else(|| self.next_horizon(run_state));
        let reach = self.stretch(run_state, horizon);
        self.said.tell(&run_state.options.progress);
        let reach = reach?;
        self.parked = (reach == StopReason::Deferred).then_some(horizon);
        if reach == StopReason::Deferred {
            return Ok(Turn::Parked);
        }
        let (plan, reached) = (run_state.plan.clone(), self.reached);
        let steppers = self.looped.as_ref().map(InLoop::steppers).unwrap_or_default();
        let forgotten = run_state
            .recorder()
            .forget(|_, number| steppers[number].next_activation());
        forgotten.map_err(|failure| run_state.over(failure))?;
        let violation = run_state.recorder().take_violation();
        if let Some((number, reason)) = violation {
            let participant = run_state.name(number).to_owned();
            return Err(Ending::Failed { participant, reason });
        }
        if let Some(participant) = self.said.full() {
            let reason = flood();
            return Err(Ending::Failed { participant, reason });
        }
        if reach == StopReason::Held
            && let Some(held) = self.held()
        {
            let at = held.next_instant();
            let t_s = plan.timebase.seconds(at);
            run_state.options.progress.report(Report::Time { t_s });
            return Ok(match run_state.options.interrupt.asked() {
                true => Turn::Over(interrupted(t_s)),
                false => Turn::Held(at),
            });
        }
        run_state.tell(horizon, horizon == reached);
        self.reached = horizon;
        let t_s = plan.timebase.seconds(horizon);
        run_state.options.progress.report(Report::Time { t_s });
        if run_state.options.interrupt.asked() {
            return Ok(Turn::Over(interrupted(t_s)));
        }
        if let Some(reason) = run_state.times.stops() {
            let reason = reason.to_owned();
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if horizon >= plan.end {
            return Ok(Turn::Over(Ending::Complete));
        }
        if run_state.options.steering.is_some() && self.flushed.elapsed() > FLUSH {
            self.flushed = Instant::now();
            let flushed = run_state.recorder().flush();
            flushed.map_err(|error| Ending::own(error.to_string()))?;
        }
        match run_state.clock.stop() {
            Some(stop) if stop == horizon => Ok(Turn::Rests(stop)),
            _ => Ok(Turn::Going),
        }
    }

    fn park(&mut self) {
        self.looped.iter_mut().for_each(InLoop::defer_steps);
    }

    fn pending(&mut self) -> Option<PendingStep<'_>> {
        self.looped.as_mut()?.pending()
    }

    fn rests_at(&self, now: Ticks) -> bool {
        self.reached == now
    }

    fn save(&mut self, run_state: &RunState, number: usize) -> Result<Vec<u8>, RunFailure> {
        let steppers = self.looped.as_ref().map(InLoop::steppers).unwrap_or_default();
        let state = steppers
            .get(number)
            .map_or(Ok(None), |stepper| state::of(stepper.participant()));
        let entry = &run_state.entries[number];
        let state = state.map_err(|reason| odd(entry, save_failed(&reason)))?;
        state.ok_or_else(|| odd(entry, cannot_save()))
    }

    fn continue_at(
        &mut self,
        run_state: &mut RunState,
        cut: &Cut,
        slots: Vec<Slot>,
        back: bool,
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        let newcomers: Vec<Option<Entry>> = (slots.iter())
            .map(|slot| match slot {
                Slot::New(entry, _) => Some((**entry).clone()),
                Slot::Same(_) => None,
            })
            .collect();
        if back {
            let Some(looped) = self.looped.take() else {
                return Err(RunFailure::Other("the run is over".into()));
            };
            let in_slots = looped.into_participants().into_iter().zip(slots).enumerate();
            let participants = in_slots.filter_map(|(number, (now, one))| {
                slot(run_state, number, cut.next[number], one, Some(now), &self.said).transpose()
            });
            let participants = participants.collect::<Result<Vec<_>, _>>()?;
            let positions = run_state.positions(cut)?;
            let parts = parts(&run_state.plan, participants, &run_state.recorder);
            let looped = InLoop::resume(&run_state.plan, parts, positions);
            let mut looped = looped.map_err(|error| RunFailure::Other(error.to_string()))?;
            looped.log_to(&self.said.sink());
            self.looped = Some(looped);
        } else if let Some(looped) = &mut self.looped {
            // The other participants are not affected when a slot gets another program.
            for (number, one) in slots.into_iter().enumerate() {
                if let Slot::New(..) = one {
                    looped.notify_replaced(number);
                }
                if let Some(newcomer) = slot(run_state, number, cut.next[number], one, None, &self.said)? {
                    looped.replace(number, newcomer);
                }
            }
        }
        run_state.recorder().stand_at(cut);
        for (entry, newcomer) in run_state.entries.iter_mut().zip(newcomers) {
            if let Some(newcomer) = newcomer {
                *entry = newcomer;
            }
        }
        Ok(Vec::new())
    }

    fn show_inputs(&mut self, run_state: &mut RunState, _: &Cut) -> Result<Vec<FailedParticipant>, RunFailure> {
        if let Some(looped) = &mut self.looped {
            for (participant, input, payload) in run_state.inputs.iter() {
                looped.set_input(participant, input, payload);
            }
        }
        Ok(Vec::new())
    }

    fn went_back(&mut self, to: Ticks) {
        self.reached = to;
    }

    fn outlives_failures(&self) -> bool {
        false
    }

    fn survive(&mut self, _: &mut RunState, ending: Ending) -> Result<(), Ending> {
        Err(ending)
    }

    fn note_failures(&mut self, _: Vec<FailedParticipant>) {}

    fn processes(&self) -> String {
        format!("process {}", std::process::id())
    }

    fn failure(&mut self, _: &RunState) -> Option<RunFailure> {
        None
    }

    fn renew_patience(&mut self) {}

    fn hold(&mut self, number: usize) -> Option<Ticks> {
        self.hold = Some(number);
        let stepper = self.looped.as_ref()?.steppers().get(number)?;
        let next = stepper.next_activation() + u64::from(stepper.is_held());
        Some(stepper.assignment().sample_time.instant(next))
    }

    fn let_go(&mut self) {
        self.hold = None;
    }

    fn held(&self) -> Option<&Stepper> {
        let stepper = self.looped.as_ref()?.steppers().get(self.hold?)?;
        stepper.is_held().then_some(stepper)
    }

    fn answer(&mut self, output: usize, payload: &[u8]) {
        if let (Some(looped), Some(number)) = (&mut self.looped, self.hold) {
            looped.set_output(number, output, payload);
        }
    }

    fn said(&self, participant: &str) -> Option<String> {
        Some(self.said.newest(participant))
    }

    fn bring_down(&mut self, run_state: &mut RunState) {
        self.looped = None;
        self.said.tell(&run_state.options.progress);
    }

    fn account(&self) -> Account {
        Account {
            placement: "all participants in one loop of one process".into(),
            logs: self.said.kept(),
            ..Account::default()
        }
    }
}
