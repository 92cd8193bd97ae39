//! Combination of the measures of a scenario with its assessment.

use lockstep::wire;

use super::Measures;
use crate::assessment::{Assessment, Figures, Measured};

/// Both as one assessment: it has the figures of both, and a run is a success when the criteria of both are met.
pub struct CombinedAssessment {
    own: Option<Box<dyn Assessment>>,
    measures: Measures,
}

impl CombinedAssessment {
    /// `measures` combined with the assessment `own`, if there is one.
    pub fn new(own: Option<Box<dyn Assessment>>, measures: Measures) -> CombinedAssessment {
        CombinedAssessment { own, measures }
    }
}

impl Assessment for CombinedAssessment {
    fn reads(&self, stream: usize) -> bool {
        self.own.as_ref().is_some_and(|own| own.reads(stream)) || self.measures.reads(stream)
    }

    fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]) {
        if let Some(own) = &mut self.own {
            own.sample(stream, stamp_s, payload);
        }
        self.measures.sample(stream, stamp_s, payload);
    }

    fn save(&self) -> Option<Vec<u8>> {
        let own = match &self.own {
            Some(own) => Some(own.save()?),
            None => None,
        };
        wire::encode("measures", &(own, self.measures.saved())).ok()
    }

    fn restore(&mut self, saved: &[u8], lacks: &[bool]) -> Result<(), String> {
        let decoded = wire::decode::<(Option<Vec<u8>>, Vec<_>)>("measures", saved);
        let (saved_own, measures) = decoded.map_err(|error| error.to_string())?;
        if let Some(assessment) = &mut self.own
            && (0..lacks.len()).any(|stream| lacks[stream] && assessment.reads(stream))
        {
            assessment.restore(&saved_own.unwrap_or_default(), lacks)?;
        }
        self.measures.restore(&measures, lacks)
    }

    fn finish(&mut self, measures: Vec<Measured>) -> Figures {
        let all = self.measures.finish().into_iter().chain(measures).collect();
        match &mut self.own {
            Some(own) => own.finish(all),
            None => Figures::default().with(all),
        }
    }
}
