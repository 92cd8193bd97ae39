//! Any mix of periods, offsets, delays and shapes gives the same bits from every executor.

mod common;

use common::{RandomScenario, SharedTape, random_scenarios, reference};
use lockstep::executor::{InLoop, StopReason, connect_locally, run_in_threads};
use lockstep::participant::Participant;
use lockstep::plan::{Cut, Observed, Plan, PlanError};
use proptest::prelude::*;

fn build_plan(scenario: &RandomScenario) -> Result<Plan, TestCaseError> {
    match scenario.plan() {
        Ok(plan) => Ok(plan),
        // A random scenario may have an algebraic loop; other tests cover its rejection.
        Err(errors) => {
            let loops = |e: &PlanError| matches!(e, PlanError::AlgebraicLoop { .. } | PlanError::Capacity { .. });
            prop_assert!(errors.iter().all(loops), "{errors:?}");
            Err(TestCaseError::reject("loop"))
        }
    }
}

/// Resumes at `cut` with new links and the samples on the tape.
fn resume_from_cut(plan: &Plan, cut: &Cut, participants: Vec<Box<dyn Participant>>, tape: &SharedTape) {
    let read = |stream: u32, index: u64| {
        let tape = tape.0.lock().unwrap();
        let (found, _, payload) = &tape[stream as usize][index as usize];
        assert_eq!(*found, index);
        Ok::<_, String>(payload.clone())
    };
    let numbers = 0..plan.participants.len();
    let positions = numbers
        .map(|number| plan.position(cut, number, read).unwrap())
        .collect();
    let parts = connect_locally(plan, participants, |_| Box::new(tape.clone()));
    let mut run = InLoop::resume(plan, parts, positions).unwrap();
    run.run_to(plan.end, |_| {}).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn loop_equals_reference_executor(scenario in random_scenarios()) {
        let plan = build_plan(&scenario)?;
        let tape = SharedTape::new(&plan);
        let steppers = connect_locally(&plan, scenario.participants(), |_| Box::new(tape.clone()));
        InLoop::new(&plan, steppers).run_to(plan.end, |_| {}).unwrap();
        prop_assert_eq!(tape.take(), reference(&scenario, &plan));
    }

    #[test]
    fn loop_with_pauses_equals_reference(scenario in random_scenarios(), stops in prop::collection::vec(0_i64..10_000, 0..5)) {
        let plan = build_plan(&scenario)?;
        let tape = SharedTape::new(&plan);
        let mut run = InLoop::new(&plan, connect_locally(&plan, scenario.participants(), |_| Box::new(tape.clone())));
        let mut stops: Vec<_> = stops.into_iter().map(|stop| plan.end.min(stop * plan.end / 10_000)).collect();
        stops.sort_unstable();
        for stop in stops {
            run.run_to(stop, |_| {}).unwrap();
            for stepper in run.steppers() {
                // When paused, every participant has done exactly the steps before the horizon.
                let own = stepper.assignment();
                prop_assert_eq!(stepper.next_activation(), own.sample_time.count_before(stop));
            }
        }
        run.run_to(plan.end, |_| {}).unwrap();
        prop_assert_eq!(tape.take(), reference(&scenario, &plan));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    /// Participants are paused before random steps and released: the tape does not change. Where one is paused, all activations before that
    /// instant are complete.
    #[test]
    fn loop_with_held_steps_equals_reference(
        scenario in random_scenarios(),
        holds in prop::collection::vec((0_usize..6, 1_usize..4), 0..20),
    ) {
        let plan = build_plan(&scenario)?;
        let tape = SharedTape::new(&plan);
        let mut run = InLoop::new(&plan, connect_locally(&plan, scenario.participants(), |_| Box::new(tape.clone())));
        for (number, times) in holds {
            let number = number % plan.participants.len();
            for _ in 0..times {
                let before = run.steppers()[number].next_activation();
                let was_paused = run.steppers()[number].is_before_step();
                let paused = run.run_to_step(number, plan.end, |_| {}).unwrap() == StopReason::BeforeStep;
                let own = &run.steppers()[number];
                prop_assert_eq!(paused, own.is_before_step());
                prop_assert_eq!(own.next_activation(), (before + u64::from(was_paused)).min(own.assignment().activations));
                let now = own.next_instant();
                for stepper in run.steppers().iter().filter(|_| paused) {
                    let done = stepper.assignment().sample_time;
                    let next = stepper.next_activation();
                    prop_assert!(next >= done.count_before(now) && next <= done.count_before(now + 1));
                }
            }
        }
        run.run_to(plan.end, |_| {}).unwrap();
        prop_assert_eq!(tape.take(), reference(&scenario, &plan));
    }
}

/// Random observed parts of a stream.
fn observed() -> impl Strategy<Value = Observed> {
    prop_oneof![
        2 => Just(Observed::NONE),
        1 => Just(Observed::ALL),
        1 => (1_u64..5, 0_u64..4, 0_u64..20).prop_map(|(every, first, end)| Observed { every, first, end }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn executor_skips_unseen_samples_without_changes(
        scenario in random_scenarios(),
        observed in prop::collection::vec(observed(), 18),
        threads in any::<bool>(),
    ) {
        let mut plan = build_plan(&scenario)?;
        let whole = reference(&scenario, &plan);
        plan.observed = observed;
        let tape = SharedTape::new(&plan);
        let parts = connect_locally(&plan, scenario.participants(), |_| Box::new(tape.clone()));
        if threads {
            run_in_threads(parts, plan.end).unwrap();
        } else {
            InLoop::new(&plan, parts).run_to(plan.end, |_| {}).unwrap();
        }
        // A sample that is not observed is announced, and its payload, which may be anything, is not there.
        let expected = whole.into_iter().enumerate().map(|(stream, samples)| {
            let part = plan.observed(stream);
            let samples = samples.into_iter();
            let samples = samples.map(|(index, stamp, payload)| {
                (index, stamp, if part.contains(index) { payload } else { Vec::new() })
            });
            samples.collect()
        });
        prop_assert_eq!(tape.take(), expected.collect::<Vec<Vec<_>>>());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn run_resumed_at_any_instant_equals_reference(scenario in random_scenarios(), stop in 0_i64..10_000) {
        let plan = build_plan(&scenario)?;
        let tape = SharedTape::new(&plan);
        let mut run = InLoop::new(&plan, connect_locally(&plan, scenario.participants(), |_| Box::new(tape.clone())));
        let stop = stop * plan.end / 10_000;
        run.run_to(stop, |_| {}).unwrap();
        resume_from_cut(&plan, &plan.cut_at(stop), run.into_participants(), &tape);
        prop_assert_eq!(tape.take(), reference(&scenario, &plan));
    }

    #[test]
    fn run_resumed_from_any_positions_equals_reference(
        scenario in random_scenarios(),
        poll_order in prop::collection::vec(0_usize..6, 0..200),
    ) {
        let plan = build_plan(&scenario)?;
        let tape = SharedTape::new(&plan);
        let parts = connect_locally(&plan, scenario.participants(), |_| Box::new(tape.clone()));
        let mut steppers: Vec<_> = parts.into_iter().map(|part| part.into_stepper()).collect();
        steppers.iter_mut().for_each(|stepper| stepper.extend_horizon(plan.end));
        for number in poll_order {
            let number = number % steppers.len();
            steppers[number].poll().unwrap();
        }
        for stepper in &mut steppers {
            prop_assert!(stepper.pause().unwrap());
        }
        let cut = Cut { next: steppers.iter().map(|stepper| stepper.next_activation()).collect() };
        let participants = steppers.into_iter().map(|stepper| stepper.into_participant()).collect();
        resume_from_cut(&plan, &cut, participants, &tape);
        prop_assert_eq!(tape.take(), reference(&scenario, &plan));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn threads_equal_reference_executor(scenario in random_scenarios()) {
        let plan = build_plan(&scenario)?;
        let tape = SharedTape::new(&plan);
        run_in_threads(connect_locally(&plan, scenario.participants(), |_| Box::new(tape.clone())), plan.end).unwrap();
        prop_assert_eq!(tape.take(), reference(&scenario, &plan));
    }
}
