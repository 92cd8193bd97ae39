//! A run with every participant in a process of its own.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use lockstep::plan::Plan;
use lockstep::time::Ticks;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tape::folder::RunFolder;
use tape::{Event, EventKind};

use super::agenda::Agenda;
use super::awake::Patience;
use super::checkpoint::Checkpoint;
use super::crew::{self, Member, Taken};
use super::explain;
use super::horizon::Guide;
use super::monitor::Monitor;
use super::outcome::{Ending, ORCHESTRATOR, Outcome, RunFailure};
use super::place::Place;
use super::prepare::{self, Known};
use super::recording::Recorder;
use super::set_up::{self, Ready};
use super::slices::Slices;
use super::survive::{Fallen, Restarts};
use super::{Options, bus, room};
use crate::observer::{Event as Report, Progress};
use crate::scenario::{Entry, OnFailure, Scenario};
use crate::scope::{self, Scope};

/// How long participants may take to leave after they were told to.
pub(super) const GRACE: Duration = Duration::from_millis(500);
/// The orchestrator's nap when there is nothing to do.
const NAP: Timespec = Timespec {
    tv_sec: 0,
    tv_nsec: 1_000_000,
};
/// Deaths are looked for at least this often.
const LOOK: Duration = Duration::from_millis(2);
/// Batches that are taken from one participant before the next one is looked at.
pub(super) const BATCHES: usize = 16;
/// Samples reach the disk at least this often.
const FLUSH: Duration = Duration::from_millis(50);

pub(super) fn run(scenario: &Scenario, options: &Options) -> Result<Outcome, RunFailure> {
    // Whatever can be refused is refused before anything starts or is written.
    let known = prepare::check(scenario)?;
    let entries = prepare::entries(scenario, options)?;
    scope::leftovers().iter().for_each(scope::Leftover::remove);
    let monitor = Monitor::new(options.interrupt.clone());
    room::check(&known.plan, scenario.moves())?;
    let claim = prepare::folder(scenario, options)?;
    let folder = claim.folder().clone();
    let ran = run_in(folder, scenario, options, &known, entries, monitor);
    prepare::settled(ran, claim)
}

fn run_in(
    folder: RunFolder,
    scenario: &Scenario,
    options: &Options,
    known: &Known,
    entries: Vec<Entry>,
    monitor: Monitor,
) -> Result<Outcome, RunFailure> {
    let Ready {
        entries,
        programs,
        scope,
        plan,
        recorder,
        start,
        place,
        placement,
        crew,
        recovered,
    } = set_up::set_up(
        scenario,
        options,
        &known.interfaces,
        &known.plan,
        entries,
        &folder,
        &monitor,
    )?;
    let agenda = Agenda::new(scenario, &plan, options, start.from, start.substituted)?;
    options.begin(&plan, &folder);
    let mut conductor = Conductor {
        guide: Guide::new(&plan, options, agenda, start.from),
        progress: options.progress.clone(),
        restarts: vec![Restarts::default(); entries.len()],
        slices: Slices::default(),
        fallen: Vec::new(),
        entries,
        substituted: start.substituted,
        programs,
        // What a run goes on from is good for going back to as well, until its first own checkpoint.
        last_checkpoint: options.origin.as_ref().map(|origin| origin.checkpoint.clone()),
        scenario,
        scope,
        folder,
        plan,
        options,
        monitor,
        crew,
        place,
        recorder,
        recovered,
        started: Instant::now(),
        patience: Patience::new(options.patience()),
        last_flush: Instant::now(),
        last_look: Instant::now(),
        warned: false,
    };
    let ending = conductor.conduct();
    let known = Instant::now();
    let wall_s = (known - conductor.started).as_secs_f64();
    let Conductor {
        crew,
        recorder,
        plan,
        place,
        scope,
        folder,
        recovered,
        ..
    } = conductor.bring_down(&ending);
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
    let (sealed, figures) = recorder.finish();
    let (ending, digest) = Outcome::sealed(ending, sealed);
    // Ports before the place, the place before its files.
    drop(crew);
    drop(place);
    drop(scope);
    Ok(Outcome {
        folder: folder.root().to_owned(),
        ending,
        simulated_s,
        wall_s,
        known,
        digest,
        recovered,
        figures,
        timing,
        sources,
        placement: placement.reason,
    })
}

