//! The executor that runs every participant in its own process.

use std::time::{Duration, Instant};

use lockstep::plan::Cut;
use lockstep::time::Ticks;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::child::GRACE;
use super::handshake;
use super::monitor::Monitor;
use super::participants::{self, ParticipantHandle, Taken};
use super::place::Place;
use super::resources;
use super::sigbus;
use super::stall::standstill;
use super::time_slices::Slices;
use crate::observer::Event as Report;
use crate::run::executor::{Account, Executor, Slot, Turn};
use crate::run::failed::{FailedParticipant, Restarts};
use crate::run::outcome::{Ending, RunFailure};
use crate::run::recording::recorder::Recorder;
use crate::run::state::RunState;
use crate::run::timeout::Patience;
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
pub(crate) const BATCHES: usize = 16;
/// How often, at least, samples are flushed to disk.
const FLUSH: Duration = Duration::from_millis(50);

/// The participants' processes, and the shared memory that connects them with the orchestrator. Ports are dropped before the place,
/// the place before its files.
pub(crate) struct Processes {
    pub(crate) handles: Vec<ParticipantHandle>,
    pub(crate) place: Place,
    pub(crate) scope: Scope,
    pub(crate) monitor: Monitor,
    /// How many programs were started in mid-run.
    pub(crate) programs: usize,
    pub(crate) failures: Failures,
    /// The choice of cores in words.
    pub(crate) placement: String,
    pub(crate) rounds: Rounds,
}

/// The participants that have failed.
pub(crate) struct Failures {
    /// How often each participant was restarted or replaced.
    pub(crate) restarts: Vec<Restarts>,
    /// The participants that failed besides the one that was reported, and were not handled yet.
    pub(crate) unhandled: Vec<FailedParticipant>,
}

/// When the orchestrator last did each of its periodic tasks.
pub(crate) struct Rounds {
    /// How long the run may make no progress.
    pub(crate) patience: Patience,
    flushed: Instant,
    looked: Instant,
    slices: Slices,
    warned: bool,
}

