//! A run with all participants in this process.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use lockstep::executor::{InLoop, RunError, assemble};
use lockstep::participant::Participant;
use lockstep::time::Ticks;
use recorder::tape::{Event, EventKind};

use super::outcome::{Ending, Outcome, RunFailure};
use super::progress::Progress;
use super::recording::Direct;
use super::signals::Interrupt;
use super::{Options, prepare};
use crate::scenario::Scenario;

/// Activations between two looks at the clock and the signals.
const GLANCE: u32 = 512;

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
    let mut stops = prepare::stops(&plan, options)?;
    stops.push(plan.end);
    let mut ending = Ending::Complete;
    for stop in stops {
        if let Some(end) = run_to(&mut looped, &plan, stop, options, &interrupt, &mut progress, started) {
            ending = end;
            break;
        }
        let who = format!("process {}", std::process::id());
        if stop < plan.end && !prepare::pause(&plan, stop, &who, &mut progress, &interrupt) {
            ending = Ending::Stopped {
                reason: format!("stopped at t = {} s", plan.timebase.seconds(stop)),
            };
            break;
        }
    }
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
        placement: "all participants in one loop of one process".into(),
    })
}

/// Runs up to `stop`, in short stretches so that signals and pacing are seen. `Some` when the run is over.
fn run_to(
    looped: &mut InLoop,
    plan: &lockstep::plan::Plan,
    stop: Ticks,
    options: &Options,
    interrupt: &Interrupt,
    progress: &mut Progress,
    started: Instant,
) -> Option<Ending> {
    let shortest = plan
        .participants
        .iter()
        .map(|own| own.sample_time.period)
        .min()
        .unwrap_or(1);
    let stretch = shortest.saturating_mul(i64::from(GLANCE));
    let mut horizon: Ticks = 0;
    loop {
        horizon = match options.pace {
            None => horizon.saturating_add(stretch).min(stop),
            Some(pace) => prepare::paced(plan, pace, started).min(stop),
        };
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
        let t = plan.timebase.seconds(horizon);
        progress.show(t);
        if interrupt.asked() {
            return Some(Ending::Stopped {
                reason: format!("interrupted at t = {t} s"),
            });
        }
        if horizon >= stop {
            return None;
        }
        if options.pace.is_some() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
}
