//! Batched runs: participants of one type are stepped together, and each run equals the separate run.

use std::sync::{Arc, Mutex};

use lockstep::executor::{InLoop, RunError, StopReason, connect_locally};
use lockstep::link::{Hold, Timing};
use lockstep::participant::{
    BatchStepper, BatchedStep, Failure, Inputs, Interface, Kind, Member, Outputs, Participant, Step, StepBatch,
};
use lockstep::plan::{LinkSpec, ParticipantSpec, Plan};
use lockstep::random::Stream;
use lockstep::time::Rational;
use lockstep::transport::NoRecording;

lockstep::message! {
    /// A number.
    struct Value {
        /// The number.
        x: f64 = "1",
    }
}

/// A decay driven by its input, which can be stepped in batches; `WHICH` distinguishes types of it.
struct Decay<const WHICH: usize> {
    x: f64,
    rate: f64,
    /// The activation that fails.
    fails: u64,
    /// The largest batch in which it was stepped.
    largest_batch: Arc<Mutex<usize>>,
}

fn next(x: f64, rate: f64, period: f64, input: f64) -> f64 {
    (period * rate).mul_add(input - x, x)
}

impl<const WHICH: usize> Participant for Decay<WHICH> {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Value>("in")
            .output::<Value>("out")
    }
    fn initialise(&mut self, _: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = Value { x: self.x };
        Ok(())
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        if step.index == self.fails {
            return Err(format!("it gives up at {}", step.t).into());
        }
        self.x = next(self.x, self.rate, step.period, inputs.get::<Value>(0).x);
        *outputs.get_mut(0) = Value { x: self.x };
        Ok(())
    }
    fn batch_member(&mut self) -> Option<Member<'_>> {
        Some(Member::of(self))
    }
}

impl<const WHICH: usize> StepBatch for Decay<WHICH> {
    /// The number of calls: it depends on the batches, so no result may depend on it.
    type Common = u64;

    fn step_batch(steps: &mut [BatchedStep<'_, Self>], calls: &mut u64) {
        *calls += 1;
        let count = steps.len();
        for four in steps.chunks_mut(4) {
            let (mut x, mut rate, mut period, mut input) = ([0.0; 4], [0.0; 4], [0.0; 4], [0.0; 4]);
            for (lane, one) in four.iter().enumerate() {
                (x[lane], rate[lane]) = (one.participant.x, one.participant.rate);
                (period[lane], input[lane]) = (one.step.period, one.inputs.get::<Value>(0).x);
            }
            let all: [f64; 4] = std::array::from_fn(|lane| next(x[lane], rate[lane], period[lane], input[lane]));
            for (one, x) in four.iter_mut().zip(all) {
                let mut largest_batch = one.participant.largest_batch.lock().unwrap();
                *largest_batch = count.max(*largest_batch);
                drop(largest_batch);
                if one.step.index == one.participant.fails {
                    one.fail(format!("it gives up at {}", one.step.t).into());
                    continue;
                }
                one.participant.x = x;
                *one.outputs.get_mut(0) = Value { x };
            }
        }
    }
}

/// Records the value of a decay at its own period; it is never stepped in a batch.
struct InputProbe(Arc<Mutex<Vec<u64>>>);

impl Participant for InputProbe {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Value>("in")
            .output::<Value>("out")
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let received = inputs.get::<Value>(0).x;
        self.0.lock().unwrap().push(received.to_bits());
        *outputs.get_mut(0) = Value {
            x: received + (7.0 * step.t).sin(),
        };
        Ok(())
    }
}

/// A run: two decays of two kinds in a cycle with a probe.
struct Run {
    looped: InLoop,
    plan: Plan,
    received: Arc<Mutex<Vec<u64>>>,
    largest_batch: Arc<Mutex<usize>>,
}

