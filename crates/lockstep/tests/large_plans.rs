//! The largest runs that there may be: 512 participants with 256 inputs each. Looking through all links for each link would be ten
//! thousand million comparisons; planning and running need no such search.

use lockstep::executor::{InLoop, LoopEvent, connect_locally};
use lockstep::link::Timing;
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, Participant, Step};
use lockstep::plan::{LinkSpec, ParticipantSpec, Plan, PlanError};
use lockstep::time::Rational;
use lockstep::transport::NoRecording;

const PARTICIPANTS: usize = 512;
const INPUTS: usize = 256;

lockstep::message! {
    /// A number.
    pub struct Number {
        /// Its value.
        pub x: f64 = "1",
    }
}

fn plan(kind: Kind, offset: impl Fn(usize) -> i64, links: Vec<(usize, usize, usize)>) -> Result<Plan, Vec<PlanError>> {
    let mut interface = Interface::new(kind).output::<Number>("out");
    for input in 0..INPUTS {
        interface = interface.optional_input::<Number>(&format!("in{input}"));
    }
    let participants = (0..PARTICIPANTS).map(|number| ParticipantSpec {
        name: format!("p{number:03}"),
        period: Rational::from_millis(2),
        offset: Rational::from_millis(offset(number)),
        interface: interface.clone(),
    });
    let link = |(from, to, input): (usize, usize, usize)| LinkSpec {
        name: format!("p{from:03}-p{to:03}-{input}"),
        from: (format!("p{from:03}"), "out".into()),
        to: (format!("p{to:03}"), format!("in{input}")),
        timing: Timing::default(),
        initial: None,
        conversion: None,
        random_stream: None,
        faults: Vec::new(),
    };
    let links: Vec<LinkSpec> = links.into_iter().map(link).collect();
    Plan::build(participants.collect(), &links, Rational::from_millis(20), 1)
}

/// `from` of input number `input` of participant `to`, for all of them.
fn links(from: impl Fn(usize, usize) -> Option<usize>) -> Vec<(usize, usize, usize)> {
    let all = (0..PARTICIPANTS).flat_map(|to| (0..INPUTS).map(move |input| (to, input)));
    all.filter_map(|(to, input)| Some((from(to, input)?, to, input)))
        .collect()
}

#[test]
fn largest_plan_links_every_input() {
    let all = links(|to, input| Some((to * 7 + input) % PARTICIPANTS));
    let plan = plan(Kind::Continuous, |_| 0, all).unwrap();
    assert_eq!(plan.links.len(), PARTICIPANTS * INPUTS);
    for (to, participant) in plan.participants.iter().enumerate() {
        for (input, links) in participant.inputs.iter().enumerate() {
            assert_eq!(links.len(), 1);
            let link = &plan.links[links[0]];
            assert_eq!((link.from.0, link.to), ((to * 7 + input) % PARTICIPANTS, (to, input)));
        }
    }
    let consumers: usize = (plan.assignments())
        .map(|assignment| assignment.outputs[0].consumers.len())
        .sum();
    assert_eq!(consumers, plan.links.len());
}

#[test]
fn largest_plan_ranks_producers_before_consumers() {
    // Each reads from the 256 after it, so the last one comes first.
    let all = links(|to, input| Some(to + 1 + input).filter(|from| *from < PARTICIPANTS));
    let plan = plan(Kind::Sampled, |_| 0, all).unwrap();
    for (number, participant) in plan.participants.iter().enumerate() {
        assert_eq!(participant.rank as usize, PARTICIPANTS - 1 - number);
    }
}

#[test]
fn largest_plan_ranks_open_cycles() {
    // Odd participants read even ones and vice versa; they are never activated at the same instant.
    let all = links(|to, input| Some((to + 1 + 2 * input) % PARTICIPANTS));
    let plan = plan(Kind::Sampled, |number| (number % 2) as i64, all).unwrap();
    let mut ranks: Vec<u32> = plan.participants.iter().map(|participant| participant.rank).collect();
    ranks.sort_unstable();
    assert!(ranks.into_iter().eq(0..PARTICIPANTS as u32));
}

#[test]
fn largest_plan_reports_every_error() {
    let all = links(|to, input| Some((to + input) % PARTICIPANTS));
    let twice: Vec<_> = all.iter().flat_map(|link| [*link, *link]).collect();
    let errors = plan(Kind::Continuous, |_| 0, twice).unwrap_err();
    let count = |is: fn(&PlanError) -> bool| errors.iter().filter(|error| is(error)).count();
    assert_eq!(count(|error| matches!(error, PlanError::NameTwice(_))), all.len());
    assert_eq!(count(|error| matches!(error, PlanError::FedTwice { .. })), all.len());
}

/// Does nothing.
struct Idle;

impl Participant for Idle {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled).output::<Number>("out")
    }
    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
    fn step(&mut self, _: &Step, _: &Inputs, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
}

#[test]
fn loop_steps_by_instant_and_rank() {
    // Five periods, and offsets of which some coincide.
    let specs = (0..PARTICIPANTS as i128).map(|number| ParticipantSpec {
        name: format!("p{number:03}"),
        period: Rational::from_millis([1, 2, 5, 3, 7][number as usize % 5]),
        offset: Rational::new(number * 37 % 300, 300_000).unwrap(),
        interface: Idle.interface(),
    });
    let plan = Plan::build(specs.collect(), &[], Rational::from_millis(40), 1).unwrap();
    let idle = (0..PARTICIPANTS).map(|_| Box::new(Idle) as Box<dyn Participant>);
    let mut looped = InLoop::new(&plan, connect_locally(&plan, idle.collect(), |_| Box::new(NoRecording)));
    let mut stepped = Vec::new();
    // With several horizons, as in a run.
    for horizon in [1, plan.end / 3, plan.end / 2, plan.end] {
        let watch = |event: LoopEvent| {
            if let LoopEvent::Stepped {
                participant,
                activation,
            } = event
            {
                let own = &plan.participants[participant];
                stepped.push((own.sample_time.instant(activation), own.rank));
            }
        };
        looped.run_to(horizon, watch).unwrap();
        assert!(stepped.iter().all(|(instant, _)| *instant < horizon));
    }
    assert!(stepped.is_sorted());
    let all: u64 = plan.participants.iter().map(|own| own.activations).sum();
    assert_eq!(stepped.len() as u64, all);
}
