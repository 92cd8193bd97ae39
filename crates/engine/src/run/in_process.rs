//! A run with all participants in this process.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use lockstep::executor::{InLoop, Part, RunError, assemble};
use lockstep::participant::Participant;
use lockstep::plan::Plan;
use lockstep::stepper::settle;
use lockstep::time::Ticks;
use tape::folder::RunFolder;
use tape::{Event, EventKind};

use super::agenda::{Agenda, Business};
use super::checkpoint::Checkpoint;
use super::horizon::Guide;
use super::outcome::{Ending, ORCHESTRATOR, Outcome, RunFailure};
use super::recording::{Direct, Recorder};
use super::{Options, prepare};
use crate::observer::{Event as Report, Interrupt, Progress};
use crate::scenario::{Entry, Scenario, State};

/// Activations between two looks at the clock and the signals.
const GLANCE: u32 = 512;
/// A nap while nobody may go on.
const NAP: Duration = Duration::from_millis(1);
/// Whoever watches the run sees samples at least this often.
const FLUSH: Duration = Duration::from_millis(50);

pub(super) fn run(scenario: &Scenario, options: &Options) -> Result<Outcome, RunFailure> {
    let plan = prepare::check_here(scenario)?.plan;
    let entries = prepare::entries(scenario, options)?;
    let participants = entries.iter().map(|entry| make(scenario, entry));
    let participants = participants.collect::<Result<Vec<_>, _>>()?;
    // A program that cannot run here is refused now, not at its time.
    for substitution in &scenario.substitutions {
        make(scenario, &substitution.entry)?;
    }
    let claim = prepare::folder(scenario, options)?;
    let folder = claim.folder().clone();
    let ran = run_in(&folder, scenario, options, plan, entries, participants);
    prepare::settled(ran, claim)
}

fn run_in(
    folder: &RunFolder,
    scenario: &Scenario,
    options: &Options,
    plan: Plan,
    entries: Vec<Entry>,
    mut participants: Vec<Box<dyn Participant>>,
) -> Result<Outcome, RunFailure> {
    let mut recorder = prepare::recorder(scenario, &plan, folder)?;
    let start = prepare::start(scenario, &plan, options, &mut recorder)?;
    let agenda = Agenda::new(scenario, &plan, options, start.from, start.substituted)?;
    let recorder = Arc::new(Mutex::new(recorder));
    let looped = match start.positions {
        None => InLoop::new(&plan, parts(&plan, participants, &recorder)),
        Some(mut positions) => {
            for (number, (participant, position)) in participants.iter_mut().zip(&mut positions).enumerate() {
                let state = position.state.take();
                let t = instant(&plan, number, position.next);
                settle(participant.as_mut(), t, true, state.as_deref())
                    .map_err(|error| odd(&entries[number], error))?;
            }
            let parts = parts(&plan, participants, &recorder);
            InLoop::resume(&plan, parts, positions).map_err(|error| RunFailure::Other(error.to_string()))?
        }
    };
    options.begin(&plan, folder);
    let mut run = Run {
        looped: Some(looped),
        scenario,
        guide: Guide::new(&plan, options, agenda, start.from),
        plan,
        options,
        entries,
        recorder,
        substituted: start.substituted,
        checkpoints: folder.checkpoints(),
        interrupt: options.interrupt.clone(),
        progress: options.progress.clone(),
        started: Instant::now(),
    };
    let ending = run.conduct(start.from)?;
    let known = Instant::now();
    let wall_s = (known - run.started).as_secs_f64();
    let Run {
        looped,
        plan,
        recorder,
        progress,
        ..
    } = run;
    progress.report(Report::Over);
    drop(looped);
    let recorder = Arc::into_inner(recorder).expect("the participants are gone");
    let mut recorder = recorder.into_inner().unwrap_or_else(PoisonError::into_inner);
    // A tape that cannot be written is the fault of no participant.
    let ending = match recorder.take_error() {
        Some(error) => Ending::own(error.to_string()),
        None => ending,
    };
    let simulated_s = plan.timebase.seconds(recorder.newest.clamp(0, plan.end));
    if let Ending::Failed { participant, reason } = &ending {
        let time = plan.timebase.time(recorder.newest.max(0)).unwrap_or_default();
        let (participant, text) = (Some(participant.clone()), reason.clone());
        // A full disk has no room for the event either; the reason is printed all the same.
        let _ = recorder.event(&Event {
            time,
            kind: EventKind::Failure,
            participant,
            text,
        });
    }
    let ending = recorder.with_active_faults(ending);
    let (sealed, figures) = recorder.finish();
    let (ending, digest) = Outcome::sealed(ending, sealed);
    Ok(Outcome {
        folder: folder.root().to_owned(),
        ending,
        simulated_s,
        wall_s,
        known,
        digest,
        recovered: Vec::new(),
        figures,
        timing: BTreeMap::new(),
        sources: BTreeMap::new(),
        placement: "all participants in one loop of one process".into(),
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
            stuck @ RunError::Stuck { .. } => (ORCHESTRATOR.into(), stuck.to_string()),
        };
        Ending::Failed { participant, reason }
    }
}

