//! Failure recovery: which participants are restarted or replaced, and when the run ends instead.

use std::time::Duration;

use lockstep::plan::Cut;
use lockstep::time::Ticks;
use tape::{Event, EventKind};

use super::executor::Slot;
use super::failed::{FailedParticipant, RESTARTS_MAX, Restarts};
use super::outcome::{Ending, RunFailure};
use super::prepare;
use super::processes::descriptions;
use super::processes::executor::{BATCHES_MAX, Processes};
use super::processes::participants::BatchResult;
use super::state::RunState;
use super::stops::actions::save_for_restarts;
use super::timeout::Timeout;
use crate::scenario::OnFailure;

/// Why a run ends when a guard violation is found only at its end: a substitute that does nothing would only hide the violation.
const NO_STEP_LEFT: &str = "it had taken its last step when its outputs were looked at, so a substitute has nothing to do; where the run \
                            rests (`--checkpoint-every`) everything before is looked at first";

impl Processes {
    /// Handles the failure in `ending` as the scenario specifies: returns when the run can continue, or returns the ending as an error.
    /// A participant that fails while the run is resumed counts as one more failure.
    pub(super) fn recover_from_failure(&mut self, run_state: &mut RunState, ending: Ending) -> Result<(), Ending> {
        let Ending::Failed { participant, reason } = &ending else {
            return Err(ending);
        };
        let Some(number) = run_state.plan.participant(participant) else {
            return Err(ending);
        };
        let reason = reason.clone();
        let mut failed_participants = vec![FailedParticipant { number, reason }];
        let others = std::mem::take(&mut self.failures.unhandled);
        failed_participants.extend(others.into_iter().filter(|one| one.number != number));
        let first = failed_participants[0].clone();
        let mut checked = 0;
        loop {
            for one in &failed_participants[checked..] {
                self.check_policy(run_state, one, &first)?;
            }
            checked = failed_participants.len();
            let done = self.pause_others(run_state, &mut failed_participants).and_then(|()| {
                if failed_participants.len() > checked {
                    // Another participant failed meanwhile, and must be judged before anything is done.
                    return Ok(None);
                }
                self.recover(run_state, &failed_participants).map(Some)
            });
            match done {
                Ok(Some(missing)) if missing.is_empty() => return Ok(()),
                Ok(Some(missing)) => (failed_participants, checked) = (missing, 0),
                Ok(None) => {}
                Err(RunFailure::Interrupted) => return Err(run_state.ending_of(RunFailure::Interrupted)),
                // The first failure matters most.
                Err(second) => {
                    return Err(Ending::Failed {
                        participant: run_state.plan.participants[first.number].name.clone(),
                        reason: format!("{}\nand the run could not be resumed: {second}", first.reason),
                    });
                }
            }
        }
    }

    /// Fails if the run must end because of `one`. If it is not `first`, it failed after that.
    fn check_policy(
        &mut self,
        run_state: &mut RunState,
        one: &FailedParticipant,
        first: &FailedParticipant,
    ) -> Result<(), Ending> {
        let participant = run_state.plan.participants[one.number].name.clone();
        let mut over = None;
        if run_state.entries[one.number].on_failure == OnFailure::Stop || self.handles.is_empty() {
            over = Some(String::new());
        } else {
            let furthest = self.handles[one.number].status().next;
            let restarts = &mut self.failures.restarts[one.number];
            if furthest > restarts.furthest {
                *restarts = Restarts { furthest, count: 0 };
            }
            restarts.count += 1;
            if restarts.count > RESTARTS_MAX {
                over = Some(format!("\n(restarted {RESTARTS_MAX} times without progress)"));
            }
        }
        let Some(mut more) = over else {
            run_state
                .options
                .progress
                .notice(&format!("participant `{participant}`: {}", one.reason));
            return Ok(());
        };
        if one.number != first.number {
            let name = &run_state.plan.participants[first.number].name;
            more += &format!(
                "\n(when the run was to go on after participant `{name}`: {})",
                first.first_line()
            );
        }
        let reason = one.reason.clone() + &more;
        Err(Ending::Failed { participant, reason })
    }

