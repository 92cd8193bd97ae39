//! The executor that runs every participant in its own process.

use std::time::{Duration, Instant};

use lockstep::plan::Cut;
use lockstep::time::Ticks;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::child::GRACE;
use super::handshake;
use super::monitor::Monitor;
use super::participants::{self, BatchResult, ParticipantHandle};
use super::resources;
use super::run_services::RunServices;
use super::sigbus;
use super::stall::diagnose;
use super::time_slices::TimeSlices;
use crate::observer::Event as Report;
use crate::run::executor::{Executor, ExecutorReport, Slot, Turn};
use crate::run::failed::{FailedParticipant, Restarts};
use crate::run::outcome::{Ending, RunFailure};
use crate::run::recording::recorder::Recorder;
use crate::run::state::RunState;
use crate::run::timeout::Timeout;
use crate::scenario::{ORCHESTRATOR, OnFailure};
use crate::scope::Scope;

/// How long the orchestrator sleeps when there is nothing to do.
const POLL_TIMEOUT: Timespec = Timespec {
    tv_sec: 0,
    tv_nsec: 1_000_000,
};
/// How often, at least, the orchestrator checks for participants that have died.
const LIVENESS_INTERVAL: Duration = Duration::from_millis(2);
/// The most batches that are taken from one participant before the next one is served.
pub(crate) const BATCHES_MAX: usize = 16;
/// How often, at least, samples are flushed to disk.
const FLUSH_INTERVAL: Duration = Duration::from_millis(50);

/// The participants' processes, and the shared memory that connects them with the orchestrator. Ports are dropped before the services,
/// the services before their files.
pub(crate) struct Processes {
    pub(crate) handles: Vec<ParticipantHandle>,
    pub(crate) services: RunServices,
    pub(crate) scope: Scope,
    pub(crate) monitor: Monitor,
    /// How many programs were started in mid-run.
    pub(crate) programs: usize,
    pub(crate) failures: Failures,
    /// The choice of cores in words.
    pub(crate) placement: String,
    pub(crate) periodic: PeriodicTasks,
}

/// The participants that have failed.
pub(crate) struct Failures {
    /// How often each participant was restarted or replaced.
    pub(crate) restarts: Vec<Restarts>,
    /// The participants that failed besides the one that was reported, and were not handled yet.
    pub(crate) unhandled: Vec<FailedParticipant>,
}

/// When the orchestrator last did each of its periodic tasks.
pub(crate) struct PeriodicTasks {
    /// How long the run may make no progress.
    pub(crate) stall_timeout: Timeout,
    last_flush: Instant,
    last_liveness_check: Instant,
    time_slices: TimeSlices,
    stall_reported: bool,
}

impl PeriodicTasks {
    /// The run may make no progress for as long as `stall_timeout`.
    pub(crate) fn new(stall_timeout: Duration) -> PeriodicTasks {
        PeriodicTasks {
            stall_timeout: Timeout::new(stall_timeout),
            last_flush: Instant::now(),
            last_liveness_check: Instant::now(),
            time_slices: TimeSlices::default(),
            stall_reported: false,
        }
    }
}

impl Processes {
    /// Extends the horizon as far as the clock controller grants.
    fn advance_clock(&mut self, run_state: &mut RunState) {
        let newest = run_state.newest();
        let horizon = run_state.clock.horizon(newest);
        if horizon > self.services.clock.horizon() {
            run_state.recorder().grant(horizon);
            self.services.clock.extend(horizon);
            self.handles.iter().for_each(ParticipantHandle::wake);
        }
    }

    /// Takes what participants have recorded; returns whether there was progress.
    fn drain(&mut self, run_state: &mut RunState) -> Result<bool, Ending> {
        let mut progressed = false;
        for number in 0..self.handles.len() {
            // Bounded, so that one participant cannot delay the others.
            for _ in 0..BATCHES_MAX {
                match self.take_from(run_state, number)? {
                    BatchResult::Empty => break,
                    BatchResult::NoProgress => {}
                    BatchResult::Progress => progressed = true,
                }
            }
        }
        let dropped = run_state
            .recorder()
            .drop_unneeded(|recorder, number| self.reached_activation(recorder, number));
        dropped.map_err(|failure| run_state.ending_of(failure))?;
        Ok(progressed)
    }

    /// The activation that participant number `number` has reached, as far as its records show.
    pub(crate) fn reached_activation(&self, recorder: &Recorder, number: usize) -> u64 {
        let recorded = recorder.activations(number);
        recorded
            .unwrap_or_else(|| self.handles[number].status().next)
            .min(recorder.plan.participants[number].activations)
            .max(recorder.base_activation(number))
    }

    /// Takes a batch of what participant number `number` has recorded.
    fn take_from(&mut self, run_state: &mut RunState, number: usize) -> Result<BatchResult, Ending> {
        let handle = &mut self.handles[number];
        let failed = |participant: &str, reason: String| Ending::Failed {
            participant: participant.to_owned(),
            reason,
        };
        let taken = handle.take(number, &mut run_state.recorder());
        for (lost, spans) in handle.spans.drain(..) {
            run_state.span_analysis.take(number, lost, &spans, &run_state.clock);
        }
        let progressed = match taken {
            Ok(progressed) => progressed,
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
            None => Ok(progressed),
        }
    }

