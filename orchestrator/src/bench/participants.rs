//! Participants that do nothing but exchange 27 doubles.

use engine::Catalogue;
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

/// Adds the two relays under the names by which a scenario of [`scenario_text`] asks for them.
pub fn register(catalogue: Catalogue) -> Catalogue {
    catalogue
        .internal("bench-continuous", |_| Ok(Box::new(Relay(Kind::Continuous))))
        .internal("bench-sampled", |_| Ok(Box::new(Relay(Kind::Sampled))))
}

/// A ring of `count` relays, the first of them continuous, all activated every millisecond for `steps` steps.
pub fn scenario_text(count: usize, steps: u64) -> String {
    let mut text = format!("title = \"a ring of {count} relays\"\nduration = \"{steps} ms\"\n");
    for number in 0..count {
        let kind = if number == 0 {
            "bench-continuous"
        } else {
            "bench-sampled"
        };
        let before = (number + count - 1) % count;
        text += &format!(
            "[participants.r{number:02}]\nrun = {{ builtin = \"{kind}\" }}\nperiod = \"1 ms\"\n\
             [connections.c{number:02}]\nfrom = \"r{before:02}.to\"\nto = \"r{number:02}.from\"\n"
        );
    }
    text
}
