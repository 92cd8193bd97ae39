//! Descriptions of what a participant does, and of how its process ended.

use std::process::ExitStatus;

use lockstep::plan::Plan;
use lockstep::transport::iceoryx::{Activity, Status};

use super::child::ParticipantProcess;
use super::resources;
use crate::run::log::tail_message;

/// What participant number `number` does.
pub(crate) fn describe_activity(plan: &Plan, number: usize, status: Status) -> String {
    match status.activity {
        Activity::Starting => "getting ready".into(),
        Activity::Computing => format!("computing activation {}", status.next),
        Activity::Input { input, index } => {
            let link = plan.links_into(number).nth(input as usize);
            match link.map(|link| &plan.links[link]) {
                Some(link) => format!("waiting for sample #{index} of {}", plan.output_name(link.from)),
                None => format!("waiting for input {input}"),
            }
        }
        Activity::Room { output, consumer } => {
            let readers = plan.links.iter().filter(|link| link.from == (number, output as usize));
            match readers.clone().nth(consumer as usize) {
                Some(link) => format!("waiting until {} has read", plan.input_name(link.to)),
                None => "waiting for a reader".into(),
            }
        }
        Activity::Recorder => "waiting for the recorder".into(),
        Activity::Paused => "paused at the horizon".into(),
        Activity::Finished => "finished".into(),
    }
}

/// The time of the next activation, s.
pub(crate) fn next_activation_s(plan: &Plan, number: usize, status: Status) -> f64 {
    plan.timebase
        .seconds(plan.participants[number].sample_time.instant(status.next))
}

/// Reports the exit of a participant's process, which ended before it was done; `last` is the status that it reported last.
pub(crate) fn exit_report(
    plan: &Plan,
    number: usize,
    process: &ParticipantProcess,
    last: Status,
    status: ExitStatus,
) -> String {
    format!(
        "process {} {}{} at t = {} s (activation {}) while {}{}",
        process.pid(),
        ParticipantProcess::describe_exit(status),
        resources::bus_error_hint(status),
        next_activation_s(plan, number, last),
        last.next,
        describe_activity(plan, number, last),
        tail_message(process.log())
    )
}
