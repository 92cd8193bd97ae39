//! Measures over random tapes against a plain computation over the whole of them, and in any order in which streams arrive.

use engine::assessment::Measured;
use engine::measures::Measures;
use engine::scenario::DeclaredMeasure;
use lockstep::port::{Descriptor, Element, Field};
use lockstep::random::Stream;
use lockstep::time::Rational;
use tape::StreamSpec;

const CASES: u64 = 300;

fn time(numerator: i128, denominator: i128) -> Rational {
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
    }
}

/// A stream with a length in metres or millimetres, a vector, an attitude and an integer.
fn stream(participant: &str, length: &str, offset: Rational, period: Rational) -> StreamSpec {
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
struct Sample {
    at: Rational,
    stamp_s: f64,
    x: f64,
    v: [f64; 3],
    q: [f64; 4],
    n: i32,
}

impl Sample {
    fn payload(&self) -> Vec<u8> {
        let doubles = std::iter::once(self.x).chain(self.v).chain(self.q);
        let mut bytes: Vec<u8> = doubles.flat_map(f64::to_le_bytes).collect();
        bytes.extend(self.n.to_le_bytes());
        bytes.extend([1, 0, 0, 1]);
        bytes
    }
}

/// Draws of one case, one after the other.
struct Dice(Stream, u64);

impl Dice {
    fn below(&mut self, count: u64) -> u64 {
        self.1 += 1;
        self.0.bits(self.1) % count
    }

    fn normal(&mut self) -> f64 {
        self.1 += 1;
        self.0.normal(self.1)
    }

    fn time(&mut self, most: u64) -> Rational {
        let denominator = [1, 3, 10, 30, 250, 1000][self.below(6) as usize];
        time(i128::from(self.below(most * denominator + 1)), i128::from(denominator))
    }

    fn samples(&mut self, spec: &StreamSpec, end: Rational) -> Vec<Sample> {
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

/// The samples `streams` in an order that `dice` chooses; each stream in its own order.
fn fed(declared: &[DeclaredMeasure], specs: &[StreamSpec], streams: &[Vec<Sample>], dice: &mut Dice) -> Vec<Measured> {
    let definitions = declared.iter().map(|one| one.resolve(specs).expect("it fits"));
    let mut measures = Measures::new(definitions.collect(), specs).expect("it has a tick");
    let mut next = vec![0; streams.len()];
    // How long one stream is served before the other has its turn: from sample by sample to all at once.
    let bout = 1 + dice.below(200);
    while next.iter().zip(streams).any(|(next, all)| *next < all.len()) {
        let stream = dice.below(streams.len() as u64) as usize;
        for _ in 0..bout {
            let Some(sample) = streams[stream].get(next[stream]) else {
                break;
            };
            measures.sample(stream, sample.stamp_s, &sample.payload());
            next[stream] += 1;
        }
    }
    measures.finish()
}

/// One measure in TOML, with the figure by a plain computation over values and instants of the window.
type Reference = (&'static str, fn(&[f64], &[f64], f64) -> Option<f64>);

const SCALAR: [Reference; 16] = [
    ("compute = 'min'", |x, _, _| x.iter().copied().reduce(f64::min)),
    ("compute = 'max'", |x, _, _| x.iter().copied().reduce(f64::max)),
    ("compute = 'max-abs'", |x, _, _| {
        x.iter().map(|x| x.abs()).reduce(f64::max)
    }),
    ("compute = 'mean'", |x, _, _| {
        some(x, x.iter().sum::<f64>() / x.len() as f64)
    }),
    ("compute = 'rms'", |x, _, _| {
        some(x, (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt())
    }),
    ("compute = 'final'", |x, _, _| x.last().copied()),
    ("compute = 'range'", |x, _, _| {
        Some(x.iter().copied().reduce(f64::max)? - x.iter().copied().reduce(f64::min)?)
    }),
    ("compute = 'integral'", |x, t, _| {
        some(
            x,
            x.windows(2)
                .zip(t.windows(2))
                .map(|(x, t)| (x[0] + x[1]) / 2.0 * (t[1] - t[0]))
                .sum(),
        )
    }),
    ("compute = 'integral-abs'", |x, t, _| {
        some(
            x,
            x.windows(2)
                .zip(t.windows(2))
                .map(|(x, t)| (x[0].abs() + x[1].abs()) / 2.0 * (t[1] - t[0]))
                .sum(),
        )
    }),
    ("compute = 'rate'", |x, t, _| {
        x.windows(2)
            .zip(t.windows(2))
            .map(|(x, t)| ((x[1] - x[0]) / (t[1] - t[0])).abs())
            .reduce(f64::max)
    }),
    ("compute = 'time-above'\nthreshold = '300 mm'", |x, _, p| {
        some(x, x.iter().filter(|x| **x > 0.3).count() as f64 * p)
    }),
    ("compute = 'time-below'\nthreshold = '300 mm'", |x, _, p| {
        some(x, x.iter().filter(|x| **x < 0.3).count() as f64 * p)
    }),
    ("compute = 'first-crossing'\nthreshold = '0.5 m'", |x, t, _| {
        let below = x.first()? < &0.5;
        (0..x.len()).find(|&k| (x[k] < 0.5) != below).map(|k| t[k])
    }),
    ("compute = 'settling-time'\nband = '[-1.5, 1500] mm'", |x, t, _| {
        let outside = x.iter().rposition(|x| !(-0.0015..=1.5).contains(x));
        let first = outside.map_or(0, |k| k + 1);
        Some(t.get(first)? - t[0])
    }),
    ("compute = 'changes'", |x, _, _| {
        some(x, x.windows(2).filter(|x| x[0] != x[1]).count() as f64)
    }),
    ("compute = 'percentile'\npercent = 90", |x, _, _| {
        let least = |value: &&f64| x.iter().filter(|x| x <= value).count() * 10 >= x.len() * 9;
        x.iter().filter(least).copied().reduce(f64::min)
    }),
];

fn some(x: &[f64], value: f64) -> Option<f64> {
    (!x.is_empty()).then_some(value)
}

/// The rotation from one attitude to the other as a matrix, and its angle from the trace and the skew part.
fn angle(p: [f64; 4], q: [f64; 4]) -> f64 {
    let matrix = |q: [f64; 4]| {
        let n = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [w, x, y, z] = q.map(|x| x / n);
        [
            [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
            ],
            [
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
            ],
            [
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
            ],
        ]
    };
    let (a, b) = (matrix(p), matrix(q));
    let r = |i: usize, j: usize| (0..3).map(|k| a[k][i] * b[k][j]).sum::<f64>();
    let skew = [r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)];
    let sine = skew.iter().map(|x| x * x).sum::<f64>().sqrt() / 2.0;
    sine.atan2((r(0, 0) + r(1, 1) + r(2, 2) - 1.0) / 2.0)
}

fn declared(name: &str, text: &str) -> DeclaredMeasure {
    let table = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
    DeclaredMeasure::of_table(name, table).unwrap_or_else(|(key, reason)| panic!("{text}: {key}: {reason}"))
}

fn close(found: Option<f64>, expected: Option<f64>, scale: f64) -> bool {
    match (found, expected) {
        (Some(found), Some(expected)) => (found - expected).abs() <= 1e-12 * scale.max(expected.abs()),
        (found, expected) => found == expected,
    }
}

/// What of `samples` lies from `from` to `to`, and for each the newest of `others` by then, found by search.
fn paired<'a>(
    samples: &'a [Sample],
    others: &'a [Sample],
    from: Rational,
    to: Rational,
) -> Vec<(&'a Sample, &'a Sample)> {
    let inside = samples.iter().filter(|sample| sample.at >= from && sample.at <= to);
    inside
        .filter_map(|sample| Some((sample, others.iter().rev().find(|other| other.at <= sample.at)?)))
        .collect()
}

#[test]
fn figures_are_those_of_a_plain_computation_in_any_order_of_arrival() {
    let (mut measured, mut absent) = (0, 0);
    for case in 0..CASES {
        let mut dice = Dice(Stream::new(16, &format!("measures {case}")), 0);
        let mut period = || time(1, [1, 3, 7, 20, 100, 333][dice.below(6) as usize]);
        let periods = [period(), period()];
        let offsets = [dice.time(2), dice.time(2)];
        let specs = [
            stream("near", "m", offsets[0], periods[0]),
            stream("far", "mm", offsets[1], periods[1]),
        ];
        let end = dice.time(8);
        let streams = specs.each_ref().map(|spec| dice.samples(spec, end));
        let (a, b) = (dice.time(8), dice.time(8));
        let (from, to) = (a.min(b), a.max(b));
        let window = format!("from = '{from}'\nto = '{to}'\n");
        let pairs = paired(&streams[0], &streams[1], from, to);
        let alone = streams[0].iter().filter(|one| one.at >= from && one.at <= to);
        let alone: Vec<&Sample> = alone.collect();
        let all: Vec<DeclaredMeasure> = SCALAR
            .iter()
            .flat_map(|(text, _)| {
                ["", "minus = 'far.out.x'\n"].map(|minus| format!("of = 'near.out.x'\n{minus}{window}{text}"))
            })
            .chain([
                format!("of = 'near.out.v'\nminus = 'far.out.v'\nthrough = 'norm'\ncompute = 'max'\n{window}"),
                format!("of = 'near.out.q'\nminus = 'far.out.q'\nthrough = 'angle'\ncompute = 'mean'\n{window}"),
                format!("of = 'near.out.v[2]'\ncompute = 'max-abs'\nunit = 'km/h'\n{window}"),
                format!("of = 'near.out.v'\ncompute = 'min'\n{window}"),
                format!("of = 'near.out.n'\ncompute = 'changes'\n{window}"),
                format!("of = 'near.out.x'\ncompute = 'at'\nat = '{from}'"),
            ])
            .enumerate()
            .map(|(number, text)| declared(&format!("m{number}"), &text))
            .collect();
        let found = fed(&all, &specs, &streams, &mut dice);
        assert_eq!(
            found,
            fed(&all, &specs, &streams, &mut dice),
            "case {case}: another order of arrival"
        );

        let stamps = |samples: &mut dyn Iterator<Item = &Sample>| samples.map(|one| one.stamp_s).collect::<Vec<f64>>();
        let t = [
            stamps(&mut alone.iter().copied()),
            stamps(&mut pairs.iter().map(|pair| pair.0)),
        ];
        let x: [Vec<f64>; 2] = [
            alone.iter().map(|one| one.x).collect(),
            pairs.iter().map(|(near, far)| near.x - far.x * 1e-3).collect(),
        ];
        for (number, one) in found.iter().take(32).enumerate() {
            let (text, compute) = SCALAR[number / 2];
            let expected = compute(&x[number % 2], &t[number % 2], specs[0].period.seconds());
            let scale = x[number % 2].iter().fold(1.0, |sum, x| sum + x.abs());
            assert!(
                close(one.value.as_f64(), expected, scale),
                "case {case}, {text}: {one:?}, {expected:?}"
            );
            assert_eq!(one.reason.is_some(), expected.is_none(), "case {case}, {text}: {one:?}");
            *if expected.is_some() { &mut measured } else { &mut absent } += 1;
        }
        let apart = |(near, far): &(&Sample, &Sample)| {
            (0..3)
                .map(|i| (near.v[i] - far.v[i]) * (near.v[i] - far.v[i]))
                .sum::<f64>()
                .sqrt()
        };
        let norm = pairs.iter().map(apart).reduce(f64::max);
        assert!(close(found[32].value.as_f64(), norm, 1.0), "case {case}");
        let angles: Vec<f64> = pairs.iter().map(|(near, far)| angle(near.q, far.q)).collect();
        let mean = some(&angles, angles.iter().sum::<f64>() / angles.len() as f64);
        assert!(
            close(found[33].value.as_f64(), mean, 1e3),
            "case {case}: {:?}, {mean:?}",
            found[33]
        );
        let speed = alone.iter().map(|one| one.v[2].abs()).reduce(f64::max);
        assert!(
            close(found[34].value.as_f64(), speed.map(|v| v * 3.6), 1.0),
            "case {case}"
        );
        for element in 0..3 {
            let least = alone.iter().map(|one| one.v[element]).reduce(f64::min);
            assert_eq!(found[35].value[element].as_f64(), least, "case {case}");
        }
        let changes = alone.windows(2).filter(|two| two[0].n != two[1].n).count() as f64;
        let changes = (!alone.is_empty()).then_some(changes);
        assert_eq!(found[36].value.as_f64(), changes, "case {case}");
        // held for a period, and no longer
        let newest = streams[0].iter().rev().find(|one| one.at <= from);
        let held = newest.filter(|one| one.at.checked_add(specs[0].period).is_some_and(|until| from <= until));
        assert_eq!(found[37].value.as_f64(), held.map(|one| one.x), "case {case}");
    }
    assert!(
        measured > 3000 && absent > 300,
        "{measured} {absent}: the cases are too much alike"
    );
}

#[test]
fn limits_say_by_how_much_and_when() {
    let specs = [stream("near", "m", Rational::ZERO, time(1, 2))];
    let texts = [
        "of = 'near.out.x'\ncompute = 'max'\nat-most = '5 mm'",
        "of = 'near.out.x'\ncompute = 'min'\nat-least = '-1 m'",
        "of = 'near.out.x'\ncompute = 'mean'\nwithin = '[-1, 1] m'",
        "of = 'near.out.n'\ncompute = 'changes'\nat-most = 2",
        "of = 'near.out.v'\ncompute = 'max'\nat-most = '1 km/h'",
        "of = 'near.out.x'\ncompute = 'max'\nfrom = '1 h'\nat-most = '5 mm'",
    ];
    let all = texts.map(|text| declared("a", text));
    let sample = |k: i128, x: f64, v: [f64; 3]| Sample {
        at: time(k, 2),
        stamp_s: time(k, 2).seconds(),
        x,
        v,
        q: [1.0, 0.0, 0.0, 0.0],
        n: k as i32,
    };
    let streams = [vec![
        sample(0, 0.001, [0.0; 3]),
        sample(1, 0.0075, [0.0, 2.0, 1.0]),
        sample(2, -3.0, [0.1, 0.2, 0.3]),
    ]];
    let found = fed(&all, &specs, &streams, &mut Dice(Stream::new(1, "limits"), 0));
    let lines: Vec<String> = found.iter().map(Measured::line).collect();
    for (line, parts) in lines.iter().zip([
        &["FAIL", "7.50 mm", "(at most 5.00 mm): 2.50 mm too much at t = 0.5 s"][..],
        &["FAIL", "-3.00 m", "(at least -1.00 m): 2.00 m too little at t = 1 s"],
        &["ok", "(from -1.00 to 1.00 m)"],
        &["ok", "2.00 (at most 2.00)"],
        &["FAIL", "7.20 km/h (at most 1.00 km/h): 6.20 km/h too much at t = 0.5 s"],
        &[
            "FAIL",
            "not measured: there is no sample in the window (at most 5.00 mm)",
        ],
    ]) {
        for part in parts {
            assert!(line.contains(part), "`{part}` is not in: {line}");
        }
    }
}

#[test]
fn what_is_not_a_number_is_not_measured() {
    let specs = [stream("near", "m", Rational::ZERO, time(1, 2))];
    let all = [
        declared("a", "of = 'near.out.x'\ncompute = 'max'\nat-most = '5 m'"),
        declared("b", "of = 'near.out.x'\ncompute = 'max'\nto = '0.5 s'"),
        declared("c", "of = 'near.out.q'\nthrough = 'angle'\ncompute = 'max'"),
    ];
    let samples = [0.0, 1.0, f64::NAN, 9.0].iter().enumerate().map(|(k, x)| Sample {
        at: time(k as i128, 2),
        stamp_s: time(k as i128, 2).seconds(),
        x: *x,
        v: [0.0; 3],
        // no attitude at 1.5 s
        q: if k < 3 { [1.0, 0.0, 0.0, 0.0] } else { [0.0; 4] },
        n: 0,
    });
    let found = fed(&all, &specs, &[samples.collect()], &mut Dice(Stream::new(1, "nan"), 0));
    assert_eq!(found[0].reason.as_deref(), Some("the value is NaN at t = 1 s"));
    assert!(!found[0].criterion.as_ref().expect("it has a limit").met);
    assert_eq!(
        found[1].value.as_f64(),
        Some(1.0),
        "what is outside the window does not matter"
    );
    assert_eq!(found[2].reason.as_deref(), Some("the value is NaN at t = 1.5 s"));
}

#[test]
fn what_does_not_fit_is_refused_with_its_key() {
    let specs = [
        stream("near", "m", Rational::ZERO, time(1, 2)),
        stream("far", "V", Rational::ZERO, time(1, 3)),
    ];
    for (text, key, part) in [
        (
            "of = 'near.out.y'\ncompute = 'max'",
            "of",
            "no field or element `y`; it has `x: f64 in m`",
        ),
        (
            "of = 'nowhere.out.x'\ncompute = 'max'",
            "of",
            "the streams are `near.out`, `far.out`",
        ),
        (
            "of = 'near.out.v[3]'\ncompute = 'max'",
            "of",
            "no field or element `v[3]`",
        ),
        (
            "of = 'near.out.x'\nminus = 'far.out.x'\ncompute = 'max'",
            "minus",
            "is in V, `near.out.x` in m",
        ),
        (
            "of = 'near.out.x'\nminus = 'near.out.v'\ncompute = 'max'",
            "minus",
            "shape [3]",
        ),
        ("of = 'near.out.v'\nthrough = 'angle'\ncompute = 'max'", "through", ""),
        (
            "of = 'near.out.x'\nthrough = 'norm'\ncompute = 'max'",
            "through",
            "one number",
        ),
        ("of = 'near.out.x'\ncompute = 'max'\nat-most = 5", "at-most", "no unit"),
        (
            "of = 'near.out.x'\ncompute = 'max'\nat-most = '5 s'",
            "at-most",
            "dimension s",
        ),
        (
            "of = 'near.out.x'\ncompute = 'rate'\nat-most = '5 m'",
            "at-most",
            "not a value in m/s",
        ),
        (
            "of = 'near.out.x'\ncompute = 'integral'\nat-most = '5 m'",
            "at-most",
            "not a value in m s",
        ),
        (
            "of = 'near.out.x'\ncompute = 'time-above'\nthreshold = '5 s'",
            "threshold",
            "not a value in m",
        ),
        ("of = 'near.out.x'\ncompute = 'max'\nunit = 'deg'", "unit", "dimension"),
        (
            "of = 'near.out.x'\ncompute = 'max'\nwithin = '[2, 1] m'",
            "within",
            "the lower one first",
        ),
    ] {
        let refused = declared("a", text).resolve(&specs).expect_err(text);
        let key = if text.contains("'angle'") { "of" } else { key };
        assert_eq!(refused.0, key, "{text}: {refused:?}");
        assert!(refused.1.contains(part), "{text}: {refused:?}");
    }
    for (name, text, key, part) in [
        ("a b", "of = 'near.out.x'\ncompute = 'max'", "", "letters, digits"),
        (
            "outcome",
            "of = 'near.out.x'\ncompute = 'max'",
            "",
            "column of that name",
        ),
        (
            "a",
            "of = 'near.out.x'\ncompute = 'biggest'",
            "compute",
            "unknown variant `biggest`",
        ),
        (
            "a",
            "of = 'near.out.x'\ncompute = 'max'\nlimit = 3",
            "limit",
            "unknown field `limit`",
        ),
        ("a", "of = 'near.out.x'\ncompute = 'at'", "", "`at` is missing"),
        (
            "a",
            "of = 'near.out.x'\ncompute = 'max'\nat = '1 s'",
            "at",
            "compute = \"max\"",
        ),
        (
            "a",
            "of = 'near.out.x'\ncompute = 'at'\nat = '1 s'\nfrom = '0 s'",
            "from",
            "one instant",
        ),
        (
            "a",
            "of = 'near.out.x'\ncompute = 'max'\nfrom = '2 s'\nto = '1 s'",
            "to",
            "before `from`",
        ),
        (
            "a",
            "of = 'near.out.x'\ncompute = 'percentile'\npercent = 101",
            "percent",
            "between 0 and 100",
        ),
        (
            "a",
            "of = 'near.out.x'\ncompute = 'max'\nwithin = '[1, 2] m'\nat-most = '1 m'",
            "within",
            "leave those out",
        ),
    ] {
        let table = text.parse().expect("it is TOML");
        let refused = DeclaredMeasure::of_table(name, table).expect_err(text);
        assert_eq!(refused.0, key, "{text}: {refused:?}");
        assert!(refused.1.contains(part), "{text}: {refused:?}");
    }
}
