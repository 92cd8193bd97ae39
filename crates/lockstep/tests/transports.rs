//! The requirements on every transport: one test suite for all of them.

mod test_domain;

use std::collections::VecDeque;

use lockstep::control::ParticipantEvent;
use lockstep::transport::iceoryx::{LinkService, RecordReceiver, RecordSender, Recorded, SharedRecord};
use lockstep::transport::{Header, Receiver, Recording, Sender, TransportError, local};
use proptest::prelude::*;
use test_domain::TestDomain;

/// The two ends of a link, and the service that must outlive them.
struct Link {
    sender: Box<dyn Sender>,
    receiver: Box<dyn Receiver>,
    _keeps: Option<(LinkService, TestDomain)>,
}

fn in_one_process(size: usize, capacity: usize) -> Link {
    let (sender, receiver) = local::link(size, capacity);
    Link {
        sender: Box::new(sender),
        receiver: Box::new(receiver),
        _keeps: None,
    }
}

fn in_shared_memory(size: usize, capacity: usize) -> Link {
    let test = TestDomain::new();
    let service = LinkService::create(&test.domain, 7, size, capacity).expect("a new domain has room");
    Link {
        receiver: Box::new(service.receiver(&test.domain).expect("the only receiver")),
        sender: Box::new(service.sender(&test.domain).expect("the only sender")),
        _keeps: Some((service, test)),
    }
}

fn sample(index: u64, size: usize) -> (Header, Vec<u8>) {
    let payload = (0..size).map(|at| (index as usize * 31 + at * 7) as u8).collect();
    let stamp = index as i64 * 1000 - 5;
    (Header { index, stamp }, payload)
}

impl Link {
    fn send(&mut self, index: u64, size: usize) -> bool {
        let (header, payload) = sample(index, size);
        self.sender
            .try_send(header, &payload)
            .expect("the size is the link's own")
    }

    fn receive(&mut self, size: usize) -> Option<(Header, Vec<u8>)> {
        let mut payload = vec![0xff; size];
        let header = self.receiver.try_receive(&mut payload);
        header
            .expect("the size is the link's own")
            .map(|header| (header, payload))
    }
}

/// Each implementation of a link runs every check.
macro_rules! every_link {
    ($($check:ident),+ $(,)?) => {
        mod local_ring { $(#[test] fn $check() { super::$check(super::in_one_process); })+ }
        mod shared_memory { $(#[test] fn $check() { super::$check(super::in_shared_memory); })+ }
    };
}

every_link!(
    empty_link_returns_no_sample,
    link_delivers_sample_unchanged,
    full_link_rejects_sample_and_keeps_queue,
    link_rejects_sample_of_wrong_size,
    link_is_fifo_queue_for_any_call_order,
);

type CreateLink = fn(usize, usize) -> Link;

fn empty_link_returns_no_sample(create_link: CreateLink) {
    let mut link = create_link(16, 2);
    assert_eq!(link.receive(16), None);
    assert!(link.send(0, 16));
    assert!(link.receive(16).is_some());
    assert_eq!(link.receive(16), None, "a sample is received once");
}

fn link_delivers_sample_unchanged(create_link: CreateLink) {
    for size in [1, 7, 8, 216, 4096, 100_000] {
        let mut link = create_link(size, 1);
        for index in [0, 1, u64::MAX >> 12] {
            assert!(link.send(index, size));
            assert_eq!(link.receive(size), Some(sample(index, size)), "{size} bytes");
        }
    }
}

fn full_link_rejects_sample_and_keeps_queue(create_link: CreateLink) {
    for capacity in [1, 2, 13] {
        let mut link = create_link(24, capacity);
        for index in 0..capacity as u64 {
            assert!(link.send(index, 24), "there is room for {capacity}");
        }
        for round in 0..50 {
            let next = round + capacity as u64;
            assert!(!link.send(next, 24), "there is no room for more than {capacity}");
            assert!(!link.send(next, 24), "nor when it is tried again");
            assert_eq!(link.receive(24), Some(sample(round, 24)));
            assert!(link.send(next, 24), "one that was taken makes room for one");
        }
    }
}

fn link_rejects_sample_of_wrong_size(create_link: CreateLink) {
    let mut link = create_link(16, 2);
    let (header, payload) = sample(0, 24);
    assert!(link.sender.try_send(header, &payload).is_err());
    assert!(link.sender.try_send(header, &payload[..8]).is_err());
    assert_eq!(link.receive(16), None, "what was refused was not sent");
    assert!(link.send(1, 16));
    assert!(link.receiver.try_receive(&mut [0; 8]).is_err());
}

fn link_is_fifo_queue_for_any_call_order(create_link: CreateLink) {
    let plans = (1..20_usize, prop::collection::vec(any::<bool>(), 0..400));
    proptest!(ProptestConfig::with_cases(24), |((capacity, calls) in plans)| {
        let mut link = create_link(40, capacity);
        let (mut queue, mut next) = (VecDeque::new(), 0);
        for sends in calls {
            if sends {
                let fits = queue.len() < capacity;
                prop_assert_eq!(link.send(next, 40), fits);
                if fits {
                    queue.push_back(sample(next, 40));
                    next += 1;
                }
            } else {
                prop_assert_eq!(link.receive(40), queue.pop_front());
            }
        }
    });
}

#[test]
fn record_delivers_entries_in_order_to_lagging_recorder() {
    // From a word to more than is taken at a time; some thousand of the large ones go several times round the ring.
    let sizes = prop::collection::vec(prop_oneof![1..64_usize, 64..3000_usize, 33_000..50_000_usize], 1..4);
    let plans = (sizes, prop::collection::vec(0..40_u64, 1..60));
    proptest!(ProptestConfig::with_cases(12), |((sizes, lags) in plans)| {
        let test = TestDomain::new();
        let mut receiver = RecordReceiver::create(&test.domain, "plant").expect("room");
        let sender = RecordSender::open(&test.domain, "plant", 0, &sizes, 1 << 14).expect("the recorder is there");
        let mut sender = SharedRecord(std::rc::Rc::new(std::cell::RefCell::new(sender)));
        let streams: Vec<(u32, usize)> = (0..).zip(sizes).collect();
        let (mut expected, mut next, mut events) = (VecDeque::new(), 0, 0);
        let mut take = |expected: &mut VecDeque<(u32, Header, Vec<u8>)>| {
            receiver.receive(|entry| {
                match entry {
                    Recorded::Sample { stream, header, payload } => {
                        assert_eq!(Some((stream, header, payload.to_vec())), expected.pop_front());
                    }
                    Recorded::Event(event) => {
                        assert_eq!(event, ParticipantEvent::Paused { next: events });
                        events += 1;
                    }
                }
                Ok::<(), TransportError>(())
            })
        };
        for (round, lag) in (0..).zip(lags) {
            for index in next..next + lag {
                for &(stream, size) in &streams {
                    let (header, payload) = sample(index, size);
                    while !sender.try_append(stream, header, &payload)? {
                        prop_assert!(take(&mut expected)?, "a full record has something to take");
                    }
                    expected.push_back((stream, header, payload));
                }
                sender.commit();
            }
            next += lag;
            while !sender.0.borrow_mut().try_append_event(&ParticipantEvent::Paused { next: round })? {
                prop_assert!(take(&mut expected)?, "a full record has something to take");
            }
            take(&mut expected)?;
        }
        while take(&mut expected)? {}
        prop_assert!(expected.is_empty());
    });
}
