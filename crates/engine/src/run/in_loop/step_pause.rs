//! A pause within an instant: a participant is paused before its step, its inputs can be read, and its outputs can be set instead of
//! the step.

use lockstep::participant::{Interface, Payload};
use lockstep::port::{Descriptor, Message};
use tape::{Event, EventKind};

use crate::run::handle::{Run, RunEnd};
use crate::run::outcome::{Ending, RunFailure};
use crate::run::recording::newest::Sample;

impl Run {
    /// Runs until `participant` is about to step: it has the inputs of its next activation, at [`Run::now`], and everything that
    /// must come before that has been done. [`Run::read_input`] returns its inputs and [`Run::set_output`] sets its outputs; if none is
    /// set, it steps as usual when the run continues. Returns `false` when it has no activation left: then the run has reached its end.
    ///
    /// # Errors
    /// When there is no such participant, or the run is in processes; [`RunFailure::Over`].
    pub fn run_to_step(&mut self, participant: &str) -> Result<bool, RunFailure> {
        let number = self.participant_number(participant)?;
        if self.over.is_some() {
            return Err(self.over_failure());
        }
        let Some(next) = self.executor.pause_before_step(number) else {
            return Err(RunFailure::Participant {
                participant: participant.to_owned(),
                reason:
                    "is in a process of its own, which cannot be paused before a step: run in this process (`in_process`)"
                        .into(),
            });
        };
        // No further than that, because granted time cannot be revoked.
        self.advance(Some(next.saturating_add(1)));
        match &self.over {
            None => Ok(true),
            Some(RunEnd { ending, .. }) if *ending == Ending::Complete => Ok(false),
            Some(_) => Err(self.over_failure()),
        }
    }

    /// The ports of a participant.
    ///
    /// # Errors
    /// When there is no such participant.
    pub fn interface(&self, participant: &str) -> Result<&Interface, RunFailure> {
        let number = self.participant_number(participant)?;
        Ok(&self.run_state.plan.participants[number].interface)
    }

    /// The sample that `PARTICIPANT.INPUT` has in the activation before whose step the participant is paused, with delays and
    /// faults applied. Its index is that of the activation, its stamp the instant.
    ///
    /// # Errors
    /// When the participant is not paused before its step, or has no such input.
    pub fn read_input(&self, port: &str) -> Result<Sample, RunFailure> {
        let (name, input) = self.split_held_port(port)?;
        let stepper = self.executor.before_step().ok_or_else(|| not_paused(port, name))?;
        let inputs = &stepper.assignment().interface.inputs;
        let number = port_number(port, "input", input, inputs.iter().map(|one| &one.name))?;
        let descriptor = inputs[number].descriptor.clone();
        let mut payload = Payload::zeroed(descriptor.size as usize);
        payload.bytes_mut().copy_from_slice(stepper.input_value(number));
        Ok(Sample {
            name: port.to_owned(),
            descriptor,
            index: stepper.next_activation(),
            stamp_s: stepper.next_seconds(),
            payload,
        })
    }

    /// Sets `PARTICIPANT.OUTPUT` for the activation before whose step the participant is paused: the participant then does not step, and
    /// this value is published instead. Outputs that are not set keep their last value.
    ///
    /// # Errors
    /// When the participant is not paused before its step, has no such output, or its payload has other fields than `M`.
    pub fn set_output<M: Message>(&mut self, port: &str, value: &M) -> Result<(), RunFailure> {
        self.set_output_as(port, Payload::of(value).bytes(), Some(&M::descriptor()))
    }

    /// As [`Run::set_output`], with the bytes of the payload.
    ///
    /// # Errors
    /// As [`Run::set_output`]; also for a wrong size.
    pub fn set_output_bytes(&mut self, port: &str, payload: &[u8]) -> Result<(), RunFailure> {
        self.set_output_as(port, payload, None)
    }

    fn set_output_as(&mut self, port: &str, payload: &[u8], message: Option<&Descriptor>) -> Result<(), RunFailure> {
        let (name, output) = self.split_held_port(port)?;
        let stepper = self.executor.before_step().ok_or_else(|| not_paused(port, name))?;
        let outputs = &stepper.assignment().interface.outputs;
        let number = port_number(port, "output", output, outputs.iter().map(|one| &one.name))?;
        let descriptor = &outputs[number].descriptor;
        let refuse = |reason: String| {
            let port = port.to_owned();
            Err(RunFailure::Port { port, reason })
        };
        if let Some((message, difference)) =
            message.and_then(|message| Some((message, message.difference(descriptor)?)))
        {
            return refuse(format!("its payload is no `{}`: {difference}", message.name));
        }
        if payload.len() != descriptor.size as usize {
            return refuse(format!(
                "its payload has {} bytes, not {}",
                descriptor.size,
                payload.len()
            ));
        }
        if let Some(invalid) = descriptor.invalid(payload).next() {
            return refuse(format!("cannot be set to {}", invalid.describe("a value")));
        }
        self.override_output(number, payload)
    }

