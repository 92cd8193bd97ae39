//! A water tank with a leak, and a pump that holds its level, for programs that make and drive runs from code.

use std::path::Path;
use std::sync::Arc;

use escapement::prelude::*;

escapement::message! {
    /// What is in the tank.
    pub struct Level {
        /// Depth of the water.
        pub depth: f64 = "m",
        /// The volume that has leaked so far.
        pub lost: f64 = "m^3",
    }
}

escapement::message! {
    /// The output of the pump.
    pub struct Pump {
        /// Volume per second.
        pub flow: f64 = "m^3/s",
    }
}

/// The area of the tank, m².
const AREA: f64 = 2.0;

struct Tank {
    level: Level,
    /// The area of the leak, m².
    leak: f64,
}

/// The parameters of a tank, below `parameters` in a scenario.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// The depth at the start, m.
    depth: f64,
    /// The area of the leak, m².
    leak: f64,
}

fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let Parameters { depth, leak } = escapement::lockstep::units::read(&setup.parameters)?;
    let level = Level { depth, lost: 0.0 };
    Ok(Box::new(Tank { level, leak }))
}

impl Participant for Tank {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Pump>("pump")
            .output::<Level>("level")
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = self.level;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        // Torricelli's law: the outflow speed is that of a free fall from the water surface.
        let leaks = self.leak * (2.0 * 9.81 * self.level.depth.max(0.0)).sqrt();
        self.level.depth += step.period * (inputs.get::<Pump>(0).flow - leaks) / AREA;
        self.level.lost += step.period * leaks;
        *outputs.get_mut(0) = self.level;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        Some([self.level.depth, self.level.lost].map(f64::to_le_bytes).concat())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        let (depth, lost) = state.split_at_checked(8).ok_or("a state of another tank")?;
        self.level = Level {
            depth: f64::from_le_bytes(depth.try_into()?),
            lost: f64::from_le_bytes(lost.try_into()?),
        };
        Ok(())
    }
}

/// Delivers a flow proportional to the level error.
struct Controller {
    ports: Ports,
    level: InputPort<Level>,
    flow: OutputPort<Pump>,
    parameters: Gains,
}

/// The parameters of a pump, below `parameters` in a scenario.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gains {
    /// The desired depth, m.
    pub wanted: f64,
    /// Flow per metre of level error, m²/s.
    pub gain: f64,
}

impl Controller {
    fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
        let mut ports = Ports::new(Kind::Sampled);
        Ok(Box::new(Controller {
            level: ports.input("level"),
            flow: ports.output("flow"),
            ports,
            parameters: escapement::lockstep::units::read(&setup.parameters)?,
        }))
    }
}

impl Participant for Controller {
    fn interface(&self) -> Interface {
        self.ports.interface()
    }

    fn step(&mut self, _: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let missing = self.parameters.wanted - inputs[self.level].depth;
        outputs[self.flow].flow = (self.parameters.gain * missing).max(0.0);
        Ok(())
    }
}

/// Everything that scenarios may name.
pub fn contents(catalogue: Catalogue) -> Catalogue {
    catalogue
        .participant("tank", make)
        .participant("pump", Controller::make)
}

/// A catalogue with these contents.
pub fn catalogue() -> Arc<Catalogue> {
    Arc::new(contents(Catalogue::new(concat!(
        "from-code ",
        env!("CARGO_PKG_VERSION")
    ))))
}

/// Two minutes of a leaking tank. Nothing in the scenario feeds its pump input: code sets it, so it is listed in `inputs`.
///
/// # Errors
/// None, unless the text below is wrong.
pub fn scenario() -> Result<Scenario, Box<dyn std::error::Error>> {
    let text = r#"
        title = "A tank that leaks"
        duration = "120 s"
        inputs = ["tank.pump"]

        [participants.tank]
        run = { builtin = "tank" }
        period = "50 ms"
        parameters = { depth = 0.4, leak = 0.002 }
    "#;
    Ok(Scenario::read_text(&catalogue(), Path::new("tank.toml"), text)?)
}

/// A run in this process, with the tape in memory.
pub fn options() -> Options {
    Options {
        in_process: true,
        record: Record::Memory,
        ..Options::default()
    }
}
