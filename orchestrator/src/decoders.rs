//! Decoders of untrusted bytes, each as a plain function of the bytes that must return for any input.
//!
//! `fuzz/` feeds them with libFuzzer; the test below feeds them the inputs in `fuzz/corpus`. A function may reject any
//! input. It must not panic, hang or allocate without bound, and the input that it accepts must satisfy the assertions
//! here.

use crate::catalogue::catalogue;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lockstep::control::{ParticipantEvent, Reply, Request};
use lockstep::participant::{Interface, Setup};
use lockstep::time::Rational;
use lockstep::transport::TransportError;
use lockstep::transport::iceoryx::{Address, unpack};
use lockstep::{units, wire};
use multibody::Description;
use tape::compare::compare;
use tape::{Reader, Source};
use toml::{Table, Value};

use engine::run::checkpoint::Checkpoint;
use engine::scenario::Scenario;

/// Reads arbitrary bytes.
pub type Decode = fn(&[u8]);

/// The functions by name: the names of the targets and of the folders of the corpus.
pub const ALL: [(&str, Decode); 12] = [
    ("scenario", scenario),
    ("urdf", urdf),
    ("control", control),
    ("record", record),
    ("checkpoint", checkpoint),
    ("tape", tape),
    ("gains", gains),
    ("units", units),
    ("descriptor", descriptor),
    ("fmu", fmu),
    ("description", description),
    ("ssp", ssp),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A scenario file, up to its plan. Programs are looked up, but not started.
pub fn scenario(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let file = root().join("scenarios/fuzzed.toml");
    match Scenario::read_text(catalogue(), &file, text) {
        Ok(scenario) => {
            let unknown = vec![None; scenario.participants.len()];
            if let Err(error) = scenario.assumed_plan(&unknown) {
                assert!(!error.to_string().is_empty());
            }
        }
        Err(error) => assert!(error.to_string().contains("fuzzed.toml"), "{error}"),
    }
}

/// A file with an FMU: the archive, every file in it, and its description.
pub fn fmu(bytes: &[u8]) {
    let Ok(archive) = fmu::Archive::read(bytes.to_vec()) else {
        return;
    };
    let mut total = 0;
    for entry in archive.entries() {
        total += entry.size;
        assert!(!entry.name.starts_with('/') && !entry.name.split('/').any(|part| part == ".."));
        // The sizes in the directory may be false; they bound what is unpacked.
        if entry.size < 1 << 22
            && let Some(Ok(contents)) = archive.file(&entry.name)
        {
            assert_eq!(contents.len() as u64, entry.size);
            if entry.name == "modelDescription.xml" {
                description(&contents);
            }
        }
    }
    assert!(total <= fmu::UNPACKED_MAX);
}

/// The description of an FMU.
pub fn description(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match fmu::Description::read(text) {
        Ok(description) => fmu::check_description(&description),
        Err(error) => assert!(error.to_string().contains("modelDescription.xml")),
    }
}

/// The files of a system structure with its FMU, separated by lines of three dashes: description, parameters and their
/// mapping, and a description that the first one may refer to.
pub fn ssp(bytes: &[u8]) {
    const NAMES: [&str; 4] = ["SystemStructure.ssd", "a.ssv", "a.ssm", "b.ssd"];
    let mut files = BTreeMap::from([(
        "a.fmu".to_owned(),
        include_bytes!("../../fuzz/corpus/fmu/pair.fmu").to_vec(),
    )]);
    let parts = split_files(bytes).into_iter().map(<[u8]>::to_vec);
    files.extend(NAMES.map(str::to_owned).into_iter().zip(parts));
    let package = ssp::Package::Files(files);
    match ssp::import_package(Path::new("fuzzed.ssp"), &package, ssp::Options::default()) {
        Ok(imported) => {
            let scenario: Result<Table, _> = imported.scenario.parse();
            assert!(scenario.is_ok(), "{scenario:?}\n{}", imported.scenario);
        }
        Err(error) => assert!(error.to_string().contains("fuzzed.ssp"), "{error}"),
    }
}

/// Files in one input, separated by lines of three dashes.
fn split_files(bytes: &[u8]) -> Vec<&[u8]> {
    const SEPARATOR: &[u8] = b"\n---\n";
    let mut parts = Vec::new();
    let mut rest = bytes;
    while let Some(at) = rest.windows(SEPARATOR.len()).position(|part| part == SEPARATOR) {
        parts.push(&rest[..at]);
        rest = &rest[at + SEPARATOR.len()..];
    }
    parts.push(rest);
    parts
}

/// A mechanism in URDF.
pub fn urdf(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(description) = Description::from_urdf(text) {
        // The result is valid, or the input is rejected.
        let _ = description.validate();
    }
}

/// Control messages, addresses, and a participant's description of its ports.
pub fn control(bytes: &[u8]) {
    if let Ok(request) = wire::decode::<Request>("a request", bytes) {
        assert_eq!(wire::encode("a request", &request).as_deref(), Ok(bytes));
    }
    if let Ok(Reply::Described { interface }) = wire::decode::<Reply>("a reply", bytes) {
        check(&interface);
    }
    let _ = wire::decode::<ParticipantEvent>("a participant event", bytes);
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = text.parse::<Address>();
        let _ = text.parse::<Rational>();
    }
}

