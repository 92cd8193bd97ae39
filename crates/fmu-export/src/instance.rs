//! An FMU instance: what both versions of the standard have in common.

mod contents;

use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

use engine::Catalogue;
use lockstep::wire;
use serde::{Deserialize, Serialize};

use crate::body::{Body, State, exact};
use crate::kind::{Native, Version};
use crate::log::Log;
use crate::manifest::Content;
use crate::model::Model;
use crate::parameter::{Parameter, ParameterValue};
use crate::refusal::{Refusal, Status};
use crate::variable::{ValueLocation, Variable};

/// The mode of an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    /// Parameters and start values can be set.
    Instantiated,
    /// Outputs can be read, inputs set.
    Initialisation,
    /// Between steps.
    Step,
    /// Terminated.
    Terminated,
}

/// An instance of an exported FMU.
pub struct Instance {
    log: Log,
    version: Version,
    token: String,
    mode: Mode,
    failed: bool,
    start: f64,
    body: Box<dyn Body>,
    parameters: Vec<Parameter>,
    /// The parameters before changes by the importer.
    defaults: Vec<Parameter>,
    variables: Vec<Variable>,
    /// Strings returned by the last call.
    texts: Vec<CString>,
    /// Binary values returned by the last call.
    binaries: Vec<Vec<u8>>,
    can_save_state: bool,
    /// Whether parameters were set since the body began.
    outdated: bool,
    /// Whether the importer wants the participants' log lines.
    forwards_log: bool,
}

/// A saved state of an instance, held by the importer.
pub struct SavedState {
    bytes: Vec<u8>,
    body: State,
}

#[derive(Serialize, Deserialize)]
struct SerialisedState {
    token: String,
    mode: Mode,
    start: f64,
    /// Changed parameters, by number.
    parameters: Vec<(u64, ParameterValue)>,
    body: Vec<u8>,
}

impl Instance {
    /// Creates an instance of the FMU whose resources are in `resources`.
    ///
    /// # Errors
    /// The reason why no instance can be created.
    pub fn new(
        catalogue: &Arc<Catalogue>,
        version: Version,
        resources: &Path,
        token: &str,
        log: Log,
    ) -> Result<Instance, (Log, String)> {
        let made = Content::read(catalogue, resources).and_then(|content| {
            if content.manifest.version() != version {
                let own = content.manifest.fmi;
                return Err(format!(
                    "it is an FMU of FMI {own}.0, and was instantiated as one of another version"
                ));
            }
            if content.token != token.trim() {
                return Err(format!(
                    "its token is `{}`, not `{}`: modelDescription.xml and the resources are not of one FMU",
                    content.token,
                    token.trim()
                ));
            }
            let token = content.token.clone();
            Model::new(content).map(|model| (token, model))
        });
        let (token, model) = match made {
            Ok(made) => made,
            Err(text) => return Err((log, text)),
        };
        Ok(Instance {
            log,
            version,
            token,
            mode: Mode::Instantiated,
            failed: false,
            start: model.body.time(),
            body: model.body,
            defaults: model.parameters.clone(),
            parameters: model.parameters,
            variables: model.variables,
            texts: Vec::new(),
            binaries: Vec::new(),
            can_save_state: model.can_save_state,
            outdated: false,
            forwards_log: true,
        })
    }

    /// Writes a message to the importer's log.
    pub fn log_message(&self, status: Status, text: &str) {
        self.log.write(status, text);
    }

    /// Forwards the participants' log lines since the last call.
    pub fn forward_log_lines(&mut self) {
        for line in self.body.take_log_lines() {
            if self.forwards_log {
                self.log_message(Status::Ok, &line);
            }
        }
    }

    /// Sets whether the importer wants the participants' log lines.
    pub fn set_forwards_log(&mut self, forwards_log: bool) {
        self.forwards_log = forwards_log;
    }

    /// Logs why a call was rejected, and records whether the instance has failed.
    pub fn record_refusal(&mut self, refusal: &Refusal) -> Status {
        self.failed |= refusal.status == Status::Error;
        self.log_message(refusal.status, &refusal.text);
        refusal.status
    }

    /// Whether the instance has failed: it can then only be reset, given another state, or freed.
    pub fn is_failed(&self) -> bool {
        self.failed
    }

    /// The present mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The instant up to which the instance has been stepped, s.
    pub fn time(&self) -> f64 {
        self.body.time()
    }

    /// Whether the end of the scenario has been reached.
    pub fn is_over(&self) -> bool {
        self.body.is_over()
    }

    fn check_mode(&self, modes: &[Mode], what: &str) -> Result<(), Refusal> {
        if modes.contains(&self.mode) {
            return Ok(());
        }
        Err(Refusal::error(format!(
            "{what} is not allowed where it stands ({:?})",
            self.mode
        )))
    }

