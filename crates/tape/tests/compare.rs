//! The comparison of two tapes.

mod common;

use common::{payload, pose, scalar, spec, stamp};
use tape::compare::{Comparison, StreamDifference, compare};
use tape::{MemoryTape, Sink, StreamSpec};

fn streams() -> Vec<StreamSpec> {
    vec![
        spec("plant", "truth", pose(), "0 s", "1 ms"),
        spec("controller", "command", scalar(), "0 s", "10 ms"),
    ]
}

/// A tape of `streams`, 600 samples each, with every payload modified by `change`.
fn tape(streams: &[StreamSpec], count: u64, change: impl Fn(&str, u64, &mut Vec<u8>)) -> MemoryTape {
    let mut tape = MemoryTape::new(streams.to_vec()).unwrap();
    for (s, spec) in streams.iter().enumerate() {
        for k in 0..count {
            let mut bytes = payload(spec, k);
            // Finite numbers, so that differences have a size.
            for (at, chunk) in bytes.chunks_exact_mut(8).enumerate().take(3) {
                chunk.copy_from_slice(&((k + at as u64) as f64).to_le_bytes());
            }
            change(&spec.port, k, &mut bytes);
            tape.sample(s, k, stamp(spec, k), &bytes).unwrap();
        }
    }
    tape
}

fn set(bytes: &mut [u8], element: usize, value: f64) {
    bytes[8 * element..][..8].copy_from_slice(&value.to_le_bytes());
}

fn check(change: impl Fn(&str, u64, &mut Vec<u8>)) -> Comparison {
    let a = tape(&streams(), 600, |_, _, _| {});
    let b = tape(&streams(), 600, change);
    compare(&a, &b).unwrap()
}

#[test]
fn comparison_ignores_order_of_streams() {
    let mut reversed = streams();
    reversed.reverse();
    let result = compare(
        &tape(&streams(), 600, |_, _, _| {}),
        &tape(&reversed, 600, |_, _, _| {}),
    )
    .unwrap();
    assert!(result.identical, "{result:?}");
    assert_eq!((result.samples, result.first, result.fields.len()), (1200, None, 0));
}

#[test]
fn comparison_reports_first_and_largest_differences() {
    let result = check(|port, k, bytes| match (port, k) {
        ("truth", 300..) => set(bytes, 2, (k + 2) as f64 + if k == 450 { -4.0 } else { 0.5 }),
        ("command", 20) => set(bytes, 0, 7.0),
        _ => {}
    });
    assert!(!result.identical);
    let first = result.first.unwrap();
    assert_eq!(
        (&*first.stream, first.index, first.stamp_s),
        ("controller.command", 20, 0.2)
    );
    assert_eq!((&*first.element, &*first.unit), ("x", "rad"));
    assert_eq!((&*first.a.value, &*first.b.value), ("20.0", "7.0"));
    assert_eq!(result.fields.len(), 2);
    let p = &result.fields[1];
    assert_eq!(
        (&*p.field, &*p.element, &*p.unit),
        ("plant.truth.p_NB_N", "p_NB_N[2]", "m")
    );
    assert_eq!((p.largest, p.stamp_s, p.samples), (4.0, 0.45, 300));
}

#[test]
fn comparison_detects_bitwise_differences() {
    let negative_zero = check(|port, k, bytes| {
        if (port, k) == ("command", 0) {
            set(bytes, 0, -0.0);
        }
    });
    let first = negative_zero.first.unwrap();
    assert_eq!(
        (&*first.a.bits, &*first.b.bits),
        ("0000000000000000", "8000000000000000")
    );
    assert_eq!(negative_zero.fields[0].largest, 0.0);
    let nan = check(|port, k, bytes| {
        if port == "command" && k >= 5 {
            set(bytes, 0, if k == 7 { f64::NAN } else { 1e9 });
        }
    });
    assert!(nan.fields[0].largest.is_nan());
    assert_eq!(nan.fields[0].stamp_s, 0.07);
}

#[test]
fn comparison_names_mismatched_streams() {
    let mut other = streams();
    other[0].descriptor.fields[0].unit = "cm".into();
    other.push(spec("guidance", "setpoint", scalar(), "0 s", "10 ms"));
    other[1].period = "20 ms".parse().unwrap();
    let result = compare(&tape(&streams(), 10, |_, _, _| {}), &tape(&other, 10, |_, _, _| {})).unwrap();
    assert!(!result.identical && result.first.is_none());
    assert_eq!(
        result.streams[0],
        StreamDifference::Missing {
            stream: "guidance.setpoint".into(),
            missing_in: 'A'
        }
    );
    assert!(matches!(&result.streams[1], StreamDifference::SampleTime { detail, .. } if detail.contains("20 ms")));
    assert!(matches!(&result.streams[2], StreamDifference::Description { detail, .. } if detail.contains("in cm")));

    let result = compare(&tape(&streams(), 10, |_, _, _| {}), &tape(&streams(), 7, |_, _, _| {})).unwrap();
    assert!(!result.identical && result.first.is_none() && result.samples == 14);
    assert!(matches!(
        result.streams[..],
        [StreamDifference::Length { a: 10, b: 7, .. }, _]
    ));
}
