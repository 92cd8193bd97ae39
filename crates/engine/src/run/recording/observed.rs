//! Which samples of a run are observed by something other than the participants that read them.

use lockstep::plan::{Observed, Plan};
use tape::StreamSpec;

use super::guard::SampleGuard;
use super::recorded_part::RecordedPart;
use crate::assessment::Assessment;
use crate::scenario::Scenario;

/// The observers of a run's samples.
pub(crate) struct Observers<'a> {
    /// What the tape, or its digest, keeps of each stream, if there is one.
    pub(crate) kept: Option<&'a [RecordedPart]>,
    pub(crate) assessment: Option<&'a dyn Assessment>,
    pub(crate) guards: &'a [SampleGuard],
    /// Whether every sample is observed: a program may ask for the newest of any stream, or the run may be resumed.
    pub(crate) all: bool,
}

impl Observers<'_> {
    /// Which samples of each of `streams`, those of `plan`, are observed.
    pub(crate) fn observed(&self, scenario: &Scenario, plan: &Plan, streams: &[StreamSpec]) -> Vec<Observed> {
        let one = |(stream, spec): (usize, &StreamSpec)| {
            // A substitute continues from the values that its predecessor published last.
            let mut substituted = scenario.substitutions.iter().map(|one| one.participant);
            let replaced = substituted.any(|number| plan.participants[number].name == spec.participant);
            let read = self.assessment.is_some_and(|assessment| assessment.reads(stream));
            let guarded = self.guards.iter().any(|guard| guard.stream == stream);
            if self.all || replaced || read || guarded {
                return Observed::ALL;
            }
            self.kept.map_or(Observed::NONE, |kept| kept[stream].observed())
        };
        streams.iter().enumerate().map(one).collect()
    }
}
