//! A run with all participants in this process.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lockstep::executor::{InLoop, RunError, assemble};
use lockstep::participant::Participant;
use lockstep::plan::Plan;
use lockstep::time::Ticks;
use recorder::tape::{Event, EventKind};

use super::horizon::Guide;
use super::outcome::{Ending, Outcome, RunFailure};
use super::progress::Progress;
use super::recording::Direct;
use super::signals::Interrupt;
use super::{Options, prepare};
use crate::scenario::Scenario;

/// Activations between two looks at the clock and the signals.
const GLANCE: u32 = 512;
/// A nap while nobody may go on.
const NAP: Duration = Duration::from_millis(1);
/// Whoever watches the run sees samples at least this often.
const FLUSH: Duration = Duration::from_millis(50);

pub(super) fn run(scenario: &Scenario, options: &Options) -> Result<Outcome, RunFailure> {
    let made = scenario.make()?;
    let mut participants: Vec<Box<dyn Participant>> = Vec::new();
    for (entry, participant) in scenario.participants.iter().zip(made) {
        participants.push(participant.ok_or_else(|| RunFailure::Participant {
            participant: entry.setup.name.clone(),
            reason: "it is a program of its own, which cannot run in this process: leave out --in-process".into(),
        })?);
    }
    let plan = prepare::check(scenario)?.plan;
    let folder = prepare::folder(scenario, options)?;
    let recorder = Arc::new(Mutex::new(prepare::recorder(scenario, &plan, &folder)?));
    let parts = assemble(&plan, participants, |participant| {
        Box::new(Direct {
            recorder: recorder.clone(),
            participant,
        })
    });
    let mut looped = InLoop::new(&plan, parts);
    let interrupt = Interrupt::install().map_err(|error| RunFailure::Other(error.to_string()))?;
    let mut progress = Progress::new(scenario.duration.seconds(), options.quiet);
    let started = Instant::now();
    options.begin(&plan, &folder);
    let mut guide = Guide::new(&plan, options)?;
    let mut flushed = Instant::now();
    let mut reached: Ticks = 0;
    let ending = loop {
        if let Some(end) = run_on(&mut looped, &plan, &mut reached, &mut guide, &interrupt, &mut progress) {
            break end;
        }
        // Whoever looks at the tape at a stop sees everything before it.
        let at_stop = guide.stop() == Some(reached);
        if at_stop || (options.steering.is_some() && flushed.elapsed() > FLUSH) {
            flushed = Instant::now();
            let mut recorder = recorder.lock().unwrap_or_else(PoisonError::into_inner);
            if let Err(error) = recorder.flush() {
                return Err(error.into());
            }
        }
        if at_stop {
            let who = format!("process {}", std::process::id());
            let steering = guide.rest();
            if !prepare::pause(&plan, reached, &who, &mut progress, &interrupt, steering.as_deref()) {
                break Ending::Stopped {
                    reason: format!("stopped at t = {} s", plan.timebase.seconds(reached)),
                };
            }
            guide.go_on();
        }
    };
    progress.clear();
    let wall_s = started.elapsed().as_secs_f64();
    drop(looped);
    let recorder = Arc::into_inner(recorder).expect("the participants are gone");
    let mut recorder = recorder.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some(error) = recorder.take_error() {
        return Err(error.into());
    }
    let simulated_s = plan.timebase.seconds(recorder.newest.clamp(0, plan.end));
    if let Ending::Failed { participant, reason } = &ending {
        let time = plan.timebase.time(recorder.newest.max(0)).unwrap_or_default();
        let (participant, text) = (Some(participant.clone()), reason.clone());
        recorder.event(&Event {
            time,
            kind: EventKind::Failure,
            participant,
            text,
        })?;
    }
    let ending = recorder.with_active_faults(ending);
    let (digest, figures) = recorder.finish()?;
    Ok(Outcome {
        folder: folder.root().to_owned(),
        ending,
        simulated_s,
        wall_s,
        digest,
        figures,
        timing: BTreeMap::new(),
        sources: BTreeMap::new(),
        placement: "all participants in one loop of one process".into(),
    })
}

/// Runs a short stretch, so that signals, pacing and wishes are seen. `Some` when the run is over.
fn run_on(
    looped: &mut InLoop,
    plan: &Plan,
    reached: &mut Ticks,
    guide: &mut Guide,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Option<Ending> {
    let shortest = plan.participants.iter().map(|own| own.sample_time.period).min();
    let stretch = shortest.unwrap_or(1).saturating_mul(i64::from(GLANCE));
    let horizon = guide.horizon(*reached).min(reached.saturating_add(stretch));
    if horizon == *reached && horizon > 0 {
        std::thread::sleep(NAP);
    }
    if let Err(error) = looped.run_to(horizon, |_| {}) {
        let participant = match &error {
            RunError::Participant { participant, .. } => participant.clone(),
            RunError::Stuck { .. } => String::new(),
        };
        return Some(Ending::Failed {
            participant,
            reason: error.to_string(),
        });
    }
    guide.tell(horizon, horizon == *reached);
    *reached = horizon;
    let t = plan.timebase.seconds(horizon);
    progress.show(t);
    if interrupt.asked() {
        return Some(Ending::Stopped {
            reason: format!("interrupted at t = {t} s"),
        });
    }
    (horizon >= plan.end).then_some(Ending::Complete)
}
