//! Tapes are read as they were written, and equal tapes have equal digests.

mod common;

use common::{TempFolder, payload, pose, scalar, spec, stamp};
use lockstep::time::Rational;
use proptest::prelude::*;
use tape::{
    AppendError, CreateError, DigestSink, Event, EventKind, MemoryTape, ReadError, Reader, Records, Sink, Source,
    StreamSpec, Writer, digest_of,
};

fn two_streams() -> Vec<StreamSpec> {
    vec![
        spec("plant", "truth", pose(), "0 s", "1 ms"),
        spec("controller", "command", scalar(), "1/300 s", "30 Hz"),
    ]
}

/// Feeds `counts[s]` samples of every stream, in the interleaving `order`.
fn feed(sink: &mut dyn Sink, streams: &[StreamSpec], counts: &[u64], order: u64) {
    let mut next: Vec<u64> = streams.iter().map(|s| s.first_index).collect();
    let mut state = order;
    while (0..streams.len()).any(|s| next[s] < streams[s].first_index + counts[s]) {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let s = (state >> 33) as usize % streams.len();
        if next[s] < streams[s].first_index + counts[s] {
            let spec = &streams[s];
            sink.sample(s, next[s], stamp(spec, next[s]), &payload(spec, next[s]))
                .unwrap();
            next[s] += 1;
        }
    }
}

#[test]
fn tape_round_trips_bit_for_bit() {
    let scratch = TempFolder::new("tape");
    let dir = scratch.join("tape");
    let mut streams = two_streams();
    streams[1].first_index = 17;
    let mut writer = Writer::create(&dir, streams.clone()).unwrap();
    feed(&mut writer, &streams, &[5000, 160], 3);
    let event = Event {
        time: "1/3 s".parse().unwrap(),
        kind: EventKind::Fault,
        participant: Some("plant".into()),
        text: "valve 2 stuck".into(),
    };
    writer.event(&event).unwrap();
    let digest = writer.finish().unwrap();

    // The run folder works as well as its tape.
    let reader = Reader::open(&scratch.0).unwrap();
    assert_eq!(reader.sealed_digest(), Some(digest));
    assert_eq!(reader.digest().unwrap(), digest);
    assert_eq!(digest_of(&dir).unwrap(), digest);
    reader.verify().unwrap();
    assert_eq!(reader.incomplete_records(), []);
    assert_eq!(reader.events().unwrap(), [event]);

    for spec in &streams {
        let stream = reader.stream(&spec.name()).unwrap();
        let mut records = Records::new(&reader, stream);
        let mut seen = 0;
        while let Some(record) = records.next().unwrap() {
            assert_eq!(record.index, spec.first_index + seen);
            assert_eq!(record.stamp_s.to_bits(), stamp(spec, record.index).to_bits());
            assert_eq!(record.payload, payload(spec, record.index));
            seen += 1;
        }
        assert_eq!(seen, reader.count(stream));
    }

    // Random access, and a field by its name.
    let p = reader.field("plant.truth.p_NB_N").unwrap();
    let mut record = vec![0; streams[0].stride()];
    reader.read(p.stream, 4321, &mut record).unwrap();
    assert_eq!(record[8..], payload(&streams[0], 4321));
    assert_eq!(f64::from_le_bytes(record[..8].try_into().unwrap()), 4.321);
    assert!(matches!(
        reader.read(p.stream, 5000, &mut record),
        Err(ReadError::Range { .. })
    ));
    let text = reader.field("plant.truth.p_NX_N").unwrap_err().to_string();
    assert!(text.contains("plant.truth") && text.contains("`p_NB_N`"), "{text}");
    let text = reader.field("plant.thruth.p_NB_N").unwrap_err().to_string();
    assert!(text.contains("`plant.truth`"), "{text}");
}

#[test]
fn writer_rejects_invalid_sample_without_trace() {
    let scratch = TempFolder::new("refuse");
    let streams = two_streams();
    let mut writer = Writer::create(&scratch.join("t"), streams.clone()).unwrap();
    let good = payload(&streams[0], 0);
    writer.append(0, 0, 0.0, &good).unwrap();
    let check = |result: Result<(), AppendError>, parts: &[&str]| {
        let text = result.unwrap_err().to_string();
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
    };
    check(
        writer.append(0, 0, 0.0, &good),
        &["plant.truth", "sample 0", "1 was due"],
    );
    check(
        writer.append(0, 2, 0.002, &good),
        &["plant.truth", "sample 2", "1 was due"],
    );
    check(writer.append(0, 1, 0.001, &good[1..]), &["47 bytes", "has 48"]);
    check(
        writer.append(0, 1, 0.001_000_1, &good),
        &["stamped 0.0010001 s", "0.001 s"],
    );
    check(writer.append(0, 1, f64::NAN, &good), &["NaN"]);
    check(writer.append(2, 0, 0.0, &good), &["no stream number 2"]);
    writer.append(0, 1, 0.001, &good).unwrap();
    assert_eq!(
        (writer.count(0), writer.count(1), writer.count(2)),
        (Some(2), Some(0), None)
    );
    writer.finish().unwrap();
    assert!(matches!(
        Writer::create(&scratch.join("t"), streams),
        Err(CreateError::Exists { .. })
    ));
    assert_eq!(Reader::open(&scratch.join("t")).unwrap().count(1), 2);
}