    /// Ends the processes of `failed_participants`, and pauses all other participants. A participant that fails before it is paused
    /// is added to `failed_participants`.
    fn pause_others(
        &mut self,
        run_state: &mut RunState,
        failed_participants: &mut Vec<FailedParticipant>,
    ) -> Result<(), RunFailure> {
        for one in failed_participants.iter() {
            let handle = &mut self.handles[one.number];
            handle.process.shut_down(Duration::ZERO);
            handle.failure_event = None;
            // The samples that it had handed over count, up to the first faulty one.
            while let Ok(BatchResult::NoProgress | BatchResult::Progress) =
                handle.take(one.number, &mut run_state.recorder())
            {}
        }
        self.services.clock.pause();
        let mut timeout = Timeout::new(run_state.options.stall_timeout());
        loop {
            let mut unpaused = None;
            for number in 0..self.handles.len() {
                if failed_participants.iter().any(|one| one.number == number) {
                    continue;
                }
                match self.poll_pause(run_state, number)? {
                    Ok(true) => {}
                    Ok(false) => unpaused = Some(number),
                    Err(reason) => {
                        self.handles[number].process.shut_down(Duration::ZERO);
                        failed_participants.push(FailedParticipant { number, reason });
                    }
                }
            }
            let Some(number) = unpaused else { return Ok(()) };
            if self.monitor.is_interrupted() {
                return Err(RunFailure::Interrupted);
            }
            if timeout.is_over() {
                let process = &mut self.handles[number].process;
                let limit = timeout.limit_s();
                let reason = format!("process {} did not pause within {limit} s", process.pid());
                process.shut_down(Duration::ZERO);
                failed_participants.push(FailedParticipant { number, reason });
            }
            std::thread::sleep(Duration::from_micros(300));
        }
    }

    /// Whether participant number `number` is paused; if it failed too, the reason.
    fn poll_pause(&mut self, run_state: &mut RunState, number: usize) -> Result<Result<bool, String>, RunFailure> {
        let handle = &mut self.handles[number];
        handle.wake();
        let ended = handle.process.exit_status();
        // Bounded, because a participant may send events without end.
        for _ in 0..BATCHES_MAX {
            let taken = handle.take(number, &mut run_state.recorder());
            match taken {
                Ok(BatchResult::NoProgress | BatchResult::Progress) => {}
                Ok(BatchResult::Empty) => break,
                Err(broken) => {
                    let error = run_state.recorder().take_error();
                    return match error {
                        Some(error) => Err(error.into()),
                        None => Ok(Err(broken.0)),
                    };
                }
            }
        }
        if let Some(failed) = handle.failure() {
            return Ok(Err(failed));
        }
        match ended {
            // A participant that ended after it was paused is found missing during the move.
            Some(status) if handle.paused_before.is_none() => {
                let last = handle.status();
                Ok(Err(descriptions::exit_report(
                    &run_state.plan,
                    number,
                    &handle.process,
                    last,
                    status,
                )))
            }
            _ => Ok(Ok(handle.paused_before.is_some())),
        }
    }

    /// Continues the run as the scenario specifies; all participants are paused except `failed_participants`, whose processes have
    /// ended. Returns those that fail meanwhile.
    fn recover(
        &mut self,
        run_state: &mut RunState,
        failed_participants: &[FailedParticipant],
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        // A different program would not reproduce the samples on the tape: a participant that fails while the run goes back is
        // restarted too.
        let mut failed_numbers = failed_participants.iter().map(|one| one.number);
        if failed_numbers.any(|number| {
            run_state.entries[number].on_failure == OnFailure::Restart || run_state.recorder().is_ahead_of(number)
        }) {
            self.restore_last_checkpoint(run_state, failed_participants)
        } else {
            self.substitute_failed(run_state, failed_participants)
        }
    }

