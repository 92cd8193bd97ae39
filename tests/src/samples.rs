//! The content of a tape.

use std::collections::BTreeMap;
use std::path::Path;

use tape::{Reader, Records, Source};

/// The samples of each stream of a run by their stamps.
///
/// # Panics
/// When there is no tape, or when it differs from what was sealed.
pub fn samples(run: &Path) -> BTreeMap<String, BTreeMap<u64, Vec<u8>>> {
    let tape = Reader::open(run).expect("there is a tape");
    tape.verify().expect("it is what was sealed");
    let streams = tape.streams().iter().enumerate().map(|(stream, spec)| {
        let mut records = Records::new(&tape, stream);
        let mut samples = BTreeMap::new();
        while let Some(record) = records.next().expect("it can be read") {
            samples.insert(record.stamp_s.to_bits(), record.payload.to_vec());
        }
        (spec.name(), samples)
    });
    streams.collect()
}

/// Options that keep a part of a stock capture's tape.
pub const PARTIAL_RECORD: [&str; 8] = [
    "--set",
    "record.plant.truth=false",
    "--set",
    "record.plant.measured={ every = \"20 ms\", from = \"0.505 s\", to = \"2 s\" }",
    "--set",
    "record.controller={ command = { to = \"1 s\" } }",
    "--set",
    "record.guidance=true",
];
