//! Batched runs in one thread: where participants allow it, the steps of several runs are done together.

use std::sync::Arc;

use lockstep::participant::PendingStep;

use crate::run::handle::{LoopExit, Run};
use crate::run::options::Options;
use crate::run::outcome::{Outcome, RunFailure};
use crate::scenario::Scenario;

/// A run in one loop of this process that stops wherever a step is to be done together with those of other runs.
pub(crate) struct BatchedRun {
    run: Run,
}

impl BatchedRun {
    /// A run before its first step.
    ///
    /// # Errors
    /// As [`Run::begin`].
    pub(crate) fn begin(scenario: Arc<Scenario>, options: Options) -> Result<BatchedRun, RunFailure> {
        let mut run = Run::begin(scenario, options, false)?;
        run.executor.park();
        run.begin_advance(None);
        Ok(BatchedRun { run })
    }

    /// Continues to the next such step, which [`BatchedStep::pending`] then returns; `false` at the end of the run.
    pub(crate) fn advance(&mut self) -> bool {
        match self.run.run_loop(None) {
            LoopExit::Parked => true,
            exit => {
                self.run.end_advance(None, exit);
                false
            }
        }
    }

    /// The step that waits to be done.
    pub(crate) fn pending(&mut self) -> Option<PendingStep<'_>> {
        self.run.executor.pending()
    }

    /// The outcome of the run.
    pub(crate) fn conclude(self) -> Outcome {
        self.run.conclude()
    }
}
