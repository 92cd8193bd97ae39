//! What measures say: of limits, of what cannot be measured, and of what does not fit.

mod common;

use common::{RandomSource, Sample, declared, measure_shuffled, stream, time};
use engine::assessment::Measured;
use engine::scenario::DeclaredMeasure;
use lockstep::random::Stream;
use lockstep::time::Rational;

#[test]
fn limits_report_margin_and_time() {
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
    let found = measure_shuffled(&all, &specs, &streams, &mut RandomSource(Stream::new(1, "limits"), 0));
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
fn nan_values_are_not_measured() {
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
    let found = measure_shuffled(
        &all,
        &specs,
        &[samples.collect()],
        &mut RandomSource(Stream::new(1, "nan"), 0),
    );
    assert_eq!(found[0].reason.as_deref(), Some("the value is NaN at t = 1 s"));
    assert!(!found[0].criterion.as_ref().expect("it has a limit").met);
    assert_eq!(
        found[1].value.as_f64(),
        Some(1.0),
        "what is outside the window does not matter"
    );
    assert_eq!(found[2].reason.as_deref(), Some("the value is NaN at t = 1.5 s"));
}

/// Measures that do not fit the streams of the test, the key that is to blame, and a part of the reason.
const UNFIT: [(&str, &str, &str); 15] = [
    (
        "of = 'near.out.y'\ncompute = 'max'",
        "of",
        "no field or element `y`; it has `x: f64 in m`",
    ),
    (
        "of = 'nowhere.out.x'\ncompute = 'max'",
        "of",
        "there is no stream `nowhere.out`; there is `near.out`, `far.out`",
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
    ("of = 'near.out.v'\nthrough = 'angle'\ncompute = 'max'", "of", ""),
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
    (
        "of = 'near.out.x'\ncompute = 'max'\nat-most = '100 mm'\nat-least = '2 m'",
        "at-most",
        "\"100 mm\" is below `at-least`, \"2 m\": no figure meets both",
    ),
];

#[test]
fn misfitting_measure_is_refused_with_its_key() {
    let specs = [
        stream("near", "m", Rational::ZERO, time(1, 2)),
        stream("far", "V", Rational::ZERO, time(1, 3)),
    ];
    for (text, key, part) in UNFIT {
        let refused = declared("a", text).resolve(&specs).expect_err(text);
        assert_eq!(refused.0, key, "{text}: {refused:?}");
        assert!(refused.1.contains(part), "{text}: {refused:?}");
    }
}

/// Measures that fit no streams: name, table, the key that is to blame, and a part of the reason.
const WRONG: [(&str, &str, &str, &str); 10] = [
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
];

#[test]
fn measure_without_streams_is_refused_with_its_key() {
    for (name, text, key, part) in WRONG {
        let table = text.parse().expect("it is TOML");
        let refused = DeclaredMeasure::of_table(name, table).expect_err(text);
        assert_eq!(refused.0, key, "{text}: {refused:?}");
        assert!(refused.1.contains(part), "{text}: {refused:?}");
    }
}