/// A participant's description of its ports in JSON, as in the index of a tape.
pub fn descriptor(bytes: &[u8]) {
    if let Ok(interface) = serde_json::from_slice::<Interface>(bytes) {
        check(&interface);
    }
}

fn check(interface: &Interface) {
    if interface.validate().is_err() {
        return;
    }
    assert_eq!(interface.difference(interface), None);
    let ports = interface.outputs.iter().map(|port| &port.descriptor);
    for descriptor in ports.chain(interface.inputs.iter().map(|port| &port.descriptor)) {
        let payload = vec![0x7f; descriptor.size as usize];
        for field in &descriptor.fields {
            assert!(field.range().end <= payload.len());
            let last = field.len() - 1;
            let _ = (field.value(&payload, last), field.element_name(last));
            let _ = field.shown(&payload, last);
        }
        descriptor
            .invalid(&payload)
            .for_each(|invalid| drop(invalid.describe("it")));
        assert_eq!(descriptor.hash64(), descriptor.clone().hash64());
    }
}

/// A record of samples and notes.
pub fn record(bytes: &[u8]) {
    let mut entries = 0;
    let words: Vec<u64> = bytes
        .as_chunks::<8>()
        .0
        .iter()
        .map(|word| u64::from_le_bytes(*word))
        .collect();
    let result: Result<usize, TransportError> = unpack(&words, |_| {
        entries += 1;
        Ok(())
    });
    assert!(entries <= bytes.len() / 32, "an entry has 32 bytes at least");
    match result {
        Ok(used) => assert!(used <= words.len()),
        Err(broken) => assert!(!broken.0.is_empty()),
    }
}

/// A checkpoint file, and its content without the checksum, which rejects most inputs.
pub fn checkpoint(bytes: &[u8]) {
    if let Ok(checkpoint) = Checkpoint::decode(Path::new("fuzzed.checkpoint"), bytes) {
        assert_eq!(checkpoint.encode().as_deref().ok(), Some(bytes));
    }
    let _ = wire::decode::<Checkpoint>("a checkpoint", bytes);
}

