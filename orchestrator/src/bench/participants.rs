//! Participants that do nothing but exchange 27 doubles.

use engine::Catalogue;
use engine::scenario::{ConnectionSpec, ParticipantSpec, ScenarioSpec};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, Participant, Step};

lockstep::message! {
    /// As large as a measured state of the stock plant.
    pub struct Parcel {
        /// Anything.
        pub values: [f64; 27] = "1",
    }
}

/// Passes on what it gets, continuous or sampled.
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

/// Adds the two relays under the names by which a scenario of [`ring`] asks for them.
pub fn register(catalogue: Catalogue) -> Catalogue {
    catalogue
        .internal("bench-continuous", |_| Ok(Box::new(Relay(Kind::Continuous))))
        .internal("bench-sampled", |_| Ok(Box::new(Relay(Kind::Sampled))))
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
