//! The placement of participants on cores.
//!
//! A hand-off costs least between two processes that each spin on a core of their own, a few microseconds between two that yield to each
//! other on one core, and ten times that when one must be woken on another core. So every participant gets a core of its own where there
//! are enough; otherwise participants that must alternate anyway share a core, and those that can work at the same time get different
//! ones.

use std::collections::HashMap;

use super::Plan;
use super::components::strongly_connected;

/// The placement of a run's participants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Placement {
    /// The core of each participant; `None` leaves it to the operating system.
    pub cores: Vec<Option<usize>>,
    /// The number of participants on each participant's core, itself included; a participant that is alone may spin.
    pub sharing: Vec<usize>,
    /// The groups of participants that alternate, each in the order of the scenario.
    pub groups: Vec<Vec<usize>>,
    /// A description of the choice.
    pub reason: String,
}

/// Chooses a core for every participant out of `cores`, the numbers this process may use.
pub fn place(plan: &Plan, cores: &[usize]) -> Placement {
    let count = plan.participants.len();
    let groups = alternating_groups(plan);
    let names = |group: &[usize]| -> String {
        group
            .iter()
            .map(|&member| plan.participants[member].name.as_str())
            .collect::<Vec<_>>()
            .join("+")
    };
    if cores.len() < 2 {
        let reason = "one core: all participants share it".to_owned();
        return Placement {
            cores: vec![None; count],
            sharing: vec![count; count],
            groups,
            reason,
        };
    }
    if cores.len() > count
        && let Some(separate) = place_separately(plan, cores)
    {
        return separate;
    }
    // The group with the most work first, onto the core with the least work so far; the number of activations stands for the work.
    let work = |group: &[usize]| {
        group
            .iter()
            .map(|&member| plan.participants[member].activations)
            .sum::<u64>()
    };
    let mut by_work: Vec<&Vec<usize>> = groups.iter().collect();
    by_work.sort_by_key(|group| std::cmp::Reverse(work(group)));
    let mut load = vec![0_u64; cores.len()];
    let mut core_of = vec![None; count];
    let mut groups_on_core = vec![Vec::new(); cores.len()];
    for group in by_work {
        // The last core is the first choice, because core 0 serves most interrupts and the recorder.
        let core = (0..cores.len())
            .rev()
            .min_by_key(|&core| load[core])
            .expect("there are cores");
        load[core] += work(group);
        group.iter().for_each(|&member| core_of[member] = Some(cores[core]));
        groups_on_core[core].push(names(group));
    }
    let core_texts: Vec<String> = groups_on_core
        .iter()
        .zip(cores)
        .filter(|(groups, _)| !groups.is_empty())
        .map(|(groups, core)| format!("core {core}: {}", groups.join(", ")))
        .collect();
    let reason = format!(
        "{} cores for {count} participants: participants that alternate share a core ({})",
        cores.len(),
        core_texts.join("; ")
    );
    let mut on_core: HashMap<Option<usize>, usize> = HashMap::new();
    core_of.iter().for_each(|core| *on_core.entry(*core).or_default() += 1);
    let sharing = core_of.iter().map(|core| on_core[core]).collect();
    Placement {
        cores: core_of,
        sharing,
        groups,
        reason,
    }
}

/// Assigns every participant its own core out of `cores`, for participants that spin: one that spins on a shared core keeps that core
/// from the participant it waits for. Where there is no spare core, the recorder shares the first one. `None` with fewer cores than
/// participants.
pub fn place_separately(plan: &Plan, cores: &[usize]) -> Option<Placement> {
    let count = plan.participants.len();
    let spare = cores.len().checked_sub(count)?;
    let own = cores.iter().skip(spare.min(1)).take(count);
    Some(Placement {
        cores: own.map(|&core| Some(core)).collect(),
        sharing: vec![1; count],
        groups: alternating_groups(plan),
        reason: format!("{} cores for {count} participants: a core each, spinning", cores.len()),
    })
}

/// The groups that alternate: cycles of links whose delay is too short for both ends to work at the same time. A link allows that when
/// its delay is at least half the longer of the two periods.
fn alternating_groups(plan: &Plan) -> Vec<Vec<usize>> {
    let short_links = plan.links.iter().filter(|link| {
        let periods = [link.from.0, link.to.0].map(|end| plan.participants[end].sample_time.period);
        // In a wider type: half a period of one tick is not a whole tick, and twice a long delay may exceed the range of ticks.
        2 * i128::from(link.delivery.delay_bounds().0) < i128::from(periods[0].max(periods[1]))
    });
    let edges: Vec<(usize, usize)> = short_links.map(|link| (link.from.0, link.to.0)).collect();
    let mut groups = strongly_connected(plan.participants.len(), &edges);
    groups.iter_mut().for_each(|group| group.sort_unstable());
    groups.sort_unstable();
    groups
}