fn run(number: u64) -> Run {
    let draw = |name: &str, least: i128, most: i128| {
        let uniform = Stream::new(5, name).uniform(number);
        least + (uniform * (most - least) as f64) as i128
    };
    let millis = |millis: i128| Rational::new(millis, 1000).unwrap();
    let (received, largest_batch) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Mutex::new(0)));
    let fails = |name: &str| {
        if draw(name, 0, 6) == 0 {
            draw(name, 0, 150) as u64
        } else {
            u64::MAX
        }
    };
    let first = Decay::<0> {
        x: draw("x", -5, 5) as f64,
        rate: draw("rate", 1, 9) as f64 / 7.0,
        fails: fails("fails"),
        largest_batch: largest_batch.clone(),
    };
    let second = Decay::<1> {
        x: 1.0,
        rate: draw("second", 1, 9) as f64 / 11.0,
        fails: fails("fails too"),
        largest_batch: largest_batch.clone(),
    };
    let all: Vec<(&str, i128, Box<dyn Participant>)> = vec![
        ("first", draw("period", 1, 4), Box::new(first)),
        ("second", draw("period too", 1, 4), Box::new(second)),
        ("listener", draw("hears", 1, 20), Box::new(InputProbe(received.clone()))),
    ];
    let specs = all.iter().map(|(name, period, participant)| ParticipantSpec {
        name: (*name).into(),
        period: millis(*period),
        offset: millis(0),
        interface: participant.interface(),
    });
    let links = [
        ("first", "second", 0),
        ("second", "listener", 0),
        ("listener", "first", draw("delay", 20, 60)),
    ];
    let links = links.map(|(from, to, delay)| LinkSpec {
        name: format!("{from}-{to}"),
        from: (from.into(), "out".into()),
        to: (to.into(), "in".into()),
        timing: Timing {
            delay: millis(delay),
            hold: Hold::Last,
            ..Timing::default()
        },
        initial: None,
        conversion: None,
        random_stream: None,
        faults: Vec::new(),
    });
    let plan = Plan::build(specs.collect(), &links, millis(draw("end", 50, 400)), 1).unwrap();
    let own = all.into_iter().map(|(_, _, participant)| participant).collect();
    let looped = InLoop::new(&plan, connect_locally(&plan, own, |_| Box::new(NoRecording)));
    Run {
        looped,
        plan,
        received,
        largest_batch,
    }
}

fn describe_end(ended: Result<StopReason, RunError>) -> String {
    match ended {
        Ok(reach) => format!("{reach:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn batched_runs_equal_separate_runs() {
    let mut largest = 0;
    for first in (0..200).step_by(8) {
        let separate: Vec<_> = (first..first + 8)
            .map(|number| {
                let mut run = run(number);
                let ended = describe_end(run.looped.run_to(run.plan.end, |_| {}));
                let received = run.received.lock().unwrap().clone();
                (ended, received)
            })
            .collect();
        let mut runs: Vec<Run> = (first..first + 8).map(run).collect();
        runs.iter_mut().for_each(|run| run.looped.defer_steps());
        let mut ended: Vec<Option<String>> = vec![None; runs.len()];
        let mut batch_stepper = BatchStepper::default();
        while ended.contains(&None) {
            for (run, ended) in runs.iter_mut().zip(&mut ended).filter(|(_, ended)| ended.is_none()) {
                match run.looped.run_to(run.plan.end, |_| {}) {
                    Ok(StopReason::Deferred) => {}
                    over => *ended = Some(describe_end(over)),
                }
            }
            let pending = runs.iter_mut().zip(&ended).filter(|(_, ended)| ended.is_none());
            let mut pending: Vec<_> = pending.filter_map(|(run, _)| run.looped.pending()).collect();
            batch_stepper.step(&mut pending);
        }
        for (number, (run, ended)) in runs.iter().zip(ended).enumerate() {
            let received = run.received.lock().unwrap().clone();
            assert_eq!(
                (ended.unwrap(), received),
                separate[number],
                "run {}",
                first as usize + number
            );
            largest = largest.max(*run.largest_batch.lock().unwrap());
        }
    }
    assert!(largest >= 4, "at most {largest} went together");
}

#[test]
fn loop_returns_deferred_step_until_it_is_executed() {
    let mut run = (0..).map(run).find(|run| run.plan.end > 0).unwrap();
    assert!(run.looped.pending().is_none());
    run.looped.defer_steps();
    assert_eq!(run.looped.run_to(run.plan.end, |_| {}).unwrap(), StopReason::Deferred);
    // A second call returns the same step: it has not been executed.
    assert_eq!(run.looped.run_to(run.plan.end, |_| {}).unwrap(), StopReason::Deferred);
    assert!(run.looped.pending().is_some());
}
