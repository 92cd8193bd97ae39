//! Driving a run from code while it is paused: continue, read values, set inputs, save, and go back.

use std::time::Instant;

use lockstep::participant::Payload;
use lockstep::port::Message;
use lockstep::time::{Rational, Ticks};
use toml::{Table, Value};

use super::handle::{Run, RunEnd};
use super::inputs::{self, Inputs};
use super::outcome::{Ending, RunFailure};
use super::prepare;
use super::recording::newest::{Sample, no_field};
use super::recording::streams::streams;
use super::saved::checkpoint;
use super::stops::actions;
use super::stops::schedule::Schedule;
use crate::assessment::Figures;
use crate::scenario::payload;

/// The state of a [`Run`] at an instant, in memory.
#[derive(Debug, Clone)]
pub struct Checkpoint {
    state: checkpoint::Checkpoint,
    inputs: Inputs,
    event_count: usize,
    now: Ticks,
    run: u64,
    number: u64,
}

impl Checkpoint {
    /// The instant: all participants have done exactly the activations before it.
    pub fn time(&self) -> Rational {
        self.state.time
    }

    /// The state that participant `name` saved.
    pub fn state(&self, name: &str) -> Option<&[u8]> {
        let number = self
            .state
            .participants
            .iter()
            .position(|participant| participant == name)?;
        self.state.states.get(number).map(Vec::as_slice)
    }
}

/// An instant in code: exact, or as text in the form that a scenario uses.
pub trait AsInstant {
    /// The instant.
    ///
    /// # Errors
    /// When a text is no time.
    fn instant(&self) -> Result<Rational, RunFailure>;
}

impl AsInstant for Rational {
    fn instant(&self) -> Result<Rational, RunFailure> {
        Ok(*self)
    }
}

impl AsInstant for &str {
    fn instant(&self) -> Result<Rational, RunFailure> {
        self.parse().map_err(|error| RunFailure::Instant {
            time: (*self).to_owned(),
            reason: format!("is not a time: {error}; write such as \"2.5 s\" or \"1/300 s\""),
        })
    }
}

impl Run {
    /// The instant at which the run is paused: all participants have done exactly the activations before it.
    pub fn now(&self) -> Rational {
        self.run_state.time(self.now)
    }

    /// The same, s.
    pub fn now_s(&self) -> f64 {
        self.run_state.plan.timebase.seconds(self.now)
    }

    /// Whether the run is over: it has come to its end, or has failed.
    pub fn is_over(&self) -> bool {
        self.over.is_some()
    }

    /// Runs until all participants have done exactly the activations before `time`, rounded up to the plan's tick, and pauses there.
    ///
    /// # Errors
    /// [`RunFailure::Instant`] for a time before now or after the end, [`RunFailure::Over`] when the run ends before it gets there;
    /// [`Run::end`] reports how.
    pub fn run_to(&mut self, time: impl AsInstant) -> Result<(), RunFailure> {
        let time = time.instant()?;
        let refuse = |reason: String| {
            let time = time.to_string();
            Err(RunFailure::Instant { time, reason })
        };
        let plan = &self.run_state.plan;
        let ticks = match plan.timebase.ceil(time) {
            Ok(ticks) if time <= self.run_state.scenario.duration => ticks.min(plan.end),
            _ => {
                return refuse(format!(
                    "is after the end of the run at {}",
                    self.run_state.scenario.duration
                ));
            }
        };
        if ticks < self.now {
            return refuse(format!(
                "has passed: the run is paused at {}; `restore` goes back",
                self.now()
            ));
        }
        if ticks == self.now {
            self.reject_within_instant("continue to a later instant first")?;
        }
        self.run_to_tick(ticks)
    }

    /// Runs to the next communication point after now, and pauses there; at the end of the run after the last one.
    ///
    /// # Errors
    /// As [`Run::run_to`].
    pub fn step(&mut self) -> Result<(), RunFailure> {
        let (plan, now) = (&self.run_state.plan, self.now);
        let next = plan.participants.iter().filter_map(|planned| {
            let next = planned.sample_time.count_before(now.saturating_add(1));
            (next < planned.activations).then(|| planned.sample_time.instant(next))
        });
        let next = next.min().unwrap_or(plan.end);
        if self.over.is_none() && now >= plan.end {
            return Err(self.over_failure());
        }
        self.run_to_tick(next)
    }

    fn run_to_tick(&mut self, ticks: Ticks) -> Result<(), RunFailure> {
        if self.over.is_some() {
            return Err(self.over_failure());
        }
        if ticks > self.now {
            self.run_until(Some(ticks));
        }
        match &self.over {
            None => Ok(()),
            Some(RunEnd { ending, .. }) if *ending == Ending::Complete => Ok(()),
            Some(_) => Err(self.over_failure()),
        }
    }