/// A participant that can run in this process.
fn make(scenario: &Scenario, entry: &Entry) -> Result<Box<dyn Participant>, RunFailure> {
    scenario.participant(entry)?.ok_or_else(|| RunFailure::Participant {
        participant: entry.setup.name.clone(),
        reason: "it is a program of its own, which cannot run in this process: leave out --in-process".into(),
    })
}

fn parts(plan: &Plan, participants: Vec<Box<dyn Participant>>, recorder: &Arc<Mutex<Recorder>>) -> Vec<Part> {
    assemble(plan, participants, |participant| {
        Box::new(Direct {
            recorder: recorder.clone(),
            participant,
        })
    })
}

/// When activation `next` of participant number `number` is, s.
fn instant(plan: &Plan, number: usize, next: u64) -> f64 {
    plan.timebase
        .seconds(plan.participants[number].sample_time.instant(next))
}

fn odd(entry: &Entry, error: impl ToString) -> RunFailure {
    RunFailure::Participant {
        participant: entry.setup.name.clone(),
        reason: error.to_string(),
    }
}

/// A run under way.
struct Run<'a> {
    /// Always there but while it is being taken up.
    looped: Option<InLoop>,
    scenario: &'a Scenario,
    plan: Plan,
    options: &'a Options,
    entries: Vec<Entry>,
    recorder: Arc<Mutex<Recorder>>,
    guide: Guide,
    substituted: usize,
    checkpoints: PathBuf,
    interrupt: Interrupt,
    progress: Progress,
    started: Instant,
}

