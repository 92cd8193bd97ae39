//! All measures of a run.

use lockstep::time::TickError;
use tape::StreamSpec;

use super::Definition;
use super::measure::Measure;
use crate::assessment::Measured;

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
