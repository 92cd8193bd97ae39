//! Participants that are FMUs.

use std::cell::RefCell;
use std::path::Path;

use lockstep::participant::{
    Failure, Inputs, Interface, Log, Outputs, ParameterError, Participant, Setup, Step, Termination,
};
use lockstep::wire;
use serde::{Deserialize, Serialize};

use crate::aliases::Aliases;
use crate::history::History;
use crate::instance::Running;
use crate::layout::Layout;
use crate::model::Model;
use crate::options::Options;
use crate::settings::Settings;

/// Tolerance of the ratio of a period to the FMU's fixed step from a whole number.
const STEP_TOLERANCE: f64 = 1e-6;

/// Which FMUs can be saved: the end of the reason why one was not.
const SAVE_REMEDY: &str = "An FMU that can serialise its state is saved by its own functions (canGetAndSetFMUState and \
     canSerializeFMUState in FMI 3.0, canGetAndSetFMUstate and canSerializeFMUstate in 2.0), any other by the history of its inputs: \
     use an FMU of which one of them holds, or run without";

/// The saved state of an FMU.
#[derive(Serialize, Deserialize)]
struct Saved {
    /// The identity of the FMU.
    token: String,
    state: SavedState,
}

#[derive(Serialize, Deserialize)]
enum SavedState {
    /// In the FMU's own format.
    Serialised(Vec<u8>),
    /// All inputs so far.
    InputHistory(History),
}

/// An FMU as a participant. Before the initialisation no code of it is loaded.
struct Fmu {
    model: Model,
    settings: Settings,
    layout: Layout,
    name: String,
    period: f64,
    tolerance: Option<f64>,
    feedthrough: bool,
    /// Whether the working directory may be changed: only where the process has no other participant.
    own_process: bool,
    running: Option<Running>,
    /// The input history, where the FMU cannot save its state.
    history: Option<History>,
    /// Why the last `save` failed, with the remedy.
    save_failure: RefCell<Option<String>>,
}

/// Checks that `file` is an FMU that can run here, and that the other keys of `run` fit it. Returns the other names of its fields.
///
/// # Errors
/// Names the key below `run`.
pub fn check(file: &Path, options: &toml::Table) -> Result<Aliases, ParameterError> {
    let options = Options::read(options)?;
    let model = open(file)?;
    // Extents of arrays may depend on parameters, which are not known here.
    let settings = Settings::read(&model.description, &toml::Table::new())?;
    Layout::new(&model.description, &options, &settings).map(|layout| layout.aliases)
}

fn open(file: &Path) -> Result<Model, ParameterError> {
    let open = || {
        let model = Model::open(file)?;
        model.library()?;
        Ok(model)
    };
    open().map_err(|error: crate::model::FmuError| ParameterError::new("fmu", error))
}

/// Creates the participant of an FMU with the other keys of `run`, as TOML; `own_process` where it is the only participant of
/// this process.
///
/// # Errors
/// Names the parameter that is rejected; `fmu`, `ports`, `record` and `tolerance` are keys of `run`, which [`check`] has
/// already validated.
pub fn participant(
    file: &Path,
    options: &str,
    setup: &Setup,
    own_process: bool,
) -> Result<Box<dyn Participant>, ParameterError> {
    let options = options
        .parse()
        .map_err(|error: toml::de::Error| ParameterError::new("", error))?;
    Ok(Box::new(Fmu::make(file, &options, setup, own_process)?))
}

impl Fmu {
    fn make(file: &Path, options: &toml::Table, setup: &Setup, own_process: bool) -> Result<Fmu, ParameterError> {
        let options = Options::read(options)?;
        let model = open(file)?;
        let settings = Settings::read(&model.description, &setup.parameters)?;
        let layout = Layout::new(&model.description, &options, &settings)?;
        if let Some(own) = model.description.capabilities.fixed_step {
            let steps = setup.period / own;
            if (steps - steps.round()).abs() > STEP_TOLERANCE || steps.round() < 1.0 {
                return Err(ParameterError::new(
                    "",
                    format!(
                        "the period is {} s and the FMU's own step is fixed at {own} s: the period must be a whole multiple of it, \
                         such as {} s",
                        setup.period,
                        own * steps.round().max(1.0)
                    ),
                ));
            }
        }
        Ok(Fmu {
            tolerance: options.tolerance.or(model.description.experiment.tolerance),
            feedthrough: options.feedthrough,
            model,
            settings,
            layout,
            name: setup.name.clone(),
            period: setup.period,
            own_process,
            running: None,
            history: None,
            save_failure: RefCell::default(),
        })
    }

    fn start(&mut self, t: f64) -> Result<(), Failure> {
        // The previous instance is dropped first: some FMUs permit one instance only.
        self.running = None;
        let (name, own_process) = (&self.name, self.own_process);
        let running = Running::start(&self.model, &self.settings, name, t, self.tolerance, own_process)?;
        if self.own_process {
            let work = running.working_directory();
            std::env::set_current_dir(&work).map_err(|error| format!("`{}`: {error}", work.display()))?;
        }
        self.running = Some(running);
        let own = self.model.description.capabilities.serialise;
        self.history = (!own).then(|| History::new(t));
        Ok(())
    }

