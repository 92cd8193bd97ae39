//! A run with every participant in a process of its own.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use lockstep::control::Note;
use lockstep::plan::Plan;
use lockstep::transport::iceoryx::{ClockWriter, Domain, LinkService};
use recorder::tape::{Event, EventKind};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::Options;
use super::crew::{self, Member};
use super::explain;
use super::horizon::Guide;
use super::outcome::{Ending, Outcome, RunFailure};
use super::prepare;
use super::progress::Progress;
use super::recording::Recorder;
use super::signals::Interrupt;
use crate::scenario::Scenario;
use crate::scope::{self, Scope};

/// How long participants may take to leave after they were told to.
const GRACE: Duration = Duration::from_millis(500);
/// The orchestrator's nap when there is nothing to do.
const NAP: Timespec = Timespec {
    tv_sec: 0,
    tv_nsec: 500_000,
};
/// Samples reach the disk at least this often.
const FLUSH: Duration = Duration::from_millis(50);

pub(super) fn run(scenario: &Scenario, options: &Options) -> Result<Outcome, RunFailure> {
    // Whatever can be refused is refused before anything starts or is written.
    let known = prepare::check(scenario)?;
    scope::leftovers().iter().for_each(scope::Leftover::remove);
    let interrupt = Interrupt::install().map_err(|error| RunFailure::Other(error.to_string()))?;
    let folder = prepare::folder(scenario, options)?;
    let scope = Scope::create()?;
    let domain = Domain::enter(scope.address().clone(), "orchestrator")?;
    let mut crew = crew::launch(scenario, &domain, &folder, &interrupt)?;
    let interfaces = crew::interfaces(scenario, &known.interfaces, &mut crew, &interrupt)?;
    let plan = scenario.plan(&interfaces)?;
    let recorder = prepare::recorder(scenario, &plan, &folder)?;

    let mut links = Vec::new();
    for (number, link) in plan.links.iter().enumerate() {
        let size = plan.participants[link.from.0].interface.outputs[link.from.1]
            .descriptor
            .size as usize;
        links.push(LinkService::create(&domain, number as u32, size, link.capacity)?);
    }
    let clock = ClockWriter::create(&domain, plan.participants.len())?;
    let placement = crew::connect(&plan, &mut crew, options, &interrupt)?;
    options.begin(&plan, &folder);
    let mut conductor = Conductor {
        guide: Guide::new(&plan, options)?,
        progress: Progress::new(scenario.duration.seconds(), options.quiet),
        plan,
        options,
        interrupt,
        crew,
        clock,
        recorder,
        started: Instant::now(),
        last_moved: Instant::now(),
        last_flush: Instant::now(),
        warned: false,
    };
    let ending = conductor.conduct();
    let wall_s = conductor.started.elapsed().as_secs_f64();
    let Conductor {
        crew,
        recorder,
        plan,
        clock,
        ..
    } = conductor.bring_down(&ending)?;
    let timing = crew
        .iter()
        .filter_map(|member| Some((member.process.name.clone(), member.timing.clone()?)));
    let timing: BTreeMap<_, _> = timing.collect();
    let source = |link: &Option<usize>| link.map_or("nobody".into(), |link| plan.output_name(plan.links[link].from));
    let sources = (plan.participants.iter())
        .map(|own| (own.name.clone(), own.inputs.iter().map(source).collect()))
        .collect();
    let simulated_s = plan.timebase.seconds(recorder.newest.clamp(0, plan.end));
    let ending = recorder.with_active_faults(ending);
    let (digest, figures) = recorder.finish()?;
    // Ports before the domain, the domain before its files.
    drop((crew, links, clock));
    drop(domain);
    drop(scope);
    let folder = folder.root().to_owned();
    Ok(Outcome {
        folder,
        ending,
        simulated_s,
        wall_s,
        digest,
        figures,
        timing,
        sources,
        placement,
    })
}

/// A run under way.
struct Conductor<'a> {
    plan: Plan,
    options: &'a Options,
    interrupt: Interrupt,
    crew: Vec<Member>,
    clock: ClockWriter,
    recorder: Recorder,
    progress: Progress,
    /// How far everybody may go.
    guide: Guide,
    started: Instant,
    last_moved: Instant,
    last_flush: Instant,
    warned: bool,
}

