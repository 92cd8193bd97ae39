//! Assessments: figures of merit, computed online from the samples, and criteria.

mod criterion;
mod fields;
mod measured;
mod setup;

use serde_json::{Map, Value};

pub use criterion::{Criterion, unit_suffix};
pub use fields::{Numbers, stream};
pub use measured::Measured;
pub use setup::AssessmentSetup;

/// The figures of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figures {
    /// The figures as written to `summary.json`, by name with unit suffix.
    pub values: Map<String, Value>,
    /// The figures that the scenario declares.
    pub measures: Vec<Measured>,
    /// The criteria and their results, those of the measures included.
    pub criteria: Vec<Criterion>,
    /// Why there is no verdict, when the run ended too early.
    pub incomplete: Option<String>,
    /// The name of the value that says whether the run succeeded, where the assessment has one.
    pub success: Option<&'static str>,
    /// The verdict as text, where the assessment gives one; else it follows from the criteria.
    pub headline: Option<String>,
    /// The values as text, a line each.
    pub lines: Vec<String>,
}

impl Figures {
    /// Whether there is a verdict and every criterion is met.
    pub fn met(&self) -> bool {
        self.incomplete.is_none() && self.criteria.iter().all(|criterion| criterion.met)
    }

    /// The word for the verdict: `met`, `not-met`, or `complete` where there are no criteria.
    pub fn verdict(&self) -> &'static str {
        match (self.met(), &self.criteria[..]) {
            (true, []) => "complete",
            (true, _) => "met",
            (false, _) => "not-met",
        }
    }

    /// The figures of a run that did not reach its end: there is no verdict, and no headline that is one.
    #[must_use]
    pub fn of_unfinished(mut self) -> Figures {
        let reason = "the run did not complete";
        self.incomplete = Some(reason.to_owned());
        self.headline = None;
        if let Some(success) = self.success {
            self.values.insert(success.to_owned(), false.into());
        }
        if let Some(incomplete) = self.values.get_mut("incomplete") {
            *incomplete = reason.into();
        }
        self
    }

    /// Adds the figures `measures`, and puts their criteria before the others.
    #[must_use]
    pub fn with(mut self, measures: Vec<Measured>) -> Figures {
        let declared = measures.iter().filter_map(|measure| measure.criterion.clone());
        self.criteria.splice(0..0, declared);
        self.measures.extend(measures);
        self
    }

    /// As text: the verdict or why there is none, the criteria, and the other figures, without a final newline.
    pub fn text(&self) -> String {
        let missed = self.criteria.iter().filter(|criterion| !criterion.met).count();
        let verdict = match (&self.headline, &self.incomplete, self.criteria.len(), missed) {
            (Some(headline), ..) => Some(headline.clone()),
            (None, Some(reason), ..) => Some(format!(
                "no verdict: {reason}; the figures are of the samples up to its end"
            )),
            (None, None, 0, _) => None,
            (None, None, _, 0) => Some("met".to_owned()),
            (None, None, all, not) => Some(format!("not met: {not} of {all} criteria")),
        };
        let criteria = self.criteria.iter().map(Criterion::line);
        let plain = self.measures.iter().filter(|measure| measure.criterion.is_none());
        let lines = verdict.into_iter().chain(criteria).chain(plain.map(Measured::line));
        lines.chain(self.lines.clone()).collect::<Vec<_>>().join("\n")
    }

    /// As written to `summary.json`.
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

/// An assessment in progress. The order in which samples of different streams arrive does not matter.
pub trait Assessment: Send {
    /// Whether it reads stream number `stream`: an output that is not read need not be computed. By default it reads all.
    fn reads(&self, stream: usize) -> bool {
        let _ = stream;
        true
    }

    /// Processes a sample of stream number `stream` with its stamp, s.
    fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]);

    /// The state, for an assessment that must continue after samples that no tape has ([`[record]`](crate::run::RecordedPart)). By
    /// default `None`; then a run in which it reads a stream that is not recorded completely cannot be saved.
    fn save(&self) -> Option<Vec<u8>> {
        None
    }

    /// Replaces the state by one that another assessment of the same kind has [saved](Assessment::save). `lacks` has a flag
    /// for each stream of which this assessment has not received every earlier sample; if it reads only other streams, its
    /// present state is complete.
    ///
    /// # Errors
    /// Why the state cannot be restored.
    fn restore(&mut self, saved: &[u8], lacks: &[bool]) -> Result<(), String> {
        let _ = (saved, lacks);
        Err("the assessment has no `restore`".into())
    }

    /// The figures of the samples so far, combined [with](Figures::with) `measures`, which the scenario declares.
    fn finish(&mut self, measures: Vec<Measured>) -> Figures;
}
