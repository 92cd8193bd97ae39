//! Overhead of lockstep and recording relative to a scenario's own computing.

use engine::run::{Options, Outcome, Record, Run, RunFailure, run};
use engine::scenario::Scenario;
use rustix::time::{ClockId, clock_gettime};

use super::Measurements;

/// Wall-clock time of a scenario, s; for the fields that state it, CPU time of the stepping thread.
pub struct Overhead {
    /// One process, nothing recorded.
    pub alone: Measurements,
    /// One process, recorded.
    pub recorded: Measurements,
    /// One process per participant, recorded.
    pub processes: Measurements,
    /// CPU time in one process: all outputs are computed and their newest samples retained, as for a program that reads them,
    /// and nothing else.
    pub own_computed: Measurements,
    /// CPU time in one process, recorded.
    pub own_recorded: Measurements,
}

/// Measures `rounds` rounds of each, alternating. Run folders go to `out` and are removed.
pub fn overhead(scenario: &Scenario, rounds: usize, out: &std::path::Path) -> anyhow::Result<Overhead> {
    let mut all = Overhead {
        alone: Measurements::default(),
        recorded: Measurements::default(),
        processes: Measurements::default(),
        own_computed: Measurements::default(),
        own_recorded: Measurements::default(),
    };
    let alone = Options {
        in_process: true,
        record: Record::Nothing,
        ..Options::default()
    };
    let folder = out.join(format!("bench-{}", std::process::id()));
    let recorded = |in_process| Options {
        in_process,
        out: Some(folder.clone()),
        patience_s: 60.0,
        ..Options::default()
    };
    for _ in 0..rounds {
        all.alone.add(run(scenario, &alone)?.wall_s);
        let (own_s, _) = timed(|| {
            let mut computed = Run::start(scenario, &alone)?;
            computed.run_to(scenario.duration)?;
            computed.end()
        })?;
        all.own_computed.add(own_s);
        let (own_s, outcome) = timed(|| run(scenario, &recorded(true)))?;
        std::fs::remove_dir_all(&folder)?;
        all.recorded.add(outcome.wall_s);
        all.own_recorded.add(own_s);
        all.processes.add(run(scenario, &recorded(false))?.wall_s);
        std::fs::remove_dir_all(&folder)?;
    }
    Ok(all)
}

/// The CPU time of this thread for `one` run.
fn timed(one: impl FnOnce() -> Result<Outcome, RunFailure>) -> anyhow::Result<(f64, Outcome)> {
    let now = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
    };
    let started = now();
    let outcome = one()?;
    Ok((now() - started, outcome))
}
