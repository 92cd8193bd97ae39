//! Heap allocations of a participant between its first and its last step: none.

mod test_domain;

use lockstep::executor::{InLoop, connect_locally};
use lockstep::fault::Slot;
use lockstep::link::{Conversion, Hold, Pair, Term, Timing};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, Participant, Step};
use lockstep::plan::{LinkSpec, ParticipantSpec, Plan};
use lockstep::port::Message;
use lockstep::time::Rational;
use lockstep::transport::iceoryx::{LinkService, RecordReceiver, RecordSender, Recorded, SharedRecord};
use lockstep::transport::{Header, NoRecording, Receiver, Recording, Sender, TransportError};
use test_domain::TestDomain;
use testing::allocation::{Allocations, Counting, allocations_during};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

lockstep::message! {
    /// The message between the two participants.
    pub struct Word {
        /// A position.
        pub x: f64 = "m",
        /// A speed.
        pub v: f64 = "m/s",
    }
}

/// Adds up its inputs.
struct Sum {
    kind: Kind,
    x: f64,
}

impl Participant for Sum {
    fn interface(&self) -> Interface {
        Interface::new(self.kind).input::<Word>("in0").output::<Word>("out0")
    }
    fn initialise(&mut self, _t: f64, _outputs: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.x += step.period * (1.0 - inputs.get::<Word>(0).x);
        *outputs.get_mut(0) = Word { x: self.x, v: step.t };
        Ok(())
    }
}

fn participants_of_both_kinds() -> [Sum; 2] {
    [Kind::Continuous, Kind::Sampled].map(|kind| Sum { kind, x: 0.0 })
}

/// A conversion of the message to itself, with sums.
fn conversion() -> Conversion {
    let message = Word::descriptor();
    let slot = |name: &str| Slot::resolve(&message, name).expect("it has one").1[0];
    let pair = |name: &str, adds: bool| Pair {
        to: slot(name),
        count: 1,
        terms: ["x", "v"]
            .map(|from| Term {
                from: slot(from),
                scale: 0.5,
            })
            .to_vec(),
        offset: 0.25,
        adds,
    };
    Conversion {
        pairs: vec![pair("x", false), pair("v", true)],
        message,
    }
}

/// Two participants that read each other, with delay, jitter and drops; with `converted` and interpolated fields, or with whole samples.
fn plan(converted: bool) -> Plan {
    let second = |text: &str| text.parse::<Rational>().expect("a time");
    let participants = participants_of_both_kinds();
    let specs = participants
        .iter()
        .zip([("plant", "1 ms"), ("controller", "1/300 s")])
        .map(|(participant, (name, period))| ParticipantSpec {
            name: name.into(),
            period: second(period),
            offset: Rational::ZERO,
            interface: participant.interface(),
        });
    let link = |name: &str, from: &str, to: &str| LinkSpec {
        name: name.into(),
        from: (from.into(), "out0".into()),
        to: (to.into(), "in0".into()),
        timing: Timing {
            delay: second("2 ms"),
            jitter: second("3 ms"),
            drop: 0.1,
            hold: if converted { Hold::Linear } else { Hold::Last },
        },
        initial: None,
        conversion: converted.then(conversion),
        random_stream: converted.then(|| name.into()),
        faults: Vec::new(),
    };
    let links = [
        link("measured", "plant", "controller"),
        link("command", "controller", "plant"),
    ];
    Plan::build(specs.collect(), &links, second("10 s"), 5).expect("a plan")
}

#[test]
fn loop_allocates_nothing_between_first_and_last_step() {
    [false, true].into_iter().for_each(assert_no_allocation);
}

fn assert_no_allocation(converted: bool) {
    let plan = plan(converted);
    let boxed = participants_of_both_kinds()
        .into_iter()
        .map(|own| Box::new(own) as _)
        .collect();
    let mut looped = InLoop::new(&plan, connect_locally(&plan, boxed, |_| Box::new(NoRecording)));
    looped.run_to(1, |_| {}).expect("the first step");
    let taken = allocations_during(|| {
        looped.run_to(plan.end, |_| {}).expect("the rest");
    });
    assert_eq!(taken, Allocations::default());
}

#[test]
fn shared_memory_link_allocates_nothing_per_sample() {
    const SAMPLES: u64 = 5000;
    let test = TestDomain::new();
    let link = LinkService::create(&test.domain, 0, 216, 4).expect("room");
    let mut receiver = link.receiver(&test.domain).expect("the only one");
    let mut sender = link.sender(&test.domain).expect("the only one");
    assert_eq!((receiver.prepare(), sender.prepare()), (Ok(()), Ok(())));
    let mut buffer = [0; 216];
    let mut exchange = |count: u64| {
        for index in 0..count {
            let header = Header { index, stamp: 0 };
            assert!(sender.try_send(header, &[3; 216]).expect("sent"));
            assert_eq!(receiver.try_receive(&mut buffer), Ok(Some(header)));
        }
    };
    let taken = allocations_during(|| exchange(SAMPLES));
    assert_eq!(taken, Allocations::default());
}

#[test]
fn record_allocates_nothing_per_sample() {
    const SAMPLES: u64 = 20_000;
    let test = TestDomain::new();
    let mut receiver = RecordReceiver::create(&test.domain, "plant").expect("room");
    let sender = RecordSender::open(&test.domain, "plant", 0, &[size_of::<Word>()], 1 << 20).expect("the only one");
    let mut sender = SharedRecord(std::rc::Rc::new(std::cell::RefCell::new(sender)));
    assert_eq!(receiver.take_memory(), Ok(true));
    let mut seen = 0;
    let mut record = |count: u64| {
        for index in 0..count {
            let header = Header { index, stamp: 0 };
            assert!(sender.try_append(0, header, &[1; 16]).expect("recorded"));
            sender.commit();
            let take = |entry: Recorded<'_>| {
                seen += u64::from(matches!(entry, Recorded::Sample { .. }));
                Ok::<(), TransportError>(())
            };
            receiver.receive(take).expect("whole entries");
        }
    };
    let taken = allocations_during(|| record(SAMPLES));
    assert_eq!(seen, SAMPLES);
    assert_eq!(taken, Allocations::default());
}
