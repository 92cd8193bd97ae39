//! A damper that lies in the way that its argument names, at its hundredth sample or in its answers.

use std::process::ExitCode;

use escapement_tests::liar::{Liar, honest_reply, run};
use escapement_tests::parts::Push;
use lockstep::control::{ParticipantEvent, Reply, Request, Timing};
use lockstep::participant::Interface;
use lockstep::wire::encode;

const LIE: u64 = 100;

fn reply(lie: &str, request: &Request) -> Option<Vec<u8>> {
    let mut reply = honest_reply(request);
    match (lie, request, &mut reply) {
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

fn act(lie: &str, liar: &mut Liar) {
    liar.behave(LIE);
    let (mut header, mut payload, mut stream) = (liar.header(LIE), Liar::payload(LIE), None);
    match lie {
        "link-repeats" | "record-repeats" => header.index -= 1,
        "link-back" | "record-back" => header = liar.header(LIE / 2),
        "link-skips" | "record-skips" => header = liar.header(LIE + 1),
        "link-stamp" | "record-stamp" => header.stamp += 1,
        "link-nan" => payload[..8].copy_from_slice(&f64::NAN.to_le_bytes()),
        "record-size" => payload.truncate(9),
        "record-stream" => stream = Some(1 - liar.assignment.outputs[0].stream),
        "record-unknown" => stream = Some(77),
        "record-last" => header.index = u64::MAX,
        "record-twice" => liar.record_anew(),
        // It wakes no consumer: all that it sends is found all the same.
        "wakes-none" => {
            liar.behave_from(LIE, liar.assignment.activations);
            return liar.event(&ParticipantEvent::Finished(Timing::default()));
        }
        "intrudes" => {
            let _kept = liar.intrude("plant");
            return liar.behave_from(LIE, liar.assignment.activations);
        }
        // Done, after a tenth of its samples.
        "finishes" => return liar.event(&ParticipantEvent::Finished(Timing::default())),
        // At rest where the plan has twice as many activations before; then with that number, which it has not done.
        "rests-early" => return liar.rest(liar.header(2 * LIE).stamp, LIE, |request| reply(lie, request)),
        "rests-short" => return liar.rest(liar.header(2 * LIE).stamp, 2 * LIE, |request| reply(lie, request)),
        "rests-beyond" => return liar.rest(liar.header(3 * LIE).stamp, 3 * LIE, |request| reply(lie, request)),
        "repeats-itself" => loop {
            let (horizon, next) = (liar.header(LIE).stamp, LIE);
            liar.event(&ParticipantEvent::AtHorizon { horizon, next });
        },
        // The activation at the very instant before which all participants are to rest.
        "past-the-horizon" => return liar.behave_from(LIE, LIE + 1),
        "steers-the-terminal" => {
            let (activation, t) = (LIE, "1\u{1b}[31m".to_owned());
            let reason = "\u{1b}[2J\0odd\nerror: all is well\rcaptured".to_owned();
            return liar.event(&ParticipantEvent::Failed { activation, t, reason });
        }
        "steers-in-its-log" => {
            eprint!("\u{1b}[2J\0last\nerror: all is well\n");
            std::process::abort();
        }
        "dies-on-move" => return liar.rest(liar.header(LIE).stamp, LIE, |request| reply(lie, request)),
        _ => return liar.behave(0),
    }
    match lie.starts_with("link") {
        true => liar.send(header, &payload),
        false => liar.record(stream, header, &payload),
    }
}

fn main() -> ExitCode {
    let lie = std::env::args().nth(1).unwrap_or_default();
    run(|request| reply(&lie, request), |liar| act(&lie, liar))
}