    pub(super) fn over_failure(&self) -> RunFailure {
        let how = self.over.as_ref().and_then(|over| over.ending.reason());
        RunFailure::Over {
            how: how.unwrap_or_else(|| format!("it ended at {}", self.now())),
        }
    }

    /// The newest sample of `PARTICIPANT.OUTPUT`, as the participant published it, before signal faults are applied. The sample of
    /// a sampled participant is stamped before now, that of a continuous one at or after now.
    ///
    /// # Errors
    /// When there is no such output, or no sample of it yet.
    pub fn newest(&self, port: &str) -> Result<Sample, RunFailure> {
        let streams = streams(&self.run_state.plan);
        let refuse = |reason: String| RunFailure::Port {
            port: port.to_owned(),
            reason,
        };
        let number = streams.iter().position(|spec| spec.name() == port);
        let number = number.ok_or_else(|| {
            let known: Vec<String> = streams.iter().map(|spec| format!("`{}`", spec.name())).collect();
            refuse(format!("there is no such output; there is {}", known.join(", ")))
        })?;
        let recorder = self.run_state.recorder();
        let (header, payload) = recorder
            .newest_of(number)
            .ok_or_else(|| refuse(format!("has no sample yet at t = {}", self.now())))?;
        Ok(Sample {
            name: port.to_owned(),
            descriptor: streams[number].descriptor.clone(),
            index: header.index,
            stamp_s: self.run_state.plan.timebase.seconds(header.stamp),
            payload: payload.clone(),
        })
    }

    /// The log of `participant` so far: in one process at least the newest 64 KiB, in processes everything that the participant has
    /// written.
    ///
    /// # Errors
    /// When there is no such participant.
    pub fn log(&self, participant: &str) -> Result<String, RunFailure> {
        self.participant_number(participant)?;
        let from_file = || {
            let file = self.run_state.folder.as_ref()?.stderr(participant);
            Some(String::from_utf8_lossy(&std::fs::read(file).ok()?).into_owned())
        };
        let log = self.executor.newest_log(participant).or_else(from_file);
        Ok(log.unwrap_or_default())
    }

    /// The figures so far, if the scenario has an assessment or measures: those of a run that ended now.
    pub fn figures(&self) -> Option<Figures> {
        self.run_state.recorder().figures()
    }

    /// Sets the unconnected input `PARTICIPANT.INPUT` to `value`: the activations at or after now see it, until it is set again. An
    /// event on the tape records this.
    ///
    /// # Errors
    /// [`RunFailure::Port`] when there is no such input, when it is connected (the message names the output), when its payload has
    /// other fields than `M`, and for a number that is not finite; [`RunFailure::Over`].
    pub fn set<M: Message>(&mut self, port: &str, value: &M) -> Result<(), RunFailure> {
        let (participant, input) = inputs::find(&self.run_state.plan, port)?;
        let descriptor = &self.run_state.plan.participants[participant].interface.inputs[input].descriptor;
        if let Some(difference) = M::descriptor().difference(descriptor) {
            return Err(RunFailure::Port {
                port: port.to_owned(),
                reason: format!("its payload is no `{}`: {difference}", M::descriptor().name),
            });
        }
        self.set_bytes(port, Payload::of(value).bytes())
    }

    /// As [`Run::set`], with fields by their names, each with its elements row-major in the field's unit; fields that are not named
    /// are zero.
    ///
    /// # Errors
    /// As [`Run::set`]; also for an unknown field, and for a wrong number of elements.
    pub fn set_fields(&mut self, port: &str, fields: &[(&str, &[f64])]) -> Result<(), RunFailure> {
        let (participant, input) = inputs::find(&self.run_state.plan, port)?;
        let descriptor = &self.run_state.plan.participants[participant].interface.inputs[input].descriptor;
        let refuse = |reason: String| RunFailure::Port {
            port: port.to_owned(),
            reason,
        };
        let mut table = Table::new();
        for (name, values) in fields {
            if descriptor.field(name).is_none() {
                return Err(refuse(no_field(descriptor, name)));
            }
            let values = values.iter().copied().map(Value::Float).collect();
            table.insert((*name).to_owned(), Value::Array(values));
        }
        let bytes = payload(&Value::Table(table), descriptor).map_err(refuse)?;
        self.set_bytes(port, &bytes)
    }

