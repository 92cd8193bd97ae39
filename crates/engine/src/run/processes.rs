//! The executor that runs every participant in its own process.

use std::time::{Duration, Instant};

use lockstep::plan::Cut;
use lockstep::time::Ticks;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::awake::Patience;
use super::child::GRACE;
use super::course::Course;
use super::crew::{self, Member, Taken};
use super::executor::{Account, Executor, Seat, Turn};
use super::fallen::{Fallen, Restarts};
use super::handshake;
use super::monitor::Monitor;
use super::outcome::{Ending, RunFailure};
use super::place::Place;
use super::recording::Recorder;
use super::slices::Slices;
use super::standstill::standstill;
use super::{bus, room};
use crate::observer::Event as Report;
use crate::scenario::{ORCHESTRATOR, OnFailure};
use crate::scope::Scope;

/// How long the orchestrator sleeps when there is nothing to do.
const NAP: Timespec = Timespec {
    tv_sec: 0,
    tv_nsec: 1_000_000,
};
/// How often, at least, the orchestrator checks for participants that have died.
const LOOK: Duration = Duration::from_millis(2);
/// The most batches that are taken from one participant before the next one is served.
pub(super) const BATCHES: usize = 16;
/// How often, at least, samples are flushed to disk.
const FLUSH: Duration = Duration::from_millis(50);

/// The participants' processes, and the shared memory that connects them with the orchestrator. Ports are dropped before the place,
/// the place before its files.
pub(super) struct Processes {
    pub(super) crew: Vec<Member>,
    pub(super) place: Place,
    pub(super) scope: Scope,
    pub(super) monitor: Monitor,
    /// How many programs were started in mid-run.
    pub(super) programs: usize,
    pub(super) failures: Failures,
    /// The choice of cores in words.
    pub(super) placement: String,
    pub(super) rounds: Rounds,
}

/// The participants that have failed.
pub(super) struct Failures {
    /// How often each participant was restarted or replaced.
    pub(super) restarts: Vec<Restarts>,
    /// The participants that failed besides the one that was reported, and were not handled yet.
    pub(super) fallen: Vec<Fallen>,
}

/// When the orchestrator last did each of its periodic tasks.
pub(super) struct Rounds {
    /// How long the run may make no progress.
    pub(super) patience: Patience,
    flushed: Instant,
    looked: Instant,
    slices: Slices,
    warned: bool,
}

impl Rounds {
    /// The run may make no progress for as long as `patience`.
    pub(super) fn new(patience: Duration) -> Rounds {
        Rounds {
            patience: Patience::new(patience),
            flushed: Instant::now(),
            looked: Instant::now(),
            slices: Slices::default(),
            warned: false,
        }
    }
}

impl Processes {
    /// Extends the horizon as far as the guide grants.
    fn advance_clock(&mut self, course: &mut Course) {
        let newest = course.newest();
        let horizon = course.guide.horizon(newest);
        if horizon > self.place.clock.horizon() {
            course.recorder().grant(horizon);
            self.place.clock.extend(horizon);
            self.crew.iter().for_each(Member::ring);
        }
    }

    /// Takes what participants have recorded; returns whether there was progress.
    fn drain(&mut self, course: &mut Course) -> Result<bool, Ending> {
        let mut moved = false;
        for number in 0..self.crew.len() {
            // Bounded, so that one participant cannot delay the others.
            for _ in 0..BATCHES {
                match self.take_from(course, number)? {
                    Taken::Nothing => break,
                    Taken::Old => {}
                    Taken::News => moved = true,
                }
            }
        }
        let forgotten = course
            .recorder()
            .forget(|recorder, number| self.stands(recorder, number));
        forgotten.map_err(|failure| course.over(failure))?;
        Ok(moved)
    }

    /// The activation that participant number `number` has reached, as far as its records show.
    pub(super) fn stands(&self, recorder: &Recorder, number: usize) -> u64 {
        let recorded = recorder.activations(number);
        recorded
            .unwrap_or_else(|| self.crew[number].status().next)
            .min(recorder.plan.participants[number].activations)
            .max(recorder.base(number))
    }

