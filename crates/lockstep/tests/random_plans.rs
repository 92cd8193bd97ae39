//! Any mix of periods, offsets, delays and shapes gives the same bits from every executor.

mod common;

use common::{Shared, World, reference, worlds};
use lockstep::executor::{InLoop, assemble, run_in_threads};
use lockstep::plan::{Plan, PlanError};
use proptest::prelude::*;

fn planned(world: &World) -> Result<Plan, TestCaseError> {
    match world.plan() {
        Ok(plan) => Ok(plan),
        // A random world may well have a loop; that it is refused rightly is tested elsewhere.
        Err(errors) => {
            let loops = |e: &PlanError| matches!(e, PlanError::AlgebraicLoop { .. } | PlanError::Capacity { .. });
            prop_assert!(errors.iter().all(loops), "{errors:?}");
            Err(TestCaseError::reject("loop"))
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn the_loop_does_what_the_reference_does(world in worlds()) {
        let plan = planned(&world)?;
        let tape = Shared::new(&plan);
        let steppers = assemble(&plan, world.participants(), |_| Box::new(tape.clone()));
        InLoop::new(&plan, steppers).run_to(plan.end, |_| {}).unwrap();
        prop_assert_eq!(tape.take(), reference(&world, &plan));
    }

    #[test]
    fn stopping_on_the_way_changes_nothing(world in worlds(), stops in prop::collection::vec(0_i64..10_000, 0..5)) {
        let plan = planned(&world)?;
        let tape = Shared::new(&plan);
        let mut run = InLoop::new(&plan, assemble(&plan, world.participants(), |_| Box::new(tape.clone())));
        let mut stops: Vec<_> = stops.into_iter().map(|stop| plan.end.min(stop * plan.end / 10_000)).collect();
        stops.sort_unstable();
        for stop in stops {
            run.run_to(stop, |_| {}).unwrap();
            for stepper in run.steppers() {
                // At rest, everybody has done exactly the steps before the horizon.
                let own = stepper.assignment();
                prop_assert_eq!(stepper.next_activation(), own.sample_time.count_before(stop));
            }
        }
        run.run_to(plan.end, |_| {}).unwrap();
        prop_assert_eq!(tape.take(), reference(&world, &plan));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, max_global_rejects: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn threads_do_what_the_reference_does(world in worlds()) {
        let plan = planned(&world)?;
        let tape = Shared::new(&plan);
        run_in_threads(assemble(&plan, world.participants(), |_| Box::new(tape.clone())), plan.end).unwrap();
        prop_assert_eq!(tape.take(), reference(&world, &plan));
    }
}
