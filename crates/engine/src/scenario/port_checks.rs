//! Checks of a scenario against the ports and the streams of its plan.

use lockstep::plan::Plan;
use report::page::split_unit;
use tape::StreamSpec;

use super::error::ScenarioError;
use super::resolve::Scenario;
use super::{guards, measures, recorded, report_view};
use crate::assessment::{Assessment, AssessmentSetup};
use crate::measures::{CombinedAssessment, Definition, Measures};
use crate::run::{RecordedPart, SampleGuard};

impl Scenario {
    /// The guards, resolved against the ports of `plan`; those of participants whose ports are not `certain` are left out.
    ///
    /// # Errors
    /// Every guard that does not fit the ports.
    pub fn watches(&self, plan: &Plan, certain: impl Fn(usize) -> bool) -> Result<Vec<SampleGuard>, ScenarioError> {
        guards::watches(&self.guards, &self.source, plan, certain)
    }

    /// Checks the table `[report]` against the ports of `plan`; entries for participants whose ports are not `certain` are left
    /// out.
    ///
    /// # Errors
    /// Every signal that no participant publishes, and every unit that does not fit.
    pub fn check_drawings(&self, plan: &Plan, certain: impl Fn(usize) -> bool) -> Result<(), ScenarioError> {
        report_view::check(&self.view, &self.source, plan, certain)
    }

    /// Which samples of each of `streams`, those of `plan`, are recorded; entries for participants whose ports are not `certain` are
    /// left out.
    ///
    /// # Errors
    /// Every stream that does not exist, and every period that is no multiple of the stream's own.
    pub fn kept(
        &self,
        plan: &Plan,
        streams: &[StreamSpec],
        certain: impl Fn(usize) -> bool,
    ) -> Result<Vec<RecordedPart>, ScenarioError> {
        recorded::kept_samples(&self.record, &self.source, plan, streams, certain)
    }

    /// The measures over `streams`; those of participants whose ports are not `certain` are left out.
    ///
    /// # Errors
    /// Every measure that does not fit the streams.
    pub fn measures(
        &self,
        streams: &[StreamSpec],
        certain: impl Fn(&str) -> bool,
    ) -> Result<Vec<Definition>, ScenarioError> {
        let known = |name: &str| self.participants.iter().all(|entry| entry.setup.name != name) || certain(name);
        measures::definitions(&self.source.origin, &self.measures, streams, known)
    }

    /// The assessment of the run: the table `assessment` and the measures; `None` if there is neither.
    ///
    /// # Errors
    /// Reports the key that is refused.
    pub fn assess(&self, streams: &[StreamSpec]) -> Result<Option<Box<dyn Assessment>>, ScenarioError> {
        let own = || {
            let assessment = self.assessment.as_ref().map(|table| {
                let parameters = self
                    .participants
                    .iter()
                    .map(|entry| (&*entry.setup.name, &entry.setup.parameters));
                self.builtins().assess(&AssessmentSetup {
                    table,
                    streams,
                    parameters: parameters.collect(),
                })
            });
            assessment
                .transpose()
                .map_err(|error| self.assessment_refusal(&error.key, &error.reason))
        };
        if self.measures.is_empty() {
            return own();
        }
        let definitions = self.measures(streams, |_| true)?;
        if let Some(mut own) = own()? {
            let figures = own.finish(Vec::new());
            let named = |name: &str| {
                figures
                    .values
                    .keys()
                    .any(|key| key == name || split_unit(key).0 == name)
            };
            if let Some(duplicate) = definitions.iter().find(|definition| named(&definition.name)) {
                let reason = "the assessment has a figure of that name: choose another one";
                let mistake = self.source.mistake(&format!("measures.{}", duplicate.name), reason);
                return Err(self.source.error(vec![mistake]));
            }
        }
        let measures = Measures::new(definitions, streams).map_err(|(name, error)| {
            let mistake = self.source.mistake(&format!("measures.{name}"), error.to_string());
            self.source.error(vec![mistake])
        })?;
        Ok(Some(Box::new(CombinedAssessment::new(own()?, measures))))
    }
}
