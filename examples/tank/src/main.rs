//! A tank, and an operator who fills and drains it by a valve with three positions.

use escapement::lockstep::participant::state;
use escapement::lockstep::units::{self, Length, Quantity, Speed};
use escapement::prelude::*;
use serde::Deserialize;

escapement::enumeration! {
    /// The position of the valve.
    pub enum Valve {
        /// Nothing flows.
        Closed = 0,
        /// The level rises.
        Filling = 1,
        /// The level falls.
        Draining = 2,
    }
}

escapement::message! {
    /// The instruments of the tank.
    pub struct Gauge {
        /// The level above the bottom of the tank.
        pub level: f64 = "m",
        /// The count of the flow meter: one for each millimetre of level, in both directions.
        pub pulses: u16 = "1",
        /// The last change of the level, in whole micrometres.
        pub change: i16 = "um",
        /// Whether the upper switch is wet.
        pub full: bool = "1",
        /// Whether the lower switch is dry.
        pub empty: bool = "1",
        /// Padding.
        pub padding: [u8; 2] = "1",
    }
}

escapement::message! {
    /// The operator's commands.
    pub struct Order {
        /// The valve.
        pub valve: Valve = "1",
        /// Whether the operator has ever seen the tank full.
        pub seen_full: bool = "1",
    }
}

/// The tank: the level changes at a constant rate while the valve is open.
struct Tank {
    parameters: TankParameters,
    gauge: Gauge,
    /// The change of level that has passed the meter since its last pulse, m.
    between: f64,
}

/// The parameters below `parameters` in a scenario, with units.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TankParameters {
    level: Quantity<Length>,
    rate: Quantity<Speed>,
    lower: Quantity<Length>,
    upper: Quantity<Length>,
}

fn tank(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters: TankParameters = units::read(&setup.parameters)?;
    let mut tank = Tank {
        gauge: Gauge {
            level: parameters.level.si(),
            ..Gauge::default()
        },
        parameters,
        between: 0.0,
    };
    tank.update_switches();
    Ok(Box::new(tank))
}

impl Tank {
    fn update_switches(&mut self) {
        self.gauge.full = self.gauge.level >= self.parameters.upper.si();
        self.gauge.empty = self.gauge.level <= self.parameters.lower.si();
    }
}

impl Participant for Tank {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Order>("order")
            .output::<Gauge>("gauge")
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = self.gauge;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let flow = self.parameters.rate.si() * step.period;
        let change = match inputs.get::<Order>(0).valve {
            Valve::Closed => 0.0,
            Valve::Filling => flow,
            Valve::Draining => -flow,
        };
        self.gauge.level += change;
        self.gauge.change = (change * 1e6).round() as i16;
        self.between += change.abs();
        while self.between >= 1e-3 {
            self.between -= 1e-3;
            self.gauge.pulses = self.gauge.pulses.wrapping_add(1);
        }
        self.update_switches();
        *outputs.get_mut(0) = self.gauge;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        state::to_bytes(&(self.gauge, self.between))
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        (self.gauge, self.between) = state::from_bytes(bytes)?;
        Ok(())
    }
}

/// The operator: drains a full tank and fills an empty one.
#[derive(Default)]
struct Operator {
    order: Order,
}

fn operator(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    Ok(Box::new(Operator::default()))
}

impl Participant for Operator {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Gauge>("gauge")
            .output::<Order>("order")
    }

    fn step(&mut self, _step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let gauge = inputs.get::<Gauge>(0);
        if gauge.full {
            self.order.valve = Valve::Draining;
            self.order.seen_full = true;
        } else if gauge.empty {
            self.order.valve = Valve::Filling;
        }
        *outputs.get_mut(0) = self.order;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        state::to_bytes(&self.order)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.order = state::from_bytes(bytes)?;
        Ok(())
    }
}

fn main() -> std::process::ExitCode {
    escapement::Program::new("tank")
        .version(env!("CARGO_PKG_VERSION"))
        .participant("tank", tank)
        .participant("operator", operator)
        .main()
}