    fn check_processes(&mut self, run_state: &mut RunState) -> Result<(), Ending> {
        self.periodic.last_liveness_check = Instant::now();
        for number in 0..self.handles.len() {
            if self.handles[number].process.exit_status().is_some() {
                // What it sent before it died counts.
                while self.take_from(run_state, number)? != BatchResult::Empty {}
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
    fn check_guard_violations(&mut self, run_state: &mut RunState) -> Result<(), Ending> {
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
    fn sleep_briefly(&self) {
        let alive = self.handles.iter().filter(|handle| handle.timing.is_none());
        let mut ends: Vec<PollFd<'_>> = alive
            .map(|handle| PollFd::from_borrowed_fd(handle.process.descriptor(), PollFlags::IN))
            .collect();
        let _ = poll(&mut ends, Some(&POLL_TIMEOUT));
    }

    /// Handles a lack of progress: reports the reason once, and ends the run when the participant's time is used up.
    fn check_stall(&mut self, run_state: &mut RunState) -> Result<(), Ending> {
        let resting = self
            .handles
            .iter()
            .all(|handle| handle.has_reached(self.services.clock.horizon()));
        run_state.report_progress(run_state.newest(), resting);
        if resting {
            self.periodic.stall_timeout.restart();
        }
        let over = self.periodic.stall_timeout.is_over();
        let still = self.periodic.stall_timeout.used_s();
        if !over && (still <= 2.0 || self.periodic.stall_reported) {
            return Ok(());
        }
        let horizon = self.services.clock.horizon();
        let recorded = |stream| run_state.recorder().count(stream);
        let (participant, reason) = diagnose(&run_state.plan, &self.handles, horizon, still, recorded);
        if over {
            return Err(Ending::Failed { participant, reason });
        }
        self.periodic.stall_reported = true;
        run_state.options.progress.notice(&reason);
        Ok(())
    }
}

impl Executor for Processes {
    fn turn(&mut self, run_state: &mut RunState) -> Result<Turn, Ending> {
        self.advance_clock(run_state);
        if self.drain(run_state)? {
            self.periodic.stall_timeout.restart();
            self.periodic.stall_reported = false;
            self.check_guard_violations(run_state)?;
            // However much the other participants record, a death is noticed in time.
            if self.periodic.last_liveness_check.elapsed() > LIVENESS_INTERVAL {
                self.check_processes(run_state)?;
            }
        } else {
            self.check_processes(run_state)?;
            self.check_guard_violations(run_state)?;
            if self.handles.iter().all(|handle| handle.timing.is_some()) {
                return Ok(Turn::Over(Ending::Complete));
            }
            self.sleep_briefly();
        }
        if sigbus::take_missed_page() {
            return Err(run_state.ending_of(resources::memory_full()));
        }
        let t_s = run_state.plan.timebase.seconds(run_state.newest().max(0));
        run_state.options.progress.report(Report::Time { t_s });
        if self.monitor.is_interrupted() {
            let reason = format!("interrupted at t = {t_s} s");
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if let Some(reason) = run_state.span_analysis.stop_reason() {
            let reason = reason.to_owned();
            return Ok(Turn::Over(Ending::Stopped { reason }));
        }
        if self.periodic.last_flush.elapsed() > FLUSH_INTERVAL {
            self.periodic.last_flush = Instant::now();
            let flushed = run_state.recorder().flush();
            flushed.map_err(|error| Ending::orchestrator_failed(error.to_string()))?;
            self.periodic
                .time_slices
                .update(self.handles.iter().map(|handle| handle.process.pid()));
        }
        if let Some(now) = run_state.clock.stop()
            && self.has_reached(now)
        {
            return Ok(Turn::Paused(now));
        }
        self.check_stall(run_state)?;
        Ok(Turn::Continue)
    }

    fn has_reached(&self, now: Ticks) -> bool {
        self.handles.iter().all(|handle| handle.has_reached(now))
    }

    fn save(&mut self, _: &RunState, number: usize) -> Result<Vec<u8>, RunFailure> {
        handshake::save(&mut self.handles[number], &self.monitor)
    }

    fn continue_at(
        &mut self,
        run_state: &mut RunState,
        cut: &Cut,
        slots: Vec<Slot>,
        _rewind: bool,
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        self.relocate(run_state, cut, slots)
    }

    fn apply_inputs(&mut self, run_state: &mut RunState, cut: &Cut) -> Result<Vec<FailedParticipant>, RunFailure> {
        let slots = self.handles.iter().map(|_| Slot::Same(None)).collect();
        self.relocate(run_state, cut, slots)
    }

    fn set_reached(&mut self, _: Ticks) {}

    fn isolates_failures(&self) -> bool {
        true
    }

    fn handle_failure(&mut self, run_state: &mut RunState, ending: Ending) -> Result<(), Ending> {
        self.recover_from_failure(run_state, ending)
    }

    fn register_failures(&mut self, failed_participants: Vec<FailedParticipant>) {
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

    fn restart_timeout(&mut self) {
        self.periodic.stall_timeout.restart();
    }

    fn shut_down(&mut self, run_state: &mut RunState) {
        self.services.clock.terminate();
        self.handles.iter().for_each(ParticipantHandle::wake);
        let mut timeout = Timeout::new(GRACE);
        for handle in &mut self.handles {
            handle.process.wait_then_kill(&mut timeout);
        }
        // What the other participants had handed over counts, whichever participant failed.
        for number in 0..self.handles.len() {
            self.handles[number].failure_event = None;
            while let Ok(BatchResult::NoProgress | BatchResult::Progress) = self.take_from(run_state, number) {}
        }
    }

    fn report(&self) -> ExecutorReport {
        let timing = self.handles.iter();
        let timing = timing.filter_map(|handle| Some((handle.process.name.clone(), handle.timing.clone()?)));
        ExecutorReport {
            timing: timing.collect(),
            placement: self.placement.clone(),
            // Their logs are files.
            logs: std::collections::BTreeMap::new(),
        }
    }
}
