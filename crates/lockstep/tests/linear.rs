//! What `hold = "linear"` reads, against its formula in plain integers.

use std::sync::{Arc, Mutex};

use lockstep::executor::{InLoop, connect_locally};
use lockstep::link::{Hold, Timing};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, Participant, Step};
use lockstep::plan::{LinkSpec, ParticipantSpec, Plan};
use lockstep::time::Rational;
use lockstep::transport::NoRecording;
use proptest::prelude::*;

lockstep::message! {
    /// A signal and a count.
    pub struct Signal {
        /// A smooth function of time.
        pub x: f64 = "m",
        /// The same in single precision.
        pub single: f32 = "m",
        /// The number of the sample.
        pub count: u32 = "1",
    }
}

fn smooth(t: f64) -> f64 {
    (40.0 * t).sin() + 3.0 * t * t
}

struct Source(Kind);

impl Source {
    fn write(index: u64, t: f64, outputs: &mut Outputs) {
        *outputs.get_mut(0) = Signal {
            x: smooth(t),
            single: smooth(t) as f32,
            count: index as u32,
        };
    }
}

impl Participant for Source {
    fn interface(&self) -> Interface {
        Interface::new(self.0).output::<Signal>("out")
    }
    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        Source::write(0, t, outputs);
        Ok(())
    }
    fn step(&mut self, step: &Step, _: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        match self.0 {
            Kind::Sampled => Source::write(step.index, step.t, outputs),
            Kind::Continuous => Source::write(step.index + 1, step.t_next, outputs),
        }
        Ok(())
    }
}

#[derive(Clone, Default)]
struct InputProbe(Arc<Mutex<Vec<Signal>>>);

impl Participant for InputProbe {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled).input::<Signal>("in")
    }
    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
    fn step(&mut self, _: &Step, inputs: &Inputs, _: &mut Outputs) -> Result<(), Failure> {
        self.0.lock().unwrap().push(*inputs.get::<Signal>(0));
        Ok(())
    }
}

/// Times in microseconds.
#[derive(Debug, Clone, Copy)]
struct Times {
    period: i64,
    offset: i64,
    reads_every: i64,
    reads_from: i64,
    delay: i64,
}

const END: i64 = 200_000;

/// The values that a probe reads.
fn received(kind: Kind, times: Times, hold: Hold) -> Vec<Signal> {
    let micros = |micros: i64| Rational::new(i128::from(micros), 1_000_000).unwrap();
    let probe = InputProbe::default();
    let source = Source(kind);
    let spec = |name: &str, period, offset, interface| ParticipantSpec {
        name: name.into(),
        period: micros(period),
        offset: micros(offset),
        interface,
    };
    let link = LinkSpec {
        name: "link".into(),
        from: ("source".into(), "out".into()),
        to: ("listener".into(), "in".into()),
        timing: Timing {
            delay: micros(times.delay),
            hold,
            ..Timing::default()
        },
        initial: None,
        conversion: None,
        random_stream: None,
        faults: Vec::new(),
    };
    let specs = vec![
        spec("source", times.period, times.offset, source.interface()),
        spec("listener", times.reads_every, times.reads_from, probe.interface()),
    ];
    let plan = Plan::build(specs, &[link], micros(END), 1).unwrap();
    let own: Vec<Box<dyn Participant>> = vec![Box::new(source), Box::new(probe.clone())];
    InLoop::new(&plan, connect_locally(&plan, own, |_| Box::new(NoRecording)))
        .run_to(plan.end, |_| {})
        .unwrap();
    let received = probe.0.lock().unwrap();
    received.clone()
}

fn times() -> impl Strategy<Value = Times> {
    (
        1_i64..30_000,
        0_i64..30_000,
        1_000_i64..30_000,
        0_i64..30_000,
        0_i64..60_000,
    )
        .prop_map(|(period, offset, reads_every, reads_from, delay)| Times {
            period: period.max(300),
            offset,
            reads_every,
            reads_from,
            delay,
        })
}

fn kinds() -> impl Strategy<Value = Kind> {
    prop_oneof![Just(Kind::Sampled), Just(Kind::Continuous)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]

    #[test]
    fn linear_hold_matches_interpolation_formula(times in times(), kind in kinds()) {
        for (k, found) in received(kind, times, Hold::Linear).into_iter().enumerate() {
            let t = times.reads_from + k as i64 * times.reads_every;
            let delayed = t - times.delay;
            if delayed < times.offset {
                prop_assert_eq!(found, Signal { x: 0.0, single: 0.0, count: 0 });
                continue;
            }
            let index = (delayed - times.offset) / times.period;
            let before = times.offset + index * times.period;
            let after = before + times.period;
            let value = |micros: i64| smooth(micros as f64 / 1e6);
            let expected = if delayed > before && after < t {
                let weight = (delayed - before) as f64 / times.period as f64;
                value(before) * (1.0 - weight) + value(after) * weight
            } else {
                value(before)
            };
            prop_assert!((found.x - expected).abs() < 1e-14, "at {} us: {} for {}", t, found.x, expected);
            prop_assert!((f64::from(found.single) - expected).abs() < 2e-7);
            prop_assert_eq!(i64::from(found.count), index);
        }
    }

    #[test]
    fn linear_hold_with_long_delay_shifts_signal(times in times(), kind in kinds()) {
        let times = Times { delay: times.delay.max(times.period), ..times };
        let period = times.period as f64 / 1e6;
        // The second derivative is at most 40^2 + 6.
        let bound = period * period / 8.0 * 1606.0 + 1e-12;
        for (k, found) in received(kind, times, Hold::Linear).into_iter().enumerate() {
            let delayed = times.reads_from + k as i64 * times.reads_every - times.delay;
            if delayed >= times.offset {
                let error = (found.x - smooth(delayed as f64 / 1e6)).abs();
                prop_assert!(error <= bound, "{} above {}", error, bound);
            }
        }
    }
}

#[test]
fn linear_hold_without_delay_reads_last_sample() {
    let times = Times {
        period: 3_000,
        offset: 500,
        reads_every: 1_100,
        reads_from: 0,
        delay: 0,
    };
    for kind in [Kind::Sampled, Kind::Continuous] {
        assert_eq!(received(kind, times, Hold::Linear), received(kind, times, Hold::Last));
    }
}
