//! A participant that logs its life cycle; the C and C++ versions are in `tests/plugins`.

use lockstep::participant::{
    Failure, Inputs, Interface, Kind, Log, Outputs, ParameterError, Participant, Setup, Step, Termination,
};

lockstep::message! {
    /// The output of a [`Diary`].
    pub struct Page {
        /// Number of pages so far.
        pub number: u64 = "1",
    }
}

/// Logs a line at its start, in its third step, and at its end.
pub struct Diary {
    number: u64,
    fails_at: Option<u64>,
    panics_at: Option<u64>,
}

impl Diary {
    /// Fails in the step `fails-at`, and panics in the step `panics-at`.
    pub fn factory(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
        let index = |key: &str| setup.parameters.get(key)?.as_integer().map(i64::unsigned_abs);
        Ok(Box::new(Diary {
            number: 0,
            fails_at: index("fails-at"),
            panics_at: index("panics-at"),
        }))
    }
}

impl Participant for Diary {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled).output::<Page>("page")
    }

    fn initialise(&mut self, _: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        outputs.log("begins");
        Ok(())
    }

    fn step(&mut self, step: &Step, _: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.number += 1;
        outputs.get_mut::<Page>(0).number = self.number;
        if step.index == 2 {
            outputs.log(format_args!("is at page {}", self.number));
        }
        if self.fails_at == Some(step.index) {
            return Err("has no more pages".into());
        }
        assert!(self.panics_at != Some(step.index), "the diary burns");
        Ok(())
    }

    fn terminate(&mut self, why: Termination, log: &Log) {
        log.write(format_args!("ends, {}, at page {}", why.name(), self.number));
    }

    fn save(&self) -> Option<Vec<u8>> {
        Some(self.number.to_le_bytes().to_vec())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.number = u64::from_le_bytes(state.try_into()?);
        Ok(())
    }
}
