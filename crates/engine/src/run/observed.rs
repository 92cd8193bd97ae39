//! Which samples of a run are looked at besides by the participants that read them.

use lockstep::plan::{Observed, Plan};
use tape::StreamSpec;

use super::guard::Watch;
use super::kept::Kept;
use crate::assessment::Assessment;
use crate::scenario::Scenario;

/// What looks at the samples of a run.
pub(super) struct Observers<'a> {
    /// What the tape keeps of each stream, where there is a tape, or its digest.
    pub(super) kept: Option<&'a [Kept]>,
    pub(super) assessment: Option<&'a dyn Assessment>,
    pub(super) guards: &'a [Watch],
    /// Whether every sample is looked at: a program may ask for the newest of any stream, or the run may be taken up.
    pub(super) all: bool,
}

impl Observers<'_> {
    /// What they observe of each of `streams`, those of `plan`.
    pub(super) fn observed(&self, scenario: &Scenario, plan: &Plan, streams: &[StreamSpec]) -> Vec<Observed> {
        let one = |(stream, spec): (usize, &StreamSpec)| {
            // A substitute goes on from the values that the one before it gave out last.
            let mut substituted = scenario.substitutions.iter().map(|one| one.participant);
            let replaced = substituted.any(|number| plan.participants[number].name == spec.participant);
            let read = self.assessment.is_some_and(|assessment| assessment.reads(stream));
            let guarded = self.guards.iter().any(|guard| guard.stream == stream);
            if self.all || replaced || read || guarded {
                return Observed::ALL;
            }
            self.kept.map_or(Observed::NOTHING, |kept| kept[stream].observed())
        };
        streams.iter().enumerate().map(one).collect()
    }
}
