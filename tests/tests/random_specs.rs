//! Any scenario value can be written as TOML and read again without a difference.

use std::path::Path;

use engine::scenario::{
    ConnectionSpec, FaultKind, FaultSpec, Frames, GuardSpec, MeasureKind, MeasureSpec, OnFailureSpec, ParticipantSpec,
    RecordPart, RecordSpec, RunSpec, ScenarioSpec, State, ThroughKind, Time,
};
use lockstep::link::Hold;
use lockstep::random::Stream;
use toml::{Table, Value};

/// Consecutive random samples for one scenario.
struct Rng(Stream, u64);

impl Rng {
    fn below(&mut self, count: u64) -> u64 {
        self.1 += 1;
        self.0.bits(self.1) % count
    }

    fn maybe<T>(&mut self, make: impl FnOnce(&mut Rng) -> T) -> Option<T> {
        (self.below(2) == 0).then(|| make(self))
    }

    fn time(&mut self) -> Time {
        match self.below(5) {
            0 => "30 Hz".into(),
            1 => "1/300 s".into(),
            2 => "0.25s".into(),
            3 => "1.5e-3 s".into(),
            _ => format!("{} us", self.below(1_000_000)).into(),
        }
    }

    /// A name, possibly one that TOML must quote.
    fn name(&mut self) -> String {
        let odd = ["a", "b-2", "with space", "quo\"te", "ü", "x_1"];
        format!("{}{}", odd[self.below(6) as usize], self.below(1000))
    }

    fn number(&mut self) -> f64 {
        let odd = [0.0, -0.0, 1e-300, 0.1, f64::MAX, -2.5e17];
        odd[self.below(6) as usize]
    }

    fn value(&mut self, depth: u64) -> Value {
        match self.below(if depth == 0 { 5 } else { 7 }) {
            0 => Value::Integer(self.below(1 << 62) as i64 - (1 << 61)),
            1 => Value::Float(self.number()),
            2 => Value::Boolean(self.below(2) == 0),
            3 => Value::String("[1, 2] N m".into()),
            4 => Value::String("line\nand \"quotes\" \\ \u{1}".into()),
            5 => Value::Array((0..self.below(4)).map(|_| self.value(depth - 1)).collect()),
            _ => Value::Table(self.table(depth - 1)),
        }
    }

    fn table(&mut self, depth: u64) -> Table {
        (0..self.below(4)).map(|_| (self.name(), self.value(depth))).collect()
    }

    fn run(&mut self) -> RunSpec {
        match self.below(4) {
            0 => RunSpec::builtin(&self.name()),
            1 => RunSpec::exe("./a b", ["-x".to_owned(), self.name()]),
            2 => RunSpec {
                participant: self.maybe(Rng::name),
                ..RunSpec::library("./x.so")
            },
            _ => RunSpec {
                ports: self.maybe(|rng| rng.value(2)),
                feedthrough: self.maybe(|rng| rng.value(1)),
                tolerance: self.maybe(|rng| rng.value(0)),
                ..RunSpec::fmu("x.fmu")
            },
        }
    }

    fn connection(&mut self) -> ConnectionSpec {
        let mut connection = ConnectionSpec::new(&self.name(), &self.name())
            .delay(self.time())
            .jitter(self.time())
            .dropping(self.number())
            .hold([Hold::Last, Hold::Initial, Hold::Linear][self.below(3) as usize])
            .initial(self.value(2));
        if self.below(2) == 0 {
            connection = connection.and_to("x.y");
        }
        connection.map = self.maybe(|rng| rng.value(2));
        connection.factor = self.maybe(|rng| rng.value(1));
        connection.offset = self.maybe(|rng| rng.value(1));
        connection.sum = self.below(2) == 0;
        connection.frames = self.maybe(|rng| if rng.below(2) == 0 { Frames::Same } else { Frames::Any });
        connection
    }

    fn fault(&mut self) -> FaultSpec {
        FaultSpec {
            name: self.maybe(Rng::name),
            at: self.time(),
            until: self.maybe(Rng::time),
            input: self.maybe(Rng::name),
            output: self.maybe(Rng::name),
            field: self.maybe(Rng::name),
            kind: self.maybe(|rng| [FaultKind::BitFlip, FaultKind::Stuck][rng.below(2) as usize]),
            value: self.maybe(|rng| rng.value(1)),
            bit: self.maybe(|rng| rng.below(64) as u32),
            probability: self.maybe(Rng::number),
            connection: self.maybe(Rng::name),
            drop: self.maybe(Rng::number),
            extra_delay: self.maybe(Rng::time),
            substitute: self.maybe(Rng::name),
            run: self.maybe(Rng::run),
            parameters: self.maybe(|rng| rng.table(2)),
            state: self.maybe(|rng| [State::Cold, State::Keep][rng.below(2) as usize]),
        }
    }