    /// Restores all participants to the last checkpoint, and starts `failed_participants` in new processes, whatever their policy: no
    /// state of theirs is lost that way.
    fn restore_last_checkpoint(
        &mut self,
        run_state: &mut RunState,
        failed_participants: &[FailedParticipant],
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        let Some(checkpoint) = run_state.last_checkpoint.clone() else {
            return Err(RunFailure::Other("there is no checkpoint to go back to".into()));
        };
        let slots = prepare::slots_at(run_state, &checkpoint, |number| {
            failed_participants.iter().any(|one| one.number == number)
        });
        {
            let mut recorder = run_state.recorder();
            recorder.expect_repetition()?;
            if let Some(off_tape) = &checkpoint.off_tape {
                recorder.set_buffer(&off_tape.samples);
            }
        }
        let missing = self.relocate(run_state, &checkpoint.cut, slots)?;
        run_state.substituted = usize::try_from(checkpoint.substitutions).unwrap_or(usize::MAX);
        run_state
            .clock
            .rewind(&run_state.scenario, &run_state.plan, run_state.substituted);
        for one in failed_participants {
            let text = format!(
                "restarted from the checkpoint at t = {}: {}",
                checkpoint.time,
                one.first_line()
            );
            Self::record_event(
                run_state,
                EventKind::Restart,
                run_state.newest().max(0),
                one.number,
                text,
            )?;
        }
        Ok(missing)
    }

    /// Replaces `failed_participants` by other programs, at the activations that the failed ones had reached.
    fn substitute_failed(
        &mut self,
        run_state: &mut RunState,
        failed_participants: &[FailedParticipant],
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        let mut cut = Cut { next: Vec::new() };
        let mut slots = Vec::new();
        let mut substitutions = Vec::new();
        for (number, handle) in self.handles.iter().enumerate() {
            let reached = match handle.paused_before {
                Some(next) => next,
                None => self.reached_activation(&run_state.recorder(), number),
            };
            cut.next.push(reached);
            if run_state.recorder().is_offender(number) && reached == run_state.plan.participants[number].activations {
                return Err(RunFailure::Other(NO_STEP_LEFT.into()));
            }
            let (one, entry) = (
                failed_participants.iter().find(|one| one.number == number),
                &run_state.entries[number],
            );
            slots.push(match (one, &entry.on_failure) {
                (Some(one), OnFailure::Substitute(program)) => {
                    let entry = entry.replaced_by(program);
                    let text = format!(
                        "{} takes over at activation {reached} from its initial state, because of a failure: {}",
                        entry.program,
                        one.first_line()
                    );
                    substitutions.push((number, text));
                    Slot::New(Box::new(entry), None)
                }
                _ => Slot::Same(None),
            });
        }
        // The substitute sees again what its predecessor was shown last.
        run_state.recorder().expect_repetition()?;
        let mut missing = self.relocate(run_state, &cut, slots)?;
        // A restart must not bring back a participant that was replaced.
        run_state.last_checkpoint = None;
        let mut at = 0;
        for (number, text) in substitutions {
            run_state.recorder().producer_replaced(number);
            at = run_state.plan.participants[number]
                .sample_time
                .instant(cut.next[number]);
            Self::record_event(run_state, EventKind::Substitution, at, number, text)?;
        }
        if missing.is_empty()
            && let Some(one) = save_for_restarts(self, run_state, run_state.time(at), cut)?
        {
            // A participant that is alive but cannot save its state does no harm as long as the run need not be restored.
            if self.handles[one.number].process.exit_status().is_some() {
                missing.push(one);
            }
        }
        Ok(missing)
    }

    /// Records `text` about participant number `number` on the tape, and reports it to the user.
    fn record_event(
        run_state: &mut RunState,
        kind: EventKind,
        at: Ticks,
        number: usize,
        text: String,
    ) -> Result<(), RunFailure> {
        let name = run_state.plan.participants[number].name.clone();
        let message = format!("participant `{name}`: {text}");
        run_state.options.progress.notice(&message);
        run_state.recovered.push(message);
        let event = Event {
            time: run_state.time(at),
            kind,
            participant: Some(name),
            text,
        };
        Ok(run_state.recorder().event(&event)?)
    }
}