impl Conductor<'_> {
    /// Moves the clock, records, and watches, until the run is over.
    fn conduct(&mut self) -> Ending {
        self.advance_clock();
        loop {
            match self.drain() {
                Err(ending) => return ending,
                Ok(true) => {
                    self.last_moved = Instant::now();
                    self.warned = false;
                }
                Ok(false) => {
                    if let Some(ending) = self.look_for_deaths() {
                        return ending;
                    }
                    if self.crew.iter().all(|member| member.timing.is_some()) {
                        return Ending::Complete;
                    }
                    self.nap();
                }
            }
            let t = self.plan.timebase.seconds(self.recorder.newest.max(0));
            self.progress.show(t);
            if self.interrupt.asked() {
                return Ending::Stopped {
                    reason: format!("interrupted at t = {t} s"),
                };
            }
            if self.last_flush.elapsed() > FLUSH {
                self.last_flush = Instant::now();
                if let Err(error) = self.recorder.flush() {
                    return Ending::Failed {
                        participant: "orchestrator".into(),
                        reason: error.to_string(),
                    };
                }
                if let Some(ending) = self.look_for_floods() {
                    return ending;
                }
            }
            if let Some(ending) = self.rest().or_else(|| self.watch()) {
                return ending;
            }
            self.advance_clock();
        }
    }

    /// Moves the horizon as far as it may be.
    fn advance_clock(&mut self) {
        let horizon = self.guide.horizon(self.recorder.newest);
        if horizon > self.clock.horizon() {
            self.clock.extend(horizon);
            self.crew.iter().for_each(|member| member.bell.ring());
        }
    }

    /// Takes what participants have recorded; whether there was anything.
    fn drain(&mut self) -> Result<bool, Ending> {
        let mut moved = false;
        for (number, member) in self.crew.iter_mut().enumerate() {
            // Bounded, so that one participant cannot keep the others from being heard.
            for _ in 0..16 {
                match member.take(number, &mut self.recorder) {
                    Ok(false) => break,
                    Ok(true) => moved = true,
                    Err(broken) => {
                        let blamed = if let Some(error) = self.recorder.take_error() {
                            Ending::Failed {
                                participant: "orchestrator".into(),
                                reason: error.to_string(),
                            }
                        } else {
                            Ending::Failed {
                                participant: member.process.name.clone(),
                                reason: broken.to_string(),
                            }
                        };
                        return Err(blamed);
                    }
                }
            }
            if let Some(Note::Failed { activation, t, reason }) = &member.failed {
                return Err(Ending::Failed {
                    participant: member.process.name.clone(),
                    reason: format!("failed at t = {t} s (activation {activation}): {reason}"),
                });
            }
        }
        Ok(moved)
    }

    fn look_for_deaths(&mut self) -> Option<Ending> {
        for number in 0..self.crew.len() {
            let Some(status) = self.crew[number].process.ended() else {
                continue;
            };
            if self.crew[number].timing.is_some() && status.success() {
                continue;
            }
            // What it sent before it died counts.
            match self.drain() {
                Err(ending) => return Some(ending),
                Ok(true) => return None,
                Ok(false) => {}
            }
            let member = &self.crew[number];
            let text = explain::death(&self.plan, number, member, status);
            return Some(Ending::Failed {
                participant: member.process.name.clone(),
                reason: text,
            });
        }
        None
    }

    fn look_for_floods(&self) -> Option<Ending> {
        let member = self.crew.iter().find(|member| member.process.floods())?;
        let reason = format!(
            "wrote more than {} MiB to its standard error",
            super::child::LOG_MAX >> 20
        );
        Some(Ending::Failed {
            participant: member.process.name.clone(),
            reason,
        })
    }

    /// Sleeps until a participant ends, or for a moment.
    fn nap(&self) {
        let alive = self.crew.iter().filter(|member| member.timing.is_none());
        let mut ends: Vec<PollFd<'_>> = alive
            .map(|member| PollFd::from_borrowed_fd(member.process.descriptor(), PollFlags::IN))
            .collect();
        let _ = poll(&mut ends, Some(&NAP));
    }

    /// At a stop: waits for the user once everybody is at rest.
    fn rest(&mut self) -> Option<Ending> {
        let stop = self.guide.stop()?;
        if !self.crew.iter().all(|member| member.rests_at(stop)) {
            return None;
        }
        // Whoever looks at the tape now sees everything before the stop.
        if let Err(error) = self.recorder.flush() {
            return Some(Ending::Failed {
                participant: "orchestrator".into(),
                reason: error.to_string(),
            });
        }
        let steering = self.guide.rest();
        let who: Vec<String> = (self.crew.iter())
            .map(|member| format!("{} is process {}", member.process.name, member.process.pid()))
            .collect();
        let who = who.join(", ");
        let go_on = prepare::pause(
            &self.plan,
            stop,
            &who,
            &mut self.progress,
            &self.interrupt,
            steering.as_deref(),
        );
        if !go_on {
            return Some(Ending::Stopped {
                reason: format!("stopped at t = {} s", self.plan.timebase.seconds(stop)),
            });
        }
        self.guide.go_on();
        self.last_moved = Instant::now();
        None
    }

    /// Nothing has moved for a while: say why; after the time that a participant is given, end the run.
    fn watch(&mut self) -> Option<Ending> {
        let resting = self.crew.iter().all(|member| member.rests_at(self.clock.horizon()));
        self.guide.tell(self.recorder.newest, resting);
        if resting {
            self.last_moved = Instant::now();
        }
        let still = self.last_moved.elapsed().as_secs_f64();
        if still > self.options.patience_s {
            let (culprit, text) = explain::standstill(&self.plan, &self.crew, still);
            return Some(Ending::Failed {
                participant: culprit,
                reason: text,
            });
        }
        if still > 2.0 && !self.warned {
            self.warned = true;
            let (_, text) = explain::standstill(&self.plan, &self.crew, still);
            self.progress.say(&text);
        }
        None
    }

    /// Tells everybody to leave, sees that they do, and takes what they still had to say.
    fn bring_down(mut self, ending: &Ending) -> Result<Self, RunFailure> {
        self.progress.clear();
        self.clock.stop();
        self.crew.iter().for_each(|member| member.bell.ring());
        let started = Instant::now();
        for number in 0..self.crew.len() {
            self.crew[number]
                .process
                .bring_down(GRACE.saturating_sub(started.elapsed()));
        }
        while matches!(self.drain(), Ok(true)) {}
        if let Ending::Failed { participant, reason } = ending {
            let time = self.plan.timebase.time(self.recorder.newest.max(0)).unwrap_or_default();
            let (participant, text) = (Some(participant.clone()), reason.clone());
            // A full disk has no room for the event either; the reason is printed all the same.
            let _ = self.recorder.event(&Event {
                time,
                kind: EventKind::Failure,
                participant,
                text,
            });
        }
        Ok(self)
    }
}
