//! Stall diagnosis: which participant fails to provide what when no participant makes progress, in words.

use lockstep::plan::Plan;
use lockstep::time::Ticks;
use lockstep::transport::iceoryx::{Activity, Status};

use super::descriptions::{describe_activity, next_activation_s};
use super::participants::ParticipantHandle;
use super::process_state::{ProcessState, process_state};
use crate::scenario::ORCHESTRATOR;

/// Why a participant is the cause of a stall: the lower the variant, the more certain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum StallCause {
    /// The kernel reports that it is stopped, and it has work to do.
    StoppedWithWork,
    /// It computes, has not started, or is paused though it may proceed.
    Working,
    /// The kernel reports that it is stopped; what it was about to do is unknown.
    Stopped,
    /// It waits for something that has arrived already.
    IgnoresArrival,
}

/// Diagnoses a stall: the participant that causes it, and what each participant does. `recorded` returns how many samples of a stream are
/// on the tape.
pub(crate) fn diagnose(
    plan: &Plan,
    handles: &[ParticipantHandle],
    horizon: Ticks,
    seconds: f64,
    recorded: impl Fn(usize) -> u64,
) -> (String, String) {
    let mut lines = Vec::new();
    let statuses: Vec<Status> = handles.iter().map(ParticipantHandle::status).collect();
    let mut causes = Vec::new();
    for (number, (handle, &status)) in handles.iter().zip(&statuses).enumerate() {
        let pid = handle.process.pid();
        lines.push(format!(
            "  {} (pid {pid}) at t = {} s: {}",
            handle.process.name,
            next_activation_s(plan, number, status),
            describe_activity(plan, number, status)
        ));
        if handle.timing.is_some() {
            continue;
        }
        let planned = &plan.participants[number];
        let may_proceed = status.next < planned.activations && planned.sample_time.instant(status.next) < horizon;
        let working = match status.activity {
            Activity::Computing | Activity::Starting | Activity::Finished => true,
            Activity::Paused => may_proceed || !handle.has_reached(horizon),
            _ => false,
        };
        let ignores_arrival = match status.activity {
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
        let cause = match (process_state(pid), working, ignores_arrival) {
            (ProcessState::Stopped, true, _) | (ProcessState::Stopped, _, true) => StallCause::StoppedWithWork,
            (_, true, _) => StallCause::Working,
            (ProcessState::Stopped, ..) => StallCause::Stopped,
            (_, _, true) => StallCause::IgnoresArrival,
            _ => continue,
        };
        causes.push((cause, number));
    }
    let (name, diagnosis) = match causes.into_iter().min() {
        Some((_, number)) => {
            let pid = handles[number].process.pid();
            let (name, does) = (
                handles[number].process.name.clone(),
                state(pid, &statuses[number], seconds),
            );
            let diagnosis = format!(
                "{name} (pid {pid}, {does}) {}",
                overdue_work(plan, number, &statuses, &recorded)
            );
            (name, diagnosis)
        }
        None => (
            ORCHESTRATOR.to_owned(),
            "every participant has done its work".to_owned(),
        ),
    };
    let text = format!(
        "nothing has moved for {seconds:.1} s: {diagnosis}; recorder idle\n{}",
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
        Activity::Paused => "waiting although time has been granted",
        Activity::Finished => "done without having reported it,",
        Activity::Input { .. } | Activity::Room { .. } | Activity::Recorder => "waiting",
    };
    format!("{}, {work} for {seconds:.1} s", process_state(pid).description())
}

/// `has not published push #200; plant waits for it at t = 2 s`
fn overdue_work(plan: &Plan, culprit: usize, statuses: &[Status], recorded: impl Fn(usize) -> u64) -> String {
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
            next_activation_s(plan, number, statuses[number])
        ),
        None => format!("has not completed activation {}", statuses[culprit].next),
    }
}
