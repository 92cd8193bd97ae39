//! Scaling with the number of participants.

use super::Measurements;

/// Nanoseconds per activation in a ring of 2, 4, 8, … participants: constant when the cost of a step is linear in their
/// number. `run` runs a ring for a number of steps and returns seconds per step.
pub fn scaling(
    rounds: usize,
    largest: usize,
    mut run: impl FnMut(usize, u64) -> anyhow::Result<f64>,
) -> anyhow::Result<Vec<(usize, Measurements)>> {
    let sizes: Vec<usize> = (1..)
        .map(|power| 1 << power)
        .take_while(|&size| size <= largest)
        .collect();
    let mut all: Vec<(usize, Measurements)> = sizes.iter().map(|&size| (size, Measurements::default())).collect();
    for _ in 0..rounds {
        for (size, figures) in &mut all {
            // About the same number of exchanges for every size.
            let steps = (40_000 / *size as u64).max(200);
            figures.add(1e9 * run(*size, steps)? / *size as f64);
        }
    }
    Ok(all)
}
