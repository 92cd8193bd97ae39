//! Streams, samples and measures that the tests share.
#![allow(dead_code, reason = "each test uses some of it")]

use engine::assessment::Measured;
use engine::measures::Measures;
use engine::scenario::DeclaredMeasure;
use lockstep::port::{Descriptor, Element, Field};
use lockstep::random::Stream;
use lockstep::time::Rational;
use tape::StreamSpec;

pub fn time(numerator: i128, denominator: i128) -> Rational {
    Rational::new(numerator, denominator).expect("a fraction")
}

fn field(name: &str, element: Element, shape: &[u32], unit: &str, offset: u32) -> Field {
    Field {
        name: name.into(),
        element,
        shape: shape.to_vec(),
        unit: unit.into(),
        frame: String::new(),
        offset,
        values: Vec::new(),
    }
}

/// A stream with a length in metres or millimetres, a vector, an attitude and an integer.
pub fn stream(participant: &str, length: &str, offset: Rational, period: Rational) -> StreamSpec {
    let descriptor = Descriptor {
        name: "Odd".into(),
        size: 72,
        fields: vec![
            field("x", Element::F64, &[], length, 0),
            field("v", Element::F64, &[3], "m/s", 8),
            field("q", Element::F64, &[4], "1", 32),
            field("n", Element::I32, &[], "1", 64),
            field("b", Element::U8, &[4], "1", 68),
        ],
    };
    StreamSpec::new(participant, "out", descriptor, offset, period)
}

/// A sample: the exact instant, the stamp and the numbers.
pub struct Sample {
    pub at: Rational,
    pub stamp_s: f64,
    pub x: f64,
    pub v: [f64; 3],
    pub q: [f64; 4],
    pub n: i32,
}

impl Sample {
    pub fn payload(&self) -> Vec<u8> {
        let doubles = std::iter::once(self.x).chain(self.v).chain(self.q);
        let mut bytes: Vec<u8> = doubles.flat_map(f64::to_le_bytes).collect();
        bytes.extend(self.n.to_le_bytes());
        bytes.extend([1, 0, 0, 1]);
        bytes
    }
}

/// Random numbers of one case, in a fixed order.
pub struct RandomSource(pub Stream, pub u64);

impl RandomSource {
    pub fn below(&mut self, count: u64) -> u64 {
        self.1 += 1;
        self.0.bits(self.1) % count
    }

    pub fn normal(&mut self) -> f64 {
        self.1 += 1;
        self.0.normal(self.1)
    }

    pub fn time(&mut self, most: u64) -> Rational {
        let denominator = [1, 3, 10, 30, 250, 1000][self.below(6) as usize];
        time(i128::from(self.below(most * denominator + 1)), i128::from(denominator))
    }

    pub fn samples(&mut self, spec: &StreamSpec, end: Rational) -> Vec<Sample> {
        let mut samples = Vec::new();
        for k in 0.. {
            let at = spec
                .period
                .checked_mul(k)
                .and_then(|t| t.checked_add(spec.offset))
                .unwrap();
            if at > end {
                break;
            }
            samples.push(Sample {
                at,
                stamp_s: at.seconds(),
                x: self.normal(),
                v: std::array::from_fn(|_| self.normal()),
                q: std::array::from_fn(|_| self.normal()),
                n: self.below(3) as i32,
            });
        }
        samples
    }
}

/// The measured values of the samples `streams`, passed in an order that `random` chooses; each stream in its own order.
pub fn measure_shuffled(
    declared: &[DeclaredMeasure],
    specs: &[StreamSpec],
    streams: &[Vec<Sample>],
    random: &mut RandomSource,
) -> Vec<Measured> {
    let definitions = declared.iter().map(|one| one.resolve(specs).expect("it fits"));
    let mut measures = Measures::new(definitions.collect(), specs).expect("it has a tick");
    let mut next = vec![0; streams.len()];
    // How many samples of one stream are passed in a row: from one to all of them.
    let burst = 1 + random.below(200);
    while next.iter().zip(streams).any(|(next, all)| *next < all.len()) {
        let stream = random.below(streams.len() as u64) as usize;
        for _ in 0..burst {
            let Some(sample) = streams[stream].get(next[stream]) else {
                break;
            };
            measures.sample(stream, sample.stamp_s, &sample.payload());
            next[stream] += 1;
        }
    }
    measures.finish()
}

pub fn declared(name: &str, text: &str) -> DeclaredMeasure {
    let table = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
    DeclaredMeasure::of_table(name, table).unwrap_or_else(|(key, reason)| panic!("{text}: {key}: {reason}"))
}
