//! A damper that violates the protocol in the way that its argument names, at its hundredth sample or in its answers.

use std::process::ExitCode;

use escapement_tests::offender::{Offender, conforming_reply, run_offender};
use escapement_tests::participants::Push;
use lockstep::control::{ParticipantEvent, Reply, Request, WallTimeBreakdown};
use lockstep::participant::Interface;
use lockstep::wire::encode;

const AT: u64 = 100;

fn reply(violation: &str, request: &Request) -> Option<Vec<u8>> {
    let mut reply = conforming_reply(request);
    match (violation, request, &mut reply) {
        ("silence", Request::Hello { .. }, _) => return None,
        ("garbage", Request::Hello { .. }, _) => return Some((0..=255).collect()),
        // A list of 2^63 ports.
        ("count", Request::Configure { .. }, _) => return Some([&[1, 0, 0, 0, 0, 0, 0, 0][..], &[0xff; 8]].concat()),
        ("nothing", Request::Configure { .. }, _) => return Some(Vec::new()),
        ("version", Request::Hello { .. }, Reply::Hello { protocol, .. }) => *protocol += 7,
        ("dies-on-move", Request::Move { .. }, _) => std::process::abort(),
        ("answer", Request::Connect { .. }, reply) => *reply = Reply::State(None),
        ("gap", Request::Configure { .. }, Reply::Described { interface }) => {
            *interface = Interface::new(interface.kind).output::<Push>("push");
            interface.outputs[0].descriptor.fields[1].offset = 4;
        }
        ("steers-in-a-unit", Request::Configure { .. }, Reply::Described { interface }) => {
            interface.outputs[0].descriptor.fields[0].unit = "N\u{1b}[2J\nerror: all is well".into();
        }
        _ => {}
    }
    Some(encode("a reply", &reply).expect("small"))
}

fn act(violation: &str, offender: &mut Offender) {
    offender.step_until(AT);
    let (mut header, mut payload, mut stream) = (offender.header(AT), Offender::payload(AT), None);
    match violation {
        "link-repeats" | "record-repeats" => header.index -= 1,
        "link-back" | "record-back" => header = offender.header(AT / 2),
        "link-skips" | "record-skips" => header = offender.header(AT + 1),
        "link-stamp" | "record-stamp" => header.stamp += 1,
        "link-nan" => payload[..8].copy_from_slice(&f64::NAN.to_le_bytes()),
        "record-size" => payload.truncate(9),
        "record-stream" => stream = Some(1 - offender.assignment.outputs[0].stream),
        "record-unknown" => stream = Some(77),
        "record-last" => header.index = u64::MAX,
        "record-twice" => offender.reopen_record(),
        // It wakes no consumer: all that it sends is found all the same.
        "wakes-none" => {
            offender.step_range(AT, offender.assignment.activations);
            return offender.event(&ParticipantEvent::Finished(WallTimeBreakdown::default()));
        }
        "opens-other-record" => {
            let _kept = offender.open_record_of("plant");
            return offender.step_range(AT, offender.assignment.activations);
        }
        // Done, after a tenth of its samples.
        "finishes" => return offender.event(&ParticipantEvent::Finished(WallTimeBreakdown::default())),
        // Paused where the plan has twice as many activations before; then with that number, which it has not done.
        "pauses-early" => {
            return offender.pause_at(offender.header(2 * AT).stamp, AT, |request| reply(violation, request));
        }
        "pauses-short" => {
            return offender.pause_at(offender.header(2 * AT).stamp, 2 * AT, |request| {
                reply(violation, request)
            });
        }
        "pauses-beyond" => {
            return offender.pause_at(offender.header(3 * AT).stamp, 3 * AT, |request| {
                reply(violation, request)
            });
        }
        "repeats-itself" => loop {
            let (horizon, next) = (offender.header(AT).stamp, AT);
            offender.event(&ParticipantEvent::AtHorizon { horizon, next });
        },
        // The activation at the very instant before which all participants are to rest.
        "past-the-horizon" => return offender.step_range(AT, AT + 1),
        "steers-the-terminal" => {
            let (activation, t) = (AT, "1\u{1b}[31m".to_owned());
            let reason = "\u{1b}[2J\0odd\nerror: all is well\rcaptured".to_owned();
            return offender.event(&ParticipantEvent::Failed { activation, t, reason });
        }
        "steers-in-its-log" => {
            eprint!("\u{1b}[2J\0last\nerror: all is well\n");
            std::process::abort();
        }
        "dies-on-move" => return offender.pause_at(offender.header(AT).stamp, AT, |request| reply(violation, request)),
        _ => return offender.step_until(0),
    }
    match violation.starts_with("link") {
        true => offender.send(header, &payload),
        false => offender.record(stream, header, &payload),
    }
}

fn main() -> ExitCode {
    let violation = std::env::args().nth(1).unwrap_or_default();
    run_offender(
        |request| reply(&violation, request),
        |offender| act(&violation, offender),
    )
}
