//! Benefit of a delay: two participants with the same computing load, in one loop and in two processes.

use std::hint::black_box;
use std::time::{Duration, Instant};

use engine::scenario::ScenarioSpec;

use super::Measurements;
use super::participants::{compute, workers};

/// The computing time of a step.
const WORK: Duration = Duration::from_micros(20);
/// The delay of the connections, steps.
const DELAY_STEPS: u64 = 10;
/// Steps of a round.
pub const STEPS: u64 = 20_000;

/// Seconds per step of the same two participants.
pub struct DelayBenefit {
    /// In one loop.
    pub looped: Measurements,
    /// In two processes.
    pub processes: Measurements,
}

/// Measures `rounds` rounds of each, alternating. `run` runs a scenario, in one loop or in processes, and returns seconds
/// per step.
pub fn delay_benefit(
    rounds: usize,
    mut run: impl FnMut(&ScenarioSpec, bool) -> anyhow::Result<f64>,
) -> anyhow::Result<DelayBenefit> {
    let scenario = workers(turns_in(WORK), DELAY_STEPS, STEPS);
    let mut all = DelayBenefit {
        looped: Measurements::default(),
        processes: Measurements::default(),
    };
    for _ in 0..rounds {
        all.looped.add(run(&scenario, true)?);
        all.processes.add(run(&scenario, false)?);
    }
    Ok(all)
}

/// The number of loop turns that take `time` on this machine: the shortest of several trials.
fn turns_in(time: Duration) -> u64 {
    const TURNS: u64 = 100_000;
    let tries = (0..5).map(|_| {
        let started = Instant::now();
        black_box(compute(TURNS, 1.0));
        started.elapsed()
    });
    let shortest = tries.min().unwrap_or(time);
    (TURNS as f64 * time.as_secs_f64() / shortest.as_secs_f64().max(1e-9)).ceil() as u64
}
