//! The body of an FMU with one participant, which the importer steps.

use std::sync::Arc;

use engine::scenario::{Entry, Scenario};
use lockstep::participant::{Inputs, Interface, Kind, Log, Outputs, Participant, Payload, Step, Termination};
use lockstep::port::Descriptor;
use lockstep::time::{Rational, SampleTime, Timebase};
use lockstep::wire;
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::body::{self, Body, State};
use crate::lines::Lines;
use crate::parameter::{Parameter, seed_of};
use crate::refusal::Refusal;
use crate::variable::{Port, Ports};

/// One participant.
///
/// A sampled one computes its outputs at t from the inputs at t, which the importer may set until it reads the outputs or continues. So its
/// activation at t is executed when outputs are read, or at the next step; if an input is set after outputs were read, the activation is
/// undone and repeated.
pub struct ParticipantBody {
    scenario: Scenario,
    entry: Entry,
    interface: Interface,
    ports: Ports,
    inputs: Inputs,
    running: Option<Running>,
    lines: Lines,
    /// The parameters with which it was begun.
    start_parameters: Vec<Parameter>,
    /// The outputs before it has begun.
    zero_outputs: Vec<Payload>,
}

struct Running {
    participant: Box<dyn Participant>,
    outputs: Outputs,
    start: Rational,
    timebase: Timebase,
    times: SampleTime,
    period: f64,
    /// The next activation; if there is an `early`, it has already been executed.
    next: u64,
    early: Option<BeforeEarlyStep>,
}

impl Drop for Running {
    fn drop(&mut self) {
        // An importer may end its simulation at any time.
        lockstep::stepper::terminate(self.participant.as_mut(), Termination::Stopped, self.outputs.log_of());
    }
}

/// The state and outputs before an activation that was executed early because its outputs were read.
struct BeforeEarlyStep {
    /// None when the participant cannot be saved.
    state: Option<Vec<u8>>,
    outputs: Vec<Payload>,
    /// Whether inputs were set since.
    stale: bool,
}

/// A state as bytes.
#[derive(Serialize, Deserialize)]
struct Saved {
    inputs: Vec<Vec<u8>>,
    running: Option<SavedRun>,
}

#[derive(Serialize, Deserialize)]
struct SavedRun {
    start: Rational,
    next: u64,
    outputs: Vec<Vec<u8>>,
    state: Vec<u8>,
}

impl ParticipantBody {
    /// Creates the participant of `entry` in `scenario`.
    ///
    /// # Errors
    /// The reason why it cannot be created.
    pub fn new(scenario: Scenario, entry: Entry) -> Result<ParticipantBody, String> {
        let interface = make(&scenario, &entry)?.interface();
        let port = |name: &String, descriptor: &Descriptor| Port {
            name: name.clone(),
            descriptor: descriptor.clone(),
        };
        let sampled = interface.kind == Kind::Sampled;
        let ports = Ports {
            inputs: interface
                .inputs
                .iter()
                .map(|one| port(&one.name, &one.descriptor))
                .collect(),
            outputs: interface
                .outputs
                .iter()
                .map(|one| port(&one.name, &one.descriptor))
                .collect(),
            figures: Vec::new(),
            feedthrough: sampled,
            discrete: sampled,
        };
        let zero_outputs = interface
            .outputs
            .iter()
            .map(|one| Payload::zeroed(one.descriptor.size as usize))
            .collect();
        Ok(ParticipantBody {
            scenario,
            entry,
            inputs: Inputs::zeroed(&interface),
            interface,
            ports,
            running: None,
            lines: Lines::default(),
            start_parameters: Vec::new(),
            zero_outputs,
        })
    }

    /// Parameters as the scenario has them.
    pub fn parameters(&self) -> (&Table, u64) {
        (&self.entry.setup.parameters, self.entry.setup.seed)
    }

    /// The period, exactly.
    pub fn period(&self) -> Rational {
        self.entry.period
    }

    /// The instant of its first activation in the scenario.
    pub fn offset(&self) -> Rational {
        self.entry.offset
    }
}

fn make(scenario: &Scenario, entry: &Entry) -> Result<Box<dyn Participant>, String> {
    let made = scenario.participant(entry).map_err(|error| error.to_string())?;
    made.ok_or_else(|| {
        format!(
            "`{}` is a program of its own, which is no part of an FMU",
            entry.setup.name
        )
    })
}

fn payloads(outputs: &mut Outputs, count: usize) -> Vec<Payload> {
    let copy = |port| {
        let bytes = outputs.bytes_mut(port);
        let mut payload = Payload::zeroed(bytes.len());
        payload.bytes_mut().copy_from_slice(bytes);
        payload
    };
    (0..count).map(copy).collect()
}