/// A run under way.
pub(super) struct Conductor<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) plan: Plan,
    pub(super) options: &'a Options,
    pub(super) monitor: Monitor,
    /// What runs in each seat.
    pub(super) entries: Vec<Entry>,
    /// How many of the scenario's substitutions have happened.
    pub(super) substituted: usize,
    /// How many programs were started in mid-run.
    pub(super) programs: usize,
    pub(super) restarts: Vec<Restarts>,
    /// Who else failed, besides the one that was reported, and was not attended to yet.
    pub(super) fallen: Vec<Fallen>,
    pub(super) last_checkpoint: Option<Checkpoint>,
    pub(super) crew: Vec<Member>,
    pub(super) place: Place,
    pub(super) scope: Scope,
    pub(super) folder: RunFolder,
    pub(super) recorder: Recorder,
    pub(super) progress: Progress,
    /// How far everybody may go.
    pub(super) guide: Guide,
    /// What became of participants that failed.
    pub(super) recovered: Vec<String>,
    started: Instant,
    /// How long nothing may move.
    pub(super) patience: Patience,
    last_flush: Instant,
    last_look: Instant,
    slices: Slices,
    warned: bool,
}

impl Conductor<'_> {
    /// Moves the clock, records, and watches, until the run is over.
    fn conduct(&mut self) -> Ending {
        self.advance_clock();
        loop {
            match self.turn() {
                Ok(None) => {}
                Ok(Some(ending)) => return ending,
                Err(failed) => {
                    if let Err(ending) = self.survive(failed) {
                        return ending;
                    }
                }
            }
            self.advance_clock();
        }
    }

    /// One look around. `Some` when the run is over; the error is a failure that the run may survive.
    fn turn(&mut self) -> Result<Option<Ending>, Ending> {
        if self.drain()? {
            self.patience.renew();
            self.warned = false;
            self.look_for_lies()?;
            // However much the others have to say, a death is seen in time.
            if self.last_look.elapsed() > LOOK {
                self.look_for_deaths()?;
            }
        } else {
            self.look_for_deaths()?;
            self.look_for_lies()?;
            if self.crew.iter().all(|member| member.timing.is_some()) {
                return Ok(Some(Ending::Complete));
            }
            self.nap();
        }
        if bus::missed() {
            return Err(self.over(room::full()));
        }
        let t = self.plan.timebase.seconds(self.recorder.newest.max(0));
        self.progress.report(Report::Time { t_s: t });
        if self.monitor.asked() {
            let reason = format!("interrupted at t = {t} s");
            return Ok(Some(Ending::Stopped { reason }));
        }
        if self.last_flush.elapsed() > FLUSH {
            self.last_flush = Instant::now();
            self.recorder.flush().map_err(|error| Ending::own(error.to_string()))?;
            self.slices.look(self.crew.iter().map(|member| member.process.pid()));
        }
        if let Some(now) = self.guide.stop()
            && self.crew.iter().all(|member| member.rests_at(now))
            && let Some(ending) = self.attend(now)?
        {
            return Ok(Some(ending));
        }
        self.watch()?;
        Ok(None)
    }

    /// Moves the horizon as far as it may be.
    fn advance_clock(&mut self) {
        let horizon = self.guide.horizon(self.recorder.newest);
        if horizon > self.place.clock.horizon() {
            self.recorder.grant(horizon);
            self.place.clock.extend(horizon);
            self.crew.iter().for_each(Member::ring);
        }
    }

    /// Waits for the user.
    pub(super) fn pause(&mut self, now: Ticks) -> Result<bool, RunFailure> {
        // Whoever looks at the tape now sees everything before the rest.
        self.recorder.flush()?;
        let steering = self.guide.hold(now);
        let who: Vec<String> = (self.crew.iter())
            .map(|member| format!("{} is process {}", member.process.name, member.process.pid()))
            .collect();
        let (plan, crew) = (&self.plan, &mut self.crew);
        let go_on = prepare::pause(
            plan,
            now,
            &who.join(", "),
            &self.progress,
            self.monitor.interrupt(),
            steering.as_deref(),
            || {
                let mut all = crew.iter_mut().enumerate();
                all.find_map(|(number, member)| {
                    let reason = member.process_failure(plan, number)?;
                    let participant = member.process.name.clone();
                    Some(RunFailure::Participant { participant, reason })
                })
            },
        );
        self.guide.go_on();
        go_on
    }

    /// Takes what participants have recorded; whether anything moved.
    fn drain(&mut self) -> Result<bool, Ending> {
        let mut moved = false;
        for number in 0..self.crew.len() {
            // Bounded, so that one participant cannot keep the others from being heard.
            for _ in 0..BATCHES {
                match self.take_from(number)? {
                    Taken::Nothing => break,
                    Taken::Old => {}
                    Taken::News => moved = true,
                }
            }
        }
        Ok(moved)
    }

    /// Takes a batch of what participant number `number` has recorded.
    fn take_from(&mut self, number: usize) -> Result<Taken, Ending> {
        let member = &mut self.crew[number];
        let failed = |participant: &str, reason: String| Ending::Failed {
            participant: participant.to_owned(),
            reason,
        };
        let taken = member.take(number, &mut self.recorder);
        let moved = match taken {
            Ok(moved) => moved,
            Err(broken) => {
                if let Some(error) = self.recorder.take_error() {
                    return Err(failed(ORCHESTRATOR, error.to_string()));
                }
                let all = self
                    .crew
                    .iter()
                    .map(|one| (one.process.name.as_str(), one.process.pid()));
                let victim = &self.crew[number];
                let name = &victim.process.name;
                return Err(match victim.foreign_writer(all) {
                    Some((author, process)) => failed(author, crew::foreign_writer_reason(name, process, &broken.0)),
                    None => failed(name, broken.0),
                });
            }
        };
        let (member, name) = (&self.crew[number], &self.crew[number].process.name);
        match member.failure() {
            Some(reason) => Err(failed(name, reason)),
            None => Ok(moved),
        }
    }

    fn look_for_deaths(&mut self) -> Result<(), Ending> {
        self.last_look = Instant::now();
        for number in 0..self.crew.len() {
            if self.crew[number].process.ended().is_some() {
                // What it sent before it died counts.
                while self.take_from(number)? != Taken::Nothing {}
            }
            let member = &mut self.crew[number];
            if let Some(reason) = member.process_failure(&self.plan, number) {
                let participant = member.process.name.clone();
                return Err(Ending::Failed { participant, reason });
            }
        }
        Ok(())
    }

    /// A guard did not let a sample pass. The sample is on the tape, so a restart would have to give it again.
    fn look_for_lies(&mut self) -> Result<(), Ending> {
        let Some((number, mut reason)) = self.recorder.take_lie() else {
            return Ok(());
        };
        let entry = &mut self.entries[number];
        if entry.on_failure == OnFailure::Restart {
            entry.on_failure = OnFailure::Stop;
            reason += "; a restart would have to give the same again, so the run ends";
        }
        let participant = entry.setup.name.clone();
        Err(Ending::Failed { participant, reason })
    }

    /// Sleeps until a participant ends, or for a moment.
    fn nap(&self) {
        let alive = self.crew.iter().filter(|member| member.timing.is_none());
        let mut ends: Vec<PollFd<'_>> = alive
            .map(|member| PollFd::from_borrowed_fd(member.process.descriptor(), PollFlags::IN))
            .collect();
        let _ = poll(&mut ends, Some(&NAP));
    }

    /// Nothing has moved for a while: say why; after the time that a participant is given, end the run.
    fn watch(&mut self) -> Result<(), Ending> {
        let resting = self
            .crew
            .iter()
            .all(|member| member.rests_at(self.place.clock.horizon()));
        self.guide.tell(self.recorder.newest, resting);
        if resting {
            self.patience.renew();
        }
        let over = self.patience.is_over();
        let still = self.patience.used_s();
        if !over && (still <= 2.0 || self.warned) {
            return Ok(());
        }
        let horizon = self.place.clock.horizon();
        let recorded = |stream| self.recorder.count(stream);
        let (participant, reason) = explain::standstill(&self.plan, &self.crew, horizon, still, recorded);
        if over {
            return Err(Ending::Failed { participant, reason });
        }
        self.warned = true;
        self.progress.say(&reason);
        Ok(())
    }

    /// Tells everybody to leave, sees that they do, and takes what they still had to say.
    fn bring_down(mut self, ending: &Ending) -> Self {
        self.progress.report(Report::Over);
        self.place.clock.stop();
        self.crew.iter().for_each(Member::ring);
        let mut grace = Patience::new(GRACE);
        for member in &mut self.crew {
            member.process.end_within(&mut grace);
        }
        // What the others had handed over counts, whoever failed.
        for number in 0..self.crew.len() {
            self.crew[number].failed = None;
            while let Ok(Taken::Old | Taken::News) = self.take_from(number) {}
        }
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
        self
    }
}
