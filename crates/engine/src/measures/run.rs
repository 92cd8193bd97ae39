//! All measures of a run.

use lockstep::time::TickError;
use tape::StreamSpec;

use super::Definition;
use super::measure::{Measure, SavedMeasure};
use crate::assessment::Measured;

/// The measures of a run. The order in which samples of different streams arrive does not matter.
#[derive(Debug, Default)]
pub struct Measures {
    all: Vec<Measure>,
    /// The measures that read each stream.
    readers: Vec<Vec<usize>>,
}

impl Measures {
    /// Creates the measures over `streams`, which the readings of the definitions refer to.
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

    /// True when there are no measures.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Whether a measure reads stream number `stream`.
    pub fn reads(&self, stream: usize) -> bool {
        self.readers.get(stream).is_some_and(|readers| !readers.is_empty())
    }

    /// Processes the next sample of stream number `stream` with its stamp, s.
    pub fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]) {
        for &reader in self.readers.get(stream).into_iter().flatten() {
            self.all[reader].sample(stream, stamp_s, payload);
        }
    }

    /// The state of each measure, with its key.
    pub(super) fn saved(&self) -> Vec<(String, SavedMeasure)> {
        self.all.iter().map(|one| (one.key(), one.saved())).collect()
    }

    /// Replaces the state by the saved one.
    ///
    /// # Errors
    /// The measure that has no saved state, and has not received every sample of its streams.
    pub(super) fn restore(&mut self, saved: &[(String, SavedMeasure)], lacks: &[bool]) -> Result<(), String> {
        for one in &mut self.all {
            let key = one.key();
            if let Some((_, saved)) = saved.iter().find(|(other, _)| *other == key) {
                one.restore(saved.clone());
            } else if one.streams().any(|stream| lacks[stream]) {
                return Err(format!(
                    "measure `{}` is new or was changed, and uses a stream of which [record] leaves samples out",
                    one.name()
                ));
            }
        }
        Ok(())
    }

    /// The figures of the samples so far, in the order of the definitions.
    pub fn finish(&self) -> Vec<Measured> {
        self.all.iter().map(Measure::finish).collect()
    }
}
