//! Participants that are FMUs.

use std::path::Path;

use lockstep::participant::{Failure, Inputs, Interface, Outputs, ParameterError, Participant, Setup, Step};
use lockstep::wire;
use serde::{Deserialize, Serialize};

use crate::history::History;
use crate::instance::Running;
use crate::layout::Layout;
use crate::model::Model;
use crate::options::Options;
use crate::settings::Settings;

/// Tolerance of the ratio of a period to the FMU's fixed step from a whole number.
const STEP_TOLERANCE: f64 = 1e-6;

/// The saved state of an FMU.
#[derive(Serialize, Deserialize)]
struct Saved {
    /// The identity of the FMU.
    token: String,
    state: State,
}

#[derive(Serialize, Deserialize)]
enum State {
    /// In the FMU's own format.
    Own(Vec<u8>),
    /// All inputs so far.
    Played(History),
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
}

/// Checks that `file` is an FMU that can run here, and that the other keys of `run` fit it.
///
/// # Errors
/// Names the key below `run`.
pub fn check(file: &Path, options: &toml::Table) -> Result<(), ParameterError> {
    let options = Options::read(options)?;
    let model = open(file)?;
    // Extents of arrays may depend on parameters, which are not known here.
    let settings = Settings::read(&model.description, &toml::Table::new())?;
    Layout::new(&model.description, &options, &settings).map(drop)
}

fn open(file: &Path) -> Result<Model, ParameterError> {
    let open = || {
        let model = Model::open(file)?;
        model.library()?;
        Ok(model)
    };
    open().map_err(|error: crate::model::FmuError| ParameterError::new("fmu", error))
}

/// Creates the participant of an FMU with the other keys of `run`, as TOML; `alone` where it is the only participant of
/// this process.
///
/// # Errors
/// Names the parameter that is rejected; `fmu`, `ports`, `record` and `tolerance` are keys of `run`, which [`check`] has
/// already validated.
pub fn participant(
    file: &Path,
    options: &str,
    setup: &Setup,
    alone: bool,
) -> Result<Box<dyn Participant>, ParameterError> {
    let options = options
        .parse()
        .map_err(|error: toml::de::Error| ParameterError::new("", error))?;
    Ok(Box::new(Fmu::make(file, &options, setup, alone)?))
}

impl Fmu {
    fn make(file: &Path, options: &toml::Table, setup: &Setup, own_process: bool) -> Result<Fmu, ParameterError> {
        let options = Options::read(options)?;
        let model = open(file)?;
        let settings = Settings::read(&model.description, &setup.parameters)?;
        let layout = Layout::new(&model.description, &options, &settings)?;
        if let Some(own) = model.description.abilities.fixed_step {
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
        })
    }

    fn start(&mut self, t: f64) -> Result<(), Failure> {
        // The previous instance is dropped first: some FMUs permit one instance only.
        self.running = None;
        let (name, alone) = (&self.name, self.own_process);
        let running = Running::start(&self.model, &self.settings, name, t, self.tolerance, alone)?;
        if self.own_process {
            let work = running.work();
            std::env::set_current_dir(&work).map_err(|error| format!("`{}`: {error}", work.display()))?;
        }
        self.running = Some(running);
        let own = self.model.description.abilities.serialise;
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
            history.push(t, self.period, ports.map(|port| inputs.bytes(port)));
            let ports = 0..layout.interface.outputs.len();
            for port in ports {
                history.gave([&*outputs.bytes_mut(port)].into_iter());
            }
        }
        Ok(())
    }

    /// Copies the FMU's log messages to the participant's log.
    fn tell(&self, outputs: &Outputs) {
        if let Some(running) = &self.running {
            running.tell(|line| outputs.log(line));
        }
    }

    /// Replays the inputs of another instance on a fresh one, and compares the outputs.
    fn play(&mut self, played: &History) -> Result<(), Failure> {
        self.start(played.start)?;
        let interface = &self.layout.interface;
        let (mut inputs, mut outputs) = (Inputs::zeroed(interface), Outputs::zeroed(interface));
        let sizes: Vec<usize> = interface
            .inputs
            .iter()
            .map(|port| port.descriptor.size as usize)
            .collect();
        let mut last = played.start;
        for (t, bytes) in played.steps(self.period) {
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
        self.running.iter().for_each(|running| running.tell(|_| {}));
        let checksum = self.history.as_ref().map(|history| history.checksum);
        if checksum != Some(played.checksum) {
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
        self.tell(outputs);
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
        self.tell(outputs);
        done
    }

    fn save(&self) -> Option<Vec<u8>> {
        let state = match &self.history {
            Some(history) if history.full => return None,
            Some(history) => State::Played(history.clone()),
            None => State::Own(self.running.as_ref()?.serialise().ok()?),
        };
        let token = self.model.description.token.clone();
        wire::encode("the state of an FMU", &Saved { token, state }).ok()
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
            State::Played(history) => self.play(&history),
            State::Own(bytes) => {
                let running = self.running.as_mut().ok_or("it is not initialised")?;
                running.deserialise(&bytes)
            }
        }
    }
}
