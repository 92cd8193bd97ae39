//! Small streams for the unit tests.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use lockstep::port::{Descriptor, Element, Field};
use lockstep::time::Rational;

use super::StreamSpec;

/// A stream of `n` doubles at 1 kHz.
pub(crate) fn spec(participant: &str, port: &str, n: u32) -> StreamSpec {
    let descriptor = Descriptor {
        name: "Doubles".into(),
        size: 8 * n,
        fields: vec![Field {
            name: "v".into(),
            element: Element::F64,
            shape: vec![n],
            unit: "m".into(),
            frame: "N".into(),
            offset: 0,
            values: Vec::new(),
        }],
    };
    StreamSpec::new(participant, port, descriptor, Rational::ZERO, Rational::from_millis(1))
}

/// Stamp and payload of sample `index` of such a stream.
pub(crate) fn sample(index: u64, n: u64) -> (f64, Vec<u8>) {
    let payload = (0..n).flat_map(|i| (index as f64 * 0.5 + i as f64).to_le_bytes());
    (index as f64 / 1000.0, payload.collect())
}

/// An unused path under the temporary folder.
pub(crate) fn scratch(name: &str) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let unique = NEXT.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("recorder-{}-{unique}-{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    path
}
