//! Reports of a run's faults: events on the tape, and lines for people.

use std::collections::VecDeque;

use lockstep::fault::FaultWindow;
use lockstep::plan::Plan;
use lockstep::time::Ticks;
use tape::{Event, EventKind};

/// A fault as it is reported to people.
pub struct Notice<'a> {
    /// Its name.
    pub name: &'a str,
    /// When it is active.
    pub span: FaultWindow,
    /// What it does, and to which signal or connection.
    pub description: &'a str,
    /// The participant whose signal it disturbs; `None` for a connection.
    pub participant: Option<&'a str>,
}

/// The faults of a plan, each once, in the order of their start times.
pub fn notices(plan: &Plan) -> Vec<Notice<'_>> {
    use lockstep::fault::FaultPort;
    let signals = plan.faults.iter().map(|fault| {
        let (FaultPort::Input { participant, .. } | FaultPort::Output { participant, .. }) = fault.place;
        Notice {
            name: &fault.name,
            span: fault.span,
            description: &fault.description,
            participant: Some(&plan.participants[participant].name),
        }
    });
    let links = plan.links.iter().flat_map(|link| &link.faults).map(|fault| Notice {
        name: &fault.name,
        span: fault.span,
        description: &fault.description,
        participant: None,
    });
    let mut notices: Vec<Notice<'_>> = signals.chain(links).collect();
    notices.sort_by(|a, b| (a.span.at, a.name).cmp(&(b.span.at, b.name)));
    notices.dedup_by(|a, b| a.name == b.name);
    notices
}

/// The beginnings and ends of faults before the end of the run, in order.
pub(crate) fn events(plan: &Plan) -> VecDeque<(Ticks, Event)> {
    let mut events = Vec::new();
    for notice in notices(plan) {
        let edges = [(Some(notice.span.at), "begins"), (notice.span.until, "ends")];
        for (time, edge) in edges {
            let Some(time) = time else { continue };
            // A time that cannot be expressed in ticks is after the end of every run.
            let Ok(ticks) = plan.timebase.ceil(time) else { continue };
            events.push((
                ticks,
                Event {
                    time,
                    kind: EventKind::Fault,
                    participant: notice.participant.map(str::to_owned),
                    text: format!("fault `{}` {edge}: {}", notice.name, notice.description),
                },
            ));
        }
    }
    events.retain(|(ticks, _)| *ticks < plan.end);
    events.sort_by_key(|(ticks, event)| (*ticks, event.time));
    events.into()
}

/// The faults that are active at `t`, as the end of a sentence; empty if there are none.
pub(crate) fn active(plan: &Plan, t: Ticks) -> String {
    let ticks = |time| plan.timebase.ceil(time).unwrap_or(Ticks::MAX);
    let is_active =
        |notice: &Notice<'_>| ticks(notice.span.at) <= t && notice.span.until.is_none_or(|until| t < ticks(until));
    let names = notices(plan).into_iter().filter(is_active);
    let names: Vec<String> = names
        .map(|notice| format!("`{}` ({})", notice.name, notice.description))
        .collect();
    if names.is_empty() {
        String::new()
    } else {
        format!("; active then: {}", names.join(", "))
    }
}

impl Notice<'_> {
    /// `from 12 s to 14 s`
    pub fn when(&self) -> String {
        match self.span.until {
            Some(until) => format!("from {} to {until}", self.span.at),
            None => format!("from {} on", self.span.at),
        }
    }
}
