//! The bytes that `docs/protocol.md` documents for implementers in other languages are the bytes on the wire.

use escapement_tests::participants::Damper;
use escapement_tests::program::root;
use lockstep::control::{PROTOCOL, ParticipantEvent, Reply, Request, WallTimeBreakdown};
use lockstep::fault::{Effect, FaultPort, FaultWindow, LinkFault, SignalFault, Slot};
use lockstep::link::{self, Conversion, Pair, Term};
use lockstep::participant::{Input, Interface, Kind, Participant};
use lockstep::plan::{InFlightSample, LinkSpec, Observed, ParticipantSpec, Plan, Position, StuckValues};
use lockstep::time::Rational;
use lockstep::wire::{decode, encode};
use serde_json::Value;

lockstep::message! {
    /// One number.
    struct Angle {
        q: f64 = "rad" in "B",
    }
}

fn hex(bytes: &[u8]) -> String {
    let words: Vec<String> = bytes
        .chunks(4)
        .map(|word| word.iter().map(|byte| format!("{byte:02x}")).collect())
        .collect();
    words.join(" ")
}

/// The content of the page, computed from the values themselves.
fn examples() -> Vec<(&'static str, Vec<u8>)> {
    let request = |request: Request| encode("a request", &request).unwrap();
    let reply = |reply: Reply| encode("a reply", &reply).unwrap();
    let event = |event: ParticipantEvent| encode("a participant event", &event).unwrap();
    vec![
        (
            "Request Hello, protocol 7",
            request(Request::Hello { protocol: PROTOCOL }),
        ),
        (
            "Reply Hello, protocol 7, program `toy 1`",
            reply(Reply::Hello {
                protocol: PROTOCOL,
                program: "toy 1".into(),
            }),
        ),
        (
            "Request Configure, name `a`, parameters `x = 1`, seed 7, period 0.5 s, offset 0 s",
            request(Request::Configure {
                name: "a".into(),
                parameters: "x = 1".into(),
                seed: 7,
                period: 0.5,
                offset: 0.0,
            }),
        ),
        (
            "Reply Described: sampled, no input, output `q` of message `Angle` with the scalar `q` in rad, frame B",
            reply(Reply::Described {
                interface: Interface::new(Kind::Sampled).output::<Angle>("q"),
            }),
        ),
        (
            "Request Move, address `esc_a_@/tmp/a`",
            request(Request::Move {
                address: "esc_a_@/tmp/a".into(),
            }),
        ),
        ("Request Terminate", request(Request::Terminate)),
        ("Reply Done", reply(Reply::Done)),
        ("Reply State, none", reply(Reply::State(None))),
        (
            "Participant event AtHorizon, horizon 1000, next activation 100",
            event(ParticipantEvent::AtHorizon {
                horizon: 1000,
                next: 100,
            }),
        ),
        (
            "Participant event Paused, next activation 100",
            event(ParticipantEvent::Paused { next: 100 }),
        ),
        (
            "Participant event Finished, one link in, 1 ns in total, all else zero",
            event(ParticipantEvent::Finished(WallTimeBreakdown {
                total_ns: 1,
                inputs_ns: vec![0],
                ..WallTimeBreakdown::default()
            })),
        ),
    ]
}

#[test]
fn documented_examples_are_the_encoded_messages() {
    let page = std::fs::read_to_string(root().join("docs/protocol.md")).expect("the page is there");
    let table: String = examples()
        .iter()
        .map(|(what, bytes)| format!("| {what} | `{}` |\n", hex(bytes)))
        .collect();
    for line in table.lines() {
        assert!(page.contains(line), "docs/protocol.md should have\n\n{table}");
    }
}

/// A decoder written only from the page.
struct PageDecoder<'a>(&'a [u8]);