/// A tape: index, a stream called `a.b`, and events, separated by lines of three dashes.
pub fn tape(bytes: &[u8]) {
    let folder = std::env::temp_dir().join(format!("escapement-tape-{}", std::process::id()));
    let parts = split_files(bytes);
    let write = || -> std::io::Result<()> {
        std::fs::create_dir_all(&folder)?;
        for (number, name) in ["index.json", "a.b.bin", "events.jsonl", "seal.json"]
            .iter()
            .enumerate()
        {
            match parts.get(number) {
                Some(part) => std::fs::write(folder.join(name), part)?,
                None => drop(std::fs::remove_file(folder.join(name))),
            }
        }
        Ok(())
    };
    if write().is_ok()
        && let Ok(reader) = Reader::open(&folder)
    {
        for (stream, spec) in reader.streams().iter().enumerate() {
            let mut record = vec![0; spec.stride()];
            let count = reader.count(stream);
            for index in [0, count / 2, count.saturating_sub(1), count] {
                let _ = reader.read(stream, index, &mut record);
            }
        }
        let _ = (reader.events(), reader.incomplete_records().len());
        if let Ok(comparison) = compare(&reader, &reader) {
            assert!(comparison.identical, "a tape is equal to itself");
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
}

/// A file with gains, read in the controller's parameters.
pub fn gains(bytes: &[u8]) {
    static STOCK: OnceLock<Table> = OnceLock::new();
    let stock = STOCK.get_or_init(|| {
        let read = |name: &str| std::fs::read_to_string(root().join("models").join(name)).unwrap_or_default();
        let mut stock = Table::new();
        stock.insert("urdf".into(), Value::String(read("servicer.urdf")));
        let servicer = read("servicer.toml").parse::<Table>().unwrap_or_default();
        stock.insert("servicer".into(), Value::Table(servicer));
        stock
    });
    let Some(gains) = std::str::from_utf8(bytes)
        .ok()
        .and_then(|text| text.parse::<Table>().ok())
    else {
        return;
    };
    let mut parameters = stock.clone();
    parameters.insert("gains".into(), Value::Table(gains));
    let setup = Setup {
        name: "controller".into(),
        parameters,
        seed: 1,
        period: 0.01,
        offset: 0.0,
    };
    if let Err(error) = controller_proc::factory(&setup) {
        assert!(!error.reason.is_empty());
    }
}

/// Quantities and times in the user's notation, and faults of the command line.
pub fn units(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let (unit, value) = text.split_once('|').unwrap_or(("rad", text));
    if let Ok((numbers, _)) = units::convert(value, unit) {
        assert!(numbers.iter().all(|number| number.is_finite()));
    }
    let table = Table::from_iter([("value".to_owned(), Value::String(text.to_owned()))]);
    let _ = units::read::<AnyQuantity>(&table);
    if let Ok(time) = text.parse::<Rational>() {
        assert_eq!(time.to_string().parse(), Ok(time), "{text}");
    }
    let _ = text.parse::<engine::scenario::FaultSpec>();
}

/// One quantity of every shape.
#[derive(serde::Deserialize)]
#[serde(untagged)]
#[allow(dead_code, reason = "only the reading of it matters")]
enum AnyQuantity {
    Angle(units::Quantity<units::Angle>),
    Speed(units::Vector<units::Speed, 3>),
    Torque(units::PerAxis<units::Torque, 7>),
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::random::Stream;

    /// `bytes` with a few changes derived from `round`: flipped bits, and ranges removed, repeated or taken from `other`.
    fn mutated(bytes: &[u8], other: &[u8], draws: &Stream, round: u64) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        let draw = |number: u64, of: usize| (draws.bits(64 * round + number) % of.max(1) as u64) as usize;
        for change in 0..=draw(0, 4) as u64 {
            let at = draw(8 * change + 1, bytes.len());
            let to = (at + draw(8 * change + 2, 24)).min(bytes.len());
            match draw(8 * change + 3, 5) {
                0 if at < bytes.len() => bytes[at] ^= 1 << draw(8 * change + 4, 8),
                1 if at < bytes.len() => bytes[at] = draw(8 * change + 4, 256) as u8,
                2 => drop(bytes.drain(at..to)),
                3 => {
                    let again = bytes[at..to].to_vec();
                    bytes.splice(at..at, again);
                }
                _ => {
                    let from = draw(8 * change + 5, other.len());
                    let end = (from + draw(8 * change + 6, 40)).min(other.len());
                    bytes.splice(at..at, other[from..end].iter().copied());
                }
            }
        }
        bytes
    }

    /// The decoders also survive random changes of the corpus. `ESCAPEMENT_MUTATIONS` is the number of changed versions of
    /// each input.
    #[test]
    fn decoders_return_for_mutated_corpus() {
        let rounds = std::env::var("ESCAPEMENT_MUTATIONS").ok();
        let rounds: u64 = rounds.and_then(|rounds| rounds.parse().ok()).unwrap_or(60);
        for (name, decode) in ALL {
            let folder = root().join("fuzz/corpus").join(name);
            let mut paths: Vec<PathBuf> = std::fs::read_dir(&folder)
                .expect("there is a corpus")
                .map(|entry| entry.expect("the corpus can be listed").path())
                .collect();
            paths.sort();
            let corpus: Vec<Vec<u8>> = paths.iter().map(|path| std::fs::read(path).unwrap()).collect();
            for (number, bytes) in corpus.iter().enumerate() {
                let draws = Stream::new(number as u64, name);
                for round in 0..rounds {
                    let other = &corpus[draws.bits(64 * round + 63) as usize % corpus.len()];
                    let changed = mutated(bytes, other, &draws, round);
                    let survived = std::panic::catch_unwind(|| decode(&changed));
                    assert!(
                        survived.is_ok(),
                        "{name}: round {round} of {} is not survived:\n{}",
                        paths[number].display(),
                        changed.escape_ascii()
                    );
                }
            }
        }
    }

    /// All inputs of the corpus, including crashes that were found.
    #[test]
    fn decoders_return_for_corpus() {
        for (name, decode) in ALL {
            let folder = root().join("fuzz/corpus").join(name);
            let entries = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
            let mut count = 0;
            for entry in entries {
                let path = entry.expect("the corpus can be listed").path();
                let bytes = std::fs::read(&path).expect("the corpus can be read");
                let survived = std::panic::catch_unwind(|| decode(&bytes));
                assert!(survived.is_ok(), "{} is not survived", path.display());
                // And truncated versions of them.
                for at in (0..bytes.len()).step_by((bytes.len() / 16).max(1)) {
                    let survived = std::panic::catch_unwind(|| decode(&bytes[..at]));
                    assert!(
                        survived.is_ok(),
                        "the first {at} bytes of {} are not survived",
                        path.display()
                    );
                }
                count += 1;
            }
            assert!(count > 0, "{} is empty", folder.display());
        }
    }
}