fn restore_outputs(outputs: &mut Outputs, payloads: &[Payload]) {
    for (port, payload) in payloads.iter().enumerate() {
        outputs.bytes_mut(port).copy_from_slice(payload.bytes());
    }
}

impl Running {
    fn now(&self) -> f64 {
        self.timebase.seconds(self.times.instant(self.next))
    }

    /// Outputs that are not finite, or not a value of their type, are a failure.
    fn check(&mut self, interface: &Interface, t: f64) -> Result<(), String> {
        for (number, port) in interface.outputs.iter().enumerate() {
            let payload: &[u8] = self.outputs.bytes_mut(number);
            if let Some(invalid) = port.descriptor.invalid(payload).next() {
                let words = invalid.describe("an output");
                return Err(format!("it gave out {}.{words} at t = {t} s", port.name));
            }
        }
        Ok(())
    }

    /// Executes the next activation, once.
    fn activate(&mut self, interface: &Interface, inputs: &Inputs) -> Result<(), String> {
        let instant = |k| self.timebase.seconds(self.times.instant(k));
        let (t, t_next) = (instant(self.next), instant(self.next + 1));
        let step = Step {
            index: self.next,
            t,
            t_next,
            period: self.period,
        };
        self.outputs.set_time(t);
        let done = self.participant.step(&step, inputs, &mut self.outputs);
        done.map_err(|failure| format!("it failed at t = {t} s (activation {}): {failure}", self.next))?;
        self.check(interface, t)
    }

    /// Computes the outputs of a sampled participant for the present inputs.
    fn evaluate(&mut self, interface: &Interface, inputs: &Inputs) -> Result<(), String> {
        match self.early.take() {
            Some(early) if !early.stale => {
                self.early = Some(early);
                return Ok(());
            }
            Some(early) => {
                let state = early.state.as_deref().ok_or_else(|| {
                    format!(
                        "inputs were set at t = {} s after outputs of this instant had been read, and the participant cannot take back \
                         its step: it has no `save` and `restore`",
                        self.now()
                    )
                })?;
                self.participant.restore(state).map_err(|failure| failure.to_string())?;
                restore_outputs(&mut self.outputs, &early.outputs);
                self.early = Some(BeforeEarlyStep { stale: false, ..early });
            }
            None => {
                self.early = Some(BeforeEarlyStep {
                    state: self.participant.save(),
                    outputs: payloads(&mut self.outputs, interface.outputs.len()),
                    stale: false,
                });
            }
        }
        self.activate(interface, inputs)
    }

    /// One step to the next instant.
    fn step_once(&mut self, interface: &Interface, inputs: &Inputs) -> Result<(), String> {
        match &self.early {
            Some(_) => {
                self.evaluate(interface, inputs)?;
                self.early = None;
            }
            None => self.activate(interface, inputs)?,
        }
        self.next += 1;
        Ok(())
    }
}

impl Body for ParticipantBody {
    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn begin(&mut self, parameters: &[Parameter], start: Rational) -> Result<(), String> {
        self.running = None;
        let mut entry = self.entry.clone();
        for parameter in parameters.iter().filter(|one| one.changed) {
            parameter.put(&mut entry.setup.parameters);
        }
        entry.setup.seed = seed_of(parameters, entry.setup.seed)?;
        entry.setup.offset = start.seconds();
        entry.offset = start;
        let timebase = Timebase::from_times([start, entry.period]).map_err(|error| error.to_string())?;
        let ticks = |time| timebase.ceil(time).map_err(|error| error.to_string());
        let times = SampleTime {
            offset: ticks(start)?,
            period: ticks(entry.period)?,
        };
        let participant = make(&self.scenario, &entry)?;
        if let Some(difference) = participant.interface().difference(&self.interface) {
            return Err(format!(
                "with these parameters its ports are others: {difference}; export it with them"
            ));
        }
        let mut running = Running {
            participant,
            outputs: Outputs::zeroed(&self.interface),
            start,
            timebase,
            times,
            period: entry.period.seconds(),
            next: 0,
            early: None,
        };
        let t = start.seconds();
        running
            .outputs
            .set_log(Log::new(&entry.setup.name, Some(Arc::new(self.lines.clone()))).at(t));
        let initialised = running.participant.initialise(t, &mut running.outputs);
        initialised.map_err(|failure| format!("it cannot be initialised at t = {t} s: {failure}"))?;
        running.check(&self.interface, t)?;
        self.running = Some(running);
        self.start_parameters = parameters.to_vec();
        Ok(())
    }

