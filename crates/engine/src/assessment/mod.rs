//! What a run is judged by: figures of merit, computed while the samples pass by.

mod criterion;
mod fields;
mod measured;

use serde_json::{Map, Value};

pub use criterion::{Criterion, behind, short};
pub use fields::{Numbers, stream};
pub use measured::Measured;

/// The figures of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figures {
    /// The figures as they stand in `summary.json`, by name with unit suffix.
    pub values: Map<String, Value>,
    /// The figures that the scenario declares.
    pub measures: Vec<Measured>,
    /// The criteria and what became of them, those of the measures included.
    pub criteria: Vec<Criterion>,
    /// Why there is no verdict, when the run ended too early.
    pub incomplete: Option<String>,
    /// The verdict for people, in the words of an assessment; else it is that of the criteria.
    pub headline: Option<String>,
    /// The values for people, a line each.
    pub lines: Vec<String>,
}

impl Figures {
    /// Whether there is a verdict and every criterion is met.
    pub fn met(&self) -> bool {
        self.incomplete.is_none() && self.criteria.iter().all(|criterion| criterion.met)
    }

    /// What the verdict is called: `met`, `not-met`, or `complete` where there are no criteria.
    pub fn verdict(&self) -> &'static str {
        match (self.met(), &self.criteria[..]) {
            (true, []) => "complete",
            (true, _) => "met",
            (false, _) => "not-met",
        }
    }

    /// With the figures `measures` beside them, and their criteria before the others.
    #[must_use]
    pub fn with(mut self, measures: Vec<Measured>) -> Figures {
        let declared = measures.iter().filter_map(|measure| measure.criterion.clone());
        self.criteria.splice(0..0, declared);
        self.measures.extend(measures);
        self
    }

    /// For people: the verdict, the criteria, and the other figures, without a line end behind the last line.
    pub fn text(&self) -> String {
        let missed = self.criteria.iter().filter(|criterion| !criterion.met).count();
        let verdict = match (&self.headline, self.criteria.len(), missed) {
            (Some(headline), ..) => Some(headline.clone()),
            (None, 0, _) => None,
            (None, _, 0) => Some("met".to_owned()),
            (None, all, not) => Some(format!("not met: {not} of {all} criteria")),
        };
        let criteria = self.criteria.iter().map(Criterion::line);
        let plain = self.measures.iter().filter(|measure| measure.criterion.is_none());
        let lines = verdict.into_iter().chain(criteria).chain(plain.map(Measured::line));
        lines.chain(self.lines.clone()).collect::<Vec<_>>().join("\n")
    }

    /// As they stand in `summary.json`.
    pub fn json(&self) -> Map<String, Value> {
        let mut all = self.values.clone();
        if !self.measures.is_empty() {
            let measures = self.measures.iter().map(|one| (one.name.clone(), one.json()));
            all.insert("measures".into(), Value::Object(measures.collect()));
        }
        all.insert("criteria".into(), serde_json::json!(self.criteria));
        all
    }

    /// The figure called `name`, if it is a number.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.values.get(name).and_then(Value::as_f64)
    }
}

/// An assessment under way. The order in which samples of different streams arrive does not matter.
pub trait Assessment: Send {
    /// Whether it takes in samples of stream number `stream`: an output that is not read need not be computed. Unless given: all of them.
    fn reads(&self, stream: usize) -> bool {
        let _ = stream;
        true
    }

    /// Takes in a sample of stream number `stream` with its stamp, s.
    fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]);

    /// What has been taken in, for an assessment that goes on from here with samples that no tape has ([`[record]`](crate::run::Kept)). Unless given:
    /// `None`, and a run is not saved in which it reads a stream that is not recorded whole.
    fn save(&self) -> Option<Vec<u8>> {
        None
    }

    /// Goes on from what another one of the same kind has [saved](Assessment::save). `lacks` says of which streams not every sample
    /// before has been given to this one; what reads others only has taken them in.
    ///
    /// # Errors
    /// Why that cannot be done.
    fn restore(&mut self, saved: &[u8], lacks: &[bool]) -> Result<(), String> {
        let _ = (saved, lacks);
        Err("the assessment has no `restore`".into())
    }

    /// The figures of what has been seen, with `measures`, which the scenario declares, [beside them](Figures::with).
    fn finish(&mut self, measures: Vec<Measured>) -> Figures;
}