impl Rounds {
    /// The run may make no progress for as long as `patience`.
    pub(crate) fn new(patience: Duration) -> Rounds {
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
    /// Extends the horizon as far as the clock controller grants.
    fn advance_clock(&mut self, run_state: &mut RunState) {
        let newest = run_state.newest();
        let horizon = run_state.clock.horizon(newest);
        if horizon > self.place.clock.horizon() {
            run_state.recorder().grant(horizon);
            self.place.clock.extend(horizon);
            self.handles.iter().for_each(ParticipantHandle::ring);
        }
    }

    /// Takes what participants have recorded; returns whether there was progress.
    fn drain(&mut self, run_state: &mut RunState) -> Result<bool, Ending> {
        let mut moved = false;
        for number in 0..self.handles.len() {
            // Bounded, so that one participant cannot delay the others.
            for _ in 0..BATCHES {
                match self.take_from(run_state, number)? {
                    Taken::Nothing => break,
                    Taken::Old => {}
                    Taken::News => moved = true,
                }
            }
        }
        let forgotten = run_state
            .recorder()
            .forget(|recorder, number| self.stands(recorder, number));
        forgotten.map_err(|failure| run_state.over(failure))?;
        Ok(moved)
    }

    /// The activation that participant number `number` has reached, as far as its records show.
    pub(crate) fn stands(&self, recorder: &Recorder, number: usize) -> u64 {
        let recorded = recorder.activations(number);
        recorded
            .unwrap_or_else(|| self.handles[number].status().next)
            .min(recorder.plan.participants[number].activations)
            .max(recorder.base(number))
    }

    /// Takes a batch of what participant number `number` has recorded.
    fn take_from(&mut self, run_state: &mut RunState, number: usize) -> Result<Taken, Ending> {
        let handle = &mut self.handles[number];
        let failed = |participant: &str, reason: String| Ending::Failed {
            participant: participant.to_owned(),
            reason,
        };
        let taken = handle.take(number, &mut run_state.recorder());
        for (lost, spans) in handle.spans.drain(..) {
            run_state.times.take(number, lost, &spans, &run_state.clock);
        }
        let moved = match taken {
            Ok(moved) => moved,
            Err(broken) => {
                let error = run_state.recorder().take_error();
                if let Some(error) = error {
                    return Err(failed(ORCHESTRATOR, error.to_string()));
                }
                let all = self
                    .handles
                    .iter()
                    .map(|one| (one.process.name.as_str(), one.process.pid()));
                let victim = &self.handles[number];
                let name = &victim.process.name;
                return Err(match victim.foreign_writer(all) {
                    Some((author, process)) => {
                        failed(author, participants::foreign_writer_reason(name, process, &broken.0))
                    }
                    None => failed(name, broken.0),
                });
            }
        };
        let (handle, name) = (&self.handles[number], &self.handles[number].process.name);
        match handle.failure() {
            Some(reason) => Err(failed(name, reason)),
            None => Ok(moved),
        }
    }

    fn look_for_deaths(&mut self, run_state: &mut RunState) -> Result<(), Ending> {
        self.rounds.looked = Instant::now();
        for number in 0..self.handles.len() {
            if self.handles[number].process.ended().is_some() {
                // What it sent before it died counts.
                while self.take_from(run_state, number)? != Taken::Nothing {}
            }
            let handle = &mut self.handles[number];
            if let Some(reason) = handle.process_failure(&run_state.plan, number) {
                let participant = handle.process.name.clone();
                return Err(Ending::Failed { participant, reason });
            }
        }
        Ok(())
    }

    /// Fails if a guard has rejected a sample. The sample is on the tape, so a restart would have to produce it again.
    fn look_for_lies(&mut self, run_state: &mut RunState) -> Result<(), Ending> {
        let violation = run_state.recorder().take_violation();
        let Some((number, mut reason)) = violation else {
            return Ok(());
        };
        let entry = &mut run_state.entries[number];
        if entry.on_failure == OnFailure::Restart {
            entry.on_failure = OnFailure::Stop;
            reason += "; a restart would have to give the same again, so the run ends";
        }
        let participant = entry.setup.name.clone();
        Err(Ending::Failed { participant, reason })
    }

    /// Sleeps until a participant ends, or for a moment.
    fn nap(&self) {
        let alive = self.handles.iter().filter(|handle| handle.timing.is_none());
        let mut ends: Vec<PollFd<'_>> = alive
            .map(|handle| PollFd::from_borrowed_fd(handle.process.descriptor(), PollFlags::IN))
            .collect();
        let _ = poll(&mut ends, Some(&NAP));
    }

    /// Handles a lack of progress: reports the reason once, and ends the run when the participant's time is used up.
    fn watch(&mut self, run_state: &mut RunState) -> Result<(), Ending> {
        let resting = self
            .handles
            .iter()
            .all(|handle| handle.rests_at(self.place.clock.horizon()));
        run_state.tell(run_state.newest(), resting);
        if resting {
            self.rounds.patience.renew();
        }
        let over = self.rounds.patience.is_over();
        let still = self.rounds.patience.used_s();
        if !over && (still <= 2.0 || self.rounds.warned) {
            return Ok(());
        }
        let horizon = self.place.clock.horizon();
        let recorded = |stream| run_state.recorder().count(stream);
        let (participant, reason) = standstill(&run_state.plan, &self.handles, horizon, still, recorded);
        if over {
            return Err(Ending::Failed { participant, reason });
        }
        self.rounds.warned = true;
        run_state.options.progress.say(&reason);
        Ok(())
    }
}

impl Executor for Processes {
    fn turn(&mut self, run_state: &mut RunState) -> Result<Turn, Ending> {
        self.advance_clock(run_state);
        if self.drain(run_state)? {
            self.rounds.patience.renew();
            self.rounds.warned = false;
            self.look_for_lies(run_state)?;
            // However much the other participants record, a death is noticed in time.
            if self.rounds.looked.elapsed() > LOOK {
                self.look_for_deaths(run_state)?;
            }
        } else {
            self.look_for_deaths(run_state)?;
            self.look_for_lies(run_state)?;
            if self.handles.iter().all(|handle| handle.timing.is_some()) {
                return Ok(Turn::Over(Ending::Complete));
            }
            self.nap();
        }
        if sigbus::missed() {
            return Err(run_state.over(resources::full()));
        }
        let t_s = run_state.plan.timebase.seconds(run_state.newest().max(0));
        run_state.options.progress.report(Report::Time { t_s });
        if self.monitor.asked() {
            let reason = format!("interrupted at t = {t_s} s");
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if let Some(reason) = run_state.times.stops() {
            let reason = reason.to_owned();
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if self.rounds.flushed.elapsed() > FLUSH {
            self.rounds.flushed = Instant::now();
            let flushed = run_state.recorder().flush();
            flushed.map_err(|error| Ending::own(error.to_string()))?;
            self.rounds
                .slices
                .look(self.handles.iter().map(|handle| handle.process.pid()));
        }
        if let Some(now) = run_state.clock.stop()
            && self.rests_at(now)
        {
            return Ok(Turn::Rests(now));
        }
        self.watch(run_state)?;
        Ok(Turn::Going)
    }

    fn rests_at(&self, now: Ticks) -> bool {
        self.handles.iter().all(|handle| handle.rests_at(now))
    }

    fn save(&mut self, _: &RunState, number: usize) -> Result<Vec<u8>, RunFailure> {
        handshake::save(&mut self.handles[number], &self.monitor)
    }

    fn continue_at(
        &mut self,
        run_state: &mut RunState,
        cut: &Cut,
        slots: Vec<Slot>,
        _back: bool,
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        self.relocate(run_state, cut, slots)
    }

    fn show_inputs(&mut self, run_state: &mut RunState, cut: &Cut) -> Result<Vec<FailedParticipant>, RunFailure> {
        let slots = self.handles.iter().map(|_| Slot::Same(None)).collect();
        self.relocate(run_state, cut, slots)
    }

    fn went_back(&mut self, _: Ticks) {}

    fn outlives_failures(&self) -> bool {
        true
    }

    fn survive(&mut self, run_state: &mut RunState, ending: Ending) -> Result<(), Ending> {
        self.survive_failure(run_state, ending)
    }

    fn note_failures(&mut self, failed_participants: Vec<FailedParticipant>) {
        self.failures.unhandled = failed_participants;
    }

    fn processes(&self) -> String {
        let all = self.handles.iter().map(|handle| &handle.process);
        let words: Vec<String> = all
            .map(|process| format!("{} is process {}", process.name, process.pid()))
            .collect();
        words.join(", ")
    }

    fn failure(&mut self, run_state: &RunState) -> Option<RunFailure> {
        let mut all = self.handles.iter_mut().enumerate();
        all.find_map(|(number, handle)| {
            let reason = handle.process_failure(&run_state.plan, number)?;
            let participant = handle.process.name.clone();
            Some(RunFailure::Participant { participant, reason })
        })
    }

    fn renew_patience(&mut self) {
        self.rounds.patience.renew();
    }

    fn bring_down(&mut self, run_state: &mut RunState) {
        self.place.clock.terminate();
        self.handles.iter().for_each(ParticipantHandle::ring);
        let mut grace = Patience::new(GRACE);
        for handle in &mut self.handles {
            handle.process.end_within(&mut grace);
        }
        // What the other participants had handed over counts, whichever participant failed.
        for number in 0..self.handles.len() {
            self.handles[number].failed = None;
            while let Ok(Taken::Old | Taken::News) = self.take_from(run_state, number) {}
        }
    }

    fn account(&self) -> Account {
        let timing = self.handles.iter();
        let timing = timing.filter_map(|handle| Some((handle.process.name.clone(), handle.timing.clone()?)));
        Account {
            timing: timing.collect(),
            placement: self.placement.clone(),
            // Their logs are files.
            logs: std::collections::BTreeMap::new(),
        }
    }
}
