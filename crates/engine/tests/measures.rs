//! Measures over random tapes against a plain computation over the whole of them, and in any order in which streams arrive.

mod common;

use common::{RandomSource, Sample, declared, measure_shuffled, stream, time};
use engine::assessment::Measured;
use engine::scenario::DeclaredMeasure;
use lockstep::random::Stream;
use lockstep::time::Rational;
use tape::StreamSpec;

const CASES: u64 = 300;

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

/// Two streams, a window, and what of the streams lies in it.
struct Case {
    number: u64,
    specs: [StreamSpec; 2],
    streams: [Vec<Sample>; 2],
    from: Rational,
    to: Rational,
}

impl Case {
    fn drawn(number: u64, random: &mut RandomSource) -> Case {
        let mut period = || time(1, [1, 3, 7, 20, 100, 333][random.below(6) as usize]);
        let periods = [period(), period()];
        let offsets = [random.time(2), random.time(2)];
        let specs = [
            stream("near", "m", offsets[0], periods[0]),
            stream("far", "mm", offsets[1], periods[1]),
        ];
        let end = random.time(8);
        let streams = specs.each_ref().map(|spec| random.samples(spec, end));
        let (a, b) = (random.time(8), random.time(8));
        Case {
            number,
            specs,
            streams,
            from: a.min(b),
            to: a.max(b),
        }
    }

    /// The samples of the first stream in the window.
    fn alone(&self) -> Vec<&Sample> {
        let inside = |one: &&Sample| one.at >= self.from && one.at <= self.to;
        self.streams[0].iter().filter(inside).collect()
    }

    /// The same with those of the second one.
    fn pairs(&self) -> Vec<(&Sample, &Sample)> {
        paired(&self.streams[0], &self.streams[1], self.from, self.to)
    }

    /// Every scalar measure of one stream and of both, and six of other kinds.
    fn declared(&self) -> Vec<DeclaredMeasure> {
        let from = self.from;
        let window = format!("from = '{from}'\nto = '{}'\n", self.to);
        SCALAR
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
            .collect()
    }

    /// Compares the scalar measures with the plain computation; gives how many were measured, and how many were not.
    fn compare_scalars(&self, found: &[Measured]) -> [usize; 2] {
        let (case, alone, pairs) = (self.number, self.alone(), self.pairs());
        let stamps = |samples: &mut dyn Iterator<Item = &Sample>| samples.map(|one| one.stamp_s).collect::<Vec<f64>>();
        let t = [
            stamps(&mut alone.iter().copied()),
            stamps(&mut pairs.iter().map(|pair| pair.0)),
        ];
        let x: [Vec<f64>; 2] = [
            alone.iter().map(|one| one.x).collect(),
            pairs.iter().map(|(near, far)| near.x - far.x * 1e-3).collect(),
        ];
        let mut counts = [0, 0];
        for (number, one) in found.iter().take(32).enumerate() {
            let (text, compute) = SCALAR[number / 2];
            let expected = compute(&x[number % 2], &t[number % 2], self.specs[0].period.seconds());
            let scale = x[number % 2].iter().fold(1.0, |sum, x| sum + x.abs());
            assert!(
                close(one.value.as_f64(), expected, scale),
                "case {case}, {text}: {one:?}, {expected:?}"
            );
            assert_eq!(one.reason.is_some(), expected.is_none(), "case {case}, {text}: {one:?}");
            counts[usize::from(expected.is_none())] += 1;
        }
        counts
    }

    /// The same with the others.
    fn compare_others(&self, found: &[Measured]) {
        let (case, alone, pairs) = (self.number, self.alone(), self.pairs());
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
        let (from, period) = (self.from, self.specs[0].period);
        let newest = self.streams[0].iter().rev().find(|one| one.at <= from);
        let held = newest.filter(|one| one.at.checked_add(period).is_some_and(|until| from <= until));
        assert_eq!(found[37].value.as_f64(), held.map(|one| one.x), "case {case}");
    }
}

#[test]
fn figures_equal_a_plain_computation_in_any_arrival_order() {
    let (mut measured, mut absent) = (0, 0);
    for number in 0..CASES {
        let mut random = RandomSource(Stream::new(16, &format!("measures {number}")), 0);
        let case = Case::drawn(number, &mut random);
        let all = case.declared();
        let found = measure_shuffled(&all, &case.specs, &case.streams, &mut random);
        assert_eq!(
            found,
            measure_shuffled(&all, &case.specs, &case.streams, &mut random),
            "case {number}: another order of arrival"
        );
        let [there, not] = case.compare_scalars(&found);
        (measured, absent) = (measured + there, absent + not);
        case.compare_others(&found);
    }
    assert!(
        measured > 3000 && absent > 300,
        "{measured} {absent}: the cases are too much alike"
    );
}