    /// The start of the experiment, s.
    pub fn set_up(&mut self, start: f64) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Instantiated], "setting up the experiment")?;
        self.start = start;
        Ok(())
    }

    /// Enters the initialization mode: the participant is created and initialised.
    pub fn enter_initialisation(&mut self) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Instantiated], "entering the initialization mode")?;
        self.begin()?;
        self.mode = Mode::Initialisation;
        Ok(())
    }

    fn begin(&mut self) -> Result<(), Refusal> {
        self.outdated = false;
        Ok(self.body.begin(&self.parameters, exact(self.start)?)?)
    }

    /// Restarts if parameters were set in the initialization mode.
    fn restart_if_outdated(&mut self) -> Result<(), Refusal> {
        if self.outdated { self.begin() } else { Ok(()) }
    }

    /// Leaves the initialization mode.
    pub fn exit_initialisation(&mut self) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Initialisation], "leaving the initialization mode")?;
        self.restart_if_outdated()?;
        self.mode = Mode::Step;
        Ok(())
    }

    /// A step from `from` to `from + span`, s.
    pub fn step(&mut self, from: f64, span: f64) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Step], "a step")?;
        self.body.advance(from, span)
    }

    /// Terminates.
    pub fn terminate(&mut self) -> Result<(), Refusal> {
        self.check_mode(&[Mode::Step, Mode::Initialisation], "the end")?;
        self.mode = Mode::Terminated;
        Ok(())
    }

    /// Resets to the state after instantiation.
    pub fn reset(&mut self) {
        self.body.reset();
        self.parameters.clone_from(&self.defaults);
        (self.mode, self.failed, self.outdated) = (Mode::Instantiated, false, false);
        self.start = self.body.time();
    }

    fn variable(&self, reference: u32, native: Native) -> Result<usize, Refusal> {
        let variable = self.variables.get(reference as usize).ok_or_else(|| {
            let count = self.variables.len();
            Refusal::error(format!(
                "there is no variable with the value reference {reference}; there are {count}, from 0 on"
            ))
        })?;
        let own = variable.kind.native(self.version);
        if own != native {
            let kind = variable.kind.name(self.version);
            return Err(Refusal::error(format!(
                "`{}` is a {kind}, and was taken for a {native:?}",
                variable.name
            )));
        }
        Ok(reference as usize)
    }

    /// The total number of values of the variables.
    pub fn count(&self, references: &[u32], native: Native) -> Result<usize, Refusal> {
        let mut count = 0;
        for reference in references {
            count += self.variables[self.variable(*reference, native)?].len;
        }
        Ok(count)
    }

    /// Reads the values of variables consecutively into `to`.
    pub fn get(&mut self, references: &[u32], native: Native, to: &mut [u8]) -> Result<(), Refusal> {
        self.restart_if_outdated()?;
        let (mut rest, each) = (to, native.size());
        for reference in references {
            let number = self.variable(*reference, native)?;
            let Variable {
                place,
                kind,
                len,
                first,
                ..
            } = self.variables[number];
            let (own, after) = rest.split_at_mut(len * each);
            let size = kind.size();
            let value;
            let bytes: &[u8] = match place {
                ValueLocation::Time => {
                    value = self.body.time().to_le_bytes();
                    &value
                }
                ValueLocation::Figure(figure) => {
                    value = self.body.figure(figure)?.to_le_bytes();
                    &value
                }
                ValueLocation::Parameter(parameter) => match &self.parameters[parameter].value {
                    ParameterValue::Bytes(bytes) => &bytes[first * size..],
                    ParameterValue::Text(_) => return Err(Refusal::error("a text is read as a String")),
                },
                ValueLocation::Input(port, at) => &self.body.input(port)[at..],
                ValueLocation::Output(port, at) => &self.body.output(port)?[at..],
            };
            for (from, to) in bytes.chunks_exact(size).zip(own.chunks_exact_mut(each)) {
                let given = kind.to_native(from, native, to);
                given.map_err(|refusal| with_variable_name(&self.variables[number].name, refusal))?;
            }
            rest = after;
        }
        Ok(())
    }

    /// Sets variables to the consecutive values in `from`.
    pub fn set(&mut self, references: &[u32], native: Native, from: &[u8]) -> Result<(), Refusal> {
        let (mut rest, each) = (from, native.size());
        for reference in references {
            let number = self.variable(*reference, native)?;
            let Variable {
                place,
                kind,
                len,
                first,
                ..
            } = self.variables[number];
            let (own, after) = rest.split_at(len * each);
            let size = kind.size();
            let mut values = vec![0; len * size];
            for (from, to) in own.chunks_exact(each).zip(values.chunks_exact_mut(size)) {
                let variable = &self.variables[number];
                let taken = kind
                    .element_from_native(from, native, to)
                    .and_then(|()| variable.check(to));
                taken.map_err(|refusal| with_variable_name(&variable.name, refusal))?;
            }
            match place {
                ValueLocation::Input(port, at) => self.body.set(port, at, &values),
                ValueLocation::Parameter(parameter) => {
                    self.parameters_may_be_set(number)?;
                    let parameter = &mut self.parameters[parameter];
                    if let ParameterValue::Bytes(bytes) = &mut parameter.value {
                        let place = &mut bytes[first * size..first * size + values.len()];
                        parameter.changed |= *place != *values;
                        place.copy_from_slice(&values);
                    }
                }
                ValueLocation::Time | ValueLocation::Output(..) | ValueLocation::Figure(_) => {
                    let name = &self.variables[number].name;
                    return Err(Refusal::error(format!(
                        "`{name}` cannot be set: it is no input and no parameter"
                    )));
                }
            }
            rest = after;
        }
        Ok(())
    }

    fn parameters_may_be_set(&mut self, number: usize) -> Result<(), Refusal> {
        if matches!(self.mode, Mode::Instantiated | Mode::Initialisation) {
            self.outdated = self.mode == Mode::Initialisation;
            return Ok(());
        }
        let name = &self.variables[number].name;
        Err(Refusal::error(format!(
            "the parameter `{name}` is fixed: set it before the initialization mode is left"
        )))
    }

    /// Saves the state.
    pub fn save(&mut self) -> Result<SavedState, Refusal> {
        if !self.can_save_state {
            let text = "the participant cannot save its state: it has no `save` and `restore`";
            return Err(Refusal::error(text));
        }
        self.restart_if_outdated()?;
        let body = self.body.save()?;
        let changed = self.parameters.iter().enumerate().filter(|(_, one)| one.changed);
        let saved = SerialisedState {
            token: self.token.clone(),
            mode: self.mode,
            start: self.start,
            parameters: changed
                .map(|(number, one)| (number as u64, one.value.clone()))
                .collect(),
            body: body.bytes.clone(),
        };
        let bytes = wire::encode("the state of an FMU", &saved).map_err(|error| error.to_string())?;
        Ok(SavedState { bytes, body })
    }

    /// Restores a state, also after a failure.
    pub fn restore(&mut self, state: &SavedState) -> Result<(), Refusal> {
        let saved: SerialisedState =
            wire::decode("the state of an FMU", &state.bytes).map_err(|error| error.to_string())?;
        if saved.token != self.token {
            return Err(Refusal::error("it is the state of another FMU"));
        }
        let mut parameters = self.defaults.clone();
        for (number, value) in saved.parameters {
            let parameter = usize::try_from(number)
                .ok()
                .and_then(|number| parameters.get_mut(number));
            let parameter = parameter.ok_or_else(|| Refusal::error("the state has parameters of another FMU"))?;
            (parameter.value, parameter.changed) = (value, true);
        }
        self.body.restore(&parameters, &state.body)?;
        (self.parameters, self.outdated) = (parameters, false);
        (self.mode, self.start, self.failed) = (saved.mode, saved.start, false);
        Ok(())
    }

    /// The inputs on which the variable `reference` depends at the same instant.
    pub fn dependencies(&self, reference: u32) -> Result<Vec<u32>, Refusal> {
        let variable = self.variables.get(reference as usize);
        let variable = variable.ok_or_else(|| Refusal::error(format!("there is no variable {reference}")))?;
        let depends = self.body.ports().feedthrough && matches!(variable.place, ValueLocation::Output(..));
        let inputs = self
            .variables
            .iter()
            .enumerate()
            .filter(|(_, one)| matches!(one.place, ValueLocation::Input(..)));
        Ok(inputs.filter(|_| depends).map(|(number, _)| number as u32).collect())
    }
}

impl SavedState {
    /// The state as bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// A state from bytes, which may come from a file.
    pub fn of_bytes(bytes: &[u8]) -> Result<SavedState, String> {
        let saved: SerialisedState = wire::decode("the state of an FMU", bytes).map_err(|error| error.to_string())?;
        let body = State {
            bytes: saved.body,
            checkpoint: None,
        };
        Ok(SavedState {
            bytes: bytes.to_vec(),
            body,
        })
    }
}

fn with_variable_name(name: &str, refusal: Refusal) -> Refusal {
    Refusal {
        text: format!("`{name}`: {}", refusal.text),
        ..refusal
    }
}
