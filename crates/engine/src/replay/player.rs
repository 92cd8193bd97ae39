//! The player: a participant that publishes again what another one published in a recorded run. As a listener it receives the
//! outputs of the participant that is replayed.
//!
//! The listener is necessary: a participant hands over its samples for the tape before it sends them to other participants. So the
//! samples that it published are on the replay's tape up to the activation in which it fails, as in the run.

use std::ffi::OsString;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

use lockstep::participant::{
    Failure, Input, Inputs, Interface, Kind, Output, Outputs, ParameterError, Participant, Setup, Step,
};
use tape::{Reader, Source};
use toml::Value;

/// The name of the player in a replay's scenario.
pub const NAME: &str = "recording";
/// How many bytes of a stream are read at once.
const CHUNK_BYTES: usize = 1 << 18;

/// How the player uses the streams on the tape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Publishes them, stamped at its activations, as a controller does.
    Sampled,
    /// Publishes them, with the first sample before the run starts, as a plant does.
    Continuous,
    /// Receives such samples as inputs.
    Listener,
}

impl Role {
    const ALL: [(&str, Role); 3] = [
        ("sampled", Role::Sampled),
        ("continuous", Role::Continuous),
        ("listener", Role::Listener),
    ];
}

/// The parameters are made by [`super::Replay`], never by a user.
pub(super) fn parameters(tape: &Path, participant: &str, ports: &[String], role: Role) -> toml::Table {
    let mut table = toml::Table::new();
    table.insert("tape".into(), path_value(tape));
    table.insert("participant".into(), Value::String(participant.into()));
    let ports = ports.iter().cloned().map(Value::String).collect();
    table.insert("ports".into(), Value::Array(ports));
    let (name, _) = Role::ALL
        .iter()
        .find(|(_, known)| *known == role)
        .expect("all are listed");
    table.insert("role".into(), Value::String((*name).into()));
    table
}

/// A path as a parameter: text, or its bytes if it is not valid text.
fn path_value(path: &Path) -> Value {
    match path.to_str() {
        Some(text) => Value::String(text.to_owned()),
        None => Value::Array(
            path.as_os_str()
                .as_bytes()
                .iter()
                .map(|&byte| i64::from(byte).into())
                .collect(),
        ),
    }
}

fn path_of(value: &Value) -> Option<PathBuf> {
    match value {
        Value::String(text) => Some(text.into()),
        Value::Array(bytes) => {
            let bytes = bytes.iter().map(|byte| u8::try_from(byte.as_integer()?).ok());
            Some(OsString::from_vec(bytes.collect::<Option<_>>()?).into())
        }
        _ => None,
    }
}

/// Makes the participant.
pub fn factory(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let missing = |key: &str| ParameterError::new(key, "missing: a recording is played by `escapement replay`");
    let text = |key: &str| {
        let value = setup.parameters.get(key).and_then(Value::as_str);
        value.ok_or_else(|| missing(key))
    };
    let tape = setup
        .parameters
        .get("tape")
        .and_then(path_of)
        .ok_or_else(|| missing("tape"))?;
    let participant = text("participant")?;
    let reader = Reader::open(&tape).map_err(|error| ParameterError::new("tape", error))?;
    let ports = setup.parameters.get("ports").and_then(Value::as_array);
    let mut tracks = Vec::new();
    for port in ports.into_iter().flatten().filter_map(Value::as_str) {
        let stream = reader.stream(&format!("{participant}.{port}"));
        let stream = stream.map_err(|error| ParameterError::new("ports", error))?;
        let stride = reader.streams()[stream].stride();
        tracks.push(Track {
            stream,
            stride,
            count: reader.count(stream),
            chunk: vec![0; (CHUNK_BYTES / stride).max(1) * stride],
            held: 0..0,
        });
    }
    let name = text("role")?;
    let role = Role::ALL.iter().find(|(known, _)| *known == name);
    let &(_, role) = role.ok_or_else(|| ParameterError::new("role", format!("`{name}` is not known")))?;
    Ok(Box::new(Player { role, reader, tracks }))
}

/// One stream of the tape, read in chunks.
struct Track {
    stream: usize,
    stride: usize,
    count: u64,
    chunk: Vec<u8>,
    /// The records that the chunk holds.
    held: std::ops::Range<u64>,
}

impl Track {
    /// The payload of record `index`; `None` after the end of the tape.
    fn payload(&mut self, reader: &Reader, index: u64) -> Result<Option<&[u8]>, Failure> {
        if index >= self.count {
            return Ok(None);
        }
        if !self.held.contains(&index) {
            let records = ((self.chunk.len() / self.stride) as u64).min(self.count - index);
            reader.read(self.stream, index, &mut self.chunk[..records as usize * self.stride])?;
            self.held = index..index + records;
        }
        let at = (index - self.held.start) as usize * self.stride;
        Ok(Some(&self.chunk[at + size_of::<f64>()..at + self.stride]))
    }
}

struct Player {
    role: Role,
    reader: Reader,
    tracks: Vec<Track>,
}

impl Player {
    /// After the end of the tape the last value is repeated: it is never read, because the replay ends before.
    fn publish(&mut self, index: u64, outputs: &mut Outputs) -> Result<(), Failure> {
        for (port, track) in self.tracks.iter_mut().enumerate() {
            if let Some(payload) = track.payload(&self.reader, index)? {
                outputs.bytes_mut(port).copy_from_slice(payload);
            }
        }
        Ok(())
    }
}

impl Participant for Player {
    fn interface(&self) -> Interface {
        let specs = self.tracks.iter().map(|track| &self.reader.streams()[track.stream]);
        if self.role == Role::Listener {
            let mut interface = Interface::new(Kind::Sampled);
            interface.inputs = specs
                .map(|spec| Input {
                    name: spec.port.clone(),
                    descriptor: spec.descriptor.clone(),
                    required: true,
                })
                .collect();
            return interface;
        }
        let mut interface = Interface::new(match self.role {
            Role::Continuous => Kind::Continuous,
            _ => Kind::Sampled,
        });
        interface.outputs = specs
            .map(|spec| Output {
                name: spec.port.clone(),
                descriptor: spec.descriptor.clone(),
            })
            .collect();
        interface
    }

    fn initialise(&mut self, _: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        match self.role {
            Role::Continuous => self.publish(0, outputs),
            Role::Sampled | Role::Listener => Ok(()),
        }
    }

    fn step(&mut self, step: &Step, _: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        match self.role {
            Role::Continuous => self.publish(step.index + 1, outputs),
            Role::Sampled => self.publish(step.index, outputs),
            Role::Listener => Ok(()),
        }
    }
}
