//! All measures of a run.

use lockstep::time::TickError;
use tape::StreamSpec;

use super::Definition;
use super::measure::{Measure, Saved};
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

    /// What has been taken in, each measure with what it looks at.
    pub(super) fn saved(&self) -> Vec<(String, Saved)> {
        self.all.iter().map(|one| (one.key(), one.saved())).collect()
    }

    /// Goes on from what was saved, in place of what has been taken in.
    ///
    /// # Errors
    /// The measure that was not saved, and has not taken in every sample of what it looks at.
    pub(super) fn restore(&mut self, saved: &[(String, Saved)], lacks: &[bool]) -> Result<(), String> {
        for one in &mut self.all {
            let key = one.key();
            if let Some((_, saved)) = saved.iter().find(|(other, _)| *other == key) {
                one.restore(saved.clone());
            } else if one.streams().any(|stream| lacks[stream]) {
                return Err(format!(
                    "measure `{}` is new or was changed, and looks at a stream of which [record] leaves samples out",
                    one.name()
                ));
            }
        }
        Ok(())
    }

    /// The figures of what has been seen, in the order of the definitions.
    pub fn finish(&self) -> Vec<Measured> {
        self.all.iter().map(Measure::finish).collect()
    }
}