impl Run<'_> {
    /// Runs from rest to rest, until it is over.
    fn conduct(&mut self, from: Ticks) -> Result<Ending, RunFailure> {
        let (mut reached, mut flushed) = (from, Instant::now());
        loop {
            if let Some(ending) = self.run_on(&mut reached) {
                return Ok(ending);
            }
            // Whoever looks at the tape at a rest sees everything before it.
            let at_rest = self.guide.stop() == Some(reached);
            if at_rest || (self.options.steering.is_some() && flushed.elapsed() > FLUSH) {
                flushed = Instant::now();
                self.recorder().flush()?;
            }
            while let Some(business) = self.guide.take(reached) {
                match business {
                    Business::Checkpoint { file: true } => self.checkpoint(reached)?,
                    // Nobody dies alone here, so nobody is restarted.
                    Business::Checkpoint { file: false } => {}
                    Business::Substitute(number) => self.substitute(reached, number)?,
                    Business::Pause => {
                        let who = format!("process {}", std::process::id());
                        let steering = self.guide.hold(reached);
                        let (progress, interrupt) = (&self.progress, &self.interrupt);
                        let steering = steering.as_deref();
                        if !prepare::pause(&self.plan, reached, &who, progress, interrupt, steering, || None)? {
                            let t = self.plan.timebase.seconds(reached);
                            let reason = format!("stopped at t = {t} s");
                            return Ok(Ending::Stopped { reason });
                        }
                        self.guide.go_on();
                    }
                }
            }
        }
    }

    fn recorder(&self) -> MutexGuard<'_, Recorder> {
        self.recorder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn save(&self, number: usize) -> Result<Vec<u8>, RunFailure> {
        let steppers = self.looped.as_ref().map(InLoop::steppers).unwrap_or_default();
        let state = steppers.get(number).and_then(|stepper| stepper.participant().save());
        state.ok_or_else(|| odd(&self.entries[number], "cannot save its state"))
    }

    fn checkpoint(&mut self, now: Ticks) -> Result<(), RunFailure> {
        let states = (0..self.entries.len()).map(|number| self.save(number));
        let states = states.collect::<Result<_, _>>()?;
        let (time, cut) = (self.plan.timebase.time(now).unwrap_or_default(), self.plan.cut_at(now));
        let checkpoint = Checkpoint::new(&self.plan, time, cut, states, self.substituted, &self.entries);
        self.recorder().flush()?;
        checkpoint.write(&self.checkpoints)?;
        Ok(())
    }

    fn substitute(&mut self, now: Ticks, number: usize) -> Result<(), RunFailure> {
        let substitution = &self.scenario.substitutions[number];
        let seat = substitution.participant;
        let cut = self.plan.cut_at(now);
        let state = match substitution.state {
            State::Cold => None,
            State::Keep => Some(self.save(seat)?),
        };
        let entry = substitution.entry.clone();
        let mut newcomer = make(self.scenario, &entry)?;
        if let Some(difference) = newcomer.interface().difference(&self.plan.participants[seat].interface) {
            return Err(odd(
                &entry,
                format!("describes other ports than expected: {difference}"),
            ));
        }
        let t = instant(&self.plan, seat, cut.next[seat]);
        settle(newcomer.as_mut(), t, true, state.as_deref()).map_err(|error| odd(&entry, error))?;
        let Some(looped) = self.looped.take() else {
            return Ok(());
        };
        let mut participants = looped.into_participants();
        participants[seat] = newcomer;
        let states = vec![None; participants.len()];
        let played = self.recorder().played()?;
        let positions = prepare::positions(&self.plan, &cut, &played, states)?;
        let parts = parts(&self.plan, participants, &self.recorder);
        let looped = InLoop::resume(&self.plan, parts, positions);
        self.looped = Some(looped.map_err(|error| RunFailure::Other(error.to_string()))?);
        let event = prepare::substitution_event(&self.plan, now, &cut, seat, &entry, substitution.state);
        self.recorder().event(&event)?;
        self.recorder().renew(seat);
        self.entries[seat] = entry;
        self.substituted = number + 1;
        Ok(())
    }

    /// Runs a short stretch, so that signals, pacing and wishes are seen. `Some` when the run is over.
    fn run_on(&mut self, reached: &mut Ticks) -> Option<Ending> {
        let shortest = self.plan.participants.iter().map(|own| own.sample_time.period).min();
        let stretch = shortest.unwrap_or(1).saturating_mul(i64::from(GLANCE));
        let horizon = self.guide.horizon(*reached).min(reached.saturating_add(stretch));
        if horizon == *reached && horizon > 0 {
            std::thread::sleep(NAP);
        }
        if let Some(Err(error)) = self.looped.as_mut().map(|looped| looped.run_to(horizon, |_| {})) {
            return Some(error.into());
        }
        if let Some((number, reason)) = self.recorder().take_lie() {
            let participant = self.entries[number].setup.name.clone();
            return Some(Ending::Failed { participant, reason });
        }
        self.guide.tell(horizon, horizon == *reached);
        *reached = horizon;
        let t = self.plan.timebase.seconds(horizon);
        self.progress.report(Report::Time { t_s: t });
        if self.interrupt.asked() {
            return Some(Ending::Stopped {
                reason: format!("interrupted at t = {t} s"),
            });
        }
        (horizon >= self.plan.end).then_some(Ending::Complete)
    }
}