    /// As [`Run::set`], with the bytes of the payload.
    ///
    /// # Errors
    /// As [`Run::set`]; also for a wrong size.
    pub fn set_bytes(&mut self, port: &str, bytes: &[u8]) -> Result<(), RunFailure> {
        let input = inputs::find(&self.run_state.plan, port)?;
        self.reject_within_instant("an input is set at a pause between two instants (`run_to`)")?;
        if self.over.is_some() {
            return Err(self.over_failure());
        }
        let descriptor = &self.run_state.plan.participants[input.0].interface.inputs[input.1].descriptor;
        let refuse = |reason: String| RunFailure::Port {
            port: port.to_owned(),
            reason,
        };
        if bytes.len() != descriptor.size as usize {
            let reason = format!("its payload has {} bytes, not {}", descriptor.size, bytes.len());
            return Err(refuse(reason));
        }
        if let Some(invalid) = descriptor.invalid(bytes).next() {
            return Err(refuse(format!("cannot be set to {}", invalid.describe("a value"))));
        }
        let event = inputs::event(&self.run_state.plan, self.now(), input, bytes);
        self.run_state.recorder().event(&event)?;
        self.run_state.inputs.insert(input, bytes.to_owned());
        self.inputs_pending = true;
        Ok(())
    }

    /// Saves the state of the run now.
    ///
    /// # Errors
    /// When a participant cannot save its state; when the run keeps no samples to go back to ([`Record`](super::Record)); [`RunFailure::Over`].
    pub fn save(&mut self) -> Result<Checkpoint, RunFailure> {
        if self.over.is_some() {
            return Err(self.over_failure());
        }
        self.reject_within_instant("a state is saved at a pause between two instants (`run_to`)")?;
        let (cut, event_count) = {
            let recorder = self.run_state.recorder();
            recorder.check_samples()?;
            (recorder.cut_at(self.now), recorder.event_count())
        };
        let time = self.now();
        let state = actions::collect_checkpoint(self.executor.as_mut(), &self.run_state, time, cut)?;
        self.checkpoint_count += 1;
        self.valid_checkpoints.push(self.checkpoint_count);
        Ok(Checkpoint {
            state,
            inputs: self.run_state.inputs.clone(),
            event_count,
            now: self.now,
            run: self.number,
            number: self.checkpoint_count,
        })
    }

    /// Goes back to `checkpoint`, which this run has saved: all participants get the state saved in it, and the tape, the figures
    /// and the events are cut back to it. This is possible after the end of the run too, unless a participant has failed.
    ///
    /// # Errors
    /// When the checkpoint is another run's, or when the run has gone back to an earlier instant since: then the samples that lead
    /// to it no longer exist.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), RunFailure> {
        let time = checkpoint.time();
        let refuse = |reason: &str| {
            let reason = reason.to_owned();
            let time = time.to_string();
            Err(RunFailure::Instant { time, reason })
        };
        if checkpoint.run != self.number {
            return refuse("is the instant of a checkpoint of another run: a run can restore only its own checkpoints");
        }
        if !self.valid_checkpoints.contains(&checkpoint.number) {
            return refuse(
                "is the instant of a checkpoint that the run has left behind: it has gone back to before it, and what led to it is \
                 no longer recorded",
            );
        }
        if self.over.as_ref().is_some_and(|over| over.ending != Ending::Complete) {
            return Err(self.over_failure());
        }
        let restored = self.rewind_to(checkpoint);
        if let Err(failure) = &restored {
            let ending = Ending::orchestrator_failed(failure.to_string());
            let ended_at = Instant::now();
            self.over = Some(RunEnd { ending, ended_at });
        }
        restored
    }

    fn rewind_to(&mut self, checkpoint: &Checkpoint) -> Result<(), RunFailure> {
        let run_state = &mut self.run_state;
        let state = &checkpoint.state;
        let (assessment, guards) =
            prepare::create_evaluators(&run_state.scenario, &run_state.plan, &streams(&run_state.plan))?;
        let (cut, event_count) = (&state.cut, checkpoint.event_count);
        run_state.recorder().cut_back(state, event_count, assessment, guards)?;
        run_state.inputs.clone_from(&checkpoint.inputs);
        run_state.substituted = usize::try_from(state.substitutions).unwrap_or(usize::MAX);
        let schedule = Schedule::new(
            &run_state.scenario,
            &run_state.plan,
            &run_state.options,
            checkpoint.now,
            run_state.substituted,
        )?;
        let slots = prepare::slots_at(run_state, state, |_| false);
        let failed_participants = self.executor.continue_at(run_state, cut, slots, true)?;
        if let Some(first) = failed_participants.first() {
            return Err(RunFailure::Participant {
                participant: run_state.name(first.number).to_owned(),
                reason: first.reason.clone(),
            });
        }
        run_state.clock.reset(schedule, checkpoint.now);
        run_state.last_checkpoint = run_state.scenario.restarts().then(|| state.clone());
        self.executor.set_reached(checkpoint.now);
        (self.now, self.over, self.inputs_pending) = (checkpoint.now, None, false);
        // The record that outputs were set is cut off as well.
        (self.before_step, self.outputs_set) = (false, false);
        self.valid_checkpoints.retain(|save| *save <= checkpoint.number);
        Ok(())
    }
}