    fn reset(&mut self) {
        self.running = None;
        self.inputs = Inputs::zeroed(&self.interface);
    }

    fn time(&self) -> f64 {
        self.running.as_ref().map_or(self.entry.setup.offset, Running::now)
    }

    fn input(&self, port: usize) -> &[u8] {
        self.inputs.bytes(port)
    }

    fn set(&mut self, port: usize, at: usize, bytes: &[u8]) {
        let place = &mut self.inputs.bytes_mut(port)[at..at + bytes.len()];
        if place != bytes {
            place.copy_from_slice(bytes);
            if let Some(early) = self.running.as_mut().and_then(|running| running.early.as_mut()) {
                early.stale = true;
            }
        }
    }

    fn output(&mut self, port: usize) -> Result<&[u8], String> {
        let Some(running) = &mut self.running else {
            return Ok(self.zero_outputs[port].bytes());
        };
        if self.interface.kind == Kind::Sampled {
            running.evaluate(&self.interface, &self.inputs)?;
        }
        Ok(running.outputs.bytes_mut(port))
    }

    fn figure(&mut self, _: usize) -> Result<f64, String> {
        Err("a participant alone has no figures".into())
    }

    fn advance(&mut self, from: f64, span: f64) -> Result<(), Refusal> {
        let Some(running) = &mut self.running else {
            return Err(Refusal::error("it is not initialised"));
        };
        let count = body::whole_steps(running.now(), running.period, from, span)?;
        for _ in 0..count {
            running.step_once(&self.interface, &self.inputs)?;
        }
        Ok(())
    }

    fn take_log_lines(&mut self) -> Vec<String> {
        self.lines.take()
    }

    fn save(&mut self) -> Result<State, String> {
        let interface = &self.interface;
        let running = match &mut self.running {
            None => None,
            Some(running) => {
                // The state before the early activation, which is repeated when the state is restored.
                let (state, outputs) = match &running.early {
                    Some(early) => (early.state.clone(), early.outputs.clone()),
                    None => (
                        running.participant.save(),
                        payloads(&mut running.outputs, interface.outputs.len()),
                    ),
                };
                let state = state.ok_or_else(|| match running.participant.save_failure() {
                    Some(reason) => format!("the participant cannot save its state: its `save` failed: {reason}"),
                    None => "the participant cannot save its state: it has no `save` and `restore`".to_owned(),
                })?;
                Some(SavedRun {
                    start: running.start,
                    next: running.next,
                    outputs: outputs.iter().map(|one| one.bytes().to_vec()).collect(),
                    state,
                })
            }
        };
        let inputs = (0..interface.inputs.len()).map(|port| self.inputs.bytes(port).to_vec());
        let saved = Saved {
            inputs: inputs.collect(),
            running,
        };
        let bytes = wire::encode("the state of a participant", &saved).map_err(|error| error.to_string())?;
        Ok(State {
            bytes,
            checkpoint: None,
        })
    }

    fn restore(&mut self, parameters: &[Parameter], state: &State) -> Result<(), String> {
        let what = "the state of a participant";
        let saved: Saved = wire::decode(what, &state.bytes).map_err(|error| error.to_string())?;
        let sizes = |all: &[Vec<u8>]| all.iter().map(Vec::len).collect::<Vec<_>>();
        let inputs = self.interface.inputs.iter().map(|one| one.descriptor.size as usize);
        if sizes(&saved.inputs) != inputs.collect::<Vec<_>>() {
            return Err("the state has inputs of other sizes: it is another FMU's".into());
        }
        match saved.running {
            None => self.running = None,
            Some(run) => {
                let outputs = self.interface.outputs.iter().map(|one| one.descriptor.size as usize);
                if sizes(&run.outputs) != outputs.collect::<Vec<_>>() {
                    return Err("the state has outputs of other sizes: it is another FMU's".into());
                }
                let same = self.start_parameters == parameters;
                if !same || self.running.as_ref().is_none_or(|running| running.start != run.start) {
                    self.begin(parameters, run.start)?;
                }
                if let Some(running) = &mut self.running {
                    running.early = None;
                    running
                        .participant
                        .restore(&run.state)
                        .map_err(|failure| failure.to_string())?;
                    for (port, bytes) in run.outputs.iter().enumerate() {
                        running.outputs.bytes_mut(port).copy_from_slice(bytes);
                    }
                    running.next = run.next;
                }
            }
        }
        for (port, bytes) in saved.inputs.iter().enumerate() {
            self.inputs.bytes_mut(port).copy_from_slice(bytes);
        }
        Ok(())
    }
}