impl PageDecoder<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_first_chunk::<N>().expect("the message goes on");
        self.0 = rest;
        *head
    }
    fn u8(&mut self) -> u8 {
        self.take::<1>()[0]
    }
    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }
    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }
    fn i64(&mut self) -> i64 {
        i64::from_le_bytes(self.take())
    }
    fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }
    fn i128(&mut self) -> i128 {
        i128::from_le_bytes(self.take())
    }
    fn text(&mut self) -> String {
        let bytes = self.bytes();
        String::from_utf8(bytes).expect("text is UTF-8")
    }
    fn bytes(&mut self) -> Vec<u8> {
        let count = self.u64();
        (0..count).map(|_| self.u8()).collect()
    }
    fn list<T>(&mut self, mut one: impl FnMut(&mut Self) -> T) -> Vec<T> {
        let count = self.u64();
        (0..count).map(|_| one(self)).collect()
    }
    fn descriptor(&mut self) -> Value {
        let (name, size) = (self.text(), self.u32());
        let fields = self.list(|this| {
            let (name, element) = (this.text(), this.u32());
            let shape = this.list(Self::u32);
            let field = [this.text(), this.text()];
            let (offset, values) = (
                this.u32(),
                this.list(|this| serde_json::json!([this.text(), this.u8()])),
            );
            serde_json::json!([name, element, shape, field[0], field[1], offset, values])
        });
        serde_json::json!([name, size, fields])
    }
    fn interface(&mut self) -> Value {
        let kind = self.u32();
        let inputs = self.list(|this| serde_json::json!([this.text(), this.descriptor(), this.u8()]));
        let outputs = self.list(|this| serde_json::json!([this.text(), this.descriptor()]));
        serde_json::json!([kind, inputs, outputs])
    }
    /// Producer's offset and period; base, spread and scale; drop_below, hold, key.
    fn delivery(&mut self) -> ([i64; 2], [i128; 3], u64, u32, u64) {
        let producer = [self.i64(), self.i64()];
        let delay = [self.i128(), self.i128(), self.i128()];
        (producer, delay, self.u64(), self.u32(), self.u64())
    }
    /// The first element with the count; the terms; the offset; whether it adds.
    #[allow(clippy::type_complexity, reason = "a row of a table")]
    fn pair(&mut self) -> ((u32, u32, u32), Vec<(u32, u32, f64)>, f64, u8) {
        let to = (self.u32(), self.u32(), self.u32());
        let terms = self.list(|this| (this.u32(), this.u32(), this.f64()));
        (to, terms, self.f64(), self.u8())
    }
    /// From, until, extra, drop_below; without the key.
    fn link_faults(&mut self) -> Vec<(i64, i64, i128, u64)> {
        self.list(|this| {
            let one = (this.i64(), this.i64(), this.i128(), this.u64());
            this.u64();
            one
        })
    }
}

