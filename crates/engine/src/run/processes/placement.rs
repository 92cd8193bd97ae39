//! Placement: which participant runs on which core, and how each waits. Both are decided together: a participant that spins on a
//! shared core keeps the core from the very process that it waits for, and the run becomes a thousand times slower.

use lockstep::control::WaitStrategy;
use lockstep::plan::{self, Plan, place, place_separately};

use crate::run::options::{Options, Wait};

/// The cores of the participants of a run, and how they wait.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Placement {
    /// The core of each participant; `None` leaves the choice to the operating system.
    pub cores: Vec<Option<usize>>,
    /// How each participant waits.
    pub waiting: Vec<WaitStrategy>,
    /// The reason for the choice, in words.
    pub reason: String,
    /// A request that cannot be met here, in one line.
    pub denied: Option<String>,
}

impl Placement {
    /// The choice for `plan`, out of the cores that this process may use.
    pub fn choose(plan: &Plan, options: &Options) -> Placement {
        let allowed = rustix::thread::sched_getaffinity(None).ok();
        let cores: Vec<usize> = allowed
            .map(|set| {
                (0..rustix::thread::CpuSet::MAX_CPU)
                    .filter(|&core| set.is_set(core))
                    .collect()
            })
            .unwrap_or_default();
        Placement::choose_among(plan, &cores, options.wait, options.no_placement)
    }

    fn choose_among(plan: &Plan, cores: &[usize], wait: Wait, no_placement: bool) -> Placement {
        let apart = (wait == Wait::Spin).then(|| place_separately(plan, cores)).flatten();
        let denied = (wait == Wait::Spin && apart.is_none()).then(|| {
            let (count, cores) = (plan.participants.len(), cores.len());
            format!(
                "--wait spin needs a core for each of the {count} participants and there {}: they wait as with --wait auto",
                if cores == 1 { "is 1".to_owned() } else { format!("are {cores}") }
            )
        });
        let wait = if denied.is_some() { Wait::Auto } else { wait };
        let plan::Placement {
            mut cores,
            sharing,
            mut reason,
            ..
        } = apart.unwrap_or_else(|| place(plan, cores));
        if no_placement {
            cores.fill(None);
            reason = "left to the operating system".into();
        }
        Placement {
            cores,
            waiting: sharing
                .into_iter()
                .map(|sharing| waiting_strategy(wait, sharing))
                .collect(),
            reason,
            denied,
        }
    }
}

/// How a participant waits that is one of `sharing` participants on its core.
fn waiting_strategy(wait: Wait, sharing: usize) -> WaitStrategy {
    match wait {
        Wait::Auto => match sharing {
            0 | 1 => WaitStrategy::SPIN,
            2..=4 => WaitStrategy::YIELD,
            _ => WaitStrategy::OVERSUBSCRIBED,
        },
        Wait::Yield => WaitStrategy::YIELD,
        Wait::Spin => WaitStrategy::SPIN,
        Wait::Sleep => WaitStrategy::SLEEP,
    }
}

#[cfg(test)]
mod tests {
    use lockstep::link::Timing;
    use lockstep::participant::{Interface, Kind};
    use lockstep::plan::{LinkSpec, ParticipantSpec};
    use lockstep::time::Rational;

    use super::*;

    lockstep::message! {
        /// The message that circulates.
        struct Word {
            /// Anything.
            value: f64 = "1" in "",
        }
    }

    /// `count` participants, each of which waits for its predecessor.
    fn ring(count: usize) -> Plan {
        let name = |number: usize| format!("p{}", number % count);
        let participants = (0..count).map(|number| ParticipantSpec {
            name: name(number),
            period: Rational::from_millis(1),
            offset: Rational::ZERO,
            interface: Interface::new(Kind::Continuous)
                .input::<Word>("in")
                .output::<Word>("out"),
        });
        let links: Vec<LinkSpec> = (0..count)
            .map(|number| LinkSpec {
                name: format!("l{number}"),
                from: (name(number), "out".into()),
                to: (name(number + 1), "in".into()),
                timing: Timing::default(),
                initial: None,
                conversion: None,
                random_stream: None,
                faults: Vec::new(),
            })
            .collect();
        Plan::build(participants.collect(), &links, Rational::from_millis(10), 1).expect("a ring can be planned")
    }

    #[test]
    fn spinning_participant_has_a_core_of_its_own() {
        for count in 2..=7 {
            let plan = ring(count);
            for core_count in 1..=9 {
                // Core numbers that differ from their positions in the list.
                let cores: Vec<usize> = (0..core_count).map(|core| 3 * core + 1).collect();
                for (name, wait) in Wait::ALL {
                    let placement = Placement::choose_among(&plan, &cores, wait, false);
                    for (one, waiting) in placement.waiting.iter().enumerate() {
                        let core = placement.cores[one];
                        let sharing = placement.cores.iter().filter(|other| **other == core).count();
                        let alone = core.is_some_and(|core| cores.contains(&core)) && sharing == 1;
                        assert!(
                            alone || waiting.spins == 0,
                            "{count} on {core_count}, {name}: {placement:?}"
                        );
                    }
                    let denied = wait == Wait::Spin && core_count < count;
                    assert_eq!(placement.denied.is_some(), denied, "{count} on {core_count}, {name}");
                    if wait == Wait::Spin && !denied {
                        assert_eq!(
                            placement.waiting,
                            vec![WaitStrategy::SPIN; count],
                            "{count} on {core_count}"
                        );
                    }
                    let free = Placement::choose_among(&plan, &cores, wait, true);
                    assert_eq!((free.cores, free.waiting), (vec![None; count], placement.waiting));
                }
            }
        }
    }

    #[test]
    fn placement_reports_cores_that_cannot_be_granted() {
        let placement = Placement::choose_among(&ring(3), &[0, 1], Wait::Spin, false);
        assert_eq!(
            placement.denied.as_deref(),
            Some(
                "--wait spin needs a core for each of the 3 participants and there are 2: they wait as with --wait auto"
            )
        );
        assert_eq!(
            placement.waiting,
            Placement::choose_among(&ring(3), &[0, 1], Wait::Auto, false).waiting
        );
    }
}
