//! Measures: figures that a scenario declares, computed while the samples pass by.
//!
//! - [`Definition`]: what is measured, with every name resolved;
//! - `window`: which samples count, in whole ticks; `pairing`: two streams at different rates;
//! - `signal`: from payloads to numbers; `compute`: from numbers to a figure; `limit`: from a figure to a criterion;
//! - [`of_tape`]: of a tape; [`Measures`]: all measures of a run; [`Together`]: beside the assessment of a scenario.

mod compute;
mod limit;
mod measure;
mod pairing;
mod signal;
mod tape;
mod together;
mod total;
mod window;

use ::tape::StreamSpec;
use lockstep::time::TickError;

pub use compute::{Absent, Compute, Found};
pub use limit::Limits;
pub use measure::Definition;
pub use signal::{Reading, Through};
pub use tape::{MeasureError, of_tape};
pub use together::Together;

use crate::assessment::Measured;
use measure::Measure;

/// The measures of a run. The order in which samples of different streams arrive does not matter.
#[derive(Debug, Default)]
pub struct Measures {
    all: Vec<Measure>,
    /// The measures that read each stream.
    readers: Vec<Vec<usize>>,
}

impl Measures {
    /// Measures over `streams`, to which the readings of the definitions belong.
    ///
    /// # Errors
    /// The name of the measure whose times have no common tick.
    pub fn new(definitions: Vec<Definition>, streams: &[StreamSpec]) -> Result<Measures, (String, TickError)> {
        let mut measures = Measures {
            all: Vec::new(),
            readers: vec![Vec::new(); streams.len()],
        };
        for definition in definitions {
            let name = definition.name.clone();
            let measure = Measure::new(definition, streams).map_err(|error| (name, error))?;
            for stream in measure.streams() {
                measures.readers[stream].push(measures.all.len());
            }
            measures.all.push(measure);
        }
        Ok(measures)
    }

    /// True when nothing is measured.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Whether a measure reads stream number `stream`.
    pub fn reads(&self, stream: usize) -> bool {
        self.readers.get(stream).is_some_and(|readers| !readers.is_empty())
    }

    /// Takes in the next sample of stream number `stream` with its stamp, s.
    pub fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]) {
        for &reader in self.readers.get(stream).into_iter().flatten() {
            self.all[reader].sample(stream, stamp_s, payload);
        }
    }

    /// The figures of what has been seen, in the order of the definitions.
    pub fn finish(&self) -> Vec<Measured> {
        self.all.iter().map(Measure::finish).collect()
    }
}
