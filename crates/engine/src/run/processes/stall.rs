//! Stall diagnosis: which participant fails to provide what when nothing moves, in words.

use lockstep::plan::Plan;
use lockstep::time::Ticks;
use lockstep::transport::iceoryx::{Activity, Status};

use super::descriptions::{doing, instant};
use super::participants::ParticipantHandle;
use super::process_state::{Life, life};
use crate::scenario::ORCHESTRATOR;

/// Why a participant is the cause of a stall: the lower the variant, the more certain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Blame {
    /// The kernel reports that it is stopped, and it has work to do.
    StoppedWithWork,
    /// It computes, has not started, or rests though it may proceed.
    Working,
    /// The kernel reports that it is stopped; what it was about to do is unknown.
    Stopped,
    /// It waits for something that has arrived already.
    Blind,
}

/// Diagnoses a stall: the participant to blame, and what each participant does. `recorded` returns how many samples of a stream are
/// on the tape.
pub(crate) fn standstill(
    plan: &Plan,
    handles: &[ParticipantHandle],
    horizon: Ticks,
    seconds: f64,
    recorded: impl Fn(usize) -> u64,
) -> (String, String) {
    let mut lines = Vec::new();
    let statuses: Vec<Status> = handles.iter().map(ParticipantHandle::status).collect();
    let mut blamed = Vec::new();
    for (number, (handle, &status)) in handles.iter().zip(&statuses).enumerate() {
        let pid = handle.process.pid();
        lines.push(format!(
            "  {} (pid {pid}) at t = {} s: {}",
            handle.process.name,
            instant(plan, number, status),
            doing(plan, number, status)
        ));
        if handle.timing.is_some() {
            continue;
        }
        let own = &plan.participants[number];
        let may = status.next < own.activations && own.sample_time.instant(status.next) < horizon;
        let working = match status.activity {
            Activity::Computing | Activity::Starting | Activity::Finished => true,
            Activity::Paused => may || !handle.rests_at(horizon),
            _ => false,
        };
        let blind = match status.activity {
            Activity::Input { .. } => awaited(plan, number, status).is_some_and(|(from, output, index)| {
                let stream = plan.participants[from].first_stream as usize + output;
                // A producer that waits for room in another link has recorded more than it has sent.
                let sent = !matches!(statuses[from].activity, Activity::Room { .. });
                sent && recorded(stream) > index
            }),
            // The recorder has taken everything, else something would move.
            Activity::Recorder => true,
            _ => false,
        };
        let blame = match (life(pid), working, blind) {
            (Life::Stopped, true, _) | (Life::Stopped, _, true) => Blame::StoppedWithWork,
            (_, true, _) => Blame::Working,
            (Life::Stopped, ..) => Blame::Stopped,
            (_, _, true) => Blame::Blind,
            _ => continue,
        };
        blamed.push((blame, number));
    }
    let (name, debt) = match blamed.into_iter().min() {
        Some((_, number)) => {
            let pid = handles[number].process.pid();
            let (name, does) = (
                handles[number].process.name.clone(),
                state(pid, &statuses[number], seconds),
            );
            let debt = format!(
                "{name} (pid {pid}, {does}) {}",
                owes(plan, number, &statuses, &recorded)
            );
            (name, debt)
        }
        None => (ORCHESTRATOR.to_owned(), "no participant owes anything".to_owned()),
    };
    let text = format!(
        "nothing has moved for {seconds:.1} s: {debt}; recorder idle\n{}",
        lines.join("\n")
    );
    (name, text)
}

/// The producer, its output and the index of the sample for which participant number `number` waits.
fn awaited(plan: &Plan, number: usize, status: Status) -> Option<(usize, usize, u64)> {
    let Activity::Input { input, index } = status.activity else {
        return None;
    };
    let link = plan.links_into(number).nth(input as usize)?;
    let (from, output) = plan.links[link].from;
    Some((from, output, index))
}

/// `alive, computing for 4.1 s`: what the kernel and the participant itself report.
fn state(pid: u32, status: &Status, seconds: f64) -> String {
    let work = match status.activity {
        Activity::Starting => "getting ready",
        Activity::Computing => "computing",
        Activity::Paused => "waiting at a horizon that has moved since",
        Activity::Finished => "done without having reported it,",
        Activity::Input { .. } | Activity::Room { .. } | Activity::Recorder => "waiting",
    };
    format!("{}, {work} for {seconds:.1} s", life(pid).words())
}

/// `has not published push #200; plant waits for it at t = 2 s`
fn owes(plan: &Plan, culprit: usize, statuses: &[Status], recorded: impl Fn(usize) -> u64) -> String {
    if let Some((from, output, index)) = awaited(plan, culprit, statuses[culprit]) {
        let name = plan.output_name((from, output));
        let stream = plan.participants[from].first_stream as usize + output;
        return match recorded(stream) > index {
            true => format!("has not taken sample #{index} of {name}, which is on the tape"),
            false => format!("has made no progress with activation {}", statuses[culprit].next),
        };
    }
    let waiting = statuses.iter().enumerate().find_map(|(number, &status)| {
        let (from, output, index) = awaited(plan, number, status)?;
        (from == culprit).then_some((number, output, index))
    });
    match waiting {
        Some((number, output, index)) => format!(
            "has not published {} #{index}; {} waits for it at t = {} s",
            plan.participants[culprit].interface.outputs[output].name,
            plan.participants[number].name,
            instant(plan, number, statuses[number])
        ),
        None => format!("has not completed activation {}", statuses[culprit].next),
    }
}
