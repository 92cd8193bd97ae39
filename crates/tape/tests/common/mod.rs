//! Streams and samples for the tests.
#![allow(dead_code, reason = "every test program uses a part of it")]

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use lockstep::port::{Descriptor, Element, Field};
use lockstep::time::{Rational, SampleTime, Timebase};
use tape::StreamSpec;

/// A folder of its own, removed at the end of the test.
pub(crate) struct TempFolder(pub(crate) PathBuf);

impl TempFolder {
    /// A path where nothing is yet.
    pub(crate) fn new(name: &str) -> TempFolder {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let unique = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("recorder-{name}-{}-{unique}", std::process::id()));
        std::fs::create_dir(&path).unwrap();
        TempFolder(path)
    }

    pub(crate) fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for TempFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub(crate) fn field(name: &str, element: Element, shape: &[u32], unit: &str, offset: u32) -> Field {
    Field {
        name: name.into(),
        element,
        shape: shape.to_vec(),
        unit: unit.into(),
        frame: if shape == [3] { "N".into() } else { String::new() },
        offset,
        values: Vec::new(),
    }
}

/// A position, a counter and a flag with its padding: 48 bytes.
pub(crate) fn pose() -> Descriptor {
    Descriptor {
        name: "Pose".into(),
        size: 48,
        fields: vec![
            field("p_NB_N", Element::F64, &[3], "m", 0),
            field("count", Element::U64, &[], "1", 24),
            field("scale", Element::F32, &[2], "N m", 32),
            field("flag", Element::U8, &[], "1", 40),
            field("padding", Element::U8, &[7], "1", 41),
        ],
    }
}

/// One double.
pub(crate) fn scalar() -> Descriptor {
    Descriptor {
        name: "Scalar".into(),
        size: 8,
        fields: vec![field("x", Element::F64, &[], "rad", 0)],
    }
}

pub(crate) fn spec(participant: &str, port: &str, descriptor: Descriptor, offset: &str, period: &str) -> StreamSpec {
    StreamSpec::new(
        participant,
        port,
        descriptor,
        offset.parse().unwrap(),
        period.parse().unwrap(),
    )
}

/// The exact stamp of sample `index`, s.
pub(crate) fn stamp(spec: &StreamSpec, index: u64) -> f64 {
    let base = Timebase::from_times([spec.offset, spec.period, Rational::from_millis(1)]).unwrap();
    let time = SampleTime {
        offset: base.ceil(spec.offset).unwrap(),
        period: base.ceil(spec.period).unwrap(),
    };
    base.seconds(time.instant(index))
}

/// A payload that depends on stream and index in every byte.
pub(crate) fn payload(spec: &StreamSpec, index: u64) -> Vec<u8> {
    let seed = spec
        .name()
        .bytes()
        .fold(index, |x, b| x.wrapping_mul(31).wrapping_add(u64::from(b)));
    (0..u64::from(spec.descriptor.size))
        .map(|at| {
            (seed
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .wrapping_add(at.wrapping_mul(0x517c_c1b7))
                >> 24) as u8
        })
        .collect()
}