    fn advance(&mut self, t: f64, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let Fmu { layout, running, .. } = self;
        let running = running.as_mut().ok_or("it is not initialised")?;
        layout.read(inputs)?;
        running.set(&mut layout.inputs)?;
        if self.feedthrough {
            running.get(&mut layout.outputs)?;
            layout.write(outputs)?;
            running.step(t, self.period)?;
        } else {
            running.step(t, self.period)?;
            running.get(&mut layout.outputs)?;
            layout.write(outputs)?;
        }
        if let Some(history) = &mut self.history {
            let ports = 0..layout.interface.inputs.len();
            history.push_inputs(t, self.period, ports.map(|port| inputs.bytes(port)));
            let ports = 0..layout.interface.outputs.len();
            for port in ports {
                history.push_outputs([&*outputs.bytes_mut(port)].into_iter());
            }
        }
        Ok(())
    }

    /// The state.
    ///
    /// # Errors
    /// Why it cannot be saved.
    fn state(&self) -> Result<SavedState, String> {
        match &self.history {
            Some(history) if history.full => {
                Err("it has no functions for its state, and its inputs have changed so often that their history is too large".into())
            }
            Some(history) => Ok(SavedState::InputHistory(history.clone())),
            None => {
                let running = self.running.as_ref().ok_or("it is not initialised")?;
                running.serialise().map(SavedState::Serialised)
            }
        }
    }

    /// Copies the FMU's log messages to the participant's log.
    fn forward_log(&self, outputs: &Outputs) {
        if let Some(running) = &self.running {
            running.take_log_messages(|line| outputs.log(line));
        }
    }

    /// Replays the inputs of another instance on a fresh one, and compares the outputs.
    fn replay_inputs(&mut self, history: &History) -> Result<(), Failure> {
        self.start(history.start)?;
        let interface = &self.layout.interface;
        let (mut inputs, mut outputs) = (Inputs::zeroed(interface), Outputs::zeroed(interface));
        let sizes: Vec<usize> = interface
            .inputs
            .iter()
            .map(|port| port.descriptor.size as usize)
            .collect();
        let mut last = history.start;
        for (t, bytes) in history.steps(self.period) {
            if bytes.len() != sizes.iter().sum::<usize>() {
                return Err("the saved inputs have another size than its ports: it is the state of another FMU".into());
            }
            let mut rest = bytes;
            for (port, size) in sizes.iter().enumerate() {
                let (own, after) = rest.split_at(*size);
                inputs.bytes_mut(port).copy_from_slice(own);
                rest = after;
            }
            self.advance(t, &inputs, &mut outputs)?;
            last = t;
        }
        // The first instance has already reported these messages.
        self.running
            .iter()
            .for_each(|running| running.take_log_messages(|_| {}));
        let checksum = self.history.as_ref().map(|history| history.checksum);
        if checksum != Some(history.checksum) {
            return Err(format!(
                "fed the same inputs again up to t = {last} s, the FMU gave other outputs than before. It cannot save its state, so it is \
                 taken up only as it was: with the parameters and start values that it had, and if it depends on nothing but these and its \
                 inputs"
            )
            .into());
        }
        Ok(())
    }
}

impl Participant for Fmu {
    fn interface(&self) -> Interface {
        self.layout.interface.clone()
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.start(t)?;
        self.forward_log(outputs);
        if !self.feedthrough
            && let Some(running) = &mut self.running
        {
            running.get(&mut self.layout.outputs)?;
            self.layout.write(outputs)?;
        }
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let done = self.advance(step.t, inputs, outputs);
        self.forward_log(outputs);
        done
    }

    fn terminate(&mut self, _: Termination, log: &Log) {
        let Some(running) = &mut self.running else { return };
        let ended = running.terminate();
        running.take_log_messages(|line| log.write(line));
        if let Err(failure) = ended {
            log.write(failure);
        }
    }

    fn save(&self) -> Option<Vec<u8>> {
        let state = self.state();
        let saved = state.and_then(|state| {
            let token = self.model.description.token.clone();
            wire::encode("the state of an FMU", &Saved { token, state }).map_err(|error| error.to_string())
        });
        let (state, failure) = match saved {
            Ok(state) => (Some(state), None),
            Err(reason) => (None, Some(format!("{reason}. {SAVE_REMEDY}"))),
        };
        self.save_failure.replace(failure);
        state
    }