    fn measure(&mut self) -> MeasureSpec {
        MeasureSpec {
            of: self.name(),
            is: self.maybe(|rng| rng.value(0)),
            minus: self.maybe(Rng::name),
            through: self.maybe(|rng| [ThroughKind::Norm, ThroughKind::Angle][rng.below(2) as usize]),
            compute: [MeasureKind::TimeAbove, MeasureKind::Percentile, MeasureKind::Rms][self.below(3) as usize],
            from: self.maybe(Rng::time),
            to: self.maybe(Rng::time),
            at: self.maybe(Rng::time),
            threshold: self.maybe(|rng| rng.value(1)),
            band: self.maybe(|rng| rng.value(1)),
            percent: self.maybe(Rng::number),
            unit: self.maybe(Rng::name),
            at_most: self.maybe(|rng| rng.value(0)),
            at_least: self.maybe(|rng| rng.value(0)),
            within: self.maybe(|rng| rng.value(1)),
        }
    }

    fn record(&mut self) -> RecordSpec {
        match self.below(3) {
            0 => RecordSpec::Whole,
            1 => RecordSpec::Nothing,
            _ => RecordSpec::Part(RecordPart {
                every: self.maybe(Rng::time),
                from: self.maybe(Rng::time),
                to: self.maybe(Rng::time),
            }),
        }
    }

    fn spec(&mut self) -> ScenarioSpec {
        let mut spec = ScenarioSpec::new(self.time()).title("a \"title\"\nin two lines");
        spec.seed = if self.below(2) == 0 {
            self.below(9)
        } else {
            u64::MAX - self.below(9)
        };
        spec.folder = self.maybe(Rng::name);
        spec.inputs = (0..self.below(3)).map(|_| self.name()).collect();
        for _ in 0..self.below(4) {
            let mut participant = ParticipantSpec::new(self.run()).every(self.time()).offset(self.time());
            participant.parameters = self.table(3);
            participant.start_within = self.maybe(Rng::time);
            participant.on_failure = match self.below(3) {
                0 => OnFailureSpec::Stop,
                1 => OnFailureSpec::RestartFromCheckpoint,
                _ => OnFailureSpec::Substitute(Box::new(self.run())),
            };
            spec.participants.insert(self.name(), participant);
        }
        for _ in 0..self.below(4) {
            spec.connections.insert(self.name(), self.connection());
        }
        spec.faults = (0..self.below(4)).map(|_| self.fault()).collect();
        for _ in 0..self.below(3) {
            let guard = GuardSpec {
                output: self.name(),
                field: self.maybe(Rng::name),
                range: self.maybe(|rng| rng.value(1)),
                never: self.maybe(|rng| rng.value(1)),
                frozen_for: self.maybe(Rng::time),
            };
            spec.guards.insert(self.name(), guard);
            spec.measures.insert(self.name(), self.measure());
        }
        for table in [
            &mut spec.assessment,
            &mut spec.report,
            &mut spec.scene,
            &mut spec.campaign,
        ] {
            *table = self.maybe(|rng| rng.table(2));
        }
        for number in 0..self.below(4) {
            // A part is a part of a stream.
            let (of, part) = match self.below(3) {
                0 => (format!("p{number}"), RecordSpec::Nothing),
                1 => (format!("p{number}.out"), self.record()),
                _ => (format!("p{number}.seen.in"), self.record()),
            };
            spec.record.insert(of, part);
        }
        spec
    }
}

#[test]
fn any_scenario_is_written_and_read_again() {
    for seed in 0..500 {
        let spec = Rng(Stream::new(seed, "specs"), 0).spec();
        let text = spec.to_text();
        let again =
            ScenarioSpec::of_text(Path::new("any.toml"), &text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!(again, spec, "seed {seed}:\n{text}");
        assert_eq!(again.to_text(), text, "seed {seed}");
        // What was written is equal to the original.
        let mut changed = again;
        changed.set("title", spec.title.clone()).unwrap();
        assert_eq!(changed, spec, "seed {seed}");
    }
}
