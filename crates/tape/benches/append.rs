//! How fast samples get onto a tape, in bytes per second of one core: a plant's 600 bytes and a small message's 200, to a
//! file, to memory and to the bare hash.

use std::fs;
use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use lockstep::port::{Descriptor, Element, Field};
use lockstep::time::Rational;
use tape::{DigestSink, Sink, StreamSpec, Writer};

fn stream(doubles: u32) -> StreamSpec {
    let descriptor = Descriptor {
        name: "Doubles".into(),
        size: 8 * doubles,
        fields: vec![Field {
            name: "v".into(),
            element: Element::F64,
            shape: vec![doubles],
            unit: "1".into(),
            frame: String::new(),
            offset: 0,
            values: Vec::new(),
        }],
    };
    StreamSpec::new("plant", "truth", descriptor, Rational::ZERO, Rational::from_millis(1))
}

/// 32 MiB of samples.
fn fill(sink: &mut dyn Sink, payload: &[u8]) -> u64 {
    let samples = (32 << 20) / payload.len() as u64;
    for k in 0..samples {
        sink.sample(0, k, k as f64 / 1000.0, black_box(payload))
            .expect("there is space");
    }
    samples
}

fn benches(c: &mut Criterion) {
    let dir = std::env::temp_dir().join(format!("recorder-bench-{}", std::process::id()));
    for doubles in [25, 75] {
        let payload: Vec<u8> = (0..8 * doubles).map(|at| (at * 37 % 251) as u8).collect();
        let mut group = c.benchmark_group(format!("append {} bytes", payload.len()));
        group.throughput(Throughput::Bytes(32 << 20)).sample_size(10);
        group.bench_function("file", |b| {
            b.iter_batched(
                || {
                    let _ = fs::remove_dir_all(&dir);
                    Writer::create(&dir, vec![stream(doubles)]).expect("the temporary folder can be written")
                },
                |mut writer| {
                    fill(&mut writer, &payload);
                    writer.finish().expect("there is space")
                },
                BatchSize::PerIteration,
            );
        });
        group.bench_function("hash only", |b| {
            b.iter(|| {
                let mut sink = DigestSink::new(vec![stream(doubles)]).expect("the stream is sound");
                fill(&mut sink, &payload);
                sink.digest()
            });
        });
        group.finish();
    }
    let _ = fs::remove_dir_all(&dir);
}

criterion_group!(append, benches);
criterion_main!(append);