#[test]
fn assignment_decodes_as_documented() {
    let mut plan = plan();
    let part = |first| Observed {
        every: 5,
        first,
        end: 9,
    };
    plan.observed = vec![Observed::ALL, part(2), part(3)];
    let request = Request::Connect {
        assignment: plan.assignments().nth(1).expect("there are two"),
        cores: vec![3],
        waiting: lockstep::control::WaitStrategy { spins: 5, yields: 6 },
        record: 1 << 16,
        position: Some(Box::new(Position {
            next: 7,
            inputs: vec![vec![InFlightSample {
                index: 66,
                payload: vec![9; 16],
            }]],
            values: vec![vec![6; 16]],
            outputs: vec![vec![8; 8], Vec::new()],
            held: StuckValues {
                inputs: vec![vec![vec![7; 8]]],
                outputs: Vec::new(),
            },
            state: Some(vec![1, 2]),
        })),
    };
    let bytes = encode("", &request).unwrap();
    assert_eq!(decode::<Request>("", &bytes).unwrap(), request);
    let mut decoder = PageDecoder(&bytes);
    assert_eq!(decoder.u32(), 2);
    assert_eq!((decoder.text().as_str(), decoder.text().as_str()), ("damper", "1 ms"));
    assert_eq!((decoder.i64(), decoder.i64(), decoder.u64()), (0, 10, 100));
    let interface = decoder.interface();
    assert_eq!(interface[0], 0);
    assert_eq!(interface[1][0][0], "motion");
    assert_eq!(
        interface[1][0][1][2][0],
        serde_json::json!(["position", 0, [], "m", "N", 0, []])
    );
    assert_eq!(interface[1][0][2], 1);
    // One link, into input 0: number 0 from the plant, 2 ms late with up to 1 ms more.
    assert_eq!((decoder.u64(), decoder.u32(), decoder.u32()), (1, 0, 0));
    assert_eq!(decoder.text(), "plant.motion");
    let (producer, [base, spread, scale], drop_below, hold, key) = decoder.delivery();
    assert_eq!((producer, drop_below, hold), ([0, 1], 1 << 30, 1));
    assert!(
        base == 2 * scale && spread * (1 << 32) == scale,
        "{base} {spread} {scale}"
    );
    assert_ne!(key, 0);
    // A fault of the link: 3 ms more from 100 ms to 200 ms, and half of the samples lost.
    assert_eq!(decoder.link_faults(), [(100, 200, 3 * scale, 1 << 31)]);
    assert_eq!((decoder.u32(), decoder.bytes()), (0, vec![0; 16]));
    assert_eq!(u64::from(decoder.u32()), plan.links[0].capacity as u64);
    // No fault of the output. Twice the position goes into the position, and 3 m/s into the velocity.
    assert_eq!((decoder.u8(), decoder.u8()), (0, 1));
    assert_eq!(decoder.descriptor(), interface[1][0][1]);
    assert_eq!(
        decoder.list(PageDecoder::pair),
        [((0, 0, 1), vec![(0, 0, 2.0)], 0.0, 0), ((8, 0, 1), Vec::new(), 3.0, 0)]
    );
    check_outputs(&mut decoder, &plan);
    assert_eq!(decoder.list(PageDecoder::u32), [3]);
    assert_eq!((decoder.u32(), decoder.u32(), decoder.u32()), (5, 6, 1 << 16));
    check_position(&mut decoder);
    assert!(decoder.0.is_empty());
}

fn check_outputs(decoder: &mut PageDecoder<'_>, plan: &Plan) {
    // One output: stream 1, of which every fifth sample is observed, those numbered 2 to 8, for one consumer.
    assert_eq!((decoder.u64(), decoder.u32()), (1, 1));
    assert_eq!((decoder.u64(), decoder.u64(), decoder.u64()), (5, 2, 9));
    assert_eq!(decoder.u64(), 1);
    assert_eq!(
        (decoder.u32(), decoder.text().as_str(), decoder.u32()),
        (1, "plant.push", 0)
    );
    let (producer, [base, spread, scale], drop_below, hold, _) = decoder.delivery();
    assert_eq!((producer, base, spread, drop_below, hold), ([0, 10], 0, 0, 0, 0));
    assert_eq!((scale, decoder.u64()), (1, 0));
    assert_eq!((decoder.i64(), decoder.i64(), decoder.u8()), (0, 1, 0));
    assert_eq!(u64::from(decoder.u32()), plan.links[1].capacity as u64);
    assert_eq!((decoder.i64(), decoder.u64()), (1000, 0));
    // Input 0 is recorded as stream 2. A fault there: the velocity is stuck at 0.5 m/s from 0.3 s on.
    assert_eq!((decoder.u64(), decoder.u32(), decoder.u32()), (1, 0, 2));
    assert_eq!((decoder.u64(), decoder.u64(), decoder.u64()), (5, 3, 9));
    assert_eq!((decoder.u64(), decoder.text().as_str()), (1, "frozen"));
    assert_eq!((decoder.i64(), decoder.i64(), decoder.f64()), (300, i64::MAX, 0.3));
    assert_eq!(decoder.list(|this| (this.u32(), this.u32())), [(8, 0)]);
    assert_eq!(
        (decoder.u32(), decoder.u8(), decoder.list(PageDecoder::f64)),
        (4, 1, vec![0.5])
    );
    assert_ne!(decoder.u64(), 0);
}