    /// The payload of input number `input` of the paused participant, without a lookup by name; `None` if no participant is paused before its
    /// step.
    pub fn read_input_at(&self, input: usize) -> Option<&[u8]> {
        let stepper = self.executor.before_step()?;
        (input < stepper.assignment().interface.inputs.len()).then(|| stepper.input_value(input))
    }

    /// Sets output number `output` of the paused participant, without a lookup by name. A value that is not finite ends the run, as it
    /// would if the participant published it. Returns whether a participant is paused before its step and the payload has the right
    /// size.
    ///
    /// # Errors
    /// When the tape cannot be written.
    pub fn set_output_at(&mut self, output: usize, payload: &[u8]) -> Result<bool, RunFailure> {
        let outputs = self
            .executor
            .before_step()
            .map(|stepper| &stepper.assignment().interface.outputs);
        let port = outputs.and_then(|outputs| outputs.get(output));
        if port.is_none_or(|port| port.descriptor.size as usize != payload.len()) {
            return Ok(false);
        }
        self.override_output(output, payload).map(|()| true)
    }

    fn override_output(&mut self, output: usize, payload: &[u8]) -> Result<(), RunFailure> {
        if !self.outputs_set {
            // Recorded once: from here on the tape does not follow from the scenario alone.
            let participant = self
                .executor
                .before_step()
                .map(|stepper| stepper.assignment().name.clone());
            let event = Event {
                time: self.now(),
                kind: EventKind::Note,
                participant,
                text: "its outputs are set by the program that drives the run".to_owned(),
            };
            self.run_state.recorder().event(&event)?;
            self.outputs_set = true;
        }
        self.executor.set_output(output, payload);
        Ok(())
    }

    /// Refuses operations that need a pause between two instants.
    pub(crate) fn reject_within_instant(&self, what: &str) -> Result<(), RunFailure> {
        match self.executor.before_step() {
            Some(stepper) if self.before_step => Err(RunFailure::Instant {
                time: self.now().to_string(),
                reason: format!(
                    "is not over: `{}` is paused before its step there, and others have done theirs; {what}",
                    stepper.assignment().name
                ),
            }),
            _ => Ok(()),
        }
    }

    pub(in crate::run) fn participant_number(&self, participant: &str) -> Result<usize, RunFailure> {
        self.run_state.plan.participant(participant).ok_or_else(|| {
            let known: Vec<String> = (self.run_state.plan.participants.iter())
                .map(|planned| format!("`{}`", planned.name))
                .collect();
            RunFailure::Participant {
                participant: participant.to_owned(),
                reason: format!("there is no such participant; there is {}", known.join(", ")),
            }
        })
    }

    /// Splits `PARTICIPANT.PORT`; the participant must be the one that is paused.
    fn split_held_port<'a>(&self, port: &'a str) -> Result<(&'a str, &'a str), RunFailure> {
        let (name, port_name) = port.split_once('.').ok_or_else(|| RunFailure::Port {
            port: port.to_owned(),
            reason: "is not a port: write \"PARTICIPANT.PORT\"".into(),
        })?;
        match self.executor.before_step() {
            Some(stepper) if stepper.assignment().name == name => Ok((name, port_name)),
            _ => Err(not_paused(port, name)),
        }
    }
}

fn not_paused(port: &str, name: &str) -> RunFailure {
    RunFailure::Port {
        port: port.to_owned(),
        reason: format!("`{name}` is not paused before a step: `run_to_step(\"{name}\")` first"),
    }
}

/// The number of the port called `name`.
fn port_number<'a>(
    port: &str,
    what: &str,
    name: &str,
    all: impl Iterator<Item = &'a String>,
) -> Result<usize, RunFailure> {
    let all: Vec<&String> = all.collect();
    let known = || all.iter().map(|one| format!("`{one}`")).collect::<Vec<_>>().join(", ");
    all.iter().position(|one| *one == name).ok_or_else(|| RunFailure::Port {
        port: port.to_owned(),
        reason: match all.is_empty() {
            true => format!("there is no such {what}; it has none"),
            false => format!("there is no such {what}; it has {}", known()),
        },
    })
}