    fn save_failure(&self) -> Option<String> {
        self.save_failure.borrow().clone()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        let saved: Saved = wire::decode("the state of an FMU", state)?;
        let own = &self.model.description.token;
        if saved.token != *own {
            return Err(format!(
                "it is the state of another FMU: its token is `{}`, not `{own}`",
                saved.token
            )
            .into());
        }
        match saved.state {
            SavedState::InputHistory(history) => self.replay_inputs(&history),
            SavedState::Serialised(bytes) => {
                let running = self.running.as_mut().ok_or("it is not initialised")?;
                running.deserialise(&bytes)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zip::Archive;

    /// An archive of files that are not packed.
    fn archive(files: &[(&str, &str)]) -> Vec<u8> {
        let (mut bytes, mut directory) = (Vec::new(), Vec::new());
        for (name, contents) in files {
            let at = bytes.len() as u32;
            // From the needed version to the length of the extra field, the same in both headers.
            let mut about = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
            about.extend(crc32fast::hash(contents.as_bytes()).to_le_bytes());
            about.extend([(contents.len() as u32).to_le_bytes(); 2].concat());
            about.extend((name.len() as u32).to_le_bytes());
            bytes.extend([b"PK\x03\x04", &about[..], name.as_bytes(), contents.as_bytes()].concat());
            directory.extend(
                [
                    b"PK\x01\x02\x14\x00",
                    &about[..],
                    &[0; 10],
                    &at.to_le_bytes(),
                    name.as_bytes(),
                ]
                .concat(),
            );
        }
        let (count, at) = ((files.len() as u16).to_le_bytes(), (bytes.len() as u32).to_le_bytes());
        let size = (directory.len() as u32).to_le_bytes();
        let end = [b"PK\x05\x06\0\0\0\0", &count[..], &count, &size, &at, &[0, 0]].concat();
        bytes.extend([directory, end].concat());
        bytes
    }

    /// The participant of an FMU with these variables and without a library.
    fn fmu(name: &str, variables: &str) -> Result<Fmu, ParameterError> {
        let description = format!(
            "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='t'><CoSimulation modelIdentifier='m'/>\
             <ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
        );
        let files = [
            ("modelDescription.xml", description.as_str()),
            ("binaries/x86_64-linux/m.so", ""),
        ];
        let file = std::env::temp_dir().join(format!("{name}-{}.fmu", std::process::id()));
        std::fs::write(&file, archive(&files)).expect("the file can be written");
        let setup = Setup {
            name: "it".into(),
            parameters: toml::Table::new(),
            seed: 1,
            period: 1.0,
            offset: 0.0,
        };
        let made = Fmu::make(&file, &toml::Table::new(), &setup, false);
        std::fs::remove_file(&file).expect("the file is there");
        made
    }

    #[test]
    fn padding_name_differs_from_all_variables() {
        let variables = "<Float64 name='padding' valueReference='1' causality='output'/>\
                         <Int8 name='padding_2' valueReference='2' causality='output'/>";
        let interface = fmu("padding", variables)
            .expect("the variables are in order")
            .interface();
        let fields = &interface.outputs[0].descriptor.fields;
        let names: Vec<(&str, bool)> = fields.iter().map(|one| (one.name.as_str(), one.is_padding())).collect();
        assert_eq!(names, [("padding", false), ("padding_2", false), ("padding_3", true)]);
    }

    #[test]
    fn inputs_with_one_value_reference_are_both_named() {
        let variables = "<Float64 name='u1' valueReference='7' causality='input'/>\
                         <Float64 name='u2' valueReference='7' causality='input'/>";
        let error = fmu("twice", variables).err().expect("it is refused").to_string();
        assert!(
            error.contains("the inputs `u1` and `u2` have the same value reference 7"),
            "{error}"
        );
    }

    #[test]
    fn file_in_place_of_a_folder_is_refused() {
        for inside in ["resources/a", "resources/a/b", "resources/"] {
            let bytes = archive(&[(inside, ""), ("resources-of", ""), ("resources", "")]);
            let error = Archive::read(bytes).expect_err("it is refused").to_string();
            let words = format!("`resources` in the archive: it is a file, and the folder of `{inside}`");
            assert!(error.contains(&words), "{error}");
        }
        let fine = archive(&[("resources-of", ""), ("resources/", ""), ("resources/a", "")]);
        assert!(Archive::read(fine).is_ok());
    }

    #[test]
    fn failed_save_has_its_reason_and_a_later_one_has_none() {
        let variables = "<Float64 name='y' valueReference='1' causality='output'/>";
        let mut fmu = fmu("unsaved", variables).expect("the variables are in order");
        fmu.history = Some(History::new(0.0));
        assert!(fmu.save().is_some() && fmu.save_failure().is_none());
        fmu.history.iter_mut().for_each(|history| history.full = true);
        assert!(fmu.save().is_none());
        let reason = fmu.save_failure().expect("it failed");
        assert!(
            reason.starts_with("it has no functions") && reason.ends_with("run without"),
            "{reason}"
        );
        fmu.history.iter_mut().for_each(|history| history.full = false);
        assert!(fmu.save().is_some() && fmu.save_failure().is_none());
    }
}
