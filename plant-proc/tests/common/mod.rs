//! The stock scenarios in one loop, from their own files.
#![allow(dead_code)] // each test binary uses its part

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use lockstep::executor::{InLoop, connect_locally};
use lockstep::link::Timing;
use lockstep::participant::{ParameterError, Participant, Setup};
use lockstep::plan::{Initial, LinkSpec, ParticipantSpec, Plan};
use lockstep::port::Descriptor;
use lockstep::time::Rational;
use lockstep::transport::{Header, Recording, TransportError};
use toml::{Table, Value};

pub fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios")
}

/// A scenario with file names replaced by the files' contents.
pub fn load(name: &str) -> Table {
    let folder = scenarios();
    let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
    let mut table: Table = toml::from_str(&text).unwrap();
    table.iter_mut().for_each(|(_, value)| fill(value, &folder));
    table
}

fn fill(value: &mut Value, folder: &Path) {
    let Value::Table(table) = value else {
        return;
    };
    if let (1, Some(Value::String(file))) = (table.len(), table.get("file")) {
        let text = std::fs::read_to_string(folder.join(file)).unwrap();
        *value = if file.ends_with(".toml") {
            Value::Table(toml::from_str(&text).unwrap())
        } else {
            Value::String(text)
        };
        return;
    }
    table.iter_mut().for_each(|(_, value)| fill(value, folder));
}

fn text<'a>(value: &'a Value, key: &str) -> Option<&'a str> {
    value.get(key).and_then(Value::as_str)
}

fn time(text: Option<&str>) -> Rational {
    text.map_or(Rational::ZERO, |text| text.parse().unwrap())
}

/// A participant of a scenario, with its setup.
pub fn make(scenario: &Table, name: &str) -> (Setup, Box<dyn Participant>) {
    try_make(scenario, name).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The same, or the error.
pub fn try_make(scenario: &Table, name: &str) -> Result<(Setup, Box<dyn Participant>), ParameterError> {
    let own = &scenario["participants"][name];
    let factory: fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> =
        match text(&own["run"], "builtin").unwrap() {
            "plant" => plant_proc::factory,
            "controller" => controller_proc::factory,
            "guidance" => guidance_proc::factory,
            other => panic!("`{other}` is not a stock participant"),
        };
    let setup = Setup {
        name: name.to_owned(),
        parameters: own["parameters"].as_table().unwrap().clone(),
        seed: scenario["seed"].as_integer().unwrap() as u64,
        period: time(text(own, "period")).seconds(),
        offset: time(text(own, "offset")).seconds(),
    };
    factory(&setup).map(|participant| (setup, participant))
}

/// Every output of a run.
pub struct Tape {
    pub streams: Vec<(String, Descriptor)>,
    pub samples: Vec<Vec<Sample>>,
}

impl Tape {
    /// The samples of `participant.port`: stamp, s, and element `index` of `field`.
    pub fn series(&self, stream: &str, field: &str, index: usize) -> Vec<(f64, f64)> {
        let number = self.streams.iter().position(|(name, _)| name == stream).unwrap();
        let field = self.streams[number].1.field(field).unwrap();
        let samples = self.samples[number].iter();
        samples
            .map(|(stamp, payload)| (*stamp, field.value(payload, index)))
            .collect()
    }

    /// The value at an instant.
    pub fn at(&self, stream: &str, field: &str, index: usize, t: f64) -> f64 {
        let series = self.series(stream, field, index);
        series.iter().find(|(stamp, _)| (stamp - t).abs() < 1e-9).unwrap().1
    }

    /// The largest absolute value of any element.
    pub fn peak(&self, stream: &str, field: &str) -> f64 {
        let number = self.streams.iter().position(|(name, _)| name == stream).unwrap();
        let count = self.streams[number].1.field(field).unwrap().len();
        let all = (0..count).flat_map(|index| self.series(stream, field, index));
        all.map(|(_, value)| value.abs()).fold(0.0, f64::max)
    }
}

/// Stamp, s, and payload.
type Sample = (f64, Vec<u8>);

#[derive(Clone)]
struct Sink {
    samples: Arc<Mutex<Vec<Vec<Sample>>>>,
    timebase: lockstep::time::Timebase,
}

impl Recording for Sink {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        let stamp = self.timebase.seconds(header.stamp);
        self.samples.lock().unwrap()[stream as usize].push((stamp, payload.to_vec()));
        Ok(true)
    }
}

/// A scenario in one loop, before its first step.
pub struct Begun {
    pub looped: InLoop,
    pub plan: Plan,
    sink: Sink,
}

impl Begun {
    /// Everything so far.
    pub fn tape(self) -> Tape {
        let streams = self.plan.participants.iter().flat_map(|own| {
            let outputs = own.interface.outputs.iter();
            outputs.map(|port| (format!("{}.{}", own.name, port.name), port.descriptor.clone()))
        });
        let samples = std::mem::take(&mut *self.sink.samples.lock().unwrap());
        Tape {
            streams: streams.collect(),
            samples,
        }
    }
}

/// Runs a scenario in one loop.
pub fn run(scenario: &Table) -> Tape {
    let mut begun = begin(scenario);
    begun.looped.run_to(begun.plan.end, |_| {}).unwrap();
    begun.tape()
}

/// Begins it.
pub fn begin(scenario: &Table) -> Begun {
    let names: Vec<&String> = scenario["participants"].as_table().unwrap().keys().collect();
    let made: Vec<_> = names.iter().map(|name| make(scenario, name)).collect();
    let specs = names.iter().zip(&made).map(|(name, (_, participant))| ParticipantSpec {
        name: (*name).clone(),
        period: time(text(&scenario["participants"][name.as_str()], "period")),
        offset: time(text(&scenario["participants"][name.as_str()], "offset")),
        interface: participant.interface(),
    });
    let plan = Plan::build(
        specs.collect(),
        &links(scenario),
        time(scenario["duration"].as_str()),
        1,
    )
    .unwrap();
    let sink = Sink {
        samples: Arc::new(Mutex::new(vec![Vec::new(); plan.stream_count()])),
        timebase: plan.timebase,
    };
    let participants = made.into_iter().map(|(_, participant)| participant).collect();
    let parts = connect_locally(&plan, participants, |_| Box::new(sink.clone()));
    Begun {
        looped: InLoop::new(&plan, parts),
        plan,
        sink,
    }
}

/// The links of a scenario.
pub fn links(scenario: &Table) -> Vec<LinkSpec> {
    let end = |name: &str| {
        let (participant, port) = name.split_once('.').unwrap();
        (participant.to_owned(), port.to_owned())
    };
    let connections = scenario["connections"].as_table().unwrap().iter();
    let links = connections.flat_map(|(name, connection)| {
        let to: Vec<&str> = match &connection["to"] {
            Value::String(one) => vec![one],
            Value::Array(all) => all.iter().map(|one| one.as_str().unwrap()).collect(),
            other => panic!("{other}"),
        };
        let specs = to.into_iter().enumerate().map(|(at, to)| LinkSpec {
            faults: Vec::new(),
            name: format!("{name}{at}"),
            from: end(text(connection, "from").unwrap()),
            to: end(to),
            timing: Timing {
                delay: time(text(connection, "delay")),
                ..Timing::default()
            },
            initial: (text(connection, "initial") == Some("first-sample")).then_some(Initial::FirstSample),
            conversion: None,
            random_stream: None,
        });
        specs.collect::<Vec<_>>()
    });
    links.collect()
}