#[test]
fn writer_rejects_invalid_streams_before_creation() {
    let scratch = TempFolder::new("unsound");
    let refuse = |change: fn(&mut StreamSpec), part: &str| {
        let mut streams = two_streams();
        change(&mut streams[1]);
        let text = Writer::create(&scratch.join("t"), streams).unwrap_err().to_string();
        assert!(text.contains(part), "{text}");
        assert!(!scratch.join("t").exists());
    };
    refuse(|s| s.participant = "../evil".into(), "`../evil`");
    refuse(|s| s.port = String::new(), "is not the name of a port");
    refuse(|s| s.port = "a.b".into(), "`a.b`");
    refuse(|s| s.period = Rational::ZERO, "must be positive");
    refuse(
        |s| (s.participant, s.port) = ("plant".into(), "truth".into()),
        "declared twice",
    );
    refuse(|s| s.descriptor.size = 9, "do not fill");
    refuse(|s| s.descriptor.fields[0].unit = "m|s".into(), "m|s");
    refuse(|s| s.first_index = u64::MAX, "beyond 2^62");
}

/// Every difference between two tapes changes the digest.
#[test]
fn different_tapes_have_different_digests() {
    let digest = |change: fn(&mut StreamSpec), counts: &[u64]| {
        let mut streams = two_streams();
        change(&mut streams[0]);
        let mut sink = DigestSink::new(streams.clone()).unwrap();
        feed(&mut sink, &streams, counts, 1);
        sink.digest()
    };
    let digests = [
        digest(|_| {}, &[0, 0]),
        digest(|_| {}, &[10, 10]),
        digest(|_| {}, &[10, 11]),
        digest(|_| {}, &[11, 10]),
        digest(|s| s.port = "other".into(), &[0, 0]),
        digest(|s| s.descriptor.name = "Other".into(), &[0, 0]),
        digest(|s| s.descriptor.fields[0].unit = "cm".into(), &[0, 0]),
        digest(|s| s.descriptor.fields[0].frame = "B".into(), &[0, 0]),
        digest(|s| s.period = Rational::from_millis(2), &[0, 0]),
        digest(|s| s.offset = Rational::from_millis(2), &[0, 0]),
        digest(|s| s.first_index = 1, &[0, 0]),
    ];
    for (at, one) in digests.iter().enumerate() {
        assert!(digests[at + 1..].iter().all(|other| other != one), "number {at}");
    }
    assert_eq!(one_line(&digests[0]).len(), 64);
    assert_eq!(one_line(&digests[0]).parse(), Ok(digests[0]));
}

fn one_line(digest: &tape::Digest) -> String {
    digest.to_string()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// File, memory and bare hash agree, whatever the order between streams, the order of declaration and the flushes.
    #[test]
    fn digest_is_independent_of_arrival_order(
        counts in prop::collection::vec(0_u64..3000, 2),
        orders in (any::<u64>(), any::<u64>()),
        flush_at in 0_u64..100,
    ) {
        let scratch = TempFolder::new("digest");
        let streams = two_streams();
        let mut writer = Writer::create(&scratch.join("tape"), streams.clone()).unwrap();
        let flush_at = flush_at.min(counts[0]);
        for k in 0..flush_at {
            writer.append(0, k, stamp(&streams[0], k), &payload(&streams[0], k)).unwrap();
        }
        writer.flush().unwrap();
        let mut rest = streams.clone();
        rest[0].first_index = flush_at;
        feed(&mut writer, &rest, &[counts[0] - flush_at, counts[1]], orders.0);
        let digest = writer.finish().unwrap();

        let reversed: Vec<StreamSpec> = streams.iter().rev().cloned().collect();
        let reversed_counts = [counts[1], counts[0]];
        let mut memory = MemoryTape::new(reversed.clone()).unwrap();
        feed(&mut memory, &reversed, &reversed_counts, orders.1);
        let mut hash = DigestSink::new(reversed.clone()).unwrap();
        feed(&mut hash, &reversed, &reversed_counts, orders.1);
        prop_assert_eq!(memory.digest().unwrap(), digest);
        prop_assert_eq!(hash.digest(), digest);
        prop_assert_eq!(digest_of(&scratch.0).unwrap(), digest);
    }
}

#[test]
fn reader_rejects_pipe_in_place_of_file() {
    let scratch = TempFolder::new("pipe");
    let dir = scratch.join("tape");
    Writer::create(&dir, two_streams()).unwrap().finish().unwrap();
    for name in ["plant.truth.bin", "seal.json", "events.jsonl"] {
        let (path, moved) = (dir.join(name), scratch.join("aside"));
        std::fs::rename(&path, &moved).unwrap();
        let status = std::process::Command::new("mkfifo").arg(&path).status().unwrap();
        assert!(status.success(), "{name}");
        // In a separate thread: a reader that waits for a writer never returns.
        let (sender, receiver) = std::sync::mpsc::channel();
        let folder = dir.clone();
        std::thread::spawn(move || {
            let read = Reader::open(&folder).and_then(|reader| reader.events());
            let _ = sender.send(read.map_err(|error| error.to_string()));
        });
        let read = receiver.recv_timeout(std::time::Duration::from_secs(20));
        let text = read.expect("the reader does not wait for a pipe").unwrap_err();
        assert!(text.contains(name) && text.contains("not a regular file"), "{text}");
        std::fs::rename(&moved, &path).unwrap();
    }
    Reader::open(&dir).unwrap().verify().unwrap();
}
