//! Benchmark participants that exchange 27 doubles: relays, which only copy, and workers.

use std::hint::black_box;

use engine::Catalogue;
use engine::scenario::{ConnectionSpec, ParticipantSpec, RecordSpec, ScenarioSpec};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};

lockstep::message! {
    /// As large as a measured state of the stock plant.
    pub struct Parcel {
        /// Arbitrary values.
        pub values: [f64; 27] = "1",
    }
}

/// Copies its input to its output, continuous or sampled.
struct Relay(Kind);

impl Participant for Relay {
    fn interface(&self) -> Interface {
        Interface::new(self.0).input::<Parcel>("from").output::<Parcel>("to")
    }
    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
    fn step(&mut self, _: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let parcel = outputs.get_mut::<Parcel>(0);
        *parcel = *inputs.get::<Parcel>(0);
        parcel.values[0] += 1.0;
        Ok(())
    }
}

/// Computes for a number of turns; the result depends on every turn.
pub fn compute(turns: u64, seed: f64) -> f64 {
    (0..turns).fold(seed, |sum, _| black_box(sum.mul_add(0.999, 0.001)))
}

/// Computes for this number of turns, and passes the result on.
struct Worker {
    turns: u64,
}

/// Creates a worker.
fn worker(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let turns = setup.parameters.get("turns").and_then(|value| value.as_integer());
    let turns = turns.and_then(|turns| u64::try_from(turns).ok());
    let turns = turns.ok_or_else(|| ParameterError::new("turns", "is not a whole number"))?;
    Ok(Box::new(Worker { turns }))
}

impl Participant for Worker {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Parcel>("from")
            .output::<Parcel>("to")
    }
    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
    fn step(&mut self, _: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let input = inputs.get::<Parcel>(0).values[0];
        outputs.get_mut::<Parcel>(0).values[0] = compute(self.turns, input);
        Ok(())
    }
}

/// Registers the workers, and the two relays under the names that scenarios use.
pub fn register(catalogue: Catalogue) -> Catalogue {
    catalogue
        .internal("bench-continuous", |_| Ok(Box::new(Relay(Kind::Continuous))))
        .internal("bench-sampled", |_| Ok(Box::new(Relay(Kind::Sampled))))
        .internal("bench-worker", worker)
}

/// A ring of `count` relays, the first of them continuous, all activated every millisecond for `steps` steps.
pub fn ring(count: usize, steps: u64) -> ScenarioSpec {
    let ring = ScenarioSpec::new(format!("{steps} ms")).title(&format!("a ring of {count} relays"));
    (0..count).fold(ring, |ring, number| {
        let kind = if number == 0 {
            "bench-continuous"
        } else {
            "bench-sampled"
        };
        let before = (number + count - 1) % count;
        let link = ConnectionSpec::new(&format!("r{before:02}.to"), &format!("r{number:02}.from"));
        ring.participant(&format!("r{number:02}"), ParticipantSpec::builtin(kind).every("1 ms"))
            .connection(&format!("c{number:02}"), link)
    })
}

/// The scenario with nothing of its participants recorded.
pub fn unrecorded(scenario: ScenarioSpec) -> ScenarioSpec {
    let names: Vec<String> = scenario.participants.keys().cloned().collect();
    (names.iter()).fold(scenario, |scenario, name| scenario.record(name, RecordSpec::Nothing))
}

/// Two workers that compute `turns` turns per step and read each other with a delay of `late` steps, for `steps` steps.
pub fn workers(turns: u64, late: u64, steps: u64) -> ScenarioSpec {
    let scenario = ScenarioSpec::new(format!("{steps} ms")).title("two that work");
    let turns = i64::try_from(turns).unwrap_or(i64::MAX);
    [("one", "two"), ("two", "one")]
        .into_iter()
        .fold(scenario, |scenario, (own, other)| {
            let worker = ParticipantSpec::builtin("bench-worker")
                .every("1 ms")
                .parameter("turns", turns);
            let link = ConnectionSpec::new(&format!("{other}.to"), &format!("{own}.from")).delay(format!("{late} ms"));
            scenario.participant(own, worker).connection(own, link)
        })
}
