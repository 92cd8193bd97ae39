//! Who owes what to whom, in words.

use std::process::ExitStatus;

use lockstep::plan::Plan;
use lockstep::time::Ticks;
use lockstep::transport::iceoryx::{Activity, Status};

use super::child::Participant;
use super::crew::Member;
use super::log::{LOG_MAX, Log};
use super::outcome::ORCHESTRATOR;
use crate::text::quoted;

/// The last lines of a log, ready to be put behind a message.
pub(super) fn words(log: &Log) -> String {
    let lines = log.last_lines();
    if lines.is_empty() {
        "; it wrote nothing".into()
    } else {
        format!("; its last lines:\n  | {}", quoted(&lines.join("\n")))
    }
}

/// The reason of a failure by a full log.
pub(super) fn flood() -> String {
    format!("wrote more than {} MiB to its standard error", LOG_MAX >> 20)
}

/// What participant number `number` does.
fn doing(plan: &Plan, number: usize, status: Status) -> String {
    let own = &plan.participants[number];
    match status.activity {
        Activity::Starting => "getting ready".into(),
        Activity::Computing => format!("computing activation {}", status.next),
        Activity::Input { input, index } => {
            let link = own
                .inputs
                .get(input as usize)
                .copied()
                .flatten()
                .map(|link| &plan.links[link]);
            match link {
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
        Activity::Rest => "at rest at the horizon".into(),
        Activity::Finished => "finished".into(),
    }
}

fn instant(plan: &Plan, number: usize, status: Status) -> f64 {
    plan.timebase
        .seconds(plan.participants[number].sample_time.instant(status.next))
}

/// A participant's process ended before it was done.
pub(super) fn death(plan: &Plan, number: usize, member: &Member, status: ExitStatus) -> String {
    let last = member.status();
    format!(
        "process {} {} at t = {} s (activation {}) while {}{}",
        member.process.pid(),
        Participant::ending(status),
        instant(plan, number, last),
        last.next,
        doing(plan, number, last),
        words(member.process.log())
    )
}

/// Nothing moves: the participant to blame, and what everybody does.
pub(super) fn standstill(plan: &Plan, crew: &[Member], horizon: Ticks, seconds: f64) -> (String, String) {
    let mut lines = Vec::new();
    let (mut culprit, mut statuses) = (None, Vec::new());
    for (number, member) in crew.iter().enumerate() {
        let status = member.status();
        lines.push(format!(
            "  {} (pid {}) at t = {} s: {}",
            member.process.name,
            member.process.pid(),
            instant(plan, number, status),
            doing(plan, number, status)
        ));
        // Whoever computes, has not even started, or rests though the horizon has moved owes something; those who wait do not.
        let own = &plan.participants[number];
        let may = status.next < own.activations && own.sample_time.instant(status.next) < horizon;
        let indebted = match status.activity {
            Activity::Computing | Activity::Starting => true,
            Activity::Rest => may,
            _ => false,
        };
        if indebted && culprit.is_none() {
            culprit = Some(number);
        }
        statuses.push(status);
    }
    let (name, debt) = match culprit {
        Some(number) => {
            let pid = crew[number].process.pid();
            let (name, does) = (
                crew[number].process.name.clone(),
                state(pid, &statuses[number], seconds),
            );
            let debt = format!("{name} (pid {pid}, {does}) {}", owes(plan, number, &statuses));
            (name, debt)
        }
        None => (ORCHESTRATOR.to_owned(), "nobody owes anything".to_owned()),
    };
    let text = format!(
        "nothing has moved for {seconds:.1} s: {debt}; recorder idle\n{}",
        lines.join("\n")
    );
    (name, text)
}

/// `alive, computing for 4.1 s`: what the kernel and the participant itself say.
fn state(pid: u32, status: &Status, seconds: f64) -> String {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The state is the first letter behind the name, which stands in parentheses and may hold anything.
    let letter = stat.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next());
    let life = match letter {
        Some('T' | 't') => "stopped by a signal or a debugger",
        Some('D') => "alive, in the kernel",
        Some('Z') | None => "ended",
        Some(_) => "alive",
    };
    let work = match status.activity {
        Activity::Starting => "getting ready",
        Activity::Rest => "not seeing that it may go on",
        _ => "computing",
    };
    format!("{life}, {work} for {seconds:.1} s")
}

/// `has not published push #200; plant waits for it at t = 2 s`
fn owes(plan: &Plan, culprit: usize, statuses: &[Status]) -> String {
    let waiting = statuses.iter().enumerate().find_map(|(number, status)| {
        let Activity::Input { input, index } = status.activity else {
            return None;
        };
        let link = plan.participants[number]
            .inputs
            .get(input as usize)
            .copied()
            .flatten()?;
        let from = plan.links[link].from;
        (from.0 == culprit).then_some((number, from.1, index))
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