    /// Takes a batch of what participant number `number` has recorded.
    fn take_from(&mut self, course: &mut Course, number: usize) -> Result<Taken, Ending> {
        let member = &mut self.crew[number];
        let failed = |participant: &str, reason: String| Ending::Failed {
            participant: participant.to_owned(),
            reason,
        };
        let taken = member.take(number, &mut course.recorder());
        for (lost, spans) in member.spans.drain(..) {
            course.times.take(number, lost, &spans, &course.guide);
        }
        let moved = match taken {
            Ok(moved) => moved,
            Err(broken) => {
                let error = course.recorder().take_error();
                if let Some(error) = error {
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

    fn look_for_deaths(&mut self, course: &mut Course) -> Result<(), Ending> {
        self.rounds.looked = Instant::now();
        for number in 0..self.crew.len() {
            if self.crew[number].process.ended().is_some() {
                // What it sent before it died counts.
                while self.take_from(course, number)? != Taken::Nothing {}
            }
            let member = &mut self.crew[number];
            if let Some(reason) = member.process_failure(&course.plan, number) {
                let participant = member.process.name.clone();
                return Err(Ending::Failed { participant, reason });
            }
        }
        Ok(())
    }

    /// Fails if a guard has rejected a sample. The sample is on the tape, so a restart would have to produce it again.
    fn look_for_lies(&mut self, course: &mut Course) -> Result<(), Ending> {
        let lie = course.recorder().take_lie();
        let Some((number, mut reason)) = lie else {
            return Ok(());
        };
        let entry = &mut course.entries[number];
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

    /// Handles a lack of progress: reports the reason once, and ends the run when the participant's time is used up.
    fn watch(&mut self, course: &mut Course) -> Result<(), Ending> {
        let resting = self
            .crew
            .iter()
            .all(|member| member.rests_at(self.place.clock.horizon()));
        course.tell(course.newest(), resting);
        if resting {
            self.rounds.patience.renew();
        }
        let over = self.rounds.patience.is_over();
        let still = self.rounds.patience.used_s();
        if !over && (still <= 2.0 || self.rounds.warned) {
            return Ok(());
        }
        let horizon = self.place.clock.horizon();
        let recorded = |stream| course.recorder().count(stream);
        let (participant, reason) = standstill(&course.plan, &self.crew, horizon, still, recorded);
        if over {
            return Err(Ending::Failed { participant, reason });
        }
        self.rounds.warned = true;
        course.options.progress.say(&reason);
        Ok(())
    }
}

impl Executor for Processes {
    fn turn(&mut self, course: &mut Course) -> Result<Turn, Ending> {
        self.advance_clock(course);
        if self.drain(course)? {
            self.rounds.patience.renew();
            self.rounds.warned = false;
            self.look_for_lies(course)?;
            // However much the other participants record, a death is noticed in time.
            if self.rounds.looked.elapsed() > LOOK {
                self.look_for_deaths(course)?;
            }
        } else {
            self.look_for_deaths(course)?;
            self.look_for_lies(course)?;
            if self.crew.iter().all(|member| member.timing.is_some()) {
                return Ok(Turn::Over(Ending::Complete));
            }
            self.nap();
        }
        if bus::missed() {
            return Err(course.over(room::full()));
        }
        let t_s = course.plan.timebase.seconds(course.newest().max(0));
        course.options.progress.report(Report::Time { t_s });
        if self.monitor.asked() {
            let reason = format!("interrupted at t = {t_s} s");
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if let Some(reason) = course.times.stops() {
            let reason = reason.to_owned();
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if self.rounds.flushed.elapsed() > FLUSH {
            self.rounds.flushed = Instant::now();
            let flushed = course.recorder().flush();
            flushed.map_err(|error| Ending::own(error.to_string()))?;
            self.rounds
                .slices
                .look(self.crew.iter().map(|member| member.process.pid()));
        }
        if let Some(now) = course.guide.stop()
            && self.rests_at(now)
        {
            return Ok(Turn::Rests(now));
        }
        self.watch(course)?;
        Ok(Turn::Going)
    }

    fn rests_at(&self, now: Ticks) -> bool {
        self.crew.iter().all(|member| member.rests_at(now))
    }

    fn save(&mut self, _: &Course, number: usize) -> Result<Vec<u8>, RunFailure> {
        handshake::save(&mut self.crew[number], &self.monitor)
    }

    fn take_up(
        &mut self,
        course: &mut Course,
        cut: &Cut,
        seats: Vec<Seat>,
        _back: bool,
    ) -> Result<Vec<Fallen>, RunFailure> {
        self.move_everybody(course, cut, seats)
    }

    fn show_inputs(&mut self, course: &mut Course, cut: &Cut) -> Result<Vec<Fallen>, RunFailure> {
        let seats = self.crew.iter().map(|_| Seat::Same(None)).collect();
        self.move_everybody(course, cut, seats)
    }

    fn went_back(&mut self, _: Ticks) {}

    fn outlives_failures(&self) -> bool {
        true
    }

    fn survive(&mut self, course: &mut Course, ending: Ending) -> Result<(), Ending> {
        self.survive_failure(course, ending)
    }

    fn note_fallen(&mut self, fallen: Vec<Fallen>) {
        self.failures.fallen = fallen;
    }

    fn processes(&self) -> String {
        let all = self.crew.iter().map(|member| &member.process);
        let words: Vec<String> = all
            .map(|process| format!("{} is process {}", process.name, process.pid()))
            .collect();
        words.join(", ")
    }

    fn failure(&mut self, course: &Course) -> Option<RunFailure> {
        let mut all = self.crew.iter_mut().enumerate();
        all.find_map(|(number, member)| {
            let reason = member.process_failure(&course.plan, number)?;
            let participant = member.process.name.clone();
            Some(RunFailure::Participant { participant, reason })
        })
    }

    fn renew_patience(&mut self) {
        self.rounds.patience.renew();
    }

    fn bring_down(&mut self, course: &mut Course) {
        self.place.clock.stop();
        self.crew.iter().for_each(Member::ring);
        let mut grace = Patience::new(GRACE);
        for member in &mut self.crew {
            member.process.end_within(&mut grace);
        }
        // What the other participants had handed over counts, whichever participant failed.
        for number in 0..self.crew.len() {
            self.crew[number].failed = None;
            while let Ok(Taken::Old | Taken::News) = self.take_from(course, number) {}
        }
    }

    fn account(&self) -> Account {
        let timing = self.crew.iter();
        let timing = timing.filter_map(|member| Some((member.process.name.clone(), member.timing.clone()?)));
        Account {
            timing: timing.collect(),
            placement: self.placement.clone(),
            // Their logs are files.
            logs: std::collections::BTreeMap::new(),
        }
    }
}