fn check_position(decoder: &mut PageDecoder<'_>) {
    // A position: activation 7, one sample in transit, a value of an input, the held outputs, the state.
    assert_eq!((decoder.u8(), decoder.u64()), (1, 7));
    assert_eq!(
        decoder.list(|this| this.list(|this| (this.u64(), this.bytes()))),
        [[(66, vec![9; 16])]]
    );
    assert_eq!(decoder.list(PageDecoder::bytes), [vec![6; 16]]);
    assert_eq!(decoder.list(PageDecoder::bytes), [vec![8; 8], Vec::new()]);
    assert_eq!(decoder.list(|this| this.list(PageDecoder::bytes)), [[vec![7; 8]]]);
    assert_eq!(decoder.list(|this| this.list(PageDecoder::bytes)).len(), 0);
    assert_eq!((decoder.u8(), decoder.bytes()), (1, vec![1, 2]));
}

/// Twice the position, and a velocity that is always 3 m/s.
fn position_doubled() -> Conversion {
    let descriptor = Damper::default().interface().inputs[0].descriptor.clone();
    let slot = |name: &str| Slot::resolve(&descriptor, name).expect("it has one").1[0];
    let term = Term {
        from: slot("position"),
        scale: 2.0,
    };
    let pair = |to: &str, terms: Vec<Term>, offset: f64| Pair {
        to: slot(to),
        count: 1,
        terms,
        offset,
        adds: false,
    };
    Conversion {
        pairs: vec![pair("position", vec![term], 0.0), pair("velocity", Vec::new(), 3.0)],
        message: descriptor,
    }
}

/// A damper and a source of motions for it, 1 s long.
fn plan() -> Plan {
    let damper = Damper::default().interface();
    let Input { descriptor, .. } = damper.inputs[0].clone();
    let mut plant = Interface::new(Kind::Continuous);
    plant.inputs.push(Input {
        name: "push".into(),
        descriptor: damper.outputs[0].descriptor.clone(),
        required: true,
    });
    plant.outputs.push(lockstep::participant::Output {
        name: "motion".into(),
        descriptor,
    });
    let participant = |name: &str, millis, interface| ParticipantSpec {
        name: name.into(),
        period: Rational::from_millis(millis),
        offset: Rational::ZERO,
        interface,
    };
    let port = |participant: &str, port: &str| (participant.to_owned(), port.to_owned());
    let late = link::Timing {
        delay: Rational::from_millis(2),
        jitter: Rational::from_millis(1),
        drop: 0.25,
        hold: link::Hold::Initial,
    };
    let links = [
        LinkSpec {
            name: "motion".into(),
            from: port("plant", "motion"),
            to: port("damper", "motion"),
            timing: late,
            initial: None,
            conversion: Some(position_doubled()),
            random_stream: Some("motion".into()),
            faults: vec![LinkFault {
                name: "storm".into(),
                span: FaultWindow {
                    at: Rational::from_millis(100),
                    until: Some(Rational::from_millis(200)),
                },
                drop: 0.5,
                extra_delay: Rational::from_millis(3),
                description: String::new(),
            }],
        },
        LinkSpec {
            name: "push".into(),
            from: port("damper", "push"),
            to: port("plant", "push"),
            timing: link::Timing::default(),
            initial: None,
            conversion: None,
            random_stream: None,
            faults: Vec::new(),
        },
    ];
    let participants = vec![participant("plant", 1, plant), participant("damper", 10, damper)];
    let mut plan = Plan::build(participants, &links, Rational::from_millis(1000), 1).expect("a sound plan");
    let (_, slots) =
        Slot::resolve(&plan.participants[1].interface.inputs[0].descriptor, "velocity").expect("it has one");
    plan.add_signal_faults(vec![SignalFault {
        name: "frozen".into(),
        place: FaultPort::Input {
            participant: 1,
            port: 0,
        },
        span: FaultWindow {
            at: Rational::from_millis(300),
            until: None,
        },
        slots,
        effect: Effect::Stuck(Some(vec![0.5])),
        description: String::new(),
    }])
    .expect("a sound fault");
    plan
}
