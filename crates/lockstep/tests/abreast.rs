//! Loops side by side: participants of one kind are stepped together, and each run is what it is alone.

use std::sync::{Arc, Mutex};

use lockstep::executor::{InLoop, Reach, RunError, assemble};
use lockstep::link::{Hold, Timing};
use lockstep::participant::{
    Abreast, Failure, Inputs, Interface, Kind, Member, Outputs, Participant, Step, StepAbreast, Stride,
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

/// A decay that is driven by its input, of which several go together; `WHICH` makes kinds of it.
struct Decay<const WHICH: usize> {
    x: f64,
    rate: f64,
    /// Where it gives up.
    fails: u64,
    /// How many were stepped together with it, at most.
    most: Arc<Mutex<usize>>,
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
    fn abreast(&mut self) -> Option<Member<'_>> {
        Some(Member::of(self))
    }
}

impl<const WHICH: usize> StepAbreast for Decay<WHICH> {
    /// How many calls there were: that depends on the company, and so nothing may depend on it.
    type Common = u64;

    fn step_abreast(those: &mut [Abreast<'_, Self>], calls: &mut u64) {
        *calls += 1;
        let count = those.len();
        for four in those.chunks_mut(4) {
            let (mut x, mut rate, mut period, mut input) = ([0.0; 4], [0.0; 4], [0.0; 4], [0.0; 4]);
            for (lane, one) in four.iter().enumerate() {
                (x[lane], rate[lane]) = (one.participant.x, one.participant.rate);
                (period[lane], input[lane]) = (one.step.period, one.inputs.get::<Value>(0).x);
            }
            let all: [f64; 4] = std::array::from_fn(|lane| next(x[lane], rate[lane], period[lane], input[lane]));
            for (one, x) in four.iter_mut().zip(all) {
                let mut most = one.participant.most.lock().unwrap();
                *most = count.max(*most);
                drop(most);
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

/// Hears a decay at its own pace; it always goes alone.
struct Listener(Arc<Mutex<Vec<u64>>>);

impl Participant for Listener {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Value>("in")
            .output::<Value>("out")
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let heard = inputs.get::<Value>(0).x;
        self.0.lock().unwrap().push(heard.to_bits());
        *outputs.get_mut(0) = Value {
            x: heard + (7.0 * step.t).sin(),
        };
        Ok(())
    }
}

/// A run: two decays of two kinds in a circle with a listener.
struct World {
    looped: InLoop,
    plan: Plan,
    heard: Arc<Mutex<Vec<u64>>>,
    most: Arc<Mutex<usize>>,
}

fn world(number: u64) -> World {
    let draw = |name: &str, least: i128, most: i128| {
        let uniform = Stream::new(5, name).uniform(number);
        least + (uniform * (most - least) as f64) as i128
    };
    let millis = |millis: i128| Rational::new(millis, 1000).unwrap();
    let (heard, most) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Mutex::new(0)));
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
        most: most.clone(),
    };
    let second = Decay::<1> {
        x: 1.0,
        rate: draw("second", 1, 9) as f64 / 11.0,
        fails: fails("fails too"),
        most: most.clone(),
    };
    let all: Vec<(&str, i128, Box<dyn Participant>)> = vec![
        ("first", draw("period", 1, 4), Box::new(first)),
        ("second", draw("period too", 1, 4), Box::new(second)),
        ("listener", draw("hears", 1, 20), Box::new(Listener(heard.clone()))),
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
        draws: None,
        faults: Vec::new(),
    });
    let plan = Plan::build(specs.collect(), &links, millis(draw("end", 50, 400)), 1).unwrap();
    let own = all.into_iter().map(|(_, _, participant)| participant).collect();
    let looped = InLoop::new(&plan, assemble(&plan, own, |_| Box::new(NoRecording)));
    World {
        looped,
        plan,
        heard,
        most,
    }
}

fn ending(ended: Result<Reach, RunError>) -> String {
    match ended {
        Ok(reach) => format!("{reach:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn batched_runs_equal_separate_runs() {
    let mut together = 0;
    for first in (0..200).step_by(8) {
        let alone: Vec<_> = (first..first + 8)
            .map(|number| {
                let mut world = world(number);
                let ended = ending(world.looped.run_to(world.plan.end, |_| {}));
                let heard = world.heard.lock().unwrap().clone();
                (ended, heard)
            })
            .collect();
        let mut worlds: Vec<World> = (first..first + 8).map(world).collect();
        worlds.iter_mut().for_each(|world| world.looped.park());
        let mut ended: Vec<Option<String>> = vec![None; worlds.len()];
        let mut stride = Stride::default();
        while ended.contains(&None) {
            for (world, ended) in worlds.iter_mut().zip(&mut ended).filter(|(_, ended)| ended.is_none()) {
                match world.looped.run_to(world.plan.end, |_| {}) {
                    Ok(Reach::Parked) => {}
                    over => *ended = Some(ending(over)),
                }
            }
            let pending = worlds.iter_mut().zip(&ended).filter(|(_, ended)| ended.is_none());
            let mut pending: Vec<_> = pending.filter_map(|(world, _)| world.looped.pending()).collect();
            stride.step(&mut pending);
        }
        for (number, (world, ended)) in worlds.iter().zip(ended).enumerate() {
            let heard = world.heard.lock().unwrap().clone();
            assert_eq!(
                (ended.unwrap(), heard),
                alone[number],
                "world {}",
                first as usize + number
            );
            together = together.max(*world.most.lock().unwrap());
        }
    }
    assert!(together >= 4, "at most {together} went together");
}

#[test]
fn loop_returns_deferred_step_until_it_is_executed() {
    let mut world = (0..).map(world).find(|world| world.plan.end > 0).unwrap();
    assert!(world.looped.pending().is_none());
    world.looped.park();
    assert_eq!(world.looped.run_to(world.plan.end, |_| {}).unwrap(), Reach::Parked);
    // asked again it still waits, and nothing is done twice
    assert_eq!(world.looped.run_to(world.plan.end, |_| {}).unwrap(), Reach::Parked);
    assert!(world.looped.pending().is_some());
}
