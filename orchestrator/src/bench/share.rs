//! What lockstep and recording add to a scenario's own computing.

use super::Figures;
use engine::run::{Options, Record, run};
use engine::scenario::Scenario;

/// Wall time of a scenario, s.
pub struct Share {
    /// One process, nothing recorded.
    pub alone: Figures,
    /// One process, recorded.
    pub recorded: Figures,
    /// A process each, recorded.
    pub processes: Figures,
}

/// Measures `rounds` rounds of each, in turn. Run folders go to `out` and are removed.
pub fn share(scenario: &Scenario, rounds: usize, out: &std::path::Path) -> anyhow::Result<Share> {
    let mut all = Share {
        alone: Figures::default(),
        recorded: Figures::default(),
        processes: Figures::default(),
    };
    for _ in 0..rounds {
        all.alone.add(alone(scenario)?);
        all.recorded.add(wall(scenario, out, true)?);
        all.processes.add(wall(scenario, out, false)?);
    }
    Ok(all)
}

fn wall(scenario: &Scenario, out: &std::path::Path, in_process: bool) -> anyhow::Result<f64> {
    let folder = out.join(format!("bench-{}", std::process::id()));
    let options = Options {
        in_process,
        out: Some(folder.clone()),
        patience_s: 60.0,
        ..Options::default()
    };
    let outcome = run(scenario, &options)?;
    std::fs::remove_dir_all(&folder)?;
    Ok(outcome.wall_s)
}

fn alone(scenario: &Scenario) -> anyhow::Result<f64> {
    let options = Options {
        in_process: true,
        record: Record::Nothing,
        ..Options::default()
    };
    Ok(run(scenario, &options)?.wall_s)
}
